"""Compare a trajectory with the limits of a robot: position to jerk, torque and torque rate of every joint."""

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Refused, seconds
from jounce.dynamics.limits.limit_jumps import Infinite, infinite_quantities, jumps_of
from jounce.dynamics.limits.limit_report import LimitReport, LimitRow
from jounce.dynamics.limits.local_maxima import local_maxima
from jounce.dynamics.limits.motion_ends import TrajectoryEnd, end_jumps, ends_of_jumps
from jounce.dynamics.limits.shared_followers import SharedFollowers
from jounce.dynamics.limits.trajectories import FollowedTrajectory, checked_trajectory, reason_not_movable
from jounce.errors import RobotError, SampleWarning, TrajectoryError, flag
from jounce.robot.algorithms.carried_loads import CarriedLoad
from jounce.robot.model.links_and_joints import Joint, Limits
from jounce.robot.robot import Robot
from jounce.trajectory.joint_trajectory import JointTrajectory
from jounce.trajectory.law_checks.breaks import at_breaks, both_sides, distinct_instants, law_breaks, with_sides

FIELDS = ("position", "velocity", "acceleration", "jerk", "effort", "effort_rate")
TURNING = dict(zip(FIELDS, ("rad", "rad/s", "rad/s^2", "rad/s^3", "N m", "N m/s"), strict=True))
SLIDING = dict(zip(FIELDS, ("m", "m/s", "m/s^2", "m/s^3", "N", "N/s"), strict=True))
ACCELERATION = 2
EFFORTS = (4, 5)  # fields that follow from dynamics
ORDER = 3  # of the motion: jerk, and with it the rate of the torque

REST = 1e-9  # fraction of the largest velocity of a joint: a slower joint is at rest
INSTANTS = 2000  # least number over the trajectory
BETWEEN = 4  # least number of intervals between two instants of the trajectory
POINTS = 9  # instants around each peak
ROUNDS = 8  # divisions of the step


