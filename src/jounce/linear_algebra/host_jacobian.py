"""The Jacobian at one position on the host: what it closes, its rank, and the vectors that it takes to zero.

A small one is decomposed into singular values. Of a large one only what is not zero is kept: its equations go through
SuperLU, and its null vectors are found by subspace iteration with a shifted inverse, as many as there are.
"""

import dataclasses
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers
from jounce.linear_algebra.pattern import Pattern

RANK_TOLERANCE = 1e-9
SMALL = 1e-6  # of the largest singular value: how small one is next to a singular position
STEP_TOLERANCE = 1e-10
MOST_DENSE = 100  # rows and columns; from there on an elimination of what is not zero is quicker
DAMPING = 1e-6  # of the largest singular value
PROBES = 8  # random vectors, of which at least one has its part of every vector that an inverse makes long
MOST_VECTORS = 1024  # of a null space; of a larger one, so many at random


@dataclasses.dataclass(frozen=True)
class HostJacobian:
    """A Jacobian by the bodies that each row touches.

    Attributes
    ----------
    bodies : array of int, shape (rows, slots)
        The number of bodies where a row touches fewer.
    blocks : array of shape (rows, slots, width)
        Entries in the columns of those bodies.
    body_count : int
        Number of bodies.
    tolerance : float
        Of the largest singular value: those at or below count as zero.
    """

    bodies: Int[np.ndarray, "row slot"]
    blocks: Float[np.ndarray, "row slot width"]
    body_count: int
    tolerance: float = RANK_TOLERANCE

    @classmethod
    def of(cls, pattern: Pattern, entries: Float[Numbers, " entry"]) -> "HostJacobian":
        """Return the Jacobian with these entries in places of a pattern."""
        padded = np.zeros(pattern.entry_count + 1)
        padded[:-1] = entries
        return cls(np.asarray(pattern.bodies), padded.take(pattern.entry_indices), pattern.body_count)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return len(self.blocks), self.body_count * self.blocks.shape[-1]

    @property
    def is_large(self) -> bool:
        """Whether only what is not zero is kept."""
        return max(self.shape) > MOST_DENSE

    def finite(self) -> Bool[np.ndarray, " row"]:
        """Tell which rows are finite."""
        return np.asarray(np.isfinite(self.blocks).all(axis=(1, 2)))

    @cached_property
    def row_scale(self) -> Float[np.ndarray, " row"]:
        """Return what makes the largest entry of each row one."""
        largest = np.abs(self.blocks).max(axis=(1, 2), initial=0.0)
        return 1 / np.where((largest > 0) & np.isfinite(largest), largest, 1.0)

    def scaled(self, scale: Float[np.ndarray, " row"]) -> "HostJacobian":
        """Return the Jacobian with its rows multiplied by a scale."""
        return HostJacobian(self.bodies, scale[:, None, None] * self.blocks, self.body_count, self.tolerance)

    def take(self, rows: Bool[np.ndarray, " row"]) -> "HostJacobian":
        """Return the Jacobian of some rows."""
        return dataclasses.replace(self, bodies=self.bodies[rows], blocks=self.blocks[rows])

    def dense(self) -> Float[np.ndarray, "row column"]:
        """Return the matrix."""
        rows, _, width = self.blocks.shape
        matrix = np.zeros((rows, self.body_count + 1, width))
        matrix[np.arange(rows)[:, None], self.bodies] = self.blocks
        return matrix[:, :-1].reshape(self.shape)

    def sparse(self) -> Any:
        """Return the matrix as one of SciPy that keeps what is not zero."""
        from scipy.sparse import coo_array  # here, since importing SciPy takes half a second

        width = self.blocks.shape[-1]
        columns = self.bodies[:, :, None] * width + np.arange(width)
        row, slot, column = np.nonzero((self.blocks != 0) & (columns < self.shape[1]))
        where = row, columns[row, slot, column]
        return coo_array((self.blocks[row, slot, column], where), shape=self.shape).tocsr()

    def step(self, residual: Float[np.ndarray, " row"]) -> Float[np.ndarray, " column"] | None:
        """Return the shortest step that closes the residual to first order, by rows of one size; None if not finite."""
        if not (np.isfinite(residual).all() and np.isfinite(self.blocks).all()):
            return None  # what factors a matrix may never end on one that is not finite
        scale = self.row_scale
        matrix, right = self.scaled(scale), -scale * residual
        if self.is_large:
            step = _shortest(matrix.sparse(), right)
        else:
            step = np.linalg.lstsq(matrix.dense(), right, rcond=STEP_TOLERANCE)[0]
        return step if np.isfinite(step).all() else None

    @cached_property
    def rank(self) -> int:
        """Number of rows that depend on no others."""
        if self._is_regular:
            return len(self.blocks)
        if self.is_large:
            return min(self.shape) - int(np.sum(self.smallest[1] <= self.tolerance * self.largest))
        return int(np.sum(self._sizes > self.tolerance * self.largest))

    @cached_property
    def largest(self) -> float:
        """The largest singular value, or a bound near it."""
        return _largest_size(self.sparse()) if self.is_large else float(self._sizes.max(initial=0.0))

    def times(self, vectors: Float[np.ndarray, "column k"]) -> Float[np.ndarray, "row k"]:
        """Return the products with some vectors."""
        return (self.sparse() if self.is_large else self.dense()) @ vectors

    @cached_property
    def smallest(self) -> tuple[Any, Any, Any]:
        """Singular values at most `SMALL` times the largest: vectors of rows in columns, values, vectors of columns."""
        rows, columns = self.shape
        if self._is_regular:
            return np.zeros((rows, 0)), np.zeros(0), np.zeros((columns, 0))
        if not self.is_large:
            few = self._sizes <= SMALL * self.largest
            if not few.any():
                return np.zeros((rows, 0)), np.zeros(0), np.zeros((columns, 0))
            left, sizes, right = self._singular
            return left[:, : len(few)][:, few], sizes[few], right[: len(few)][few].T
        if not min(self.shape):
            return np.zeros((rows, 0)), np.zeros(0), np.zeros((columns, 0))
        matrix = self.sparse() if rows > columns else self.sparse().T.tocsr()
        vectors = _null_space(matrix, tolerance=SMALL)
        others, sizes, turned = np.linalg.svd(matrix @ vectors, full_matrices=False)
        vectors = vectors @ turned.T
        return (others, sizes, vectors) if rows > columns else (vectors, sizes, others)

    @cached_property
    def dependences(self) -> Float[np.ndarray, "row combination"]:
        """Combinations of rows that vanish, orthonormal."""
        if not self.is_large:
            return self._singular[0][:, self.rank :]
        rows, _columns = self.shape
        return _null_space(self.sparse().T.tocsr(), rows - self.rank)

    @cached_property
    def free_directions(self) -> Float[np.ndarray, "direction column"]:
        """Directions that no row sees, orthonormal; of hundreds in a large mechanism, some at random."""
        if not self.is_large:
            return self._singular[2][self.rank :]
        _rows, columns = self.shape
        return _null_space(self.sparse(), columns - self.rank).T

    @cached_property
    def _is_regular(self) -> bool:
        """Whether a small square one has no small singular values by far; an inverse takes a tenth of their time."""
        if self.is_large or self.shape[0] != self.shape[1]:
            return False
        return _has_short_inverse(self.dense(), max(SMALL, self.tolerance))

    @cached_property
    def _sizes(self) -> Float[np.ndarray, " k"]:
        return np.linalg.svd(self.dense(), compute_uv=False)  # in half the time that the vectors take besides

    @cached_property
    def _singular(self) -> tuple[Float[np.ndarray, "row row"], Float[np.ndarray, " k"], Float[np.ndarray, "c c"]]:
        return np.linalg.svd(self.dense())


