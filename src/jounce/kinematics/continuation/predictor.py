"""Allowed departures of motions and laws from their Taylor predictions, and features of laws between two instants."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.shapes import Numbers
from jounce.jet import Jet
from jounce.jet.algebra import total
from jounce.kinematics.status import Status
from jounce.mechanism.system import System

Lanes = Float[Numbers, " batch"]

LARGEST_DEPARTURE = 0.05  # from a prediction, rad or sizes of the mechanism; beyond it, a motion law jumps
SMALLEST_DEPARTURE = 1e-6  # predictions with smaller departures are always accepted
PROBES = 32  # instants within a step at which laws are checked,
FINEST = 1e-9  # unless the step is shorter than this part of the time


def near_prediction(departure: Float[Numbers, "*batch"], travel: Float[Numbers, "*batch"]) -> Bool[Numbers, "*batch"]:
    """Return whether the departure from a prediction is small relative to the predicted travel."""
    return departure <= jnp.minimum(LARGEST_DEPARTURE, jnp.maximum(0.2 * travel, SMALLEST_DEPARTURE))


def travel_of(terms: Sequence[Numbers], step: Numbers) -> Any:
    """Return an upper bound of the travel over a step, from the sizes of Taylor terms of order 1 and higher."""
    return total(term * jnp.abs(step) ** k for k, term in enumerate(terms, 1))


def laws_predictable(system: System, instant: Lanes, step: Lanes, order: int) -> Bool[Numbers, " batch"]:
    """Return whether laws that may skip whole turns keep to their own Taylor series over the step."""
    start, end = Jet.variable((instant - step)[None], order), Jet([instant[None]])
    result = np.ones(step.shape, bool)
    for before, after in zip(system.laws(start, periodic=True), system.laws(end, periodic=True), strict=True):
        departure = jnp.abs(after.coefficients[0] - before.evaluate(step[None]))
        travel = travel_of([jnp.abs(c) for c in before.dense().coefficients[1:]], step[None])
        result &= jnp.all(near_prediction(departure, travel), axis=0)
    return result


def hidden_by_laws(system: System, status: Numbers, instant: Lanes, step: Lanes, order: int) -> Numbers:
    """Return the status of instants: BRANCH_JUMP where a law leaves its Taylor series within the step.

    The series of a motion that begins with a dwell, or as smoothly as ``t**6``, is zero. If the motion returns to its
    start within the step, only these probes notice it.
    """
    start, fractions = instant - step, (np.arange(PROBES) + 0.5) / PROBES
    is_near = np.ones(step.shape, bool)
    size = SMALLEST_DEPARTURE * jnp.minimum(system.column_scale[0], 1.0)
    offsets = fractions[:, None, None] * step[None, None]

    def values(fraction: Any) -> list[Any]:
        return [law.coefficients[0] for law in system.laws(Jet([(start + fraction * step)[None]]))]

    for before, value in zip(system.laws(Jet.variable(start[None], order)), jax.vmap(values)(fractions), strict=True):
        terms = [jnp.where(jnp.isfinite(c), c, 0.0)[None] for c in before.dense().coefficients]
        departure = jnp.abs(value - Jet(tuple(terms)).evaluate(offsets))
        allowed = jnp.maximum(0.2 * travel_of([jnp.abs(c) for c in terms[1:]], offsets), size)
        is_near &= jnp.all(departure <= allowed, axis=(0, 1))
    hidden = ~is_near & (step > FINEST * jnp.abs(instant))  # instants closer than that differ by rounding only
    return jnp.where((status == int(Status.OK)) & hidden, int(Status.BRANCH_JUMP), status)
