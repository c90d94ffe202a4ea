"""Laws of polynomials that follow one another."""

from typing import Literal

import numpy as np

from jounce.trajectory import SplineMotion


class JoinedPieces(SplineMotion):
    """Polynomials that follow one another; where they meet, derivatives may jump.

    Parameters
    ----------
    begins : array_like of shape (pieces,)
        Begins of the pieces, increasing.
    powers : array_like of shape (powers, pieces)
        Coefficients, lowest power first, of the argument less the begin of its piece.
    stop : float
        End of the last piece.
    beyond : {"refuse", "continue"}, default "refuse"
        Whether the polynomials at the ends go on beyond them.
    """

    def __init__(
        self, begins: np.ndarray, powers: np.ndarray, stop: float, beyond: Literal["refuse", "continue"] = "refuse"
    ):
        self._set(begins, powers, stop, beyond)


class SmoothPieces(JoinedPieces):
    """Polynomials of a spline with all derivatives below its degree continuous."""

    def __init__(self, begins: np.ndarray, powers: np.ndarray, stop: float):
        super().__init__(begins, powers, stop)

    @property
    def joined(self) -> int:
        """Highest derivative that is known to be continuous where pieces meet."""
        return self.degree - 1
