"""The initial state of a simulation: consistent positions and velocities from partial ones, and the mobility."""

import dataclasses
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.modules import unchecked, with_fields
from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Instants, State
from jounce.dynamics.forward.saddle_fronts import SaddleFronts
from jounce.dynamics.forward.saddle_point import even_scale
from jounce.dynamics.friction.coupling import check_unique_pressing
from jounce.dynamics.masses import Gravity, Masses, gravity_of, stored_masses
from jounce.errors import AssemblyError, MechanismError, MobilityError
from jounce.execution.compilation import compiled
from jounce.execution.device import resident
from jounce.jet import Jet
from jounce.kinematics.assembly.assemble import SETTLED, assemble, freely_moving
from jounce.kinematics.continuation.correct_and_differentiate import LARGEST_CONTRADICTION
from jounce.kinematics.curves.choice import chosen
from jounce.kinematics.status import Status
from jounce.linear_algebra.host_jacobian import RANK_TOLERANCE, HostJacobian, is_clearly_regular
from jounce.mechanism import Mechanism, Model, build
from jounce.mechanism.building.builder import with_reference

TOLERANCE = 1e-12  # tolerance of the assembled positions, rad or sizes of the mechanism
ROUNDING = 1e-15  # of residuals, rad or sizes of the mechanism
LARGEST_CHANGE = 1e-2  # relative change of velocities within the uncertainty of the position by rounding


@dataclasses.dataclass(frozen=True)
class ConsistentStart:
    """A mechanism with a consistent initial state.

    Attributes
    ----------
    model : Model
        The numeric model, with scaled rows.
    equations : Equations
        Equations of motion.
    state : State
        Positions and velocities that satisfy joints, drivers and initial conditions; a batch of one.
    jacobian : HostJacobian
        Jacobian of the constraints at the state.
    sound : array of bool, shape (forces,)
        Whether each applied force is finite at the state.
    """

    model: Model
    equations: Equations
    state: State
    jacobian: HostJacobian
    sound: Bool[np.ndarray, " force"]

    @cached_property
    def mobility(self) -> str:
        """Degrees of freedom and the bodies that have them, in words."""
        freedom = self.jacobian.shape[1] - self.jacobian.rank
        if not freedom:
            return "no degree of freedom: all motion is prescribed"
        noun = "degree of freedom" if freedom == 1 else "degrees of freedom"
        return f"{freedom} {noun}: {freely_moving(self.model, self.jacobian.free_directions)}"


def consistent_start(
    mechanism: Mechanism, instant: float, built: Callable[[Model], None] | None = None
) -> ConsistentStart:
    """Return a consistent state at an instant, from the starting guess and the initial conditions.

    Initial conditions are drivers: each fixes one coordinate and its rate at the instant by its law. Where these leave
    freedom, positions are nearest to the guess of the bodies, and velocities have the least kinetic energy.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism whose bodies have masses; joints and drivers may leave degrees of freedom.
    instant : float
        s.
    built : callable, optional
        Called with the model before assembly, with the initial conditions among its drivers.

    Raises
    ------
    MechanismError
        If a value is not valid, no body has a mass, a movable body has none, or a free motion would have negative
        kinetic energy.
    AssemblyError
        If joints, drivers and initial conditions cannot all be satisfied, or the rates of redundant ones contradict.
    MobilityError
        If the start is a singular position, or one at which rounding would decide the rates.
    """
    mechanism = chosen(mechanism, instant)
    model, gravity, state, assembled = build(mechanism, initial=True), gravity_of(mechanism), None, None
    masses = stored_masses(model, mechanism, "the equations of motion")
    is_exact = True  # whether the state satisfies the rates of the rows that remain without the initial conditions
    if built is not None:
        built(model)
    if mechanism.initial:
        full_model, coordinates = _assembled(model, instant)
        model = model.released
        full_equations = equations_of(full_model, masses, gravity)
        state = _set_in_motion(full_equations, full_model, coordinates, instant)
        if full_model.system.rank is not None:  # redundant rows may contradict each other by less than is refused
            _check_rates(full_model, state, _facts(full_equations, state, instant).rates, instant)
            is_exact = False
        system = with_fields(model.system, forces=full_model.system.forces, outputs=full_model.system.outputs)
        model = dataclasses.replace(
            model, guess=coordinates, system=system, prescribed=full_model.prescribed, history=full_model.history
        )
        assembled = _without_initial_conditions(model, full_model, instant)
    model, coordinates = assembled or assemble(model, instant, TOLERANCE, free=True)
    equations = resident(equations_of(model, masses, gravity))
    if state is None:
        state = _set_in_motion(equations, model, coordinates, instant)
    elif not is_exact:
        state = jax.tree.map(np.asarray, with_rates(equations, state, np.array([[instant]])))
    facts = _facts(equations, state, instant)
    jacobian = _checked_jacobian(equations, model, facts, instant)
    if model.system.rank is not None:
        _check_rates(model, state, facts.rates, instant)
    return ConsistentStart(model, equations, state, jacobian, facts.sound[:, 0])


