"""Values along a motion, computed in chunks of one length."""

import jax
import numpy as np
import pytest

from jounce.dynamics.motion_values import in_chunks, in_lots


@pytest.mark.parametrize("count", [1, 64, 201, 256, 257, 1000])
def test_one_length_serves_motions_of_any_number_of_instants(count):
    lengths = set()

    def squares(lanes):
        lengths.add(len(lanes))
        return {"square": lanes[None] ** 2}

    found = in_chunks(squares, count)["square"]
    np.testing.assert_array_equal(found, np.arange(count)[None] ** 2)
    assert lengths == {256}


@pytest.mark.parametrize("axis", [0, 1, -1])
@pytest.mark.parametrize("count", [3, 8, 20])
def test_instants_may_stand_along_any_axis(count, axis):
    found = in_chunks(lambda lanes: np.moveaxis(np.ones((4, 5, 1)) * lanes, -1, axis), count, (8,), axis)
    np.testing.assert_array_equal(np.moveaxis(found, axis, -1), np.ones((4, 5, 1)) * np.arange(count))
    found[:] = 0.0  # an array of the caller's own


@pytest.mark.parametrize("count", [1, 15, 16, 17, 64, 71])
def test_instants_that_are_computed_a_few_together_are_those_computed_at_once(count):
    chance = np.random.default_rng(count)
    matrices, sizes = chance.normal(size=(3, 2, count)), [chance.normal(size=count)]
    seen = []

    def products(matrices, sizes):
        seen.append(matrices.shape[-1])
        return {"norm": (matrices**2).sum(axis=(0, 1)) * sizes[0], "sum": matrices.sum(axis=0)}

    found = jax.jit(lambda *arrays: in_lots(products, 16, *arrays))(matrices, sizes)
    np.testing.assert_allclose(found["norm"], np.einsum("ijt,ijt,t->t", matrices, matrices, sizes[0]), rtol=1e-14)
    np.testing.assert_allclose(found["sum"], matrices.sum(axis=0), rtol=0, atol=1e-15)
    assert set(seen) == {min(count, 16)}
