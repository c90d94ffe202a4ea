"""Laws of polynomials that follow one another."""

import numpy as np

from jounce.trajectory import SplineMotion


class JoinedPieces(SplineMotion):
    """Polynomials that follow one another; where they meet, derivatives may jump.

    Parameters
    ----------
    begins : array_like of shape (pieces,)
        Where they begin, increasing.
    powers : array_like of shape (powers, pieces)
        Coefficients, lowest power first, of what the argument exceeds the beginning by.
    stop : float
        Where the last one ends.
    """

    def __init__(self, begins: np.ndarray, powers: np.ndarray, stop: float):
        self._set(begins, powers, stop, "refuse")


class SmoothPieces(JoinedPieces):
    """Polynomials of a spline, of which all derivatives below its degree are continuous."""

    def __init__(self, begins: np.ndarray, powers: np.ndarray, stop: float):
        super().__init__(begins, powers, stop)

    @property
    def joined(self) -> int:
        """Up to which derivative its pieces are known to meet smoothly."""
        return self.degree - 1