def equations_of(model: Model, masses: Masses, gravity: Gravity) -> Equations:
    """Return the equations of motion of a mechanism."""
    check_unique_pressing(model, model.system)
    system = with_fields(model.system, outputs=())
    values = {
        "system": system,
        "masses": masses,
        "gravity": gravity,
        "scale": masses.scale(model.length),
        "pose_type": model.pose_type,
        "saddle": SaddleFronts.of(system.pattern),
    }
    return unchecked(Equations, values)


def _assembled(model: Model, instant: float) -> tuple[Model, dict[str, np.ndarray]]:
    """Return the model with initial conditions, assembled."""
    try:
        return assemble(model, instant, TOLERANCE, free=True)
    except AssemblyError as error:
        message = f"{error.message}; joints, drivers and initial conditions contradict each other there"
        raise AssemblyError(message, status=error.status) from None
    except MobilityError as error:
        message = f"joints, drivers and initial conditions together: {error.message}"
        raise MobilityError(message, status=error.status) from None


def _without_initial_conditions(
    model: Model, full_model: Model, instant: float
) -> tuple[Model, dict[str, np.ndarray]] | None:
    """Return the model without initial conditions, with the assembled coordinates, as `assemble` does.

    The assembled coordinates satisfy the remaining rows, which are independent if all rows were. None if the model
    needs an assembly of its own: its length or rows differ, or rows are redundant.
    """
    remaining = [k for k, name in enumerate(full_model.rows) if not name.startswith("initial.")]
    is_same_shape = model.length == full_model.length and model.rows == tuple(full_model.rows[k] for k in remaining)
    if not remaining or not is_same_shape or full_model.system.rank is not None:
        return None
    model, deviation = with_reference(model, model.guess, instant, model.prescribed)
    system = resident(with_fields(model.system, row_scale=np.asarray(full_model.system.row_scale)[remaining]))
    return (dataclasses.replace(model, system=system), model.guess) if deviation <= SETTLED else None


