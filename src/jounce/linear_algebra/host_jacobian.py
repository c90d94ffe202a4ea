"""The Jacobian at one position on the host: Newton steps, rank, and null vectors.

A small Jacobian is decomposed into singular values. A large one is sparse: its equations are solved by SuperLU, and all
its null vectors are found by subspace iteration with a shifted inverse.
"""

import dataclasses
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers
from jounce.linear_algebra.pattern import Pattern

RANK_TOLERANCE = 1e-9
SMALL = 1e-6  # of the largest singular value: bound of small singular values, next to a singular position
STEP_TOLERANCE = 1e-10
MOST_DENSE = 100  # rows or columns, beyond which sparse elimination is faster
DAMPING = 1e-6  # of the largest singular value
PROBES = 8  # random vectors, at least one of which has a component along any vector that an inverse amplifies
MOST_VECTORS = 1024  # of a null space; of a larger one, this many random vectors


@dataclasses.dataclass(frozen=True)
class HostJacobian:
    """A Jacobian in blocks of the bodies that each row touches.

    Attributes
    ----------
    bodies : array of int, shape (rows, slots)
        Bodies that each row touches; the number of bodies fills unused slots.
    blocks : array of shape (rows, slots, width)
        Entries in the columns of these bodies.
    body_count : int
        Number of bodies.
    tolerance : float
        Bound relative to the largest singular value, at or below which singular values count as zero.
    """

    bodies: Int[np.ndarray, "row slot"]
    blocks: Float[np.ndarray, "row slot width"]
    body_count: int
    tolerance: float = RANK_TOLERANCE

    @classmethod
    def of(cls, pattern: Pattern, entries: Float[Numbers, " entry"]) -> "HostJacobian":
        """Return the Jacobian with given entries at the places of a pattern."""
        padded = np.zeros(pattern.entry_count + 1)
        padded[:-1] = entries
        return cls(np.asarray(pattern.bodies), padded.take(pattern.entry_indices), pattern.body_count)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows, and of columns."""
        return len(self.blocks), self.body_count * self.blocks.shape[-1]

    @property
    def is_large(self) -> bool:
        """Whether the matrix is treated as sparse."""
        return max(self.shape) > MOST_DENSE

    def finite(self) -> Bool[np.ndarray, " row"]:
        """Return which rows are finite."""
        return np.asarray(np.isfinite(self.blocks).all(axis=(1, 2)))

    @cached_property
    def row_scale(self) -> Float[np.ndarray, " row"]:
        """Factors that scale the largest entry of each row to one."""
        largest = np.abs(self.blocks).max(axis=(1, 2), initial=0.0)
        return 1 / np.where((largest > 0) & np.isfinite(largest), largest, 1.0)

    def scaled(self, scale: Float[np.ndarray, " row"]) -> "HostJacobian":
        """Return the Jacobian with its rows multiplied by factors."""
        return HostJacobian(self.bodies, scale[:, None, None] * self.blocks, self.body_count, self.tolerance)

    def take(self, rows: Bool[np.ndarray, " row"]) -> "HostJacobian":
        """Return the Jacobian of selected rows."""
        return dataclasses.replace(self, bodies=self.bodies[rows], blocks=self.blocks[rows])

    def dense(self) -> Float[np.ndarray, "row column"]:
        """Return the dense matrix."""
        rows, _, width = self.blocks.shape
        matrix = np.zeros((rows, self.body_count + 1, width))
        matrix[np.arange(rows)[:, None], self.bodies] = self.blocks
        return matrix[:, :-1].reshape(self.shape)

    def sparse(self) -> Any:
        """Return the matrix in SciPy's sparse format, nonzero entries only."""
        from scipy.sparse import coo_array  # imported late, as importing SciPy takes half a second

        width = self.blocks.shape[-1]
        columns = self.bodies[:, :, None] * width + np.arange(width)
        row, slot, column = np.nonzero((self.blocks != 0) & (columns < self.shape[1]))
        positions = row, columns[row, slot, column]
        return coo_array((self.blocks[row, slot, column], positions), shape=self.shape).tocsr()

    def step(self, residual: Float[np.ndarray, " row"]) -> Float[np.ndarray, " column"] | None:
        """Return the shortest step that closes the residual to first order, rows scaled; None if it is not finite."""
        if not (np.isfinite(residual).all() and np.isfinite(self.blocks).all()):
            return None  # factorizations may not terminate on non-finite matrices
        scale = self.row_scale
        matrix, right = self.scaled(scale), -scale * residual
        if self.is_large:
            step = _shortest(matrix.sparse(), right)
        else:
            step = np.linalg.lstsq(matrix.dense(), right, rcond=STEP_TOLERANCE)[0]
        return step if np.isfinite(step).all() else None

    @cached_property
    def rank(self) -> int:
        """Number of independent rows."""
        if self._is_regular:
            return len(self.blocks)
        if self.is_large:
            return min(self.shape) - int(np.sum(self.smallest[1] <= self.tolerance * self.largest))
        return int(np.sum(self._sizes > self.tolerance * self.largest))

    @cached_property
    def largest(self) -> float:
        """The largest singular value, or a bound close to it."""
        return _largest_size(self.sparse()) if self.is_large else float(self._sizes.max(initial=0.0))

    def times(self, vectors: Float[np.ndarray, "column k"]) -> Float[np.ndarray, "row k"]:
        """Return the products with vectors."""
        return (self.sparse() if self.is_large else self.dense()) @ vectors

    @cached_property
    def smallest(self) -> tuple[Any, Any, Any]:
        """Singular values up to `SMALL` times the largest: left vectors, values, right vectors, as columns."""
        rows, columns = self.shape
        if self._is_regular:
            return np.zeros((rows, 0)), np.zeros(0), np.zeros((columns, 0))
        if not self.is_large:
            is_small = self._sizes <= SMALL * self.largest
            if not is_small.any():
                return np.zeros((rows, 0)), np.zeros(0), np.zeros((columns, 0))
            left, sizes, right = self._singular
            return left[:, : len(is_small)][:, is_small], sizes[is_small], right[: len(is_small)][is_small].T
        if not min(self.shape):
            return np.zeros((rows, 0)), np.zeros(0), np.zeros((columns, 0))
        matrix = self.sparse() if rows > columns else self.sparse().T.tocsr()
        vectors = _null_space(matrix, tolerance=SMALL)
        images, sizes, rotation = np.linalg.svd(matrix @ vectors, full_matrices=False)
        vectors = vectors @ rotation.T
        return (images, sizes, vectors) if rows > columns else (vectors, sizes, images)

    @cached_property
    def dependences(self) -> Float[np.ndarray, "row combination"]:
        """Orthonormal combinations of rows that vanish."""
        if not self.is_large:
            return self._singular[0][:, self.rank :]
        rows, _columns = self.shape
        return _null_space(self.sparse().T.tocsr(), rows - self.rank)

    @cached_property
    def free_directions(self) -> Float[np.ndarray, "direction column"]:
        """Orthonormal basis of the null space; of a very large one, random vectors."""
        if not self.is_large:
            return self._singular[2][self.rank :]
        _rows, columns = self.shape
        return _null_space(self.sparse(), columns - self.rank).T

    @cached_property
    def _is_regular(self) -> bool:
        """Whether a small square matrix is clearly regular, by its inverse, in a tenth of the time of an SVD."""
        if self.is_large or self.shape[0] != self.shape[1]:
            return False
        return _has_short_inverse(self.dense(), max(SMALL, self.tolerance))

    @cached_property
    def _sizes(self) -> Float[np.ndarray, " k"]:
        return np.linalg.svd(self.dense(), compute_uv=False)  # half the time of a decomposition with vectors

    @cached_property
    def _singular(self) -> tuple[Float[np.ndarray, "row row"], Float[np.ndarray, " k"], Float[np.ndarray, "c c"]]:
        return np.linalg.svd(self.dense())


