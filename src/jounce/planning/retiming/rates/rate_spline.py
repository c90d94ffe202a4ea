"""The square of the rate along a path as a B-spline, and the parametrization in which it is smooth even at rest."""

import dataclasses
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike
from jounce.trajectory import SplineMotion
from jounce.trajectory.splines import local_powers, pieces_at

SMOOTHNESS = 9  # degree of the parametrization
KNOT_INTERVALS = 24  # of the parametrization

_Points = Float[np.ndarray, " _"]


class Parametrization(SplineMotion):
    """The parameter s of a path over u from 0 to 1: increasing, with derivatives that vanish at ends at rest.

    If a motion starts from rest with a bounded derivative of order p, s grows as the p-th power of time. If s grows as
    the p-th power of u, u grows linearly in time: its rate is smooth and not zero.

    Parameters
    ----------
    u, s : array_like of shape (samples,)
        Samples to approximate, such as those of an approximate time law: u from 0 to 1, both increasing.
    rests : tuple of int
        Number of levels of s, including the value, that are fixed at each end; 0 or 1 if the end is not at rest.
    """

    def __init__(self, u: ArrayLike, s: ArrayLike, rests: tuple[int, int]):
        from scipy.interpolate import BSpline

        u, s = np.asarray(u, float), np.asarray(s, float)
        knots = clamped(KNOT_INTERVALS, SMOOTHNESS)
        count = len(knots) - SMOOTHNESS - 1
        greville = np.array([knots[k + 1 : k + 1 + SMOOTHNESS].mean() for k in range(count)])
        # a spline with increasing coefficients increases; k equal coefficients at an end make k - 1 derivatives vanish
        values = np.interp(greville, u, s)
        for end, fixed_levels in zip((slice(None), slice(None, None, -1)), rests, strict=True):
            values[end][: max(fixed_levels, 1)] = s[end][0]
        spline = BSpline(knots, values, SMOOTHNESS)
        breakpoints = np.linspace(0.0, 1.0, KNOT_INTERVALS + 1)
        self._set(breakpoints[:-1], local_powers(spline, breakpoints[:-1], SMOOTHNESS), 1.0, "continue")

    def derivatives(self, u: _Points, order: int) -> Float[np.ndarray, "derivative point"]:
        """Return s and its derivatives by u."""
        return np.stack([pieces_at(self, u, k) for k in range(order + 1)])


def clamped(intervals: int, degree: int) -> _Points:
    """Return evenly spaced knots from 0 to 1, repeated at the ends."""
    return np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, intervals + 1), np.ones(degree)])


@dataclasses.dataclass(frozen=True)
class RateBasis:
    """B-splines over u on cells of equal length.

    Parameters
    ----------
    cells : int
        Number of cells.
    degree : int
        Degree of the splines.
    """

    cells: int
    degree: int

    @cached_property
    def knots(self) -> _Points:
        """Knots with the ends repeated."""
        return clamped(self.cells, self.degree)

    @property
    def count(self) -> int:
        """Number of splines."""
        return self.cells + self.degree

    def matrices(self, u: _Points, order: int = 3) -> list[Any]:
        """Return the sparse matrices from coefficients to values and derivatives at points."""
        from scipy import sparse
        from scipy.interpolate import BSpline

        matrices, change = [], sparse.identity(self.count, format="csr")
        knots, u = self.knots, np.clip(u, 0.0, 1.0)
        for level in range(order + 1):
            degree = self.degree - level
            if degree < 0:
                matrices.append(sparse.csr_matrix((len(u), self.count)))
                continue
            inner_knots = knots[level : len(knots) - level]
            design: Any = BSpline.design_matrix(u, inner_knots, degree)
            matrices.append((design @ change).tocsr())
            if degree:
                widths = inner_knots[degree + 1 : -1] - inner_knots[1 : len(inner_knots) - degree - 1]
                rows = len(widths)
                lower, upper = (
                    sparse.diags(sign * degree / widths, k, shape=(rows, rows + 1)) for k, sign in ((0, -1), (1, 1))
                )
                step: Any = lower + upper
                change = step @ change
        return matrices

    def compact(self, u: _Points, matrices: list[Any]) -> tuple[Any, Any]:
        """Return the first nonzero spline at each point, and the entries of matrices from that spline on.

        Returns
        -------
        first : array of shape (point,)
        entries : array of shape (matrix, point, degree + 1)
        """
        inner = self.knots[self.degree : self.degree + self.cells + 1]
        first = np.clip(np.searchsorted(inner, np.clip(u, 0.0, 1.0), side="right") - 1, 0, self.cells - 1)
        columns = first[:, None] + np.arange(self.degree + 1)
        entries = [np.take_along_axis(matrix.toarray(), columns, axis=1) for matrix in matrices]
        return first, np.stack(entries)

    def pieces(self, coefficients: _Points) -> Float[np.ndarray, "powers cell"]:
        """Return the polynomials on the cells, as coefficients of powers of u minus its start, lowest first."""
        from scipy.interpolate import BSpline

        begins = np.linspace(0.0, 1.0, self.cells + 1)[:-1]
        return local_powers(BSpline(self.knots, coefficients, self.degree), begins, self.degree)
