"""Functions of time as Legendre series on pieces that are halved until the series are exact to rounding."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre, polynomial

from jounce.errors import TrajectoryError
from jounce.trajectory.motion import SplineMotion

POINTS = 10  # of Gauss, on each piece
NODES, WEIGHTS = legendre.leggauss(POINTS)
ANALYSIS = legendre.legvander(NODES, POINTS - 1).T * WEIGHTS * (np.arange(POINTS)[:, None] + 0.5)
"""Takes values at the points to the coefficients of Legendre polynomials."""

RESOLVED = 1e-12  # of the largest value: what the last coefficients may be
NOISE = 1e-8  # below it, last coefficients that do not fall from a piece to its half are rounding
SHORTEST = 1e-9  # of the whole: a jump may lie in such a piece
MOST = 100_000  # pieces


class Pieces(NamedTuple):
    """A function on pieces.

    Attributes
    ----------
    nodes : array of shape (pieces + 1,)
        Where pieces begin, and the last one ends, s.
    values : array of shape (pieces, points, columns)
        At the points of Gauss on each.
    """

    nodes: Float[np.ndarray, " nodes"]
    values: Float[np.ndarray, "pieces points columns"]

    @property
    def integrals(self) -> Float[np.ndarray, "pieces columns"]:
        """Integrals over the pieces."""
        return 0.5 * np.diff(self.nodes)[:, None] * np.einsum("k,pkc->pc", WEIGHTS, self.values)

    @property
    def laws(self) -> tuple["PieceMotion", ...]:
        """A motion law for each column, of polynomials."""
        series = np.einsum("kg,pgc->kpc", ANALYSIS, self.values)
        unit = np.array([_shifted(k) for k in range(POINTS)])
        powers = (
            np.einsum("kj,kpc->jpc", unit, series) / np.diff(self.nodes)[:, None] ** np.arange(POINTS)[:, None, None]
        )
        return tuple(PieceMotion(self.nodes, powers[..., column]) for column in range(self.values.shape[-1]))


class PieceMotion(SplineMotion):
    """A law of polynomials, each by the time since its piece began; the first and the last one go on beyond."""

    def __init__(self, nodes: Float[np.ndarray, " nodes"], powers: Float[np.ndarray, "powers pieces"]):
        self._set(nodes[:-1], powers, nodes[-1], "continue")


def _shifted(degree: int) -> Float[np.ndarray, " powers"]:
    """Return the powers of a Legendre polynomial of a variable that goes from 0 to 1."""
    shifted, line = np.zeros(1), np.array([-1.0, 2.0])
    for c in legendre.leg2poly([0.0] * degree + [1.0])[::-1]:
        shifted = polynomial.polyadd(polynomial.polymul(shifted, line), [c])
    return np.pad(shifted, (0, POINTS))[:POINTS]


def points_of(
    start: Float[np.ndarray, " pieces"], stop: Float[np.ndarray, " pieces"]
) -> Float[np.ndarray, "pieces points"]:
    """Return the instants of the points of Gauss on pieces."""
    return start[:, None] + 0.5 * (stop - start)[:, None] * (1.0 + NODES)


def resolved(
    function: Callable[[np.ndarray], np.ndarray], nodes: Float[np.ndarray, " nodes"], floor: float | np.ndarray = 0.0
) -> Pieces:
    """Return a function of time on pieces, halved until its series are exact to rounding.

    Parameters
    ----------
    function : callable
        Maps instants, (time,), to values, (time, columns).
    nodes : array of shape (nodes,)
        Increasing instants, s, to begin with.
    floor : float or array of shape (columns,)
        Sizes of rounding: what is less does not count.

    Raises
    ------
    TrajectoryError
        If that takes more pieces than there may be.
    """
    start, stop = nodes[:-1], nodes[1:]
    duration, accepted, total = nodes[-1] - nodes[0], [], 0
    largest, before = np.zeros(1), np.full(len(start), np.inf)
    while len(start):
        total += len(start)
        if total > MOST:
            message = f"changes too quickly near t = {start[0]:.9g} s to be followed; smooth the trajectory there"
            raise TrajectoryError(message)
        values = function(points_of(start, stop).reshape(-1)).reshape(len(start), POINTS, -1)
        largest = np.maximum(largest, np.abs(values).max(axis=(0, 1)))
        last = np.abs(np.einsum("kg,pgc->pkc", ANALYSIS[-2:], values)).max(axis=1)
        share = (np.maximum(last - floor, 0.0) / np.where(largest > 0, largest, 1.0)).max(axis=1)
        noise = (share < NOISE) & (share > 0.25 * before)
        good = (share <= RESOLVED) | noise | (stop - start <= SHORTEST * duration)
        accepted.append((start[good], stop[good], values[good]))
        middle = 0.5 * (start + stop)[~good]
        start, stop = (np.stack(pair, axis=1).reshape(-1) for pair in ((start[~good], middle), (middle, stop[~good])))
        before = np.repeat(share[~good], 2)
    begins, ends, coefficients = (np.concatenate(parts) for parts in zip(*accepted, strict=True))
    order = np.argsort(begins)
    return Pieces(np.append(begins[order], ends[order][-1]), coefficients[order])