def check_limits(
    robot: Robot,
    trajectory: JointTrajectory | Refused,
    limits: Mapping[str, Limits] | Refused | None = None,
    *,
    times: ArrayLike | None = None,
    drives: bool = True,
    hand_over: bool = False,
    loads: Sequence[CarriedLoad] = (),
) -> LimitReport:
    """Compare a trajectory, and the torques and torque rates that it needs, with the limits of the joints.

    An acceleration that opposes the velocity is compared with the deceleration limit, if there is one. A joint at rest
    counts as speeding up; at the end of the trajectory it counts as slowing down.

    All values are exact derivatives of the trajectory. They are evaluated at its own instants, at three or more between
    each two of them, at 2000 or more in total, and on both sides of known jumps and kinks of derivatives. Around the
    highest peaks of each curve the step is then refined to less than a millionth of the duration, so the reported
    values are values of the curves themselves.

    If a derivative of a law jumps within the trajectory, all higher derivatives are infinite there, and torques and
    their rates may be, too; their limits are then exceeded. The instants at which pieces of laws meet are known. Jumps
    and kinks of expressions and of Python functions are searched for between the evaluated instants; the search misses
    those below 1e-5 of the largest value or below a fourth of the change between two instants, and a second one between
    the same two.

    The robot is assumed to rest before the start and after the stop. If a joint moves there, the derivatives above the
    one that jumps are infinite: the rows contain the values of the motion itself, `LimitReport.ends` lists the jumps,
    and the limits of the infinite quantities count as exceeded. What remains of sampling errors at the ends of a spline
    is not counted as a jump.

    Parameters
    ----------
    robot : Robot
        The robot, including its loads.
    trajectory : JointTrajectory
        Joints that it does not name are at rest at zero, or at the end of their range nearest to zero; only their
        torques are compared.
    limits : dict of str to Limits, optional
        Limits of some joints that replace those of the robot; the limits of joints that follow them still apply, and
        those of joints that follow several have rows of their own.
    times : array_like of shape (time,), optional
        Increasing instants at which to evaluate, s, instead of those above.
    drives : bool, default True
        Whether torques include armature inertia, damping and friction of the drives.
    hand_over : bool, default False
        Whether the robot already moves when the trajectory starts and continues to move when it stops.
    loads : sequence of CarriedLoad, optional
        Loads that links carry during parts of the motion. Both sides of a change are compared with the limits. The step
        of the torques between them, whose rate is infinite, is not; `LimitReport.loads` lists it.

    Returns
    -------
    LimitReport
        One row for each joint and quantity, with or without a limit.

    Raises
    ------
    TrajectoryError
        If the robot does not have a joint of the trajectory, or a value is not finite.
    RobotError
        If the robot has no joints, or `limits` names one that it does not have.

    Warns
    -----
    SampleWarning
        If the samples of the trajectory do not support its jerk, or a lower derivative.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.dynamics.limits.check_limits import check_limits
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0], limits=jn.Limits(velocity=2.0, effort=4.0))
    >>> pendulum = jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    >>> report = check_limits(pendulum, jn.JointTrajectory({"pin": "sin(t)"}, start=0.0, stop=3.0))
    >>> report.kept, [(row.quantity, round(row.ratio, 4), round(row.time, 4)) for row in report.limited]
    (False, [('velocity', 0.5, 0.0), ('torque', 1.2263, 0.0)])
    """
    drives, hand_over = flag("drives", drives, error=RobotError), flag("hand_over", hand_over, error=RobotError)
    trajectory = checked_trajectory(trajectory)
    followed = FollowedTrajectory(robot, trajectory, loads=loads)
    resting, shared, count = followed.resting_joints, SharedFollowers.of(robot), len(robot.joint_names)
    names = (*robot.joint_names, *shared.names)

    def curves(times: np.ndarray) -> np.ndarray:
        """Return all quantities of all joints, shape (time, 6, columns)."""
        q = followed.coordinates(times, ORDER)
        quantities = np.zeros((len(q), len(FIELDS), len(names)))
        quantities[:, : ORDER + 1] = shared.with_followers(q)
        quantities[:, list(EFFORTS), :count] = followed.torques(q, times, drives)
        return quantities

    merged = _merged(robot, limits)
    grid = fine_grid(trajectory) if times is None else _checked_times(times)
    first, last = float(grid[0]), float(grid[-1])
    breaks = law_breaks(trajectory.laws.values(), first, last, ORDER)
    breaks = distinct_instants(np.append(breaks, followed.loaded.changes), first, last)
    grid = with_sides(grid, breaks)
    values = curves(grid)
    all_limits = [(merged | shared.limits)[name] for name in names]
    bounds = _Bounds(all_limits, REST * np.abs(values[:, 1]).max(axis=0), trajectory.stop)
    jumps = jumps_of(followed, grid, values[:, : ORDER + 1, :count])
    infinite = shared.infinite(infinite_quantities(followed, jumps, drives), jumps)
    moving_columns = {count + k for k in shared.moving(followed.columns)}
    moving_columns |= {k for k, name in enumerate(robot.joint_names) if name not in resting}
    limited = [
        (quantity, joint)
        for joint in range(len(names))
        for quantity in range(len(FIELDS))
        if (joint in moving_columns if quantity not in EFFORTS else joint < count)
    ]
    instants, peaks, weights = worst_instants(curves, bounds, grid, values, np.array(limited))
    instants = at_breaks(instants, breaks, first, last)
    rows = tuple(
        _row(
            robot.joints[names[joint]],
            bounds,
            (quantity, joint),
            *bounds.or_infinite(infinite, quantity, joint, *worst),
        )
        for (quantity, joint), *worst in zip(limited, instants.tolist(), peaks.tolist(), weights.tolist(), strict=True)
    )
    ends = _ends(followed, shared, values[:, : ORDER + 1, :count], bounds, drives)
    for message in followed.doubts:
        warnings.warn(SampleWarning(message), stacklevel=2)
    shares = bounds.shares(values, grid)
    return LimitReport(
        robot.name,
        robot.joint_names,
        rows,
        resting,
        grid,
        values[:, :, :count],
        shares[:, :, :count],
        drives=drives,
        ends=ends,
        hand_over=hand_over,
        loads=followed.load_changes(drives),
    )


