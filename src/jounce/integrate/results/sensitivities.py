"""Derivatives of a simulated motion with respect to traced values of a mechanism, by its recorded steps.

The lengths of the steps and all states are those of the simulation; the program here adds their derivatives. Steps are
divided where a derivative varies faster than the motion. As in the integrator, the motion is expanded at the beginning
of each step, the series is evaluated at its end, and the result is projected onto the constraints. The corrections of
the projection vanish up to rounding, so their matrices need no derivatives.

Over a kink of a force, the series of one side carries the state to the instant of the kink, and that of the other side
carries it on. The instant varies with the state: it is where the accelerations of both sides agree.
"""

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jounce.base.modules import with_fields
from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Instants, State
from jounce.dynamics.forward.initial_state import at_rest, initial_as_drivers
from jounce.dynamics.masses import gravity_of, masses_of
from jounce.errors import UnsupportedError
from jounce.execution.compilation import compiled
from jounce.integrate.marching.divided_steps import Pieces, divided_steps, series_through
from jounce.integrate.marching.force_discontinuities import KINKED, Kinked, refined_kink_state, with_value
from jounce.integrate.marching.smoothness_breaks import Break, breaks
from jounce.integrate.results.simulation import Simulation
from jounce.integrate.steps.events import pose_coordinates
from jounce.integrate.steps.host_calls import called, recorded
from jounce.integrate.steps.lookahead import watched_names
from jounce.integrate.steps.methods import Taylor, evaluated, expanded_about
from jounce.integrate.steps.options import instants_of
from jounce.integrate.steps.projection import normalized
from jounce.jet import Jet
from jounce.kinematics.position_analysis.solve import checked_order
from jounce.kinematics.sensitivity.sensitivities import (
    Solved,
    check_not_redundant,
    first_of,
    given_instants,
    solved_or_failed,
    solved_shapes,
)
from jounce.kinematics.sensitivity.traced_motion import TracedMotion
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.building.preconditions import check_holonomic
from jounce.mechanism.building.traced import Angles, angles_of, template, traced_model
from jounce.mechanism.outputs.base import lost_orders
from jounce.mechanism.transmissions.axis_angles import measures_angle

AT_REST = 1e-12  # m/s and rad/s
CONVERGED = 1e-13  # relative truncation error of the series of a derivative in a step
AS_GUESSED = 1e-9  # rad or sizes of the mechanism


def traced_simulation(simulate: Callable[..., Simulation], given: Mapping[str, Any]) -> Any:
    """Return the simulation of a mechanism with some values traced by JAX.

    Parameters
    ----------
    simulate : callable
        Function that simulates a mechanism of plain numbers.
    given : mapping
        Its arguments by name.

    Raises
    ------
    UnsupportedError
        For a method other than `Taylor`, for events, for forces that count revolutions of an angle about an axis, and
        for a force or a velocity that jumps.
    MechanismError
        If constraints are redundant.
    """
    mechanism, options = given["mechanism"], {k: v for k, v in given.items() if k not in ("mechanism", "initial")}
    if given.get("initial") is not None:
        mechanism = dataclasses.replace(mechanism, initial=dict(given["initial"]))
    if options.get("events") or not isinstance(options.get("method") or Taylor(), Taylor):
        raise UnsupportedError("a simulation is differentiated with jn.Taylor() and without events", name="mechanism")
    check_holonomic(mechanism, "the derivative of a simulation")
    if (recorded := _recorded(simulate, mechanism, options)) is None:
        return _called(simulate, mechanism, options)
    simulation, numeric = recorded
    check_not_redundant(simulation.model)
    if any(map(measures_angle, simulation.model.system.forces)):
        message = "a simulation is not differentiated where forces count the turns of an angle about an axis in space"
        raise UnsupportedError(message, name="forces")
    allowed = _allowed(options)
    kinks = [] if allowed is None else _kinks(simulation)
    model, equations = _model_of(mechanism, simulation)
    start = _start(mechanism, simulation, equations)
    order = simulation.poses[1]["position"].shape[0] - 1
    pieces = divided_steps(simulation.dense_output, equations, _model_of(numeric, simulation)[1], allowed, kinks)
    coordinates = _coordinates(simulation, equations, pieces, start, order)
    recorded_coordinates = {name: np.asarray(x) for name, x in simulation.poses[1].items()}
    coordinates = {name: with_value(x, recorded_coordinates[name]) for name, x in coordinates.items()}
    solved = _solved(simulation, coordinates)
    return TracedMotion(mechanism, (model, model), simulation.time, simulation.order, solved)


