"""Limited quantities along a path: polynomials in the time derivatives of s, with coefficients from jets.

With a path q(s), every quantity of second order is ``F = m s'' + c s'^2 + d s' + g``, where primes denote time
derivatives of s: the acceleration of a joint (m = dq/ds, c = d2q/ds2), its torque, the force of a driver, the
acceleration of a point. Its rate - jerk, torque rate, yank - follows from the derivatives of m, c, d and g by s.
"""

import dataclasses
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

Array = Float[np.ndarray, "..."]
M, C, D, G = range(4)


@dataclasses.dataclass(frozen=True)
class Quantity:
    """The name of a limited quantity.

    Parameters
    ----------
    owner : str
        Joint, driver, output or link.
    word : str
        velocity, acceleration, jerk, jounce, torque, torque rate, tool speed, ...
    unit : str
        Unit of values and limits.
    """

    owner: str
    word: str
    unit: str


@dataclasses.dataclass(frozen=True, eq=False)
class PathQuantities:
    """Coefficients of the limited quantities at points of a path, and their bounds, infinite for no limit.

    Parameters
    ----------
    first : array of shape (point, k1)
        Value of each quantity of first order for a rate of s of 1.
    first_bounds : array of shape (point, k1)
        Largest magnitudes of these quantities.
    second : array of shape (point, k2, 8)
        m, c, d, g and their derivatives along the path.
    lower, upper, rate_lower, rate_upper : array of shape (point, k2)
        Ranges of the values, and of their rates.
    vectors : array of shape (point, k3, 3, 2)
        m and c of vectors with limited magnitudes.
    vector_bounds : array of shape (point, k3)
        Largest magnitudes of the vectors.
    fourth : array of shape (point, k4, 4)
        First to fourth derivatives by s of coordinates with a limit of their fourth time derivative.
    fourth_bounds : array of shape (point, k4)
        Largest magnitudes of the fourth time derivatives.
    """

    first: Array
    first_bounds: Array
    second: Array
    lower: Array
    upper: Array
    rate_lower: Array
    rate_upper: Array
    vectors: Array
    vector_bounds: Array
    fourth: Array
    fourth_bounds: Array


@dataclasses.dataclass(frozen=True)
class Labels:
    """Names of the columns of `PathQuantities`."""

    first: tuple[Quantity, ...]
    second: tuple[Quantity, ...]
    rates: tuple[Quantity, ...]
    vectors: tuple[Quantity, ...]
    fourth: tuple[Quantity, ...]

    @property
    def every(self) -> tuple[Quantity, ...]:
        """Names of the curves in the order of `Curves.values`."""
        return (*self.first, *self.second, *self.rates, *self.vectors, *self.fourth)


