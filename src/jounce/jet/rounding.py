"""Coefficients of a series that rounding dominates, near a zero of its divisor."""

import jax.numpy as jnp
from jaxtyping import Bool, Float

from jounce.base.shapes import Numbers, Real
from jounce.jet.algebra import Jet
from jounce.jet.coefficients import with_rank

ROUNDING = 1e-15  # relative error of a coefficient
LARGEST_ERROR = 1e-2  # of a returned coefficient, relative to its natural size
COEFFICIENTS = 4  # used for growth rates, at any order
SMALLEST = 1e-13  # relative length of a line seen along itself, or sine of the angle of lines, that is rounding

Rates = Float[Numbers, "*batch"]


def sizes(jet: Jet, batch: int) -> list[Rates]:
    """Return the norms of the first coefficients of a jet with `batch` trailing axes after its components."""
    coefficients = jet.dense().coefficients[: COEFFICIENTS + 1]
    return [jnp.sqrt(jnp.sum(c * c, axis=0)) if jnp.ndim(c) > batch else jnp.abs(c) for c in coefficients]


def growth(coefficient_sizes: list[Rates], base: Real) -> Rates:
    """Return the growth rate of coefficients from order 1 on, relative to a size of order zero, 1/s."""
    rates = [jnp.power(size / base, 1.0 / k) for k, size in enumerate(coefficient_sizes, 1)]
    return jnp.max(jnp.stack(rates), axis=0) if rates else jnp.zeros_like(jnp.asarray(base))


def nan_where_rounding(
    result: Jet, nearness: Rates, rate: Rates, lost: int = 0, also: Bool[Numbers, "*batch"] | None = None
) -> Jet:
    """Return a series with NaN for coefficients that rounding dominates, as its divisor approaches zero.

    Parameters
    ----------
    result : Jet
        Series of shape (components, ...) or (...).
    nearness : array of shape (...)
        Nearness in time of the zero, 1/s: the growth rate of the divisor. Each coefficient has one more division by the
        divisor, and rounding errors grow as its powers.
    rate : array of shape (...)
        Growth rate of the motion, 1/s, which gives the natural size of the coefficients.
    lost : int, default 0
        Divisions, less one, before the first coefficient.
    also : array of bool, shape (...), optional
        Where the series is defined.
    """
    coefficients = []
    for k, c in enumerate(result.dense().coefficients):
        largest = (LARGEST_ERROR / ROUNDING) ** (1.0 / max(k + lost, 1))
        mask = nearness <= largest * rate  # false for a growth rate of NaN
        coefficients.append(jnp.where(with_rank(mask if also is None else mask & also, jnp.ndim(c)), c, jnp.nan))
    return Jet(coefficients)


def nan_where_rounding_in_plane(angle: Jet, projection: Jet, line: Jet, normal: Jet | None = None) -> Jet:
    """Return the angle of a line projected on a plane, NaN where the line is normal to it; vectors (components, ...).

    A moving plane has a unit normal, in the axes of the line; the projection then moves with both.
    """
    batch = jnp.ndim(angle.coefficients[0])
    flat, lengths = sizes(projection, batch), sizes(line, batch)
    rate = growth(lengths[1:], lengths[0])
    if normal is not None:
        rate = jnp.maximum(rate, growth(sizes(normal, batch)[1:], jnp.ones_like(rate)))
    return nan_where_rounding(angle, growth(flat[1:], flat[0]), rate, also=flat[0] > SMALLEST * lengths[0])


def rates_of(speed: Jet, scale: Rates, batch: int) -> tuple[Rates, Rates]:
    """Return, from the derivative of a quantity, how near in time it stands still, and its rate of motion, both 1/s.

    Parameters
    ----------
    speed : Jet
        Derivative of the quantity, of shape (...) or (components, ...), with `batch` axes "...".
    scale : array of shape (...)
        Size of the quantity itself; 1 rad for an angle.
    """
    speed_sizes = sizes(speed, batch)
    ratios = [size / k for k, size in enumerate(speed_sizes, 1)][:COEFFICIENTS]
    rate = growth([jnp.zeros_like(ratios[0]), *ratios[1:]], scale)
    later_ratios = [growth(ratios[k + 1 :], ratios[k]) for k in (1, 2) if len(ratios) > k + 1]
    if later_ratios:
        smallest = jnp.min(jnp.stack([jnp.where(jnp.isnan(x), 0.0, x) for x in later_ratios]), axis=0)
        rate = jnp.maximum(rate, jnp.where(jnp.isfinite(smallest), smallest, 0.0))
    return growth(speed_sizes[1:COEFFICIENTS], speed_sizes[0]), rate
