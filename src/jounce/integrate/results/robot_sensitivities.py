"""Derivatives of a simulated robot motion with respect to inertias and the initial state, by its recorded steps.

The lengths of the steps and all values are those of the simulation; the program here adds their derivatives. A
derivative may vary faster than the motion, as beside an equilibrium, where the series of the motion is trivial. Steps
are therefore divided until the series of every derivative by the state converges on them.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.base.padding import padded
from jounce.base.shapes import is_traced
from jounce.errors import UnsupportedError
from jounce.execution.compilation import compiled
from jounce.integrate.marching.force_discontinuities import with_value
from jounce.integrate.marching.robot_marching import RobotProblem
from jounce.integrate.marching.robot_state import RobotState, at, polynomial_of, start_levels
from jounce.integrate.results.robot_simulation import RobotSimulation
from jounce.integrate.results.simulation import steps_of
from jounce.integrate.steps.host_calls import recorded
from jounce.jet.derivatives import plain_derivatives
from jounce.rigid.inertia import Inertia, TracedInertia
from jounce.robot.algorithms.forward_dynamics import coordinates_of
from jounce.robot.robot import Robot

ORDER = 24  # of the series of a step
CONVERGED = 1e-16  # of a derivative: largest last terms of its series
LAST = 4  # terms that are tested, since every other term may vanish
PARTS = 4096  # largest number of parts of a step
PADDED = 16  # multiple to which the number of steps is padded, so that similar motions share a program

P = ParamSpec("P")
R = TypeVar("R")


@dataclasses.dataclass(frozen=True, eq=False)
class TracedRobotMotion:
    """The motion of a simulated robot with inertias or an initial state traced by JAX.

    Attributes
    ----------
    robot : Robot
        The robot.
    time : numpy.ndarray of shape (time,)
        s.
    order : int
        Highest derivative.
    q : jax.Array of shape (time, order + 1, n)
        Coordinates and their derivatives, rad or m by s.
    simulation : RobotSimulation
        Simulation at the values of the tracers.
    """

    robot: Robot
    time: Float[np.ndarray, " time"]
    order: int
    q: Any
    simulation: RobotSimulation


def of_traced_robots(traced: Callable[..., Any]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that redirects calls with values of robots traced by JAX to another function.

    Parameters
    ----------
    traced : callable
        Function that receives the decorated function, the robot, and the further arguments.
    """

    def guarded(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def wrapper(*arguments: P.args, **keywords: P.kwargs) -> R:
            options = dict(keywords)
            robot, *positional = arguments or (options.pop("mechanism", None),)
            if isinstance(robot, Robot) and not robot.closures and is_traced((robot.tree, positional, options)):
                return traced(function, robot, *positional, **options)
            return function(*arguments, **keywords)

        return wrapper

    return guarded


def traced_robot_motion(
    simulate: Callable[..., Any], robot: Robot, *positional: Any, **options: Any
) -> TracedRobotMotion:
    """Return the motion of a robot as a differentiable function of its inertias and its initial state.

    Raises
    ------
    UnsupportedError
        For events, a free base, calls within `jax.jit` or `jax.vmap`, and forces that jump.
    """
    for name in ("events", "base"):
        if options.get(name):
            message = "a simulation of a robot is differentiated without events, and on a base that is fixed"
            raise UnsupportedError(message, name=name)
    simulation = _recorded(simulate, robot, positional, options)
    if simulation.steps.kink.any():
        instant = float(simulation.steps.start[int(np.argmax(simulation.steps.kink))])
        message = (
            f"a force jumps at t = {instant:.10g} s, and how that instant moves is not known, so that a simulation is "
            "not differentiated over it: let it pass steeply, such as tanh(v/v0)"
        )
        raise UnsupportedError(message, name="torque")
    numeric = simulation._problem
    problem = with_fields(numeric, equations=with_fields(numeric.equations, tree=robot.tree))
    start, length = _divided(numeric, simulation)
    first = jax.tree.map(lambda x: jnp.asarray(x)[0, 0, :, None], simulation.steps.polynomial)
    first = _traced_start(robot, problem, first, options.get("state"))
    instants = simulation.time
    _, indices = steps_of(simulation.steps._replace(start=start, length=length), instants)
    elapsed = instants - start[indices]
    levels = max(simulation.order - 2, 0)
    padding = -len(start) % PADDED  # steps of no length
    padded_steps = np.append(start, np.full(padding, start[-1] + length[-1])), np.append(length, np.zeros(padding))
    series = _marched(problem, first, *padded_steps, indices, elapsed, instants, levels=levels)
    derivatives = jnp.moveaxis(plain_derivatives(series), -1, 0)[:, : simulation.order + 1]
    return TracedRobotMotion(robot, instants, simulation.order, with_value(derivatives, simulation.q), simulation)


def _traced_start(robot: Robot, problem: RobotProblem, first: RobotState, state: Any) -> RobotState:
    """Return the initial state with its tracers; driven joints follow their laws."""
    if not is_traced(state):
        return first
    q, rates = start_levels(robot, state)[..., None]
    is_driven = jnp.asarray(problem.equations.driven)[:, None] > 0
    coordinates, velocities = (jnp.where(is_driven, a, b) for a, b in ((first.coordinates, q), (first.rates, rates)))
    return first._replace(coordinates=coordinates, rates=velocities)


def _recorded(
    simulate: Callable[..., Any], robot: Robot, positional: tuple[Any, ...], options: dict[str, Any]
) -> RobotSimulation:
    """Return the simulation at the values of the tracers."""
    names = [name for name, link in robot.links.items() if isinstance(link.inertia, TracedInertia)]

    def simulated(values: tuple[Any, Any]) -> RobotSimulation:
        links, settings = dict(robot.links), options
        if isinstance(state := values[1], Mapping):
            settings = {**options, "state": {name: float(x) for name, x in state.items()}}
        elif state is not None:
            settings = {**options, "state": jax.tree.map(np.asarray, state)}
        for name, (mass, center, tensor) in zip(names, values[0], strict=True):
            inertia = Inertia(float(mass), np.asarray(center), np.asarray(tensor), strict=robot.strict)
            links[name] = dataclasses.replace(links[name], inertia=inertia)
        return simulate(robot.changed(links=list(links.values())), *positional, **settings)

    inertias = [robot.links[name].inertia for name in names]
    numbers = [(x.mass, x.center_of_mass, x.tensor) for x in inertias if x is not None]
    if (simulation := recorded(simulated, (numbers, options.get("state")))) is None:
        message = "a simulation of a robot decides by values: differentiate it outside of jax.jit and jax.vmap"
        raise UnsupportedError(message, name=robot.name)
    return simulation


def _divided(problem: RobotProblem, simulation: RobotSimulation) -> tuple[np.ndarray, np.ndarray]:
    """Return the starts and lengths of the steps of a simulation, divided so that derivatives converge."""
    steps = simulation.steps
    states = jax.tree.map(lambda c: np.moveaxis(np.asarray(c)[:, 0], 0, -1), steps.polynomial)
    count = len(steps.start)
    padded_states, start = jax.tree.map(lambda x: padded(x, -(-count // PADDED) * PADDED), (states, steps.start))
    growth = np.asarray(_growth(problem, padded_states, start))[:, :count]
    orders = np.arange(ORDER + 2 - LAST, ORDER + 2)
    with np.errstate(divide="ignore"):
        reach = ((CONVERGED / growth[-LAST:]) ** (1 / orders[:, None])).min(axis=0)
    parts = np.ceil(np.abs(steps.length) / reach).clip(1, None)
    if not np.isfinite(parts).all() or parts.max(initial=0) > PARTS:
        message = "changes of the motion grow too fast beside it to be followed; look at a shorter time"
        raise UnsupportedError(message, name="time")
    counts = parts.astype(int)
    fractions = np.concatenate([np.arange(n) / n for n in counts])
    start, length = np.repeat(steps.start, counts), np.repeat(steps.length, counts)
    return start + fractions * length, length / np.repeat(counts, counts)


@compiled(narrow=True)
def _growth(problem: RobotProblem, states: RobotState, time: Any) -> Any:
    """Return the largest terms of the series of derivatives by the state, (order, step)."""

    def coefficients(q: Any, rates: Any) -> Any:
        state = states._replace(coordinates=q, rates=rates)
        return polynomial_of(problem.series(state, time[None], ORDER)).coordinates

    def of(direction: Any) -> Any:
        given = (states.coordinates, states.rates)
        tangents = tuple(jnp.broadcast_to(x[:, None], states.rates.shape) for x in jnp.split(direction, 2))
        return jnp.max(jnp.abs(jax.jvp(coefficients, given, tangents)[1]), axis=1)

    return jnp.max(jax.lax.map(of, jnp.eye(2 * states.rates.shape[0])), axis=0)


@compiled("levels", narrow=True)
def _marched(
    problem: RobotProblem,
    first: RobotState,
    start: Any,
    length: Any,
    indices: Any,
    elapsed: Any,
    instants: Any,
    *,
    levels: int,
) -> Any:
    """Return the Taylor coefficients of the coordinates at instants, after recorded steps from an initial state."""

    def series(state: RobotState, time: Any) -> RobotState:
        return polynomial_of(problem.series(state, time[None], ORDER, reversible=True))

    def step(state: RobotState, given: Any) -> tuple[RobotState, RobotState]:
        time, duration = given
        return at(series(state, time[None]), duration[None]), state

    _, states = jax.lax.scan(step, first, (start, length))
    step_states = jax.tree.map(lambda x: jnp.moveaxis(x[indices, :, 0], 0, -1), states)
    end_states = at(series(step_states, start[indices]), elapsed)
    expanded = problem.series(end_states, instants[None], levels, reversible=True)
    return coordinates_of(expanded, levels)