def _recorded(
    simulate: Callable[..., Simulation], mechanism: Mechanism, options: Mapping[str, Any]
) -> tuple[Simulation, Mechanism] | None:
    """Return the simulation at the values of the tracers, and its mechanism; None if the values are not known."""
    values, make_mechanism = template(mechanism)

    def simulated(values: tuple[Any, ...]) -> tuple[Simulation, Mechanism]:
        numeric = make_mechanism(values)
        return simulate(numeric, **options), numeric

    return recorded(simulated, _as_floats(values))


def _as_floats(values: list[Any]) -> tuple[Any, ...]:
    return tuple(jnp.asarray(value, float) for value in values)


def _called(simulate: Callable[..., Any], mechanism: Mechanism, options: Mapping[str, Any]) -> TracedMotion:
    """Return a simulation within `jax.jit` or `jax.vmap`, where the program calls it on the host for each mechanism."""
    order = checked_order(options.get("order", 4))
    instants = given_instants(mechanism, options.get("time"), instants_of)
    (values, make_mechanism), levels = template(mechanism), order + max(lost_orders(mechanism.outputs.values()), 1) + 1
    shapes = solved_shapes(mechanism, len(instants), levels)
    options = {**options, "time": instants, "strict": False}

    def solved_at(values: tuple[Any, ...]) -> Solved:
        motion = simulate(make_mechanism(values), **options)
        return motion.solved if motion.traced else _solved(motion, dict(motion.poses[1]))

    solved = called(partial(solved_or_failed, solved_at, shapes), shapes, _as_floats(values))
    model = traced_model(mechanism, solved.length, solved.angles, first_of(solved.coordinates))
    check_not_redundant(model)
    return TracedMotion(mechanism, (model, model), instants, order, solved)


def _solved(simulation: Simulation, coordinates: dict[str, Any]) -> Solved:
    """Return the solved values of a simulation, with given coordinates."""
    angles, status = _angles(simulation), simulation.status.astype(float)
    length = np.float64(simulation.model.length)
    return Solved(coordinates, status, length, angles, angles.angle[0], simulation.continued_outputs)


def _angles(simulation: Simulation) -> Angles:
    """Return the angles about axes that outputs measure, with their revolutions at the instants of the simulation."""
    outputs = simulation.model.system.outputs
    angles = angles_of(simulation.model, (simulation.model.system.forces, outputs))
    measured = [k for k, group in enumerate(outputs) if measures_angle(group)]
    revolutions = tuple(np.asarray(simulation.output_values(k)[0, 0]) for k in measured)
    return angles._replace(near=(angles.near[0], revolutions))


def _model_of(mechanism: Mechanism, simulation: Simulation) -> tuple[Model, Equations]:
    """Return the model and the equations of motion as functions of the traced values."""
    state = simulation.dense_output.polynomial.map(lambda part: np.asarray(part)[0, :1, ..., None])
    first, base = first_of(pose_coordinates(state)), simulation.equations
    model = traced_model(mechanism, simulation.model.length, _angles(simulation), first)
    system = with_fields(
        model.system, outputs=(), column_scale=base.system.column_scale, row_scale=np.asarray(base.system.row_scale)
    )
    masses, gravity = masses_of(mechanism), gravity_of(mechanism)
    return model, Equations(system, masses, gravity, base.scale, base.pose_type)