def initial_as_drivers(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with its initial conditions as drivers."""
    return dataclasses.replace(mechanism, drivers={**mechanism.drivers, **mechanism.initial}, initial={})


def at_rest(model: Model, coordinates: dict[str, np.ndarray]) -> State:
    """Return the state of bodies at rest in an assembled pose."""
    position = np.asarray(coordinates["position"])[:, 1:]
    if model.pose_type.turns == 1:
        attitude = np.asarray(coordinates["angle"])[None, 1:]
    else:
        quaternion = np.asarray(coordinates["quaternion"])[:, 1:]
        attitude = quaternion / np.sqrt((quaternion**2).sum(axis=0))[None]
    spin = np.zeros((model.pose_type.turns, *position.shape[1:]))
    return State(position, attitude, np.zeros_like(position), spin)


@compiled(narrow=True, brief=True)
def with_rates(equations: Equations, state: State, time: Instants) -> State:
    """Return the state with the least change of its velocities that satisfies the rates of all constraints."""
    return _moving(equations, state, time)


@compiled(narrow=True, brief=True)
def _with_row_rates(equations: Equations, state: State, time: Instants) -> tuple[State, Any, Any]:
    """Return the state with consistent velocities, the rates of the rows at rest, and the rate of the attitude."""
    moving_state = _moving(equations, state, time)
    return moving_state, _row_rates(equations, state, time), equations.attitude_rate(moving_state)


class _Facts(NamedTuple):
    """The values that decide whether a mechanism can start from a state; NumPy arrays once computed."""

    matrix: Float[Any, "size size"]  # of the equations of motion
    entries: Float[Any, " entry"]  # of the Jacobian
    rates: Float[Any, "row 1"]  # of all rows
    sound: Bool[Any, "force 1"]  # which applied forces are finite


@compiled(narrow=True, brief=True)
def _computed_facts(equations: Equations, state: State, time: Instants) -> _Facts:
    """Return the facts by a program of their own: as part of the velocities' program they would change last digits."""
    pose = equations.pose_at_rest(state.position, state.attitude)
    matrix, entries = equations.matrix(state, time)[..., 0], equations.system.entries(pose, Jet([time]))[..., 0]
    sound = equations.system.finite_forces(equations.pose(state), Jet.variable(time, 1))
    return _Facts(matrix, entries, _row_rates(equations, state, time), sound)


def _facts(equations: Equations, state: State, instant: float) -> _Facts:
    return jax.tree.map(np.asarray, _computed_facts(equations, state, np.array([[instant]])))


def _moving(equations: Equations, state: State, time: Instants) -> State:
    """Return a state with velocities, corrected once, as masses that gears weight very differently cost digits."""
    factor = equations.factored(state, time)
    return jax.lax.fori_loop(0, 2, lambda _, moving_state: equations.with_rates(factor, moving_state, time), state)


def _set_in_motion(equations: Equations, model: Model, coordinates: dict[str, np.ndarray], instant: float) -> State:
    """Return the assembled bodies with the velocities that laws prescribe.

    At a limit position, such as a stretched arm, a residual changes with the square of a displacement. Rounding of
    the residual then hides a displacement of 1e-8, after which the velocities are different, and finite.

    Raises
    ------
    MobilityError
        If rounding would decide the velocities.
    """
    start, time = at_rest(model, coordinates), np.array([[instant]])
    state, rates, turn_rate = jax.tree.map(np.asarray, _with_row_rates(equations, start, time))
    speeds = np.concatenate([state.velocity / model.length, state.spin])[..., 0]
    size, rate = (float(np.max(np.abs(x), initial=0.0)) for x in (speeds, rates))
    if not (np.isfinite(size) and size > 0 and rate > 0):
        return state
    step = ROUNDING / rate  # s, at those velocities
    nearby = start._replace(position=start.position + step * state.velocity, attitude=start.attitude + step * turn_rate)
    displaced = jax.tree.map(np.asarray, _with_row_rates(equations, nearby, time)[0])
    change = np.concatenate([(displaced.velocity - state.velocity) / model.length, displaced.spin - state.spin])[..., 0]
    if np.max(np.abs(change)) <= LARGEST_CHANGE * size:
        return state
    message = (
        f"the start is a singular position (a dead point) at t = {instant:g} s, where the rates of the laws do not "
        f"determine the velocities of {freely_moving(model, speeds.T.reshape(1, -1))}: start at another instant, or "
        "with another position"
    )
    raise MobilityError(message)


def _row_rates(equations: Equations, state: State, time: Instants) -> Float[Numbers, "row 1"]:
    return equations.system.residual(equations.pose(state), Jet.variable(time, 1)).dense().coefficients[1]


def _check_rates(model: Model, state: State, rates: Float[np.ndarray, "row 1"], instant: float) -> None:
    """Raise AssemblyError, with the names of the rows, if the rates of redundant rows contradict each other."""
    gaps = np.abs(rates)[:, 0]
    size = max(float(np.max(np.abs(state.velocity))) / model.length, float(np.max(np.abs(state.spin))))
    if gaps.max() > LARGEST_CONTRADICTION * size:
        names = dict.fromkeys(row for row, gap in zip(model.rows, gaps, strict=True) if gap > 0.1 * gaps.max())
        message = f"redundant constraints contradict each other in their rates at t = {instant:g} s: {', '.join(names)}"
        raise AssemblyError(f"{message}; correct the laws of those named", status=Status.INCONSISTENT)


def _checked_jacobian(equations: Equations, model: Model, facts: _Facts, instant: float) -> HostJacobian:
    """Return the Jacobian of a start whose equations of motion determine all accelerations.

    Raises
    ------
    MechanismError
        If a movable body has no mass or inertia, or a free motion has negative kinetic energy.
    MobilityError
        If the equations of motion are singular.
    """
    matrix, system = facts.matrix, model.system
    jacobian = HostJacobian.of(system.pattern, facts.entries).scaled(np.asarray(system.row_scale)[:, 0])
    columns = jacobian.shape[1]
    loose = _undetermined_motions(matrix, columns)
    if len(loose):
        mass, _, moments = map(np.asarray, equations.masses)
        by_body = np.linalg.norm(loose[:, :columns].reshape(len(loose), len(model.bodies), -1), axis=(0, 2))
        for name, size, m, s in zip(
            model.bodies, by_body, mass[1:, 0], np.abs(moments[..., 1:, 0]).sum((0, 1)), strict=True
        ):
            if size > 0.05 * by_body.max() and (m == 0 or s == 0):
                lacks = "mass" if m == 0 else "inertia"
                message = f"the body can move but has no {lacks}, so that nothing determines its acceleration"
                advice = f"give it one, or join it to a body that has {'mass' if m == 0 else 'inertia'}"
                raise MechanismError(f"{message}; {advice}", name=f"bodies.{name}.{lacks}")
        names = freely_moving(model, loose[:, :columns])
        raise MobilityError(f"the equations of motion are singular at t = {instant:g} s: {names}")
    if not _is_solid(equations.masses):
        _check_energy(model, matrix[:columns, :columns], jacobian)
    return jacobian


def _undetermined_motions(matrix: Float[np.ndarray, "size size"], columns: int) -> Float[np.ndarray, "direction size"]:
    """Return the null space of the matrix of the equations; its vectors begin with the `columns` coordinates."""
    scale, tolerance = even_scale(matrix, columns), 1e-3 * RANK_TOLERANCE
    even = matrix * scale * scale[:, None]
    if is_clearly_regular(even, tolerance):
        return np.zeros((0, len(matrix)))
    is_null = (sizes := np.linalg.svd(even, compute_uv=False)) <= tolerance * sizes.max()
    if not is_null.any():
        return np.zeros((0, len(matrix)))
    directions = np.linalg.svd(even)[2][is_null] * scale
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _is_solid(masses: Masses) -> bool:
    """Return whether no body has a negative mass or moment of inertia, so that no kinetic energy is negative.

    The least moment of inertia about an axis through the center of mass is the sum of the two least second moments.
    """
    mass, _, moments = map(np.asarray, masses)
    planar = len(moments) == 2
    sums = np.trace(moments) if planar else np.linalg.eigvalsh(moments[..., 0].T)[:, :2].sum(axis=1)
    return bool(np.all(mass >= 0) and np.all(sums >= 0))


def _check_energy(model: Model, mass: Float[np.ndarray, "column column"], jacobian: HostJacobian) -> None:
    """Raise MechanismError if a free motion has negative kinetic energy."""
    count = len(model.bodies)
    by_body = np.einsum("bibj->bij", mass.reshape(count, -1, count, mass.shape[0] // count))
    eigenvalues = np.linalg.eigvalsh(by_body)
    if eigenvalues.min() >= 0 or jacobian.rank == mass.shape[0]:
        return
    free_directions = jacobian.free_directions
    if len(free_directions) == mass.shape[0] - jacobian.rank:
        values, motions = np.linalg.eigh(free_directions @ mass @ free_directions.T)
        if values[0] >= -RANK_TOLERANCE * np.abs(values).max():
            return
        motion = (motions[:, 0] @ free_directions).reshape(count, -1)
        energies = np.einsum("bi,bij,bj->b", motion, by_body, motion)
    else:  # too many free directions to list all of them
        energies = eigenvalues.min(axis=1)
    name = model.bodies[int(np.argmin(energies))]
    message = "the body can move so that its kinetic energy is negative; correct its mass and its moments of inertia"
    raise MechanismError(message, name=f"bodies.{name}.inertia")