class Curves:
    """The limited quantities as functions of z, the square of the rate of u, and its derivatives by u.

    Parameters
    ----------
    quantities : PathQuantities
        Quantities at the points.
    parameter : array of shape (5, point)
        s at the points, and its derivatives by u.
    """

    def __init__(self, quantities: PathQuantities, parameter: Array):
        self.quantities = quantities
        _, s1, s2, s3, s4 = (x[:, None] for x in parameter)
        q = quantities
        self.speed = np.abs(q.first) * s1
        m, c, d, g, m1, c1, d1, g1 = np.moveaxis(q.second, -1, 0)
        # F = half z' + square z + single sqrt(z) + constant
        self.value = np.stack([m * s1, m * s2 + c * s1**2, d * s1, g])
        # F' = sqrt(z) (half z'' + slope z' / 2 + square z + constant) + single_half z' / 2 + single z
        self.rate = np.stack(
            [
                m * s1,
                3 * m * s2 + (m1 + 2 * c) * s1**2,
                m * s3 + (m1 + 2 * c) * s1 * s2 + c1 * s1**3,
                g1 * s1,
                d * s1,
                d * s2 + d1 * s1**2,
            ]
        )
        m, c = np.moveaxis(q.vectors, -1, 0)
        s1, s2 = s1[..., None], s2[..., None]
        self.vector = np.stack([m * s1, m * s2 + c * s1**2])
        q1, q2, q3, q4 = np.moveaxis(q.fourth, -1, 0)
        s1, s2 = s1[..., 0], s2[..., 0]
        # derivatives by u of the limited coordinates: composition of the path with the parametrization
        self.fourth = np.stack(
            [
                q1 * s1,
                q1 * s2 + q2 * s1**2,
                q1 * s3 + 3 * q2 * s1 * s2 + q3 * s1**3,
                q1 * s4 + q2 * (4 * s1 * s3 + 3 * s2**2) + 6 * q3 * s1**2 * s2 + q4 * s1**4,
            ]
        )

    def values(self, law: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return values for z and its derivatives, (4, point): first, second, rates, magnitudes of vectors, fourth."""
        z, z1, z2, z3 = (x[:, None] for x in law)
        w = np.sqrt(z)
        half, square, linear, constant = self.value
        second = half * z1 / 2 + square * z + linear * w + constant
        top, slope, square, constant, single_half, linear = self.rate
        rates = w * (top * z2 / 2 + slope * z1 / 2 + square * z + constant) + single_half * z1 / 2 + linear * z
        half, square = self.vector
        vectors = np.linalg.norm(half * z1[..., None] / 2 + square * z[..., None], axis=-1)
        a, b, c, d = self.fourth
        inner = a * z2 / 2 + 1.5 * b * z1 + c * z
        fourth = z1 / 2 * inner + z * (a * z3 / 2 + 2 * b * z2 + 2.5 * c * z1 + d * z)
        return self.speed * w, second, rates, vectors, fourth

    def ratios(self, law: Array) -> Float[np.ndarray, "point curve"]:
        """Return the ratio of each quantity to its bound, 1 at the bound, with columns as in `Labels.every`."""
        q = self.quantities
        first, second, rates, vectors, fourth = self.values(law)
        sides = np.maximum(_over(second, q.upper), _over(-second, -q.lower))
        rate_sides = np.maximum(rates / q.rate_upper, rates / q.rate_lower)
        return np.concatenate(
            [
                first / q.first_bounds,
                sides,
                rate_sides,
                vectors / q.vector_bounds,
                np.abs(fourth) / q.fourth_bounds,
            ],
            axis=1,
        )

    def fourth_ratio(self, law: Array) -> float:
        """Return the largest ratio of a quantity of fourth order to its bound."""
        return float(np.max(np.abs(self.values(law)[-1]) / self.quantities.fourth_bounds, initial=0.0))

    @np.errstate(invalid="ignore")
    def rows(self, law: Array, eased: float = 1.0) -> tuple[Array, Array, Int[np.ndarray, " row"]]:
        """Return linear bounds on z and its derivatives that are exact at a time law and, if possible, conservative.

        A bound on a rate reads ``linear <= bound / sqrt(z)``. Its right side is convex, so that its tangent lies below
        it. Bounds without such a form are expanded to first order.

        Parameters
        ----------
        law : array of shape (4, point)
            z and its derivatives.
        eased : float, default 1
            Factor of the bounds of fourth order, while a search approaches them.

        Returns
        -------
        slopes : ndarray of shape (4, point, row)
            Coefficients of z, z', z'', z'''.
        right : ndarray of shape (point, row)
            Bound on the sum, about 1; infinite for no limit.
        curve : ndarray of shape (row,)
            Number of the curve in `Labels.every` of each row.
        """
        q = self.quantities
        z, z1, z2, _ = (x[:, None] for x in law)
        w = np.sqrt(z)
        zero = np.zeros_like(self.speed)
        blocks = [((self.speed / q.first_bounds) ** 2, zero, zero, zero, np.ones_like(zero))]
        half, square, linear, constant = self.value
        zeros = np.zeros_like(half)
        level = square + linear / (2 * w)
        for sign, bound in ((1, q.upper), (-1, -q.lower)):
            right = bound - sign * (constant + linear * w / 2)
            size = np.where(bound > 0, bound, 1.0)
            blocks.append((sign * level / size, sign * half / 2 / size, zeros, zeros, right / size))
        top, slope, square, constant, single_half, linear = self.rate
        # (single_half z' / 2 + single z) / sqrt(z), expanded
        mixed = (single_half * -z1 / (4 * w**3) + linear / (2 * w), single_half / (2 * w))
        remainder = single_half * z1 / (4 * w) + linear * w / 2
        for sign, bound in ((1, q.rate_upper), (-1, -q.rate_lower)):
            size = bound / w
            slopes = (sign * (square + mixed[0]) / size + 1 / (2 * z), sign * (slope / 2 + mixed[1]) / size)
            blocks.append((*slopes, sign * top / 2 / size, zeros, 1.5 - sign * (constant + remainder) / size))
        # outer + z' inner / (2 z) <= bound / z, with the second term on the left expanded
        a, b, c, d = self.fourth
        inner, ratio = a * z2 / 2 + 1.5 * b * z1 + c * z, z1 / (2 * z)
        mixed = (ratio * c - ratio * inner / z, inner / (2 * z) + ratio * 1.5 * b, ratio * a / 2)
        remainder = ratio * inner - sum(x * y for x, y in zip(mixed, (z, z1, z2), strict=True))
        size = eased * q.fourth_bounds / z
        for sign in (1, -1):
            slopes = (d + mixed[0], 2.5 * c + mixed[1], 2 * b + mixed[2], a / 2)
            slopes = (sign * slopes[0] / size + 1 / z, *(sign * x / size for x in slopes[1:]))
            blocks.append((*slopes, 2 - sign * remainder / size))
        slopes = np.stack([np.concatenate([block[k] for block in blocks], axis=1) for k in range(4)])
        right = np.concatenate([block[4] for block in blocks], axis=1)
        limits = (q.first_bounds, q.upper, q.lower, q.rate_upper, q.rate_lower, q.fourth_bounds, q.fourth_bounds)
        limited = np.isfinite(np.concatenate(limits, axis=1))
        slopes, right = np.where(limited, slopes, 0.0), np.where(limited, right, np.inf)
        counts = [x.shape[1] for x in (zero, half, top, q.vector_bounds, a)]
        starts = np.cumsum([0, *counts])
        order = (0, 1, 1, 2, 2, 4, 4)
        return slopes, right, np.concatenate([np.arange(counts[k]) + starts[k] for k in order])


def _over(values: Array, bounds: Array) -> Array:
    """Return the ratios of values to positive bounds; for other bounds, 1 plus the excess of the values."""
    safe = np.where(bounds > 0, bounds, 1.0)
    return np.where(bounds > 0, values / safe, values - bounds + 1.0)


@runtime_checkable
class Source(Protocol):
    """Function from values of s to the limited quantities of a path.

    Attributes
    ----------
    changes : array of shape (change,)
        Values of s at which quantities jump; at such a value they are those after the jump.
    """

    changes: Float[np.ndarray, " change"]

    def __call__(self, s: Float[np.ndarray, " point"]) -> PathQuantities:
        """Return the quantities at values of s."""
        ...

    def location(self, s: float) -> str:
        """Return a description of a place on the path for messages."""
        ...
