"""Vector and matrix products of jets: identities on random jets, shapes, and mixtures with constant arrays."""

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import jet

ORDER = 5
BATCH = 3


@pytest.fixture
def random():
    return np.random.default_rng(11)


def some(random, *shape, order=ORDER, gaps=False):
    """Random jet of the given component shape, on a batch; with gaps, some coefficients are absent (zero)."""
    parts = [jnp.asarray(random.uniform(-1, 1, (*shape, BATCH))) for _ in range(order + 1)]
    return jn.Jet(None if gaps and k in (1, 4) else c for k, c in enumerate(parts))


def values(x):
    return np.array(x.dense().coefficients)


def close(a, b):
    assert a.order == b.order
    np.testing.assert_allclose(values(a), values(b), rtol=0, atol=1e-13)


@pytest.mark.parametrize("gaps", [False, True], ids=["full", "gaps"])
def test_vector_identities(random, gaps):
    a, b, c = (some(random, 3, gaps=gaps) for _ in range(3))
    close(jet.cross(a, b), -jet.cross(b, a))
    zero = jet.cross(a, jet.cross(b, c)) + jet.cross(b, jet.cross(c, a)) + jet.cross(c, jet.cross(a, b))
    np.testing.assert_allclose(values(zero), 0, atol=1e-13)  # Jacobi
    close(jet.cross(a, jet.cross(b, c)), b * jet.dot(a, c) - c * jet.dot(a, b))  # Grassmann
    lagrange = jet.dot(a, a) * jet.dot(b, b) - jet.dot(a, b) ** 2
    close(jet.dot(jet.cross(a, b), jet.cross(a, b)), lagrange)
    close(jet.dot(a, jet.cross(b, c)), jet.dot(jet.cross(a, b), c))
    np.testing.assert_allclose(values(jet.dot(a, jet.cross(a, b))), 0, atol=1e-13)
    close(a.dot(b), jet.dot(a, b))
    close(a.cross(b), jet.cross(a, b))


def test_square_of_a_vector_by_half_the_products(random):
    a = some(random, 3)
    close(jet.dot(a, a), jet.dot(a, a + 0.0))
    close(jet.dot(a, a), a[0] ** 2 + a[1] ** 2 + a[2] ** 2)


def test_plane_vector_product_is_a_scalar(random):
    a, b = some(random, 2), some(random, 2)
    assert jet.cross(a, b).shape == (BATCH,)
    close(jet.cross(a, b), a[0] * b[1] - a[1] * b[0])
    close(jet.cross(a, b), -jet.cross(b, a))


@pytest.mark.parametrize("gaps", [False, True], ids=["full", "gaps"])
def test_matrix_identities(random, gaps):
    a, b, v = some(random, 2, 3, gaps=gaps), some(random, 3, 4, gaps=gaps), some(random, 4)
    assert jet.matmul(a, b).shape == (2, 4, BATCH)
    close(jet.matvec(jet.matmul(a, b), v), jet.matvec(a, jet.matvec(b, v)))
    close(jet.transpose(jet.matmul(a, b)), jet.matmul(jet.transpose(b), jet.transpose(a)))
    close(jet.transpose(jet.transpose(a)), a)
    w = some(random, 2)
    close(jet.dot(w, jet.matvec(a, jet.matvec(b, v))), jet.dot(jet.matvec(jet.transpose(a), w), jet.matvec(b, v)))


def test_products_are_cauchy_convolutions_of_numpy_products(random):
    a, v, b = some(random, 2, 3), some(random, 3), some(random, 3, 4)
    for product, left, right, subscripts in [(jet.matvec, a, v, "ijn,jn->in"), (jet.matmul, a, b, "ijn,jkn->ikn")]:
        x, y = values(left), values(right)
        expected = [sum(np.einsum(subscripts, x[j], y[k - j]) for j in range(k + 1)) for k in range(ORDER + 1)]
        np.testing.assert_allclose(values(product(left, right)), expected, atol=1e-14)


def test_constant_arrays_on_either_side(random):
    a, v = some(random, 3, 3), some(random, 3)
    m, u = random.uniform(-1, 1, (3, 3, 1)), random.uniform(-1, 1, (3, 1))
    constant_m, constant_u = jn.Jet.constant(m, ORDER), jn.Jet.constant(u, ORDER)
    close(jet.matvec(m, v), jet.matvec(constant_m, v))
    close(jet.matvec(a, u), jet.matvec(a, constant_u))
    close(jet.matmul(m, a), jet.matmul(constant_m, a))
    close(jet.cross(u, v), jet.cross(constant_u, v))
    close(jet.dot(v, u), jet.dot(v, constant_u))
    np.testing.assert_allclose(jet.dot(u, u), np.sum(u * u, axis=0))
    np.testing.assert_allclose(jet.cross(u[:, 0], m[0, :, 0]), np.cross(u[:, 0], m[0, :, 0]))
    np.testing.assert_allclose(jet.matmul(m[..., 0], m[..., 0]), m[..., 0] @ m[..., 0])
    np.testing.assert_allclose(jet.matvec(m[..., 0], u[:, 0]), m[..., 0] @ u[:, 0])


def test_stack_of_jets_numbers_and_arrays(random):
    x = some(random)
    whole = jet.stack([x, 2.0, np.arange(3.0)])
    assert whole.shape == (3, BATCH)
    np.testing.assert_array_equal(values(whole)[0], [values(x)[0], [2.0] * 3, np.arange(3.0)])
    np.testing.assert_array_equal(values(whole)[1:, 1:], 0)
    assert jet.stack([x, x.truncate(2)]).order == 2
    np.testing.assert_array_equal(jet.stack([1.0, 2.0]), [1.0, 2.0])


def test_concatenation_of_vectors(random):
    a, b = some(random, 3), some(random, 2, gaps=True)
    joined = jet.concatenate([a, b])
    np.testing.assert_array_equal(values(joined), np.concatenate([values(a), values(b)], axis=1))


@pytest.mark.parametrize("product", [jet.dot, jet.cross])
@pytest.mark.parametrize("lengths", [(3, 2), (2, 3), (3, 1), (1, 3)])
def test_product_of_vectors_of_unequal_length_is_refused(random, product, lengths):
    with pytest.raises(ValueError, match="components"):
        product(*(some(random, length) for length in lengths))


def test_vector_product_beyond_space_is_refused(random):
    with pytest.raises(ValueError, match="2 or 3 components, got 4"):
        jet.cross(some(random, 4), some(random, 4))


def test_products_of_orders_that_differ(random):
    assert jet.cross(some(random, 3, order=2), some(random, 3)).order == 2
    assert jet.matvec(some(random, 3, 3), some(random, 3, order=0)).order == 0