def _largest_size(matrix: Any) -> float:
    """Return a bound of the largest singular value from row and column sums, close if rows have few entries."""
    sizes, starts = np.abs(matrix.data), matrix.indptr[:-1][np.diff(matrix.indptr) > 0]
    sums = np.add.reduceat(sizes, starts), np.bincount(matrix.indices, sizes)
    return float(np.sqrt(np.prod([part.max(initial=0.0) for part in sums])))


def _probes(rows: int, count: int) -> Float[np.ndarray, "row probe"]:
    return np.random.default_rng(0).standard_normal((rows, count))


def _factored(matrix: Any) -> Any:
    """Return the factors of a square matrix, or None if it is singular."""
    from scipy.sparse.linalg import splu

    try:
        return splu(matrix.tocsc())
    except RuntimeError:  # SuperLU's report of a singular matrix
        return None


def _augmented(matrix: Any, damping: float) -> Any:
    """Return ``[[I, A^T], [A, -damping I]]``, the augmented system of damped least squares."""
    from scipy.sparse import coo_array

    (rows, columns), entries = matrix.shape, matrix.tocoo()
    size = rows + columns
    lower_rows, diagonal = columns + entries.row, np.arange(size if damping else columns, dtype=entries.row.dtype)
    values = np.concatenate([entries.data, entries.data, np.where(diagonal < columns, 1.0, -damping)])
    positions = [lower_rows, entries.col, diagonal], [entries.col, lower_rows, diagonal]
    return coo_array((values, tuple(map(np.concatenate, positions))), shape=(size, size))