def _largest_size(matrix: Any) -> float:
    """Return a bound of the largest singular value, near it where rows have few entries: by its rows and columns."""
    sizes, begun = np.abs(matrix.data), matrix.indptr[:-1][np.diff(matrix.indptr) > 0]
    sums = np.add.reduceat(sizes, begun), np.bincount(matrix.indices, sizes)
    return float(np.sqrt(np.prod([part.max(initial=0.0) for part in sums])))


def _probes(rows: int, count: int) -> Float[np.ndarray, "row probe"]:
    return np.random.default_rng(0).standard_normal((rows, count))


def _factored(matrix: Any) -> Any:
    """Return the factors of a square matrix, None where it is singular."""
    from scipy.sparse.linalg import splu

    try:
        return splu(matrix.tocsc())
    except RuntimeError:  # that is how SuperLU tells
        return None


def _augmented(matrix: Any, damping: float) -> Any:
    """Return ``[[I, A^T], [A, -damping I]]``, the augmented system of damped least squares."""
    from scipy.sparse import coo_array

    (rows, columns), entries = matrix.shape, matrix.tocoo()
    size = rows + columns
    below, diagonal = columns + entries.row, np.arange(size if damping else columns, dtype=entries.row.dtype)
    values = np.concatenate([entries.data, entries.data, np.where(diagonal < columns, 1.0, -damping)])
    where = [below, entries.col, diagonal], [entries.col, below, diagonal]
    return coo_array((values, tuple(map(np.concatenate, where))), shape=(size, size))


