"""Functions of time as Legendre series on pieces, halved until the series are exact to rounding."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre, polynomial

from jounce.errors import TrajectoryError
from jounce.trajectory.motion import SplineMotion
from jounce.units.instants import time_text

POINTS = 10  # Gauss points of each piece
NODES, WEIGHTS = legendre.leggauss(POINTS)
ANALYSIS = legendre.legvander(NODES, POINTS - 1).T * WEIGHTS * (np.arange(POINTS)[:, None] + 0.5)
"""Matrix from values at the Gauss points to coefficients of Legendre polynomials."""

RESOLVED = 1e-12  # fraction of the largest value, allowed for the last coefficients
NOISE = 1e-8  # last coefficients below this fraction that do not decrease as a piece is halved are rounding
SHORTEST = 1e-9  # fraction of the duration: shortest piece, which may contain a jump
MOST = 100_000  # pieces


class Pieces(NamedTuple):
    """A function on pieces.

    Attributes
    ----------
    nodes : array of shape (pieces + 1,)
        Start of each piece, and the end of the last one, s.
    values : array of shape (pieces, points, columns)
        Values at the Gauss points of each piece.
    """

    nodes: Float[np.ndarray, " nodes"]
    values: Float[np.ndarray, "pieces points columns"]

    @property
    def integrals(self) -> Float[np.ndarray, "pieces columns"]:
        """Integrals over the pieces."""
        return 0.5 * np.diff(self.nodes)[:, None] * np.einsum("k,pkc->pc", WEIGHTS, self.values)

    @property
    def laws(self) -> tuple["PieceMotion", ...]:
        """A piecewise polynomial motion law for each column."""
        series = np.einsum("kg,pgc->kpc", ANALYSIS, self.values)
        unit = np.array([_shifted(k) for k in range(POINTS)])
        powers = (
            np.einsum("kj,kpc->jpc", unit, series) / np.diff(self.nodes)[:, None] ** np.arange(POINTS)[:, None, None]
        )
        return tuple(PieceMotion(self.nodes, powers[..., column]) for column in range(self.values.shape[-1]))


class PieceMotion(SplineMotion):
    """A law of polynomials in the time since the start of each piece; the first and the last extend beyond the ends."""

    def __init__(self, nodes: Float[np.ndarray, " nodes"], powers: Float[np.ndarray, "powers pieces"]):
        self._set(nodes[:-1], powers, nodes[-1], "continue")


def _shifted(degree: int) -> Float[np.ndarray, " powers"]:
    """Return the power coefficients of a Legendre polynomial on the interval from 0 to 1."""
    shifted, line = np.zeros(1), np.array([-1.0, 2.0])
    for c in legendre.leg2poly([0.0] * degree + [1.0])[::-1]:
        shifted = polynomial.polyadd(polynomial.polymul(shifted, line), [c])
    return np.pad(shifted, (0, POINTS))[:POINTS]


def points_of(
    start: Float[np.ndarray, " pieces"], stop: Float[np.ndarray, " pieces"]
) -> Float[np.ndarray, "pieces points"]:
    """Return the instants of the Gauss points of pieces."""
    return start[:, None] + 0.5 * (stop - start)[:, None] * (1.0 + NODES)


def resolved(
    function: Callable[[np.ndarray], np.ndarray], nodes: Float[np.ndarray, " nodes"], floor: float | np.ndarray = 0.0
) -> Pieces:
    """Return a function of time on pieces, halved until its Legendre series are exact to rounding.

    Parameters
    ----------
    function : callable
        Maps instants, (time,), to values, (time, columns).
    nodes : array of shape (nodes,)
        Ends of the first pieces: increasing instants, s.
    floor : float or array of shape (columns,)
        Rounding error; smaller coefficients count as zero.

    Raises
    ------
    TrajectoryError
        If the function needs more than 100,000 pieces.
    """
    start, stop = nodes[:-1], nodes[1:]
    duration, finished, piece_count = nodes[-1] - nodes[0], [], 0
    peaks, previous = np.zeros(1), np.full(len(start), np.inf)
    while len(start):
        piece_count += len(start)
        if piece_count > MOST:
            message = (
                f"changes too quickly near t = {time_text(start[0])} s to be followed; smooth the trajectory there"
            )
            raise TrajectoryError(message)
        values = function(points_of(start, stop).reshape(-1)).reshape(len(start), POINTS, -1)
        peaks = np.maximum(peaks, np.abs(values).max(axis=(0, 1)))
        tails = np.abs(np.einsum("kg,pgc->pkc", ANALYSIS[-2:], values)).max(axis=1)
        ratios = (np.maximum(tails - floor, 0.0) / np.where(peaks > 0, peaks, 1.0)).max(axis=1)
        noise = (ratios < NOISE) & (ratios > 0.25 * previous)
        keep = (ratios <= RESOLVED) | noise | (stop - start <= SHORTEST * duration)
        finished.append((start[keep], stop[keep], values[keep]))
        middle = 0.5 * (start + stop)[~keep]
        start, stop = (np.stack(pair, axis=1).reshape(-1) for pair in ((start[~keep], middle), (middle, stop[~keep])))
        previous = np.repeat(ratios[~keep], 2)
    begins, ends, coefficients = (np.concatenate(arrays) for arrays in zip(*finished, strict=True))
    order = np.argsort(begins)
    return Pieces(np.append(begins[order], ends[order][-1]), coefficients[order])
