"""The fastest time law along a path within limits of velocity to jounce, torque and torque rate."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jounce.base.shapes import ArrayLike
from jounce.dynamics.limits.shared_followers import SharedFollowers
from jounce.dynamics.limits.trajectories import FollowedTrajectory, warn_of_degrees
from jounce.errors import SolveError, TrajectoryError, flag, whole_number
from jounce.mechanism import Mechanism
from jounce.mechanism.building.preconditions import concrete
from jounce.planning.paths.path import Path
from jounce.planning.paths.paths import Between, GivenPath, cells_needed, checked, path_of
from jounce.planning.paths.sampled_paths import path_of_samples
from jounce.planning.retiming.fastest import fastest, slowed_only
from jounce.planning.retiming.loads import along_path, in_time, instant_at, with_stops
from jounce.planning.retiming.mechanism import retime_mechanism
from jounce.planning.retiming.quantities.limits import GivenLimits, MotionLimits, limits_of
from jounce.planning.retiming.quantities.motion_limits_check import check_motion
from jounce.planning.retiming.quantities.path_quantities import Curves
from jounce.planning.retiming.quantities.robot_quantities import RobotQuantities
from jounce.planning.retiming.rates.rate_law import Conditions, RateLaw
from jounce.planning.retiming.rates.rate_motion import RateMotion
from jounce.planning.retiming.retimed import RetimedTrajectory, active_limits
from jounce.planning.retiming.running_states import retimed_from
from jounce.planning.retiming.search import Search
from jounce.planning.solver import require_solver
from jounce.robot.algorithms.carried_loads import CarriedLoad
from jounce.robot.model.links_and_joints import Limits
from jounce.robot.robot import Robot
from jounce.trajectory import FollowingMotion, JointTrajectory
from jounce.trajectory.checks import positive

CELLS = 160
ATTEMPTS = 4  # attempts to keep limits of the time derivatives
LIMIT_TOLERANCE = 1e-9  # relative tolerance of a limit for rounding
MAX_ORDER = 6
NEAR_LEAST = 1.01  # times the least time: a shorter duration is compared with the exact least time
SPEEDS = 1e-9  # relative to the largest speed: slower ends of a trajectory are at rest


@concrete
def retime(
    robot: Robot | Mechanism,
    path: GivenPath | None = None,
    limits: GivenLimits | None = None,
    *,
    names: Sequence[str] | None = None,
    rates: tuple[float, float] = (0.0, 0.0),
    order: int | None = None,
    cells: int | None = None,
    drives: bool = True,
    repair: bool = False,
    deviation: float | None = None,
    parameter: ArrayLike | None = None,
    degree: int | None = None,
    hand_over: bool = False,
    duration: float | None = None,
    state: ArrayLike | None = None,
    loads: Sequence[CarriedLoad] = (),
) -> RetimedTrajectory:
    """Return the fastest motion along a path that keeps limits.

    The square of the rate along the path is a spline from a sequence of cone programs, whose coefficients are exact
    derivatives of the path and of the torques along it. The result is checked: it exceeds no limit by more than a
    millionth, also between samples.

    Parameters
    ----------
    robot : Robot or Mechanism
        The robot, with its payload; or a mechanism, with the laws of its drivers over its time as the path.
    path : JointTrajectory, dict, or array_like of shape (points, joints)
        None for a mechanism. Waypoints, interpolated by splines of degree 5; a mapping from names of joints to
        waypoints or to expressions of ``s``, which runs from 0 to 1; or a trajectory, whose times have no effect: the
        motion stops where the trajectory turns back or stops at a corner. Joints that it does not name stand still.
    limits : dict of str to Limits, or MotionLimits, optional
        Limits that replace those of the robot. For a mechanism, `Limits` by name of drivers (effort and effort_rate
        limit the force or torque, and its rate) and of outputs, which can have limits of speed, acceleration and, for
        angles and distances, jerk.
    names : sequence of str, optional
        Joints of an array of waypoints, in the order of its columns; the joints of the robot unless given.
    rates : tuple of float, default (0, 0)
        Rates of s at the beginning and at the end, 1/s; 0 is rest.
    order : int, optional
        Highest continuous derivative of the positions, 1 to 6, also at the start from rest. By default as high as the
        limits require: 3 with limits of jounce, 2 with limits of jerk or torque rate, 1 otherwise.
    cells : int, optional
        Number of cells of the spline, 20 or more. By default 160, or enough to resolve oscillations of the path, up to
        1280. A given number, and the 160 cells of a mechanism, ignore oscillations: a path with finer oscillations may
        exceed limits between the instants of the check.
    drives : bool, default True
        Whether torques contain armature inertia, damping and friction of the drives.
    repair : bool, default False
        Whether to return the given trajectory with the smallest slowing that keeps the limits: it is never faster than
        before, and unchanged where it keeps the limits. The path must be a trajectory.
    deviation : float, optional
        Largest distance of the path from the straight lines between samples or waypoints, rad or m (for several joints
        the root of the sum of squares). The default for samples of a trajectory is 0.001, or a thousandth of the
        diagonal of their bounding box if that is less. Splines interpolate the samples if they keep the deviation,
        stand still where the samples do, and are supported by the samples to the order; otherwise the path is a spline
        with control points on the lines, which rounds corners and the noise of dwells. Waypoints are interpolated
        unless the deviation is given. For a path of expressions or laws the deviation is relative to that path, so that
        kinks can be rounded.
    parameter : array_like of shape (points,), optional
        Increasing values of s at waypoints; the chord lengths between them, from 0 to 1, unless given.
    degree : int, optional
        Degree of the splines through waypoints, with not-a-knot ends; 5 unless given. With a parameter and degree 3 the
        path is that of TOPP-RA's ``SplineInterpolator``.
    hand_over : bool, default False
        Whether a repaired trajectory may start and stop in motion, as for a robot that already moves.
    duration : float, optional
        Duration of the motion, s, instead of the least time: the fastest motion slowed evenly, or, with given rates at
        the ends, a motion that is as slow as possible everywhere.
    state : array_like of shape (derivatives, joints), optional
        State of a running robot at the beginning of the motion: positions, velocities, and if known accelerations and
        jerks, of the joints of the path in its order, also at their limits. If the state is not on the path, a curve
        leads onto the path, on which the robot may brake and turn. The curve joins the path at the first of several
        places from which some motion keeps the limits. An excess below a millionth of a limit counts as rounding.
    loads : sequence of CarriedLoad, optional
        Loads on links on parts of the path, as from the second waypoint to the fourth: limits of torques and of their
        rates apply on both sides of each change. The motion stops at a change, unless the load is ``moving``; a
        repaired trajectory stops only where it stopped before. Torques step at a change of load, so that their rate is
        infinite: the report states the step, and the speed of the load.

    Returns
    -------
    RetimedTrajectory
        A `JointTrajectory` that starts at 0 s, exact between samples. ``report`` is the result of `check_limits`;
        ``active`` has the binding limits on the path, and the time that each of them costs.

    Raises
    ------
    TrajectoryError
        If the path has a kink or a repeated point, leaves the range of a joint, or exceeds a limit at rest: the message
        has the place and the joint. If the duration is shorter than the least time, which the message has.
    RobotError
        If names or limits do not fit the robot.
    SolveError
        If no time law keeps the limits with the rates at the ends.
    UnsupportedError
        If Clarabel is not installed.

    Examples
    --------
    >>> import jounce as jn
    >>> limits = jn.Limits(velocity=1.0, acceleration=2.0)
    >>> slider = jn.Joint("slide", "base", "cart", "prismatic", axis=[1, 0, 0], limits=limits)
    >>> robot = jn.Robot("cart", [jn.Link("base"), jn.Link("cart", jn.Inertia(1.0))], [slider])
    >>> fast = jn.retime(robot, [[0.0], [2.0]])
    >>> round(fast.stop, 2)  # 2 m at 1 m/s, and 0.5 s for speeding up and slowing down
    2.5
    """
    require_solver()
    if cells is not None:
        cells = whole_number("cells", cells, 20, 5000, error=TrajectoryError)
    if duration is not None:
        duration = positive("duration", duration)
    between = Between(deviation, parameter, degree)
    if isinstance(robot, Mechanism):
        arguments = {"repair": repair, "path": path is not None, "deviation": deviation is not None}
        _check_of_robots(arguments | {"state": state is not None, "loads": len(loads) > 0}, between)
        return retime_mechanism(robot, _of_mechanism(limits), _rates(rates), order, cells or CELLS, duration)
    if not isinstance(robot, Robot):
        raise TrajectoryError("must be a Robot or a Mechanism", name="robot", value=type(robot).__name__)
    hand_over = flag("hand_over", hand_over, error=TrajectoryError)
    drives, repair = flag("drives", drives, error=TrajectoryError), flag("repair", repair, error=TrajectoryError)
    if isinstance(path, JointTrajectory):
        FollowedTrajectory(robot, path)  # checks its joints and units
    if repair:
        _check_not_repaired(duration=duration, state=state)
        return _repaired(robot, path, limits, order, cells, drives, between, hand_over=hand_over, loads=loads)
    chosen = _order(order, limits_of(robot, limits), robot)
    chosen_path = path_of(path, names if names is not None else robot.joint_names, chosen, between)
    if not isinstance(path, JointTrajectory):
        warn_of_degrees(robot, JointTrajectory(dict(chosen_path.laws), chosen_path.start, chosen_path.stop))
    conditions = Conditions(chosen, _rates(rates))
    chosen_path, path_loads = with_stops(chosen_path, along_path(_check_loads(loads, state), chosen_path), chosen)

    quantities = functools.partial(_quantities, robot, limits=limits, drives=drives, loads=path_loads)

    def planned(route: Path, conditions: Conditions, junction_s: float | None) -> RetimedTrajectory:
        source = quantities(route)
        if junction_s is None:  # a curve joined to a path is already smooth
            checked(route, chosen)
        source.check_range()
        own_cells = cells or cells_needed(route, chosen)
        law, search = fastest(source, source.labels, route.start, route.stop, conditions, own_cells, junction_s)
        certified = functools.partial(
            _certified, robot, route, search=search, source=source, drives=drives, hand_over=any(conditions.rates)
        )
        if duration is None:
            return certified(law)
        if duration < NEAR_LEAST * law.duration:
            check_duration(duration, certified(law).stop)
        return certified(search.lengthened(law, duration))

    return retimed_from(chosen_path, state, conditions, quantities, planned)


def _quantities(
    robot: Robot, path: Path, *, limits: GivenLimits | None, drives: bool, loads: Sequence[CarriedLoad]
) -> RobotQuantities:
    return RobotQuantities(robot, path, limits, drives=drives, loads=loads)


def _check_of_robots(arguments: Mapping[str, bool], between: Between) -> None:
    """Raise TrajectoryError for arguments that do not apply to a mechanism."""
    if any(arguments.values()):
        message = "the path of a mechanism is that of its drivers, which is not repaired; leave this out"
        raise TrajectoryError(message, name=next(name for name, x in arguments.items() if x))
    between.check_without_points()


def _check_not_repaired(**arguments: Any) -> None:
    """Raise TrajectoryError for arguments that a repaired trajectory determines itself."""
    for name, value in arguments.items():
        if value is not None:
            message = (
                "a repaired trajectory has its own times and its own beginning; leave this out, or do not repair it"
            )
            raise TrajectoryError(message, name=name, value=value)


def _check_loads(loads: Sequence[CarriedLoad], state: ArrayLike | None) -> tuple[CarriedLoad, ...]:
    """Raise TrajectoryError if loads change on the way from a running state."""
    if state is not None and loads:
        message = "what is carried is not known to change on the way from a running state; leave one of both out"
        raise TrajectoryError(message, name="loads")
    return tuple(loads)


def check_duration(duration: float, least: float) -> None:
    """Raise TrajectoryError if a duration is shorter than the least time."""
    if duration < least * (1 - LIMIT_TOLERANCE):
        message = f"the least time of this path within these limits is {least:.9g} s, which is longer; allow that much"
        raise TrajectoryError(message, name="duration", value=duration)


def _repaired(
    robot: Robot,
    trajectory: GivenPath | None,
    limits: GivenLimits | None,
    order: int | None,
    cells: int | None,
    drives: bool,
    between: Between,
    *,
    hand_over: bool,
    loads: Sequence[CarriedLoad],
) -> RetimedTrajectory:
    if not isinstance(trajectory, JointTrajectory):
        raise TrajectoryError("only a trajectory can be repaired", name="path", value=type(trajectory).__name__)
    between.check_without_points()
    chosen = _order(order, limits_of(robot, limits), robot)
    path = checked(path_of_samples(trajectory, chosen, between.deviation, timed=True), chosen)
    path_loads = along_path(loads, path, timed=True)
    source = RobotQuantities(robot, path, limits, drives=drives, loads=path_loads)
    source.check_range()
    timed_trajectory = JointTrajectory(path.laws, path.start, path.stop, trajectory.times)
    ends = _ends(robot, timed_trajectory, source, drives, hand_over)
    cells = cells or cells_needed(path, chosen)
    speeds = np.abs(path.derivatives(np.linspace(path.start, path.stop, 501), 1)[:, 1]).max(axis=1)
    keeps_limits = within_limits(source, np.array([path.start, path.stop])) & (speeds[[0, -1]] > SPEEDS * speeds.max())
    first, last = (1.0 if is_kept else None for is_kept in keeps_limits.tolist())
    conditions = Conditions(chosen, (first, last), max_rate=1.0)
    law, search = slowed_only(source, source.labels, path.start, path.stop, conditions, cells)
    retimed = _certified(robot, path, law, search=search, source=source, drives=drives, hand_over=True)
    # rest in samples is known for the given laws only, not for the laws of the slowed time
    known_ends = ends if all(end.at_rest for end in ends) else retimed.report.ends
    retimed.report = dataclasses.replace(retimed.report, ends=known_ends, hand_over=hand_over)
    return retimed


def _ends(robot: Robot, trajectory: JointTrajectory, source: RobotQuantities, drives: bool, hand_over: bool) -> Any:
    """Return the ends of a trajectory before its repair.

    Raises
    ------
    TrajectoryError
        If the motion jumps at an end, and the robot does not already move.
    """
    ends = check_motion(robot, trajectory, source.limits, drives=drives).ends
    for end in () if hand_over else ends:
        if end.breaks:
            owner, quantity = end.breaks[0]
            message = (
                f"the trajectory does not rest at its {end.end}: from rest, or to it, the {quantity} of {owner} is "
                "infinite there, which slowing down does not change; let it rest there, retime it without repair, or "
                "set hand_over if the robot moves already"
            )
            raise TrajectoryError(message, name="repair")
    return ends


def within_limits(source: RobotQuantities, s: np.ndarray) -> np.ndarray:
    """Return whether a motion with the time as parameter keeps its limits, at values of s."""
    shape, law = np.zeros((5, len(s))), np.zeros((4, len(s)))
    shape[0], shape[1], law[0] = s, 1.0, 1.0
    return np.all(Curves(source(s), shape).ratios(law) <= 1, axis=1)


def _certified(
    robot: Robot,
    path: Path,
    law: RateLaw,
    *,
    search: Search,
    source: RobotQuantities,
    drives: bool,
    hand_over: bool,
) -> RetimedTrajectory:
    """Return the trajectory of a law whose time derivatives keep the limits."""
    for attempt in range(ATTEMPTS):
        motion = RateMotion(np.linspace(0.0, 1.0, law.basis.cells + 1), law.basis.pieces(law.coefficients))
        if search.duration is not None and not any(search.conditions.rates):
            motion = motion.slower(search.duration / motion.duration)  # exactly
        progress = FollowingMotion(law.parameter, motion)
        laws = {name: FollowingMotion(joint_law, progress) for name, joint_law in path.laws.items()}
        trajectory = JointTrajectory(laws, 0.0, motion.duration, np.linspace(0.0, motion.duration, law.basis.cells + 1))
        loads = in_time(source.loaded.loads, progress, motion.duration)
        report = check_motion(robot, trajectory, source.limits, drives=drives, hand_over=hand_over, loads=loads)
        excess = (report.worst.ratio or 0.0) - 1 if report.worst else 0.0
        if excess <= LIMIT_TOLERANCE:
            active = active_limits(search, law, motion)
            if path.joined is not None:
                duration = instant_at(progress, motion.duration, path.joined)
                path = dataclasses.replace(path, words=f"{path.words} for {duration:.3g} s")
            return RetimedTrajectory(laws, trajectory.stop, path, progress, report, active, loads)
        if attempt == ATTEMPTS - 1 or not np.isfinite(excess):
            note = "" if report.worst is None else f" of the {report.worst.quantity} of {report.worst.joint}"
            message = f"the time law found breaks the limit{note}; try more cells"
            raise SolveError(message, name="cells", value=law.basis.cells)
        law = search.with_margin(law, excess)
    raise AssertionError


def _of_mechanism(limits: GivenLimits | None) -> dict[str, Limits]:
    if not isinstance(limits, Mapping) or not limits:
        raise TrajectoryError("must be Limits of drivers and outputs by name", name="limits", value=limits)
    return dict(limits)


def _order(order: int | None, limits: MotionLimits, robot: Robot) -> int:
    """Return the highest derivative that must be continuous."""
    min_order = 1
    all_limits = [*(limits.joints[name] for name in robot.joint_names), *SharedFollowers.of(robot).limits.values()]
    varying = {field for laws in limits.varying.values() for field in laws}
    if any(x.jerk is not None or x.effort_rate is not None for x in all_limits) or varying & {"jerk", "effort_rate"}:
        min_order = 2
    if limits.jounce or "jounce" in varying:
        min_order = 3
    if order is None:
        return min_order
    requested = whole_number("order", order, 1, MAX_ORDER, error=TrajectoryError)
    if requested < min_order:
        message = f"these limits require derivatives that are continuous to order {min_order} or higher"
        raise TrajectoryError(message, name="order", value=order)
    return requested


def _rates(rates: Any) -> tuple[float, float]:
    try:
        first, last = (float(x) for x in rates)
    except (TypeError, ValueError):
        raise TrajectoryError("must be two numbers", name="rates", value=rates) from None
    if not (np.isfinite([first, last]).all() and min(first, last) >= 0):
        raise TrajectoryError("must be finite and not negative", name="rates", value=rates)
    return first, last