def _shortest(matrix: Any, right: Float[np.ndarray, " row"]) -> Float[np.ndarray, " column"]:
    """Return the shortest solution; of least squares, damped, where rows depend on one another."""
    columns = matrix.shape[1]
    shortest, smallest = _solved(matrix, right[:, None])
    if smallest > STEP_TOLERANCE * _largest_size(matrix):
        return shortest[:, 0]
    damped = _factored(_augmented(matrix, (DAMPING * _largest_size(matrix)) ** 2))
    return damped.solve(np.concatenate([np.zeros(columns), right]))[:columns]


def _solved(matrix: Any, right: Float[np.ndarray, "row k"]) -> tuple[Float[np.ndarray, "column k"], float]:
    """Return the shortest solutions, and nearly the smallest singular value; zero where these are not to be had.

    The inverse makes a random vector longer by about the inverse of that value.
    """
    (rows, columns), count = matrix.shape, right.shape[1]
    square = rows == columns
    factors = _factored(matrix if square else _augmented(matrix, 0.0)) if rows <= columns else None
    if factors is None:
        return np.zeros((columns, count)), 0.0
    right = np.column_stack([right, _probes(rows, PROBES)])
    right_sides = right if square else np.concatenate([np.zeros((columns, count + PROBES)), right])
    solutions = factors.solve(right_sides)
    if not np.isfinite(solutions).all():
        return np.zeros((columns, count)), 0.0
    growth = float(np.max(np.linalg.norm(solutions[-rows:, count:], axis=0) / np.linalg.norm(right[:, count:], axis=0)))
    return solutions[:columns, :count], 1 / growth if square else growth**-0.5


def is_clearly_regular(matrix: Float[np.ndarray, "size size"], tolerance: float) -> bool:
    """Tell whether a square matrix, a large one with many zeros, has no small singular value by far.

    A value counts as small if it is at most the tolerance times the largest.
    """
    if len(matrix) <= MOST_DENSE:
        return _has_short_inverse(matrix, tolerance)
    from scipy.sparse import csr_array

    if not np.isfinite(matrix).all():
        return False
    nonzero = np.flatnonzero(matrix != 0.0)  # ten times as fast as SciPy looks for them
    where = np.divmod(nonzero.astype(np.int32), np.int32(len(matrix)))
    whole = csr_array((matrix.ravel()[nonzero], where), shape=matrix.shape)
    return _solved(whole, np.zeros((len(matrix), 0)))[1] > 10 * tolerance * _largest_size(whole)


def _has_short_inverse(matrix: Float[np.ndarray, "size size"], tolerance: float) -> bool:
    """Tell whether a small matrix is regular by its inverse, in a fourth of the time that singular values take."""
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return False
    squares = np.vdot(matrix, matrix) * np.vdot(inverse, inverse)  # of the condition, or of more
    return bool((10 * tolerance) ** 2 * squares < 1)


def _clearly_independent(matrix: Any, tolerance: float) -> bool:
    """Tell whether no combination of rows vanishes by far."""
    smallest = _solved(matrix, np.zeros((matrix.shape[0], 0)))[1]
    # in the larger matrix rounding hides what is smaller
    least = 10 * tolerance if matrix.shape[0] == matrix.shape[1] else max(10 * tolerance, 1e-7)
    return smallest > least * _largest_size(matrix)


def _null_space(
    matrix: Any, count: int | None = None, tolerance: float = RANK_TOLERANCE
) -> Float[np.ndarray, "column vector"]:
    """Return an orthonormal basis of what a matrix takes to zero; if its dimension is given and large, a part of it.

    The inverse of ``A^T A + d I`` shortens every vector by d over the square of its singular value, but those of the
    null space: two products leave of a random block that space and the vectors nearest to it. The block is large enough
    as soon as one vector of it is no null vector by far.
    """
    rows, columns = matrix.shape
    if not rows or not columns:
        return np.linalg.qr(_probes(columns, min(columns, MOST_VECTORS)))[0]
    if count == 0 or (count is None and _clearly_independent(matrix.T, tolerance)):
        return np.zeros((columns, 0))
    size = _largest_size(matrix)
    factors = _factored(_augmented(matrix, (DAMPING * size) ** 2))

    def nearest(width: int) -> Any:
        block = _probes(columns, width)
        for _ in range(2):
            block = factors.solve(np.concatenate([block, np.zeros((rows, width))]))[:columns]
            block = np.linalg.qr(block)[0]
        return block

    if count is not None and count > MOST_VECTORS:
        return nearest(MOST_VECTORS)
    width = PROBES + (max(0, columns - rows) if count is None else count)
    while True:
        block = nearest(min(columns, width))
        _, sizes, turned = np.linalg.svd(np.linalg.qr(matrix @ block, mode="r"))
        if width >= columns or sizes[0] > 10 * DAMPING * size:
            rank = np.count_nonzero(sizes > tolerance * size) if count is None else len(turned) - count
            return block @ turned[rank:].T
        width *= 4
