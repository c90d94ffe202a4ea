"""Rate of approach to a singular position: by products with random vectors as by the matrix, never too small."""

import jax.numpy as jnp
import numpy as np
import pytest

from jounce.kinematics.continuation.singularity_distance import _of_matrix, _of_products


def by_products(matrix):
    return float(_of_products(lambda x: jnp.asarray(matrix) @ x, len(matrix))[0])


@pytest.mark.parametrize("size", [3, 40, 200])
@pytest.mark.parametrize("seed", range(5))
def test_no_eigenvalue_is_larger_by_far(size, seed):
    matrix = np.random.default_rng(seed).standard_normal((size, size))
    largest = np.abs(np.linalg.eigvals(matrix)).max()
    for found in (by_products(matrix), float(_of_matrix(matrix)[0])):
        assert 0.7 * 0.8 * largest < abs(found) < 3 * largest


@pytest.mark.parametrize("leading", [-30.0, 50.0])
def test_one_that_leads_is_found(leading):
    random = np.random.default_rng(1)
    vectors = random.standard_normal((60, 60))
    matrix = vectors @ np.diag([leading, *random.uniform(-1, 1, 59)]) @ np.linalg.inv(vectors)
    np.testing.assert_allclose([by_products(matrix), float(_of_matrix(matrix)[0])], leading, rtol=1e-9)


def test_a_pair_that_is_not_real_counts_with_its_size():
    turning = np.zeros((50, 50))
    turning[:2, :2] = [[-1.0, -9.0], [9.0, -1.0]]
    found = by_products(turning)
    assert found < 0
    assert np.hypot(1, 9) <= abs(found) <= 1.5 * np.hypot(1, 9)


def test_what_does_not_change_has_none():
    assert abs(by_products(np.zeros((30, 30)))) < 1e-10
