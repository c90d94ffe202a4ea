"""Where rounding decides a series: near a zero of what it is divided by."""

import jax.numpy as jnp
from jaxtyping import Bool, Float

from jounce.base.shapes import Numbers, Real
from jounce.jet.algebra import Jet
from jounce.jet.coefficients import with_rank

ROUNDING = 1e-15  # of a coefficient, relative
LARGEST_ERROR = 1e-2  # of a coefficient that is returned, in its natural size
COEFFICIENTS = 4  # coefficients: the same, whatever the order
SMALLEST = 1e-13  # part of a line that is seen along it, or sine between lines, but for rounding

Rates = Float[Numbers, "*batch"]


def sizes(jet: Jet, batch: int) -> list[Rates]:
    """Return the sizes of the first coefficients of a jet that has `batch` trailing axes besides its components."""
    whole = jet.dense().coefficients[: COEFFICIENTS + 1]
    return [jnp.sqrt(jnp.sum(c * c, axis=0)) if jnp.ndim(c) > batch else jnp.abs(c) for c in whole]


def growth(coefficient_sizes: list[Rates], of: Real) -> Rates:
    """Return by which factor per unit of time coefficients from the first on grow, beside a size of order zero, 1/s."""
    rates = [jnp.power(size / of, 1.0 / k) for k, size in enumerate(coefficient_sizes, 1)]
    return jnp.max(jnp.stack(rates), axis=0) if rates else jnp.zeros_like(jnp.asarray(of))


def nan_where_rounding(
    result: Jet, nearness: Rates, rate: Rates, lost: int = 0, also: Bool[Numbers, "*batch"] | None = None
) -> Jet:
    """Return a series with NaN for those coefficients that are rounding, as what it is divided by nears zero.

    Parameters
    ----------
    result : Jet
        Of shape (components, ...) or (...).
    nearness : array of shape (...)
        How near the zero is, in time, 1/s: the growth of the divisor. Each coefficient is divided once more by the
        divisor, and rounding errors grow as its powers.
    rate : array of shape (...)
        The growth of what moves, 1/s: the natural size of the coefficients.
    lost : int, default 0
        Divisions before the first coefficient, but one.
    also : array of bool, shape (...), optional
        Where the series is defined at all.
    """
    coefficients = []
    for k, c in enumerate(result.dense().coefficients):
        largest = (LARGEST_ERROR / ROUNDING) ** (1.0 / max(k + lost, 1))
        known = nearness <= largest * rate  # false where a growth is no number
        coefficients.append(jnp.where(with_rank(known if also is None else known & also, jnp.ndim(c)), c, jnp.nan))
    return Jet(coefficients)


def nan_where_rounding_in_plane(angle: Jet, seen: Jet, line: Jet, normal: Jet | None = None) -> Jet:
    """Return the angle of a line, seen in a plane, NaN where it is seen along itself; vectors (components, ...).

    A plane that moves has a normal, in the axes of the line, unit length: what is seen moves as either does.
    """
    batch = jnp.ndim(angle.coefficients[0])
    flat, whole = sizes(seen, batch), sizes(line, batch)
    rate = growth(whole[1:], whole[0])
    if normal is not None:
        rate = jnp.maximum(rate, growth(sizes(normal, batch)[1:], jnp.ones_like(rate)))
    return nan_where_rounding(angle, growth(flat[1:], flat[0]), rate, also=flat[0] > SMALLEST * whole[0])


def rates_of(speed: Jet, scale: Rates, batch: int) -> tuple[Rates, Rates]:
    """Return how near in time a quantity stands still, and the rate of its motion, both 1/s, from its derivative.

    Parameters
    ----------
    speed : Jet
        The derivative, of shape (...) or (components, ...) with `batch` axes "...".
    scale : array of shape (...)
        The size of the quantity itself: an angle has 1 rad.
    """
    speed_sizes = sizes(speed, batch)
    own = [size / k for k, size in enumerate(speed_sizes, 1)][:COEFFICIENTS]
    rate = growth([jnp.zeros_like(own[0]), *own[1:]], scale)
    later = [growth(own[k + 1 :], own[k]) for k in (1, 2) if len(own) > k + 1]
    if later:
        least = jnp.min(jnp.stack([jnp.where(jnp.isnan(x), 0.0, x) for x in later]), axis=0)
        rate = jnp.maximum(rate, jnp.where(jnp.isfinite(least), least, 0.0))
    return growth(speed_sizes[1:COEFFICIENTS], speed_sizes[0]), rate
