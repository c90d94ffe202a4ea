"""Motion over a kink of a force: the series of both sides meet at the instant at which their accelerations agree."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jounce.dynamics.forward.accelerations import State
from jounce.integrate.marching.divided_steps import Kinks
from jounce.integrate.steps.methods import evaluated

KINKED = 4  # coefficients of the motion at a kink, for derivatives up to the third


class Kinked(NamedTuple):
    """The motion at a kink, by the series before it.

    Attributes
    ----------
    series : State
        First coefficients in the time from the instant of the kink.
    late : array of shape (1,)
        Variation of that instant, s; its value is zero, and only its derivative counts.
    """

    series: State
    late: Any


def refined_kink_state(state: State, series: State, length: Any, kinked: Kinked, kink: Kinks) -> tuple[State, Any]:
    """Return refined values of the state behind a kink, and of the variation of the instant of the kink.

    The series through the state, continued back to the kink, meets the series from before the kink.

    Parameters
    ----------
    state, series : State
        State behind the kink, and the series through it.
    length : array of shape (1,)
        Time from the state to the kink, s.
    kinked : Kinked
        The motion before the kink.
    kink : Kinks
        The kink of this piece.
    """

    def rates(series: State, elapsed: Any) -> State:
        orders = jnp.arange(1.0, len(series.position))[:, None, None, None]
        return evaluated(series.map(lambda part: part[1:] * orders), elapsed)

    before, after = rates(kinked.series, kinked.late), rates(series, length + kinked.late)
    gap = jnp.sum(kink.velocity[..., None] * (before.velocity - after.velocity), axis=(0, 1))
    gap += jnp.sum(kink.spin[..., None] * (before.spin - after.spin), axis=(0, 1))
    delay = with_value(kinked.late - gap, 0.0)
    before, after = evaluated(kinked.series, delay), evaluated(series, length + delay)
    return jax.tree.map(lambda x, a, b: x + a - b, state, before, after), delay


def with_value(x: Any, value: Any) -> Any:
    """Return a value with the derivatives of another number."""
    return value + (x - jax.lax.stop_gradient(x))
