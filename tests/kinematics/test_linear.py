"""The linear solver behind its small interface: factors, solves, transposed solves, and the ratio of pivots."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce.kinematics.linear import DenseFactor, InverseFactor, factor_type

RANDOM = np.random.default_rng(4)
MATRIX = RANDOM.normal(size=(7, 7, 5))
RIGHT = RANDOM.normal(size=(7, 5))


def test_solve():
    x = np.array(DenseFactor.of(jnp.asarray(MATRIX)).solve(jnp.asarray(RIGHT)))
    np.testing.assert_allclose(np.einsum("ijn,jn->in", MATRIX, x), RIGHT, atol=1e-12)


def test_solve_with_the_transposed_matrix():
    x = np.array(DenseFactor.of(jnp.asarray(MATRIX)).solve_transposed(jnp.asarray(RIGHT)))
    np.testing.assert_allclose(np.einsum("jin,jn->in", MATRIX, x), RIGHT, atol=1e-12)


def test_under_jit_and_as_a_pytree():
    factor = jax.jit(DenseFactor.of)(jnp.asarray(MATRIX))
    x = jax.jit(lambda f, b: f.solve(b))(factor, jnp.asarray(RIGHT))
    np.testing.assert_allclose(np.einsum("ijn,jn->in", MATRIX, np.array(x)), RIGHT, atol=1e-12)


def test_ratio_of_pivots_falls_to_zero_at_a_singular_matrix():
    singular = MATRIX.copy()
    singular[3, :, 1] = 2 * singular[0, :, 1]
    ratios = np.array(DenseFactor.of(jnp.asarray(singular)).pivot_ratio())
    assert ratios[1] < 1e-15
    assert (np.delete(ratios, 1) > 1e-4).all()


@pytest.mark.parametrize("size", [1, 2, 7, 12])
def test_inverses_by_elimination(size):
    generator = np.random.default_rng(size)
    matrices = generator.normal(size=(size, size, 5))
    matrices[0, 0] = 0.0 if size > 1 else 1.0  # the pivot is elsewhere
    right = generator.normal(size=(size, 5))
    factor = InverseFactor.of(jnp.asarray(matrices))
    expected = np.linalg.inv(np.moveaxis(matrices, -1, 0))
    np.testing.assert_allclose(
        np.moveaxis(factor.inverse(), -1, 0), expected, rtol=0, atol=1e-13 * np.abs(expected).max()
    )
    np.testing.assert_allclose(np.einsum("ijk,jk->ik", matrices, factor.solve(jnp.asarray(right))), right, atol=1e-12)
    singular = np.ones((size + 1, size + 1, 1))
    assert not np.isfinite(InverseFactor.of(jnp.asarray(singular)).inverse()).all()


def test_elimination_alone_is_free_of_lapack():
    """Programs for several threads are: batches of LAPACK wait for threads of XLA in a thread of XLA."""
    matrices = jnp.ones((4, 4, 3))
    with_lapack, without = (
        jax.jit(lambda m, kind=kind: kind.of(m).inverse()).lower(matrices).as_text()
        for kind in (DenseFactor, factor_type(3))
    )
    assert "lapack" in with_lapack
    assert "custom_call" not in without