def _allowed(options: Mapping[str, Any]) -> float | None:
    """Return the allowed relative error of a derivative in a step, or None if steps have a given length."""
    if not (options.get("method") or Taylor()).controlled:
        return None
    return max(CONVERGED, 100.0 * float(options.get("tolerance") or 0.0))


def _kinks(simulation: Simulation) -> list[Break]:
    """Return the kinks of forces along a simulation, or raise UnsupportedError if a force or a velocity jumps."""
    dense, kinks = simulation.dense_output, breaks(simulation.dense_output, float(simulation.model.length))
    names = watched_names(simulation.model)
    for order, event in ((1, "has a kink, so that velocities jump"), (2, "jumps")):
        for jump in kinks:
            if jump.order == order:
                name, time = names[int(dense.kink[jump.step])], float(dense.start[jump.step] + jump.since)
                message = (
                    f"the law {event} at t = {time:.10g} s; how that instant moves is not known, so that a simulation "
                    "is not differentiated over it: give the law a steep passage, such as tanh(x/width)"
                )
                raise UnsupportedError(message, name=name)
    return kinks


def _start(mechanism: Mechanism, simulation: Simulation, equations: Equations) -> State:
    """Return the initial state, with derivatives by which joints, drivers and initial conditions remain satisfied."""
    state = simulation.dense_output.polynomial.map(lambda part: jnp.asarray(part)[0, 0, ..., None])
    instant = np.array([[simulation.dense_output.start[0]]])
    start_model = traced_model(initial_as_drivers(mechanism), simulation.model.length)
    scales = {"column_scale": equations.system.column_scale}
    initial = dataclasses.replace(equations, system=with_fields(start_model.system, outputs=(), forces=(), **scales))
    rows, columns = initial.system.shape
    if rows == columns:
        return _corrected(initial, _corrected(initial, state, instant), instant)  # twice, for second derivatives
    _check_guessed(mechanism, simulation, state)
    guess = traced_model(mechanism, simulation.model.length).guess
    position = guess["position"][:, 1:]
    attitude = guess["angle"][None, 1:] if "angle" in guess else guess["quaternion"][:, 1:]
    inverse = np.linalg.pinv(np.asarray(_jacobian(simulation.equations, state, instant)))
    return _assembled(equations, state, (position, attitude), inverse, instant)


@compiled(narrow=True)
def _jacobian(equations: Equations, state: State, instant: Instants) -> Float[Numbers, "row column"]:
    """Return the Jacobian at a state."""
    return equations.system.jacobian(equations.pose_at_rest(state.position, state.attitude), Jet([instant]))[..., 0]


@compiled(narrow=True)
def _assembled(
    equations: Equations, base: State, guess: tuple[Any, Any], inverse: Float[Numbers, "column row"], instant: Instants
) -> State:
    """Return a known state with derivatives by the positions and attitudes of the starting guess.

    As in the assembly, the state is the guess moved by the shortest step onto the constraints. `inverse` is the
    pseudoinverse of the Jacobian.
    """
    state = base._replace(position=guess[0], attitude=guess[1])
    state = _moved(equations, state, instant, lambda gap: -(inverse @ gap))
    factor = jax.lax.stop_gradient(equations).factored(base, instant)
    return equations.with_rates(factor, state, instant)


def _moved(equations: Equations, state: State, time: Instants, change: Callable[[Numbers], Numbers]) -> State:
    """Return a state with positions moved by changes of coordinates, a function of the residuals."""
    rest_pose = equations.pose_at_rest(state.position, state.attitude)
    gap = equations.system.residual(rest_pose, Jet([time])).coefficients[0]
    pose = rest_pose.displaced(*equations.system.coordinates(change(gap), rest_pose.shifts))
    return state._replace(position=pose.position.coefficients[0][:, 1:], attitude=equations.attitude_of(pose))


