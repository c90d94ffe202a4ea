"""What a law is beyond its ends: nothing, the value there, or itself again, from where it began or ended."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp

from jounce.errors import MechanismError
from jounce.jet import Jet

SLACK = 1e-9  # of the duration: how far rounding may take an instant out of a law
CLOSED = 1e-9  # of the range of a law: so near to where it began it ends there


def check_within(first: float, last: float, start: float, stop: float, of: str) -> None:
    """Raise MechanismError if instants from a first to a last one are not all within a law that ends.

    Parameters
    ----------
    first, last : float
        Requested instants, s.
    start, stop : float
        The ends of the law.
    of : str
        What the law is given by, in the plural.
    """
    slack = SLACK * (stop - start)
    if first < start - slack or last > stop + slack:
        instant = last if last > stop + slack else first
        message = (
            f"the {of} go from {start:.9g} to {stop:.9g} s, and the law is not defined beyond them"
            "; stay within them, or choose beyond: hold, repeat or advance"
        )
        raise MechanismError(message, value=float(instant))


def continued(within: Callable[[Jet], Jet], time: Jet, start: Any, stop: Any, beyond: str, advance: Any) -> Jet:
    """Return the jet of a law that is given between two ends, also beyond them.

    Parameters
    ----------
    within : callable
        Maps a jet of time between the ends to that of the law.
    time : Jet
        s, or the coordinate that the law is of.
    start, stop : float or array
        The ends.
    beyond : {"refuse", "hold", "repeat", "continue"}
        NaN, rest at the value of the nearest end, the law again, or what `within` makes of it.
    advance : float or array
        What is added by each repetition.
    """
    if beyond == "continue":
        return within(time)
    instants, length = time.coefficients[0], stop - start
    if beyond == "repeat":
        periods = jnp.floor((instants - start) / length)
        return within(time - periods * length) + periods * jnp.asarray(advance)
    slack = SLACK * length
    outside = (instants < start - slack) | (instants > stop + slack)
    if beyond == "refuse":
        return within(time).dense().map(lambda c: jnp.where(outside, jnp.nan, c))
    held = [jnp.clip(instants, start, stop), *(jnp.zeros_like(instants),) * time.order]
    return within(Jet(jnp.where(outside, h, c) for h, c in zip(held, time.dense().coefficients, strict=True)))
