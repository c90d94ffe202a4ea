"""The linear solver behind its small interface: factors, solves, transposed solves, and the ratio of pivots."""

import jax
import jax.numpy as jnp
import numpy as np

from jounce.kinematics.linear import DenseFactor

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
