"""Elimination by reflections against NumPy, with the sign of the determinant, for many kinds of matrices."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce.linear_algebra.reflections import ReflectedFactor


@partial(jax.jit, static_argnums=1)  # one program: its many operations would be compiled each for itself
def factored(matrix, order=None):
    natural = tuple(range(len(matrix)))
    return ReflectedFactor.of(jnp.asarray(matrix), (natural, natural) if order is None else order)


solved = jax.jit(ReflectedFactor.solve, static_argnames="refined")
sign, pivot_ratio, defect = map(jax.jit, (ReflectedFactor.sign, ReflectedFactor.pivot_ratio, ReflectedFactor.defect))


def matrices(size, lanes, seed=0):
    return np.random.default_rng(seed).standard_normal((size, size, lanes))


@pytest.mark.parametrize("size", [1, 2, 7])
@pytest.mark.parametrize("shuffled", [False, True])
def test_solutions_and_signs_are_those_of_numpy(size, shuffled):
    rng = np.random.default_rng(3)
    order = tuple(tuple(rng.permutation(size).tolist()) for _ in range(2)) if shuffled else None
    matrix, right = matrices(size, 7), np.random.default_rng(1).standard_normal((size, 7))
    factor = factored(matrix, order)
    by_lane = np.moveaxis(matrix, -1, 0)
    expected = np.linalg.solve(by_lane, right.T[..., None])[..., 0].T
    for refined in (False, True):
        np.testing.assert_allclose(solved(factor, right, refined=refined), expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(sign(factor), np.linalg.slogdet(by_lane).sign)


def test_the_triangle_has_the_size_of_the_determinant():
    matrix = matrices(6, 5)
    pivots = factored(matrix).pivots
    expected = np.linalg.slogdet(np.moveaxis(matrix, -1, 0)).logabsdet
    np.testing.assert_allclose(np.sum(np.log(np.abs(pivots)), axis=0), expected, rtol=1e-12)


def test_a_zero_in_the_first_place_is_no_obstacle():
    matrix = np.array([[0.0, 1.0], [1.0, 0.0]])[..., None]
    factor = factored(matrix)
    np.testing.assert_allclose(solved(factor, jnp.asarray([[2.0], [3.0]])), [[3.0], [2.0]], rtol=1e-15)
    assert sign(factor) == -1


def test_a_singular_matrix_is_reported():
    matrix = matrices(4, 2)
    matrix[3, :, 1] = matrix[0, :, 1] - 2 * matrix[2, :, 1]
    matrix[:, 2, 0] = 0.0
    ratio = pivot_ratio(factored(matrix))
    assert ratio[0] == 0
    assert ratio[1] < 1e-14
    assert sign(factored(matrix))[0] == 0


def test_what_is_not_finite_stays_so():
    matrix = matrices(3, 1)
    matrix[1, 1, 0] = np.nan
    factor = factored(matrix)
    assert np.isnan(solved(factor, jnp.ones((3, 1)))).all()
    assert np.isnan(pivot_ratio(factor)).all()


def test_factors_serve_a_matrix_nearby():
    matrix, right = matrices(5, 3), np.random.default_rng(2).standard_normal((5, 3))
    near = matrix + 1e-7 * matrices(5, 3, seed=3)
    order = (3, 0, 4, 1, 2), (1, 4, 2, 0, 3)
    factor = factored(matrix, order).refining(jnp.asarray(near))
    expected = np.linalg.solve(np.moveaxis(near, -1, 0), right.T[..., None])[..., 0].T
    unrefined = np.max(np.abs(solved(factor, right, refined=False) - expected), axis=0)
    refined = np.max(np.abs(solved(factor, right) - expected), axis=0)
    assert (unrefined > 1e-9).all()
    assert (refined < 1e-10).all()
    assert (defect(factor) > 1e-9).all()
    assert (defect(factored(matrix, order)) < 1e-12).all()


def test_the_inverse_of_the_first_matrix():
    matrix, columns = matrices(4, 3), np.random.default_rng(4).standard_normal((4, 6))
    found = factored(matrix, ((2, 0, 3, 1), (1, 3, 2, 0))).applied_inverse(jnp.asarray(columns))
    np.testing.assert_allclose(found, np.linalg.solve(matrix[..., 0], columns), rtol=1e-10, atol=1e-12)