def _check_guessed(mechanism: Mechanism, simulation: Simulation, state: State) -> None:
    """Raise UnsupportedError unless an initial state that is not prescribed is the starting guess itself, at rest."""
    guess = at_rest(simulation.model, simulation.model.guess)
    distance = np.abs(guess.position - state.position).max() / simulation.model.length
    angle = np.abs(guess.attitude - state.attitude).max()
    speed = max(float(np.abs(np.asarray(part)).max()) for part in state[2:])
    if mechanism.initial or max(distance, angle) > AS_GUESSED or speed > AT_REST:
        raise UnsupportedError(
            "the start follows from the starting guess and from least velocities, and is differentiated only where "
            "the guess fulfills all joints and all is at rest; give an initial condition for each degree of freedom",
            name="initial",
        )


def _coordinates(
    simulation: Simulation, equations: Equations, pieces: Pieces, start: State, order: int
) -> dict[str, Any]:
    """Return the Taylor coefficients of the coordinates at the instants, after recorded steps from an initial state."""
    instants = simulation.time
    chosen = pieces.at(instants)
    elapsed = instants - pieces.start[chosen]
    return pose_coordinates(_marched(equations, start, pieces.padded(), chosen, elapsed, instants, order=order))


@compiled("order", narrow=True)
def _marched(
    equations: Equations,
    start: State,
    pieces: Pieces,
    chosen: Int[Numbers, " time"],
    elapsed: Float[Numbers, " time"],
    instants: Float[Numbers, " time"],
    *,
    order: int,
) -> State:
    """Return the series of the motion at instants, (order + 1, ..., time), after a march over recorded pieces.

    States at the beginnings of the pieces have the recorded values.
    """
    starts, lengths, known, used, kinks = pieces
    max_order = used.shape[1] - 1

    def series(state: State, used: Any, time: Any) -> State:
        return series_through(equations, state, time[None], max_order).map(
            lambda part: jnp.where(used[:, None, None], part, 0.0)
        )

    @jax.checkpoint
    def march(carry: Any, step: Any) -> tuple[Any, State]:
        state, kinked = carry
        time, length, recorded_state, used, kink = step
        time, length, state = time[None], length[None], jax.tree.map(with_value, state, recorded_state)
        expanded = series(state, used[:, None], time)
        arrived, end = evaluated(expanded, length), time + length
        if kink is not None:
            behind, delay = refined_kink_state(state, expanded, length, kinked, kink)
            new = Kinked(expanded_about(expanded, length, KINKED - 1), jnp.zeros_like(length))
            rewound = (behind, time, kinked._replace(late=delay))
            arrived, end, kinked = jax.tree.map(lambda a, b: jnp.where(kink.back, a, b), rewound, (arrived, end, new))
        return (_corrected(equations, arrived, end[None]), kinked), state

    none = None
    if kinks is not None:
        none = Kinked(expanded_about(start.map(lambda part: part[None]), jnp.zeros(1), KINKED - 1), jnp.zeros(1))
    path = starts, lengths, known.map(lambda part: part[..., None]), used, kinks
    _, states = jax.lax.scan(march, (start, none), path)
    chosen_states = states.map(lambda part: jnp.moveaxis(part[chosen, ..., 0], 0, -1))
    time = instants - elapsed

    @jax.checkpoint
    def arrive(state: State) -> State:
        arrived = evaluated(series(state, used[chosen].T, time), elapsed)
        return series_through(equations, _corrected(equations, arrived, instants[None]), instants[None], order)

    return arrive(chosen_states)


@compiled(narrow=True)
def _corrected(equations: Equations, state: State, time: Instants) -> State:
    """Return the state after one correction onto the constraints and their rates; see `projected`."""
    state = state._replace(attitude=normalized(state.attitude))
    constant, fixed = jax.lax.stop_gradient((equations, state))
    factor = constant.factored(fixed, time)
    state = _moved(equations, state, time, lambda gap: equations.least_change(factor, gap))
    return equations.with_rates(factor, state, time)
