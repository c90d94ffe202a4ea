"""Eigenmodes of ``M y'' + C y' + K y = 0``: eigenvalues and shapes, with rounding of zero eigenvalues removed."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float

SYMMETRIC = 1e-9  # fraction of a matrix: a smaller asymmetry is rounding
EPSILON = np.finfo(float).eps
REAL = 1e-9  # fraction of an eigenvalue: a smaller imaginary part is rounding

Square = Float[np.ndarray, "coordinate coordinate"]


class Eigenmodes(NamedTuple):
    """Solutions ``y = shape exp(eigenvalue t)``, one for each pair of conjugate eigenvalues, the slowest first.

    Attributes
    ----------
    eigenvalues : array of shape (modes,)
        1/s; the imaginary part is not negative.
    shapes : array of shape (coordinates, modes)
        Mode shapes of unit modal mass, ``shape^H M shape = 1``; the largest mass-weighted component of each is
        positive.
    """

    eigenvalues: Complex[np.ndarray, " mode"]
    shapes: Complex[np.ndarray, "coordinate mode"]


def eigenmodes(mass: Square, damping: Square, stiffness: Square, noise: tuple[Square, Square]) -> Eigenmodes:
    """Return the eigenmodes of a linear time-invariant system.

    Parameters
    ----------
    mass, damping, stiffness : array of shape (coordinates, coordinates)
        Matrices of the system; the mass matrix is symmetric and positive definite.
    noise : tuple of array
        Rounding errors of the entries of damping and stiffness.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the mass matrix is not positive definite.
    """
    from scipy.linalg import cholesky, solve_triangular

    lower = cholesky((mass + mass.T) / 2, lower=True)

    def weighted(matrix: Square) -> Square:
        return solve_triangular(lower, solve_triangular(lower, matrix, lower=True).T, lower=True).T

    inverse = np.abs(solve_triangular(lower, np.eye(len(mass)), lower=True))
    c, k = weighted(damping), weighted(stiffness)
    c_noise, k_noise = (_with_rounding(inverse @ eps @ inverse.T, x) for eps, x in zip(noise, (c, k), strict=True))
    if (np.abs(c) <= c_noise).all() and is_symmetric(k, k_noise):  # shapes are real
        squares, weighted_shapes = np.linalg.eigh((k + k.T) / 2)
        squares = np.where(np.abs(squares) <= _along(weighted_shapes, k_noise, weighted_shapes), 0.0, squares)
        values = np.where(squares < 0, np.sqrt(np.abs(squares)), 1j * np.sqrt(np.abs(squares)))
        shapes = weighted_shapes.astype(complex)
    else:
        values, shapes = _of_state_matrix(c, k, c_noise, k_noise)
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    peak_rows = np.argmax(np.abs(shapes) >= 0.999 * np.abs(shapes).max(axis=0, initial=0.0), axis=0)
    peaks = shapes[peak_rows, np.arange(shapes.shape[1])]
    shapes = shapes * np.conj(peaks) / np.abs(peaks)
    order = np.lexsort((np.real(values), np.abs(values)))
    vectors = solve_triangular(lower.T, shapes[:, order], lower=False)
    return Eigenmodes(values[order], vectors)


def is_symmetric(matrix: Square, noise: Square) -> bool:
    """Return whether a matrix is symmetric up to rounding."""
    size = np.abs(matrix).max(initial=0.0)
    return bool((np.abs(matrix - matrix.T) <= np.maximum(noise + noise.T, SYMMETRIC * size)).all())


def zeros(matrix: Square, noise: Square) -> tuple[Float[np.ndarray, "c k"], Float[np.ndarray, "c k"]]:
    """Return orthonormal bases of the left and the right null space of a matrix, up to rounding."""
    left, sizes, right = np.linalg.svd(matrix)
    null = sizes <= _along(left, noise, right.T)
    return left[:, null], right.T[:, null]


def _with_rounding(noise: Square, matrix: Square) -> Square:
    """Return the noise of a matrix, with the rounding of its decomposition added."""
    return noise + 4 * EPSILON * np.linalg.norm(matrix, 2) if len(matrix) else noise


def _along(left: Square, noise: Square, right: Square) -> Float[np.ndarray, " vector"]:
    """Return the noise of the products ``left^T matrix right`` of vectors, small along soft directions."""
    return np.einsum("ik,ij,jk->k", np.abs(left), noise, np.abs(right))


def _of_state_matrix(
    c: Square, k: Square, c_noise: Square, k_noise: Square
) -> tuple[Complex[np.ndarray, " mode"], Complex[np.ndarray, "coordinate mode"]]:
    """Return eigenvalues with a nonnegative imaginary part, and shapes, from the state matrix.

    The zero eigenvalues of the state matrix have Jordan chains, which rounding spreads over a circle. They are counted
    by the null vectors of the stiffness, and of the damping among these, and set to zero.
    """
    count = len(k)
    rate = max(float(np.sqrt(np.linalg.norm(k, 2))), float(np.linalg.norm(c, 2)), 1e-300)  # 1/s, for balance
    state = np.block([[np.zeros((count, count)), np.eye(count)], [-k / rate**2, -c / rate]])
    values, vectors = (x.astype(complex) for x in np.linalg.eig(state))
    left, right = zeros(k, k_noise)
    chains = zeros(left.T @ c @ right, np.abs(left.T) @ c_noise @ np.abs(right))[1].shape[1]
    order = np.argsort(np.abs(values))
    nonzero = order[right.shape[1] + chains :]
    selected = nonzero[_upper(values[nonzero])]
    eigenvalues = _without_rounding(values[selected])
    shapes = np.where(np.abs(np.imag(eigenvalues)) > 0, vectors[:count, selected], _real(vectors[:count, selected]))
    return np.concatenate([np.zeros(right.shape[1]), eigenvalues * rate]), np.concatenate([right, shapes], axis=1)


def _upper(values: Complex[np.ndarray, " value"]) -> Bool[np.ndarray, " value"]:
    """Return which eigenvalues represent their conjugate pair: real ones, and those in the upper half-plane."""
    return np.imag(values) >= -REAL * np.abs(values)


def _without_rounding(values: Complex[np.ndarray, " value"]) -> Complex[np.ndarray, " value"]:
    """Return eigenvalues with real and imaginary parts that are rounding set to zero."""
    fastest = np.abs(values).max(initial=0.0)
    undamped = np.abs(np.real(values)) <= 8 * len(values) * EPSILON * fastest
    values = np.where(undamped, 1j * np.imag(values), values)
    return np.where(np.abs(np.imag(values)) <= REAL * np.abs(values), np.real(values), values)


def _real(vectors: Complex[np.ndarray, "c k"]) -> Complex[np.ndarray, "c k"]:
    """Return the real multiples of vectors that are real up to a complex factor."""
    peaks = vectors[np.abs(vectors).argmax(axis=0), np.arange(vectors.shape[1])]
    rotated = vectors * np.conj(peaks) / np.where(peaks == 0, 1.0, np.abs(peaks))
    return np.real(rotated).astype(complex)