def _shortest(matrix: Any, right: Float[np.ndarray, " row"]) -> Float[np.ndarray, " column"]:
    """Return the shortest solution; a damped least-squares solution if rows are dependent."""
    columns = matrix.shape[1]
    shortest, smallest = _solved(matrix, right[:, None])
    if smallest > STEP_TOLERANCE * _largest_size(matrix):
        return shortest[:, 0]
    damped = _factored(_augmented(matrix, (DAMPING * _largest_size(matrix)) ** 2))
    return damped.solve(np.concatenate([np.zeros(columns), right]))[:columns]


def _solved(matrix: Any, right: Float[np.ndarray, "row k"]) -> tuple[Float[np.ndarray, "column k"], float]:
    """Return the shortest solutions and an estimate of the smallest singular value; zeros if the matrix is singular.

    The inverse amplifies random vectors by about the inverse of that value.
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
    """Return whether a square matrix, if large with many zeros, is far from singular.

    All its singular values then exceed the tolerance times the largest by a wide margin.
    """
    if len(matrix) <= MOST_DENSE:
        return _has_short_inverse(matrix, tolerance)
    from scipy.sparse import csr_array

    if not np.isfinite(matrix).all():
        return False
    nonzero = np.flatnonzero(matrix != 0.0)  # ten times as fast as SciPy's search
    positions = np.divmod(nonzero.astype(np.int32), np.int32(len(matrix)))
    sparse_matrix = csr_array((matrix.ravel()[nonzero], positions), shape=matrix.shape)
    return _solved(sparse_matrix, np.zeros((len(matrix), 0)))[1] > 10 * tolerance * _largest_size(sparse_matrix)


def _has_short_inverse(matrix: Float[np.ndarray, "size size"], tolerance: float) -> bool:
    """Return whether a small matrix is regular by its inverse, in a fourth of the time of an SVD."""
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return False
    squares = np.vdot(matrix, matrix) * np.vdot(inverse, inverse)  # squared bound of the condition number
    return bool((10 * tolerance) ** 2 * squares < 1)


def _clearly_independent(matrix: Any, tolerance: float) -> bool:
    """Return whether no combination of rows vanishes, by a wide margin."""
    smallest = _solved(matrix, np.zeros((matrix.shape[0], 0)))[1]
    # in the augmented matrix, rounding hides smaller values
    lower_bound = 10 * tolerance if matrix.shape[0] == matrix.shape[1] else max(10 * tolerance, 1e-7)
    return smallest > lower_bound * _largest_size(matrix)


def _null_space(
    matrix: Any, count: int | None = None, tolerance: float = RANK_TOLERANCE
) -> Float[np.ndarray, "column vector"]:
    """Return an orthonormal basis of the null space of a matrix; if its dimension is given and large, a part of it.

    The inverse of ``A^T A + d I`` shortens vectors by d over the square of their singular value, except those of the
    null space: two products with a random block leave that space and the vectors closest to it. The block is large
    enough when one of its vectors is clearly not a null vector.
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
        _, sizes, rotation = np.linalg.svd(np.linalg.qr(matrix @ block, mode="r"))
        if width >= columns or sizes[0] > 10 * DAMPING * size:
            rank = np.count_nonzero(sizes > tolerance * size) if count is None else len(rotation) - count
            return block @ rotation[rank:].T
        width *= 4
