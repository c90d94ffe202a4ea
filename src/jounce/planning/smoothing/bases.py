"""B-splines of degree 7 on knots: values at samples, jounce, and banded systems."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Float

DEGREE, PENALIZED = 7, 4
"""Degree of the splines, that of natural splines of least jounce, and order of the penalized derivative: jounce."""
PART = 50_000
"""Number of samples or cells whose splines are evaluated at once."""
_Knots = Float[np.ndarray, " knot"]


class Samples:
    """Samples of a joint in units of the knots, from the first knot on, converted on access, as logs are long.

    Parameters
    ----------
    times, values : array of shape (sample,)
        Instants, s, and positions, rad or m.
    knots : array of shape (cell + 1,)
        Knots, s.
    """

    def __init__(self, times: np.ndarray, values: np.ndarray, knots: np.ndarray):
        self.scale = float(np.median(np.diff(knots)))
        self.knots = (knots - knots[0]) / self.scale
        self.middle = float(values.mean())
        self._times, self._values, self._first = times, values, knots[0]

    def __len__(self) -> int:
        return len(self._times)

    def times(self, index: Any) -> Float[np.ndarray, " some"]:
        """Return selected instants."""
        return np.clip((self._times[index] - self._first) / self.scale, 0.0, self.knots[-1])

    def values(self, index: Any) -> Float[np.ndarray, " some"]:
        """Return selected values minus the mean of all."""
        return self._values[index] - self.middle

    def place(self, instant: float, side: str = "left") -> int:
        """Return the index at which an instant belongs among those of the samples, by bisection."""
        bisect = bisect_left if side == "left" else bisect_right
        return bisect(range(len(self)), instant, key=lambda k: self.times([k])[0])


def whole(knots: _Knots) -> Float[np.ndarray, " repeated"]:
    """Return knots repeated at the ends, as for B-splines."""
    return np.concatenate([np.full(DEGREE, knots[0]), knots, np.full(DEGREE, knots[-1])])


def values_at(times: Float[np.ndarray, " sample"], knots: _Knots) -> Any:
    """Return the sparse matrix of the values of B-splines at instants, (sample, spline)."""
    from scipy.interpolate import BSpline  # importing SciPy takes half a second

    return BSpline.design_matrix(times, whole(knots), DEGREE)


def penalty_root(repeated: _Knots, weights: Float[np.ndarray, " cell"]) -> Any:
    """Return a sparse matrix, (node, spline), whose square is the weighted integral of the square of the jounce.

    Parameters
    ----------
    repeated : array of shape (cell + 1 + 2 * degree,)
        Nondecreasing knots: the ends of the cells, with the knots before and after them.
    weights : array of shape (cell,)
        Weight of each cell.
    """
    from scipy import sparse
    from scipy.interpolate import BSpline

    knots, degree = repeated[DEGREE : len(repeated) - DEGREE], DEGREE
    derivative: Any = sparse.identity(len(knots) + DEGREE - 1, format="csr")
    for _ in range(PENALIZED):
        count = derivative.shape[0]
        gaps = repeated[degree + 1 : degree + count] - repeated[1:count]
        build: Any = sparse.diags_array  # its type stubs allow one diagonal only
        step = build([-degree / gaps, degree / gaps], offsets=[0, 1], shape=(count - 1, count))
        derivative, repeated, degree = step.tocsr() @ derivative, repeated[1:-1], degree - 1
    nodes, shares = np.polynomial.legendre.leggauss(degree + 1)  # exact for squares
    lengths = np.diff(knots)
    points = knots[:-1, None] + lengths[:, None] * (nodes + 1) / 2
    root = np.sqrt(weights[:, None] * lengths[:, None] / 2 * shares)
    return sparse.diags(root.reshape(-1)) @ BSpline.design_matrix(points.reshape(-1), repeated, degree) @ derivative


def parts_of(count: int) -> Iterator[slice]:
    """Yield the parts of many samples or cells, so that the matrices of each part need little memory."""
    for first in range(0, count, PART):
        yield slice(first, min(first + PART, count))


def cost(samples: Samples, weights: Float[np.ndarray, " cell"]) -> tuple[Any, Float[np.ndarray, " spline"]]:
    """Return the symmetric sparse matrix and the vector of the cost: squared distances plus weighted squared jounce.

    Parameters
    ----------
    samples : Samples
        Samples with the knots.
    weights : array of shape (cell,)
        Weight of the squared jounce in each cell.
    """
    from scipy import sparse

    knots = samples.knots
    count = len(knots) + DEGREE - 1
    bands, right = np.zeros((DEGREE + 1, count)), np.zeros(count)
    for chunk in parts_of(len(samples)):
        matrix = values_at(samples.times(chunk), knots)
        columns = slice(int(matrix.indices.min()), int(matrix.indices.max()) + 1)
        matrix = matrix[:, columns]
        bands[:, columns] += banded(matrix.T @ matrix)
        right[columns] += matrix.T @ samples.values(chunk)
    repeated = whole(knots)
    for chunk in parts_of(len(weights)):
        root = penalty_root(repeated[chunk.start : chunk.stop + 2 * DEGREE + 1], weights[chunk])
        bands[:, chunk.start : chunk.stop + DEGREE] += banded(root.T @ root)
    upper: Any = sparse.dia_array((bands[::-1], np.arange(DEGREE + 1)), shape=(count, count)).tocsr()
    return upper + sparse.triu(upper, 1).T.tocsr(), right


def banded(matrix: Any) -> Float[np.ndarray, "diagonal spline"]:
    """Return the upper diagonals of a symmetric sparse matrix, in the form of SciPy's banded solvers."""
    bands = np.zeros((DEGREE + 1, matrix.shape[0]))
    for k in range(DEGREE + 1):
        if k < matrix.shape[0]:
            bands[DEGREE - k, k:] = matrix.diagonal(k)
    return bands