class _Bounds:
    """The bounds, in arrays of shape (6, joints), infinite where there is none.

    Accelerations and decelerations are compared with one bound, after weighting each by the ratio of that bound to its
    own. A joint at rest is about to speed up, except at the end of the trajectory, `stop`.
    """

    def __init__(self, all_limits: Sequence[Limits], rest: np.ndarray, stop: float):
        def table(*fields: str, default: float = np.inf) -> np.ndarray:
            numbers = np.array([[getattr(x, field) for x in all_limits] for field in fields], float)  # None becomes NaN
            return np.where(np.isnan(numbers), default, numbers)

        max_values, (slower,) = table(*FIELDS[1:]), table("deceleration")
        faster, has_limit = max_values[ACCELERATION - 1].copy(), np.isfinite(slower)
        bound = np.where(np.isfinite(faster), faster, slower)
        max_values[ACCELERATION - 1], self.rest, self.stop = bound, rest, stop
        self.speeding = np.where(has_limit & ~np.isfinite(faster), 0.0, 1.0)
        self.slowing = np.divide(bound, slower, out=np.ones(len(all_limits)), where=has_limit)
        self.upper = np.concatenate([table("upper"), max_values])
        self.lower = np.concatenate([table("lower", default=-np.inf), -max_values])
        self.limited = np.isfinite(self.upper) | np.isfinite(self.lower)
        with np.errstate(invalid="ignore"):
            half = (self.upper - self.lower) / 2
        size = np.where(np.isfinite(self.upper), np.abs(self.upper), np.abs(self.lower))
        unit = np.where(np.isfinite(size) & (size > 0), size, 1.0)
        self.scale = np.where(np.isfinite(half) & (half > 0), half, unit)

    def weights(self, values: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the weights, relative to the bounds, of values of shape (..., 6, joints) at instants (...,)."""
        velocity, acceleration = values[..., 1, :], values[..., ACCELERATION, :]
        ends = (times == self.stop)[..., None]
        slows = np.where(np.abs(velocity) > self.rest, velocity * acceleration < 0, ends)
        factors = np.ones_like(values)
        factors[..., ACCELERATION, :] = np.where(slows, self.slowing, self.speeding)
        return factors

    def sides(self, values: Any, index: Any = ...) -> tuple[Any, Any]:
        """Return the ratios of weighted values to the upper and to the lower bound, -inf if there is none."""
        upper, lower, scale = self.upper[index], self.lower[index], self.scale[index]
        return (values - upper + scale) / scale, (lower - values + scale) / scale

    def measure(self, values: np.ndarray, index: Any = ...) -> np.ndarray:
        """Return the measure whose maximum is the worst instant: the ratio, or the magnitude if there is no limit."""
        return np.where(self.limited[index], np.maximum(*self.sides(values, index)), np.abs(values))

    def or_infinite(
        self, infinite: Infinite, quantity: int, joint: int, time: float, value: float, weight: float
    ) -> tuple[float, float, float]:
        """Return the instant, value and weight of a quantity, or those of its first infinite value."""
        weights = self.weights(infinite.before, infinite.times)[:, quantity, joint]
        jumps = np.flatnonzero((infinite.signs[:, quantity, joint] != 0) & (weights > 0))
        if not len(jumps):
            return time, value, weight
        jump = jumps[0]
        value = np.copysign(np.inf, infinite.signs[jump, quantity, joint])
        return float(infinite.times[jump]), float(value), float(weights[jump])

    def shares(self, values: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the ratios with the sign of the nearer bound, NaN if there is no limit."""
        above, below = self.sides(values * self.weights(values, times))
        return np.where(self.limited, np.where(above >= below, np.maximum(above, 0), -np.maximum(below, 0)), np.nan)


def worst_instants(
    curves: Callable[[np.ndarray], np.ndarray],
    bounds: Any,
    grid: np.ndarray,
    values: np.ndarray,
    limited: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the worst instant of each limited curve, its value and its weight.

    Around each peak that may be the highest, a grid search is refined: the best of a few instants becomes the middle of
    a shorter interval, repeatedly. A jump between two instants is approached from the side with the worse value.

    Parameters
    ----------
    curves : callable
        Function from instants, (time,), to values, (time, quantities, joints).
    bounds : object
        Object with the methods `weights` and `measure` of `_Bounds`.
    grid, values
        Initial instants, and their values of `curves`.
    limited : array of shape (curves, 2)
        Quantity and joint of each curve.
    """
    columns = tuple(limited.T)
    weights = bounds.weights(values, grid)
    measures = bounds.measure(values * weights)[:, *columns]
    numbers = np.arange(len(limited))
    top_indices = np.argmax(measures, axis=0)
    times, sizes = grid[top_indices], measures[top_indices, numbers]
    maxima, weight = values[top_indices, *columns], weights[top_indices, *columns]
    peaks = local_maxima(measures)
    low, high = grid[np.maximum(peaks - 1, 0)], grid[np.minimum(peaks + 1, len(grid) - 1)]
    fractions = np.linspace(0.0, 1.0, POINTS)
    peak, curve = np.indices(low.shape)
    for _ in range(ROUNDS):
        trials = low + fractions[:, None, None] * (high - low)
        results = curves(trials.reshape(-1)).reshape(*trials.shape, *values.shape[1:])
        curve_values, weights = (x[:, peak, curve, *columns] for x in (results, bounds.weights(results, trials)))
        trial_measures = bounds.measure(curve_values * weights, columns)
        top = np.argmax(trial_measures, axis=0)
        chosen = np.argmax(np.max(trial_measures, axis=0), axis=0)  # of the peaks of each curve
        highest = (top[chosen, numbers], chosen, numbers)
        # otherwise keep the instant of the grid, a round number
        is_better = trial_measures[highest] > sizes + 1e-12 * np.abs(sizes)
        pairs = ((trial_measures, sizes), (trials, times), (curve_values, maxima), (weights, weight))
        sizes, times, maxima, weight = (np.where(is_better, x[highest], y) for x, y in pairs)
        low = np.take_along_axis(trials, np.maximum(top - 1, 0)[None], axis=0)[0]
        high = np.take_along_axis(trials, np.minimum(top + 1, POINTS - 1)[None], axis=0)[0]
    return times, maxima, weight


def _row(joint: Joint, bounds: _Bounds, entry: tuple[int, int], time: float, value: float, weight: float) -> LimitRow:
    word, unit = word_of(joint, entry[0])
    if not bounds.limited[entry]:
        return LimitRow(joint.name, word, unit, value, time)
    above, below = (float(x) for x in bounds.sides(np.array(value * weight), entry))
    limit = (bounds.upper if above >= below else bounds.lower)[entry] / (weight or 1.0)
    return LimitRow(joint.name, word, unit, value, time, float(limit), max(above, below, 0.0))


def _ends(
    followed: FollowedTrajectory,
    shared: SharedFollowers,
    values: Float[np.ndarray, "time derivative joint"],
    bounds: _Bounds,
    drives: bool,
) -> tuple[TrajectoryEnd, ...]:
    """Return the jumps at both ends of the trajectory, and the limits that they exceed."""
    robot, jumps = followed.robot, end_jumps(followed, values)
    if np.array_equal(jumps.before, jumps.after):
        return ends_of_jumps(robot.joint_names, jumps)
    infinite = shared.infinite(infinite_quantities(followed, jumps, drives), jumps)
    names = (*robot.joint_names, *shared.names)
    weights = bounds.weights(infinite.before, infinite.times)
    broken = (infinite.signs != 0) & (weights > 0) & bounds.limited
    return tuple(
        dataclasses.replace(
            end,
            breaks=tuple((names[j], word_of(robot.joints[names[j]], q)[0]) for j, q in np.argwhere(marks.T).tolist()),
        )
        for end, marks in zip(ends_of_jumps(robot.joint_names, jumps), broken, strict=True)
    )


def word_of(joint: Joint, quantity: int) -> tuple[str, str]:
    """Return the name of a quantity of a joint, and its unit."""
    field = FIELDS[quantity]
    word = field.replace("effort", "torque" if joint.turning else "force").replace("_", " ")
    return word, (TURNING if joint.turning else SLIDING)[field]


def _merged(robot: Robot, limits: Mapping[str, Limits] | Refused | None) -> dict[str, Limits]:
    if limits is not None and not isinstance(limits, Mapping):
        message = "must be a mapping of joints to Limits; of jn.planning.MotionLimits, give their `joints`"
        raise RobotError(message, name="limits", value=type(limits).__name__)
    new_limits = dict(limits or {})
    for name, entry in new_limits.items():
        if name not in robot.joint_names:
            raise RobotError(reason_not_movable(robot, name), name="limits", value=name)
        if not isinstance(entry, Limits):
            raise RobotError("must be Limits", name=f"limits.{name}", value=entry)
    return robot.limits_with(new_limits)


def fine_grid(trajectory: JointTrajectory, least: int = BETWEEN) -> Float[np.ndarray, " time"]:
    """Return the instants of a trajectory with its ends, and evenly spaced ones between each two."""
    instants = np.unique(np.concatenate([[trajectory.start], trajectory.times, [trajectory.stop]]))
    steps = max(least, -(-INSTANTS // (len(instants) - 1)))
    evenly_spaced = instants[:-1, None] + np.diff(instants)[:, None] * (np.arange(steps) / steps)
    return np.append(evenly_spaced.reshape(-1), instants[-1])


def instants_between(
    trajectory: JointTrajectory, order: int, changes: ArrayLike = ()
) -> tuple[Float[np.ndarray, " time"], Float[np.ndarray, " time"]]:
    """Return instants between those of a trajectory, and those that they are named by.

    A break of a derivative up to an order, and a change of a load, has an instant on each side.
    """
    first, last = float(trajectory.times[0]), float(trajectory.times[-1])
    breaks = law_breaks(trajectory.laws.values(), first, last, order)
    breaks = distinct_instants(np.append(breaks, changes), first, last)
    sides, indices = both_sides(breaks, first, last)
    grid = np.setdiff1d(fine_grid(trajectory, least=1), trajectory.times)
    grid = grid[(grid > first) & (grid < last)]
    return np.concatenate([sides, grid]), np.concatenate([breaks[indices], grid])


def _checked_times(times: ArrayLike) -> Float[np.ndarray, " time"]:
    instants = np.array(seconds("times", times, TrajectoryError))
    if instants.ndim != 1 or not instants.size or not np.isfinite(instants).all() or (np.diff(instants) <= 0).any():
        raise TrajectoryError(
            "must be finite instants that increase, at least one", name="times", value=instants.tolist()
        )
    return instants
