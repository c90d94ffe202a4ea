"""A rate along a path, and its conditions in addition to limits."""

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.planning.retiming.rates.rate_spline import Parametrization, RateBasis

_Points = Float[np.ndarray, " _"]


@dataclasses.dataclass(frozen=True, eq=False)
class RateLaw:
    """A rate along a path: z, the square of the rate of u, as a spline over u.

    Parameters
    ----------
    parameter : Parametrization
        s over u.
    basis : RateBasis
        Splines over u.
    coefficients : ndarray of shape (coefficient,)
        Coefficients of z, 1/s^2.
    """

    parameter: Parametrization
    basis: RateBasis
    coefficients: _Points

    def at(self, u: _Points) -> Float[np.ndarray, "4 point"]:
        """Return z and its derivatives by u."""
        return np.stack([matrix @ self.coefficients for matrix in self.basis.matrices(u)])

    def slowed(self, factor: float) -> "RateLaw":
        """Return the law with its rate divided by a factor."""
        return dataclasses.replace(self, coefficients=self.coefficients / factor**2)

    @property
    def duration(self) -> float:
        """Time from one end to the other, s."""
        nodes, weights = quadrature(self.basis.cells, 8)
        return float(weights @ (1 / np.sqrt(self.at(nodes)[0])))


@dataclasses.dataclass(frozen=True)
class Conditions:
    """Conditions of a law in addition to the limits.

    Parameters
    ----------
    order : int
        Highest time derivative that is continuous, also at ends at rest.
    rates : tuple of float or None
        Rates of s at the ends, 1/s; zero for rest, and None for a free rate.
    max_rate : float or None
        Largest rate of s, 1/s; for a parametrization by s itself.
    further : tuple of float
        Second and third time derivatives of s at the start, if given in addition to the rate.
    """

    order: int
    rates: tuple[float | None, float | None] = (0.0, 0.0)
    max_rate: float | None = None
    further: tuple[float, ...] = ()

    @property
    def rests(self) -> tuple[int, int]:
        """Number of levels of s by u, including the value, that are fixed at each end."""
        first, last = (self.order + 1 if rate == 0 else 1 for rate in self.rates)
        return first, last


def quadrature(cells: int, count: int) -> tuple[_Points, _Points]:
    """Return the nodes and weights of Gauss quadrature on equal cells from 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    u = (np.arange(cells)[:, None] + (nodes + 1) / 2) / cells
    return u.reshape(-1), np.tile(weights / 2 / cells, cells)


def progress(law: RateLaw) -> tuple[_Points, _Points]:
    """Return the share of the duration, and s, at the knots of a law."""
    nodes, weights = quadrature(law.basis.cells, 8)
    times = (weights / np.sqrt(law.at(nodes)[0])).reshape(law.basis.cells, -1).sum(axis=1)
    u = np.append(0.0, np.cumsum(times))
    s = law.parameter.derivatives(np.linspace(0, 1, law.basis.cells + 1), 0)[0]
    return u / u[-1], s
