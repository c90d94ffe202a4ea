"""The programs of a run, compiled in another thread while its initial state is computed."""

from functools import cache, partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jounce.dynamics.forward.accelerations import Equations
from jounce.dynamics.forward.initial_state import at_rest, equations_of
from jounce.dynamics.masses import gravity_of, required_masses
from jounce.execution.background import prepare_later
from jounce.execution.compilation import LARGE
from jounce.execution.threads import thread_count
from jounce.integrate.marching.marching import (
    IntegratorState,
    RunLimits,
    march,
    room_for_steps,
    steps_between_looks,
    unexpanded,
)
from jounce.integrate.marching.user_methods import integrator
from jounce.integrate.results.simulation import derivatives_of_motion, expanded
from jounce.integrate.steps.methods import AbstractMethod
from jounce.kinematics.results.output_programs import prepare_outputs
from jounce.mechanism import AbstractMotionOutput, Mechanism, Model


def march_settings(
    equations: Equations, current: IntegratorState, method: AbstractMethod, *, watched: bool
) -> dict[str, Any]:
    """Return the static arguments of `march` for a run that begins with a state."""
    count = steps_between_looks(sum(map(np.size, current.expansion.state)), watched=watched)
    return {"method": integrator(method, equations, current), "count": count}


def prepare_run(
    mechanism: Mechanism,
    model: Model,
    instants: Float[np.ndarray, " time"],
    order: int,
    method: AbstractMethod,
    limits: RunLimits,
    *,
    watched: bool,
) -> None:
    """Compile the programs of steps and of dense output in the background, if all they depend on is known.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    model : Model
        Its model, with or without initial conditions; the bodies need not be assembled.
    instants : array of shape (time,)
        Requested instants, s.
    order : int
        Highest derivative of the outputs.
    method : AbstractMethod
        Integration method.
    limits : RunLimits
        End of the run, and bounds of its steps.
    watched : bool
        Whether events are detected.
    """
    if (model.system.rank_is_open and not mechanism.initial) or thread_count() < 2:
        return
    motion_order, length = derivatives_of_motion(mechanism, order), method.expansion_order(float(limits.tolerance))

    @cache
    def free() -> Model:
        return model.released if any(name.startswith("initial.") for name in model.rows) else model

    @cache
    def initial_state() -> tuple[Equations, IntegratorState] | None:
        if free().system.rank_is_open:
            return None
        masses, gravity = required_masses(mechanism, "the equations of motion"), gravity_of(mechanism)
        equations = equations_of(free(), masses, gravity)
        return equations, unexpanded(equations, at_rest(free(), free().guess), instants[:1], order=length)

    def shape(part: Any, axes: int) -> jax.ShapeDtypeStruct:
        """Return the shape, for one instant, of a part of the steps."""
        return jax.ShapeDtypeStruct((*part.shape[1:axes], 1), float)

    def steps() -> None:
        if (beginning := initial_state()) is not None:
            march.prepare(*beginning, limits, **march_settings(*beginning, method, watched=watched))

    def motion() -> None:
        if (beginning := initial_state()) is not None:
            equations, current = beginning
            like = jax.eval_shape(partial(room_for_steps, method, count=1), current)[0]
            polynomial, instant = like.polynomial.map(lambda part: shape(part, 4)), jax.ShapeDtypeStruct((1,), float)
            lanes = tuple(shape(part, 2) for part in like.angles), polynomial, instant, instant
            expanded.program((equations, free().system.outputs), lanes, large=LARGE, order=motion_order)

    form = model.system, length, motion_order, method, watched
    prepare_later(steps, "march", *form)
    after = any(isinstance(output, AbstractMotionOutput) for output in mechanism.outputs.values())
    if after and not free().system.rank_is_open:
        prepare_outputs(mechanism, free(), motion_order)
    prepare_later(motion, "expanded", *form)
