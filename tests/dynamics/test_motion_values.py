"""Values along a motion, a few instants computed together."""

import jax
import numpy as np
import pytest

from jounce.dynamics.motion_values import in_small_chunks


@pytest.mark.parametrize("count", [1, 15, 16, 17, 64, 71])
def test_instants_that_are_computed_a_few_together_are_those_computed_at_once(count):
    chance = np.random.default_rng(count)
    matrices, sizes = chance.normal(size=(3, 2, count)), [chance.normal(size=count)]
    seen = []

    def products(matrices, sizes):
        seen.append(matrices.shape[-1])
        return {"norm": (matrices**2).sum(axis=(0, 1)) * sizes[0], "sum": matrices.sum(axis=0)}

    found = jax.jit(lambda *arrays: in_small_chunks(products, 16, *arrays))(matrices, sizes)
    np.testing.assert_allclose(found["norm"], np.einsum("ijt,ijt,t->t", matrices, matrices, sizes[0]), rtol=1e-14)
    np.testing.assert_allclose(found["sum"], matrices.sum(axis=0), rtol=0, atol=1e-15)
    assert set(seen) == {min(count, 16)}
