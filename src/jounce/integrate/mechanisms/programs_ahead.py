"""The programs of a run, made in another thread while its start is looked for."""

from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jounce.dynamics.forward.accelerations import Equations
from jounce.dynamics.forward.initial_state import at_rest, equations_of
from jounce.dynamics.masses import gravity_of, required_masses
from jounce.execution.background import prepare_later
from jounce.integrate.marching.marching import IntegratorState, march, room_for_steps, unexpanded
from jounce.integrate.marching.user_methods import integrator
from jounce.integrate.results.simulation import derivatives_of_motion, expansion_program
from jounce.integrate.steps.methods import AbstractMethod
from jounce.kinematics.results.output_programs import prepare_outputs
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.building.builder import released

STEPS = 64  # tried between two looks at progress and events


def march_arguments(
    equations: Equations, current: IntegratorState, stop: float, limits: tuple[float, float], method: AbstractMethod
) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Return the arguments of `march` for a run, and those by name; the limits are of an error and of a step."""
    return (equations, current, stop, *limits), {"method": integrator(method, equations, current), "count": STEPS}


def prepare_run(
    mechanism: Mechanism,
    model: Model,
    instants: Float[np.ndarray, " time"],
    order: int,
    method: AbstractMethod,
    limits: tuple[float, float],
) -> None:
    """Have the programs made of the steps of a run, and of the motion within them, if all they depend on is known.

    Parameters
    ----------
    mechanism : Mechanism
        What is to move.
    model : Model
        Of it, with initial conditions or without; the bodies need not be assembled.
    instants : array of shape (time,)
        At which the motion is requested, s.
    order : int
        Highest derivative of the outputs.
    method : AbstractMethod
        How steps are taken.
    limits : tuple of float
        Of the error of a step, and the longest one, s.
    """
    model = released(model) if any(name.startswith("initial.") for name in model.rows) else model
    if model.system.rank_is_open:
        return
    motion_order, length = derivatives_of_motion(mechanism, order), method.expansion_order(limits[0])
    masses, gravity = required_masses(mechanism, "the equations of motion"), gravity_of(mechanism)
    equations, first = equations_of(model, masses, gravity), instants[:1]
    current = partial(unexpanded, equations, at_rest(model, model.guess), first, order=length)

    def steps() -> None:
        arguments, named = march_arguments(equations, current(), instants[-1], limits, method)
        march.prepare(*arguments, **named)

    def motion() -> None:
        like = jax.eval_shape(partial(room_for_steps, method, count=1), current())[0]
        program, lanes = expansion_program(equations, model.system.outputs, like, motion_order)
        program.prepare(lanes, len(instants))

    form = model.system, length, motion_order, method
    prepare_later(steps, "march", *form)
    prepare_outputs(mechanism, model, motion_order)
    prepare_later(motion, "expanded", *form)
