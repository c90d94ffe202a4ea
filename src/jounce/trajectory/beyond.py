"""Laws beyond their ends: refused, held at the value of the end, repeated, or advanced by each repetition."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient

from jounce.errors import MechanismError
from jounce.jet import Jet

SLACK = 1e-9  # fraction of the duration, by which rounding may move an instant out of a law
ROUNDING = 4 * float(np.finfo(float).eps)  # relative, by which an instant may lie before the piece that begins there
CLOSED = 1e-9  # fraction of the range of a law, within which it ends at its initial value


def check_within(first: float, last: float, start: float, stop: float, subject: str) -> None:
    """Raise MechanismError if instants from `first` to `last` are not all within a law with ends.

    Parameters
    ----------
    first, last : float
        First and last requested instant, s.
    start, stop : float
        Ends of the law.
    subject : str
        What determines the law, in the plural, for the message.
    """
    slack = SLACK * (stop - start)
    if first < start - slack or last > stop + slack:
        instant = last if last > stop + slack else first
        message = (
            f"the {subject} go from {start:.9g} to {stop:.9g} s, and the law is not defined beyond them"
            "; stay within them, or choose beyond: hold, repeat or advance"
        )
        raise MechanismError(message, value=float(instant))


def continued(within: Callable[[Jet, Any], Jet], time: Jet, start: Any, stop: Any, beyond: str, advance: Any) -> Jet:
    """Return the jet of a law that is given between two ends, continued beyond them.

    Instants that only rounding puts before the piece that begins there belong to this piece.

    Parameters
    ----------
    within : callable
        Maps a jet of time between the ends, and the instants that choose the pieces, to the jet of the law.
    time : Jet
        Time, s, or the coordinate on which the law depends.
    start, stop : float or array
        Ends of the law.
    beyond : {"refuse", "hold", "repeat", "continue"}
        NaN, the value of the nearest end at rest, repetition, or the extrapolation by `within`.
    advance : float or array
        Gain of each repetition.
    """
    instants = time.coefficients[0]
    choosing = instants + ROUNDING * jnp.abs(instants)
    if beyond == "continue":
        return within(time, choosing)
    length = stop - start
    if beyond == "repeat":
        periods = jnp.floor((choosing - start) / length)
        local = time - periods * length
        in_period = Jet((not_before(start, local.coefficients[0]), *local.coefficients[1:]))
        return within(in_period, choosing - periods * length) + periods * jnp.asarray(advance)
    slack = SLACK * length
    is_outside = (instants < start - slack) | (instants > stop + slack)
    if beyond == "refuse":
        return within(time, choosing).dense().map(lambda c: jnp.where(is_outside, jnp.nan, c))
    clipped = [jnp.clip(instants, start, stop), *(jnp.zeros_like(instants),) * time.order]
    inner = Jet(jnp.where(is_outside, h, c) for h, c in zip(clipped, time.dense().coefficients, strict=True))
    return within(inner, choosing)


def not_before(start: Any, instants: Any) -> Any:
    """Return instants of a piece that begins at `start`, without those that rounding puts before it."""
    return instants + stop_gradient(jnp.maximum(start - instants, 0.0))
