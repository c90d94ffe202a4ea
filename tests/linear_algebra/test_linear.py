"""The linear solver behind its small interface: factors, solves, transposed solves, and the ratio of pivots."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce.linear_algebra.linear import DenseFactor, singular_values

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
def test_inverses_determinants_and_solutions_where_rows_must_change_places(size):
    generator = np.random.default_rng(size)
    matrices = generator.normal(size=(size, size, 5))
    matrices[0, 0] = 0.0 if size > 1 else 1.0  # the pivot is elsewhere
    right = generator.normal(size=(size, 5))
    factor = DenseFactor.of(jnp.asarray(matrices))
    by_numpy = np.moveaxis(matrices, -1, 0)
    expected = np.moveaxis(np.linalg.inv(by_numpy), 0, -1)
    known = size * np.finfo(float).eps * np.linalg.cond(by_numpy).max()  # of the largest entry, by either way
    np.testing.assert_allclose(factor.inverse(), expected, rtol=0, atol=known * np.abs(expected).max())
    np.testing.assert_allclose(np.einsum("ijk,jk->ik", matrices, factor.solve(jnp.asarray(right))), right, atol=1e-12)
    x = factor.solve_transposed(jnp.asarray(right))
    np.testing.assert_allclose(np.einsum("jik,jk->ik", matrices, x), right, atol=1e-12)
    np.testing.assert_array_equal(factor.sign(), np.sign(np.linalg.det(by_numpy)))


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("condition", [1e1, 1e8])
def test_residuals_are_rounding_however_ill_conditioned(condition, transposed):
    """Residuals are as small as with substitution; a product with the inverse would leave 1e-10."""
    generator = np.random.default_rng(3)
    turns = [np.linalg.qr(generator.normal(size=(12, 12)))[0] for _ in range(2)]
    matrix = (turns[0] * np.logspace(0, -np.log10(condition), 12)) @ turns[1]
    system = matrix.T if transposed else matrix
    right = system @ generator.normal(size=12)
    factor = DenseFactor.of(jnp.asarray(matrix[..., None]))
    solve = factor.solve_transposed if transposed else factor.solve
    solution = np.asarray(solve(jnp.asarray(right[:, None])))[:, 0]
    scale = np.abs(system) @ np.abs(solution) + np.abs(right)
    assert (np.abs(system @ solution - right) <= 1e-15 * scale).all()


def test_singular_matrices_are_reported_and_leave_their_neighbors_alone():
    matrices = MATRIX.copy()
    matrices[:, :, 1] = 1.0
    matrices[2, 3, 3] = np.nan
    factor = DenseFactor.of(jnp.asarray(matrices))
    assert factor.pivot_ratio()[1] == 0
    assert factor.sign()[1] == 0
    assert np.isnan(factor.sign()[3])
    right = jnp.asarray(RIGHT)
    for result in (factor.solve(right), factor.solve_transposed(right), factor.inverse()):
        flat = np.asarray(result).reshape(-1, 5)
        assert np.isnan(flat[:, 1]).all()
        assert np.isnan(flat[:, 3]).any()
        assert np.isfinite(flat[:, [0, 2, 4]]).all()


@pytest.mark.parametrize("shape", [(1, 4), (3, 3), (6, 7), (6, 4)])
def test_singular_value_decompositions(shape):
    generator = np.random.default_rng(sum(shape))
    matrices = generator.normal(size=(*shape, 6))
    matrices[:, :, 1] *= np.logspace(0, -12, shape[1])  # nearly singular
    matrices[-1, :, 2] = matrices[0, :, 2]  # of lower rank
    matrices[:, :, 3] = 0.0
    matrices[:, :, 4] = np.eye(*shape)  # all alike
    u, s, v = (np.asarray(part) for part in jax.jit(singular_values)(jnp.asarray(matrices)))
    expected = np.linalg.svd(np.moveaxis(matrices, -1, 0), compute_uv=False).T
    np.testing.assert_allclose(s, expected, rtol=0, atol=4e-15 * max(expected.max(), 1))
    np.testing.assert_allclose(np.einsum("ikb,kb,jkb->ijb", u, s, v), matrices, rtol=0, atol=1e-14)
    full = s.min(axis=0) > 1e-14
    for part in (u[..., full], v[..., full]):
        products = np.einsum("ikb,ilb->klb", part, part)
        np.testing.assert_allclose(products, np.eye(len(s))[..., None] + 0 * products, rtol=0, atol=1e-13)


def test_no_operation_is_left_to_lapack():
    """Batches of LAPACK wait for XLA threads within an XLA thread: two such programs may deadlock."""

    def everything(matrices):
        factor = DenseFactor.of(matrices)
        right = matrices[0]
        return (
            factor.solve(right),
            factor.solve_transposed(right),
            factor.inverse(),
            factor.sign(),
            singular_values(matrices),
        )

    assert "custom_call" not in jax.jit(everything).lower(jnp.ones((4, 4, 3))).as_text()


@pytest.mark.parametrize("departure", [1e-6, 1e-9])
def test_factors_of_a_near_matrix_are_off_by_the_square_of_what_is_reported(departure):
    random = np.random.default_rng(5)
    matrix = random.normal(size=(12, 12, 7))
    near = matrix + departure * random.normal(size=matrix.shape)
    known = random.normal(size=(12, 7))
    right = np.einsum("rcb,cb->rb", near, known)
    factors = DenseFactor.of(matrix).refining(near)
    stated = np.asarray(factors.defect())
    off = np.abs(np.asarray(factors.solve(right, refined=False)) - known).max(axis=0)
    assert ((off < 30 * stated) & (stated < 30 * off)).all()
    condition = np.array([np.linalg.cond(near[..., k]) for k in range(7)])
    assert (np.abs(np.asarray(factors.solve(right)) - known).max(axis=0) < 1e3 * stated**2 + 1e-15 * condition).all()
