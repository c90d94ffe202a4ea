"""Over a kink of a force: the series of the motion from both sides meet where their accelerations agree."""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jounce.dynamics.forward.accelerations import State
from jounce.integrate.marching.divided_steps import Kinks
from jounce.integrate.steps.methods import evaluated

KINKED = 4  # coefficients of a motion about a kink, for derivatives up to the third


class Kinked(NamedTuple):
    """The motion at a kink, by its series before.

    Attributes
    ----------
    series : State
        Its first coefficients in the time from the instant that the kink has.
    late : array of shape (1,)
        By how much that instant changes, s: it has no value.
    """

    series: State
    late: Any


def shifted(series: State, step: Any = 0.0) -> State:
    """Return the first coefficients of series about a time `step` away."""

    def part(c: Any) -> Any:
        padded = jnp.concatenate([c, jnp.zeros((KINKED, *c.shape[1:]))])
        shifted_breaks = []
        for level in range(KINKED):
            weights = np.array([math.comb(level + k, level) for k in range(len(c))], float)
            terms = padded[level : level + len(c)] * weights[:, None, None, None]
            shifted_breaks.append(evaluated(State(terms, terms, terms, terms), jnp.broadcast_to(step, (1,))).position)
        return jnp.stack(shifted_breaks)

    return series.map(part)


def refined_kink_state(state: State, series: State, length: Any, kinked: Kinked, over: Kinks) -> tuple[State, Any]:
    """Return the state behind a kink, and how much the instant of the kink changes, better than they are.

    The series through the state goes back to the kink and meets that from before there.

    Parameters
    ----------
    state, series : State
        Behind the kink.
    length : array of shape (1,)
        From there to the kink, s.
    kinked : Kinked
        The other side.
    over : Kinks
        Of this piece.
    """

    def rates(series: State, since: Any) -> State:
        orders = jnp.arange(1.0, len(series.position))[:, None, None, None]
        return evaluated(series.map(lambda part: part[1:] * orders), since)

    before, after = rates(kinked.series, kinked.late), rates(series, length + kinked.late)
    gap = jnp.sum(over.velocity[..., None] * (before.velocity - after.velocity), axis=(0, 1))
    gap += jnp.sum(over.spin[..., None] * (before.spin - after.spin), axis=(0, 1))
    late = with_value(kinked.late - gap, 0.0)
    here, there = evaluated(kinked.series, late), evaluated(series, length + late)
    return jax.tree.map(lambda x, a, b: x + a - b, state, here, there), late


def with_value(x: Any, value: Any) -> Any:
    """Return a value that changes as another number does."""
    return value + (x - jax.lax.stop_gradient(x))
