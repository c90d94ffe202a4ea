"""Whole turns of angles: removed, chosen nearest to an expected angle, or counted along a sequence."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Real
from jounce.jet.algebra import Jet, Quantity

WHOLE_TURN = 2 * math.pi


def whole_periods(value: Real, period: Real = WHOLE_TURN) -> Any:
    """Return the whole number of periods (turns by default) nearest to a value, in the unit of the value."""
    count: Any = value / period
    return period * (nearest_whole if isinstance(count, jax.Array) else np.round)(count)


def _nearest_whole(count: Any) -> Any:
    """Return `jnp.round`, under a name by which program readers recognize turns among other rounding."""
    return jax.lax.round(count, jax.lax.RoundingMethod.TO_NEAREST_EVEN)


ROUNDING_OF_TURNS = _nearest_whole.__name__
nearest_whole = jax.jit(_nearest_whole)


def wrap(x: Quantity, period: Real = WHOLE_TURN) -> Any:
    """Shift by whole periods into ``[-period/2, period/2]``: the remainder of an angle, or of a screw's advance."""
    return x - whole_periods(x.coefficients[0] if isinstance(x, Jet) else x, period)


def shifted_by_turns(angle: Quantity, expected: Real) -> Any:
    """Return an angle shifted by the whole turns that bring it nearest to an expected one."""
    return angle - whole_periods((angle.coefficients[0] if isinstance(angle, Jet) else angle) - expected)


def principal(angle: Real) -> Any:
    """Return an angle shifted by whole turns to (-pi, pi]; half a turn is pi, up to rounding."""
    namespace = jnp if isinstance(angle, jax.Array) else np
    return angle - WHOLE_TURN * namespace.ceil((angle - np.pi) / WHOLE_TURN - 1e-9)


def counted_on(
    angles: Float[np.ndarray, "*batch place"], rises: Float[np.ndarray, "*batch step"] | float = 0.0
) -> Float[np.ndarray, "*batch place"]:
    """Return a sequence of angles, known modulo whole turns, made continuous from the first on.

    Parameters
    ----------
    angles : array of shape (..., places)
        Angles, rad.
    rises : array of shape (..., places - 1), optional
        Expected increase of each angle from the one before, to within half a turn; zero by default.
    """
    turns = np.cumsum(whole_periods(np.diff(angles, axis=-1) - rises), axis=-1)
    return np.concatenate([angles[..., :1], angles[..., 1:] - turns], axis=-1)


def counted_by_rates(
    angles: Float[np.ndarray, "*batch time"], rates: Float[np.ndarray, "*batch time"], time: Float[np.ndarray, " time"]
) -> Float[np.ndarray, "*batch time"]:
    """Return a sequence of angles, known modulo whole turns, made continuous by their rates, rad/s."""
    return counted_on(angles, 0.5 * np.diff(time) * (rates[..., 1:] + rates[..., :-1]))
