"""The simulation of a mechanism with masses and forces."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Unpack, overload

import jax
import numpy as np

from jounce.base.activity import Count
from jounce.constraints import AbstractConstraint
from jounce.dynamics.forward.ground import with_ground
from jounce.dynamics.forward.initial_state import ConsistentStart, consistent_start
from jounce.errors import JounceError, MechanismError, SolveError, check_choice
from jounce.execution.backends import joined
from jounce.execution.store.programs import expect
from jounce.integrate.marching.marching import RunLimits
from jounce.integrate.mechanisms.programs_ahead import prepare_run
from jounce.integrate.mechanisms.run import MechanismRun, unsound_forces
from jounce.integrate.results.robot_sensitivities import of_traced_robots, traced_robot_motion
from jounce.integrate.results.robot_simulation import RobotSimulation
from jounce.integrate.results.sensitivities import traced_simulation
from jounce.integrate.results.simulation import Simulation
from jounce.integrate.simulate_robot import RobotOptions, RobotSimulationOptions, check_robot_options, simulate_robot
from jounce.integrate.steps.events import Event, EventDetector
from jounce.integrate.steps.methods import AbstractMethod
from jounce.integrate.steps.options import SimulationOptions, checked_options, instants_of
from jounce.kinematics import Status, raise_for_status
from jounce.kinematics.position_analysis.curve_ends import beyond_end, ends_of
from jounce.kinematics.results.pose_outputs import check_output, output_group
from jounce.mechanism import Mechanism, Model, ParameterOutput, ParametersOutput, check_mechanism
from jounce.mechanism.building.belts import check_room
from jounce.mechanism.building.preconditions import concrete_or
from jounce.mechanism.laws.law_checks import check_laws
from jounce.mechanism.time import TimeLike
from jounce.robot import Robot


@overload
def simulate(
    mechanism: Mechanism,
    time: TimeLike | None = None,
    order: int = 4,
    *,
    initial: Mapping[str, AbstractConstraint] | None = None,
    **options: Unpack[SimulationOptions],
) -> Simulation: ...
@overload
def simulate(
    mechanism: Robot, time: TimeLike, order: int = 4, **options: Unpack[RobotSimulationOptions]
) -> RobotSimulation: ...
@of_traced_robots(traced_robot_motion)
@concrete_or(traced_simulation)
def simulate(
    mechanism: Mechanism | Robot,
    time: TimeLike | None = None,
    order: int = 4,
    *,
    method: AbstractMethod | None = None,
    tolerance: float = 1e-15,
    initial: Mapping[str, AbstractConstraint] | None = None,
    events: object = (),
    longest_step: float = np.inf,
    strict: bool = True,
    progress: Callable[[int, int], None] | None = None,
    **robot: Unpack[RobotOptions],
) -> Simulation | RobotSimulation:
    """Return the motion of a mechanism, or of a robot, under forces, with time derivatives of any order.

    Accelerations, multipliers and all their rates follow from one factored matrix at each step; positions and
    velocities are projected onto the constraints (Sommer 2024, section 7). Robots move in joint coordinates, by
    articulated bodies: `forward_dynamics`.

    Parameters
    ----------
    mechanism : Mechanism or Robot
        A mechanism with masses, or a robot. Joints and drivers may leave degrees of freedom; drivers prescribe their
        coordinates throughout.
    time : array_like of shape (time,), optional
        Instants, s, increasing, or decreasing for a run backward; by default those of the mechanism. The first is the
        start.
    order : int, default 4
        Highest derivative of the outputs, up to 30.
    method : AbstractMethod, optional
        Integration method, by default `Taylor`.
    tolerance : float, default 1e-15
        Error of a step, rad or sizes of the mechanism; 1e-17 to 0.01.
    initial : dict of str to driver, optional
        Initial conditions instead of ``mechanism.initial``: each fixes one coordinate and its rate at the start.
    events : sequence of Event, or of JointEvent for a robot, optional
        Crossings to detect.
    longest_step : float, optional
        Largest length of a step, s.
    strict : bool, default True
        Raise an error if an instant is not reached. Otherwise its values are NaN, and `Motion.status` has the reason.
    progress : callable, optional
        Called with the number of instants passed and their total.
    **robot
        For robots. `state`: q and q', of shape (2, n), or a mapping of joints to coordinates; by default at rest at
        zero. `torque`: the joint forces, N m or N: n numbers; a JAX function of time, q and q' of one sample that
        returns n numbers; or a mapping of joints to numbers, expressions of ``t``, of the names of joints and of their
        rates as ``NAME_d1``, motion laws, and functions that return one force. `driven`: a mapping of joints to laws of
        time (motions, expressions, functions, numbers) that they follow with any force. `drives`: False leaves out
        armature inertia, damping and friction, which are included by default. `base`: the initial `BaseMotion` of a
        free base. `wrenches`: a sequence of `Wrench`, of constants, functions of time, or functions of time, q and q',
        that return three components.

    Returns
    -------
    Simulation, also a `Motion`; or RobotSimulation

    Raises
    ------
    MechanismError
        If the mechanism, the instants or an option is not valid, or a movable body has no mass.
    AssemblyError
        If joints, drivers and initial conditions contradict each other.
    MobilityError
        If the start is a singular position.
    SolveError
        If, with `strict`, the motion does not reach an instant; the error has the motion up to that point.
    UnsupportedError
        If JAX traces anything but values of the mechanism.

    Examples
    --------
    >>> import jounce as jn
    >>> pendulum = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -9.81],
    ...     bodies={"rod": jn.Body([0, 0], mass=2.0, inertia=0.5, center_of_mass=[1, 0])},
    ...     joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
    ...     outputs={"angle": jn.outputs.AngleOutput("rod")},
    ... )
    >>> fall = jn.simulate(pendulum, [0.0, 0.5, 1.0], order=3)
    >>> bool(abs(fall.energy - fall.energy[0]).max() < 1e-12)
    True
    """
    if not isinstance(mechanism, Robot):
        check_mechanism(mechanism)
    order, method = checked_options(order, method, tolerance, longest_step)
    if progress is not None and not callable(progress):
        raise MechanismError("must be a function of two numbers", name="progress", value=progress)
    if isinstance(events, str) or not isinstance(events, Sequence):
        raise MechanismError("must be a list of jn.Event", name="events", value=events)
    check_robot_options(mechanism, robot)
    if isinstance(mechanism, Robot) and initial is not None:
        raise JounceError("belongs to simulations of mechanisms; a robot begins in a `state`", name="initial")
    if isinstance(mechanism, Robot):
        options = {"method": method, "tolerance": float(tolerance), "longest_step": float(longest_step)}
        options |= {"events": events, "strict": strict, "progress": progress}
        return simulate_robot(mechanism, instants_of(time, {}), order, **options, **robot)
    if initial is not None:
        if not isinstance(initial, Mapping):
            raise MechanismError("must be a mapping of names to drivers", name="initial", value=initial)
        mechanism = dataclasses.replace(mechanism, initial=dict(initial))
    instants = instants_of(mechanism.time if time is None else time, mechanism.parameter_values)
    check_laws(mechanism, instants, order, forces=True)
    expect(len(instants))
    for event in events:
        _check_event(event, mechanism)
    first = float(instants[0])
    limits = RunLimits(instants[-1], float(tolerance), float(longest_step), first)

    def prepare(model: Model) -> None:
        prepare_run(mechanism, model, instants, order, method, limits, watched=bool(events))

    start = consistent_start(mechanism, first, prepare)
    _check_forces(start, first)
    _check_ends(start, first)
    watched = [*events, *_events_at_ends(start)]
    detectors = [_detector_of(event, mechanism, start) for event in watched]
    if start.model.system.rank is not None:  # otherwise the programs are those asked for before assembly
        prepare(start.model)
    run = MechanismRun(start, method, limits, detectors, watched=bool(events))
    with Count("simulating", report=progress) as tell:
        run.go(instants, tell)
    run.note_ends(len(events))
    outcome = run.ending, run.happened[: len(events)], joined(run.backends)
    simulation = Simulation(mechanism, start, run.steps, instants, order, *outcome)
    check_room(simulation)
    if strict and run.stopped_at is None:
        raise_for_status(simulation)
    return simulation


def _check_event(event: object, mechanism: Mechanism) -> None:
    """Raise MechanismError unless an event watches an output that the mechanism can have."""
    if not isinstance(event, Event):
        raise MechanismError("must be a jn.Event", name="events", value=event)
    check_output(event.output, mechanism, "events")
    output_group(event.output, mechanism)


def _detector_of(event: Event, mechanism: Mechanism, start: ConsistentStart) -> EventDetector:
    """Return the detector of an event, or raise MechanismError if its output has no such component."""
    group = output_group(event.output, mechanism, start.model)
    pose = start.equations.pose(start.state)
    components = jax.eval_shape(lambda: group.evaluate(pose).coefficients[0]).shape[0]
    if isinstance(event.component, str):
        labels = event.output.component_labels(mechanism)
        check_choice("component", event.component, labels, MechanismError, name="events.component")
        event = dataclasses.replace(event, component=labels.index(event.component))
    if event.component >= components:
        message = f"the output has {components} component{'s' if components > 1 else ''}, counted from 0"
        raise MechanismError(message, name="events.component", value=event.component)
    return EventDetector(event, group, start.model.pose_type)


def _events_at_ends(start: ConsistentStart) -> list[Event]:
    """Return terminal events for points at the ends of their curves: two for each parameter with ends."""
    events = []
    for ends in ends_of(start.model):
        output = (ParameterOutput if ends.is_only else ParametersOutput)(ends.joint)
        for value, direction in ((ends.low - ends.slack, -1), (ends.high + ends.slack, 1)):
            events.append(Event(output, value, 0, ends.component, direction, terminal=True))
    return events


def _check_ends(start: ConsistentStart, instant: float) -> None:
    """Raise SolveError if a point starts beyond an end of its curve."""
    curves = ends_of(start.model)
    if curves and (fault := beyond_end(curves, {"position": np.asarray(with_ground(start.state.position))})):
        status = Status.END_OF_CURVE
        raise SolveError(f"t = {instant:g} s, {fault}: end of curve: {status.advice}", status=status)


def _check_forces(start: ConsistentStart, instant: float) -> None:
    """Raise SolveError if an applied force has no finite value at the start."""
    names = unsound_forces(start, start.sound)
    if names:
        status = Status.INADMISSIBLE
        message = f"t = {instant:g} s, {names}: the force is not finite: check its law and its parameters"
        raise SolveError(message, status=status)
