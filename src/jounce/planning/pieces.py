"""Piecewise polynomial laws."""

from typing import Literal

import numpy as np

from jounce.trajectory import SplineMotion


class JoinedPieces(SplineMotion):
    """A piecewise polynomial; derivatives may jump between pieces.

    Parameters
    ----------
    begins : array_like of shape (pieces,)
        Start of each piece, increasing.
    powers : array_like of shape (powers, pieces)
        Coefficients, lowest power first, in the argument minus the start of its piece.
    stop : float
        End of the last piece.
    beyond : {"refuse", "continue"}, default "refuse"
        Whether the polynomials at the ends extend beyond them.
    """

    def __init__(
        self, begins: np.ndarray, powers: np.ndarray, stop: float, beyond: Literal["refuse", "continue"] = "refuse"
    ):
        self._set(begins, powers, stop, beyond)


class SmoothPieces(JoinedPieces):
    """A spline with all derivatives below its degree continuous.

    Parameters
    ----------
    begins, powers, stop
        As for `JoinedPieces`.
    errors : array_like of shape (powers,), optional
        Errors of the derivatives, relative to their peaks, if they are those of a motion that is not known exactly.
    """

    def __init__(self, begins: np.ndarray, powers: np.ndarray, stop: float, errors: np.ndarray | None = None):
        super().__init__(begins, powers, stop)
        self.samples.derived = errors

    @property
    def joined(self) -> int:
        """Highest derivative that is continuous between pieces."""
        return self.degree - 1
