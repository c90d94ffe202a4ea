"""The check of a trajectory against limits of `check_limits`, of jounce, of points, and by position."""

import dataclasses
import warnings
from collections.abc import Mapping, Sequence

import numpy as np

from jounce.dynamics.limits.check_limits import FIELDS, check_limits, word_of
from jounce.dynamics.limits.limit_jumps import infinite_quantities, jumps_of
from jounce.dynamics.limits.limit_report import LimitReport, LimitRow
from jounce.dynamics.limits.local_maxima import local_maxima
from jounce.dynamics.limits.motion_ends import TrajectoryEnd, end_jumps
from jounce.dynamics.limits.trajectories import FollowedTrajectory
from jounce.errors import SampleWarning
from jounce.planning.paths.path import Path
from jounce.planning.retiming.quantities.limits import MotionLimits, limits_of
from jounce.planning.retiming.quantities.path_quantities import Curves
from jounce.planning.retiming.quantities.robot_quantities import RobotQuantities
from jounce.robot.algorithms.carried_loads import CarriedLoad
from jounce.robot.model.links_and_joints import Limits
from jounce.robot.robot import Robot
from jounce.trajectory import JointTrajectory
from jounce.trajectory.law_checks.breaks import at_breaks, distinct_instants, law_breaks, with_sides

EVEN = np.array([1.0, 0.0, 0.0, 0.0])  # z and its derivatives where the parameter is the time
ZOOM, ZOOMS = 9, 8
JOUNCE = 4  # highest derivative with limits
SMALL = 1e-9  # relative to the velocity of a point: a smaller jump is rounding

_PARTNERS = {"acceleration": "deceleration"}
_Infinite = Mapping[tuple[str, str], float]  # time at which a quantity of a joint is infinite, s


def check_motion(
    robot: Robot,
    trajectory: JointTrajectory,
    limits: MotionLimits,
    *,
    drives: bool = True,
    hand_over: bool = False,
    loads: Sequence[CarriedLoad] = (),
) -> LimitReport:
    """Compare a trajectory with limits of all kinds, as `check_limits` does with constant ones.

    Parameters
    ----------
    robot : Robot
        The robot, with its payload.
    trajectory : JointTrajectory
        The trajectory; joints without a law in it stand still.
    limits : MotionLimits
        Limits. Limits of jounce, of points, and limits that depend on the position have separate rows in the report.
    drives : bool, default True
        Whether torques contain armature inertia, damping and friction of the drives.
    hand_over : bool, default False
        Whether the robot already moves at the start of the trajectory, and still moves at its end.
    loads : sequence of CarriedLoad, optional
        Loads on links during parts of the motion, by time.

    Returns
    -------
    LimitReport
        The report; rows of limits that depend on the position replace rows without a limit.
    """
    given = limits_of(robot, limits)
    constant = {name: _without(entry, given.own(name)) for name, entry in given.joints.items()}
    report = check_limits(robot, trajectory, constant, drives=drives, hand_over=hand_over, loads=loads)
    infinite = {(row.joint, row.quantity): row.time for row in report.rows if row.infinite}
    joints = {  # what is judged by the constant limits is not judged here
        name: Limits(**{field: getattr(given.joints[name], field, None) for field in given.own(name) - {"jounce"}})
        for name in robot.joint_names
    }
    remaining = dataclasses.replace(given, joints=joints)
    if not (remaining.jounce or remaining.varying or remaining.points or remaining.backward):
        return report
    source = RobotQuantities(
        robot,
        Path(dict(trajectory.laws), trajectory.start, trajectory.stop),
        remaining,
        drives=drives,
        loads=loads,
    )
    added = _rows(source, trajectory, infinite)
    listed = {(row.joint, row.quantity) for row in added}
    rows = tuple(row for row in report.rows if (row.joint, row.quantity) not in listed)
    return dataclasses.replace(report, rows=(*rows, *added), ends=_ends(source, trajectory, report.ends, drives=drives))


def _ends(
    source: RobotQuantities, trajectory: JointTrajectory, ends: tuple[TrajectoryEnd, ...], *, drives: bool
) -> tuple[TrajectoryEnd, ...]:
    """Return the ends of a trajectory, whose violated limits include those of this check."""
    robot, limits, points = source.robot, source.limits, source.limits.points
    followed = FollowedTrajectory(robot, trajectory, given=False)
    jumps = end_jumps(followed, followed.coordinates(np.linspace(trajectory.start, trajectory.stop, 2001), 4))
    if np.array_equal(jumps.before, jumps.after):
        return ends
    signs = infinite_quantities(followed, jumps, drives).signs
    selected = []
    for k, end in enumerate(ends):
        broken = [
            (name, word_of(robot.joints[name], quantity)[0])
            for joint, name in enumerate(robot.joint_names)
            for quantity, field in enumerate(FIELDS)
            if signs[k, quantity, joint] and {field, _PARTNERS.get(field, field)} & limits.own(name)
        ]
        fourth = [(robot.joint_names[j], "jounce") for j in source.with_jounce if jumps.above(4)[k, j]]
        state = (jumps.after if end.end == "start" else jumps.before)[[k]]
        forced = [
            (p.link, "acceleration of the point")
            for p in points
            if p.acceleration and source.point(state, p)[:, 1].any()
        ]
        selected.append(dataclasses.replace(end, breaks=(*end.breaks, *broken, *fourth, *forced)))
    return tuple(selected)


def _without(limits: Limits, varying: frozenset[str]) -> Limits:
    """Return limits without those that depend on the position or the direction."""
    return dataclasses.replace(limits, **dict.fromkeys(varying - {"jounce"}))


def _rows(source: RobotQuantities, trajectory: JointTrajectory, infinite: _Infinite) -> list[LimitRow]:
    """Return the worst instants of quantities with limits that are not constant."""

    def ratios(times: np.ndarray) -> np.ndarray:
        return _curves(source, times).ratios(np.tile(EVEN[:, None], len(times)))

    ends = float(trajectory.start), float(trajectory.stop)
    breaks = law_breaks(trajectory.laws.values(), *ends, JOUNCE)
    breaks = distinct_instants(np.append(breaks, source.changes), *ends)
    grid = with_sides(np.unique(np.concatenate([trajectory.times, np.linspace(*ends, 2001)])), breaks)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        peak_ratios = ratios(grid)
        is_limited = peak_ratios.max(axis=0) > 0
        peaks, times = peak_ratios.max(axis=0), grid[np.argmax(peak_ratios, axis=0)]
        for indices in local_maxima(peak_ratios):
            low, high = grid[np.maximum(indices - 1, 0)], grid[np.minimum(indices + 1, len(grid) - 1)]
            columns = np.arange(peak_ratios.shape[1])
            for _ in range(ZOOMS):
                trials = low + np.linspace(0, 1, ZOOM)[:, None] * (high - low)
                results = ratios(trials.reshape(-1)).reshape(*trials.shape, -1)[:, columns, columns]
                top = np.argmax(results, axis=0)
                better = results[top, columns] > peaks * (1 + 1e-12)
                peaks, times = (
                    np.where(better, results[top, columns], peaks),
                    np.where(better, trials[top, columns], times),
                )
                low, high = trials[np.maximum(top - 1, 0), columns], trials[np.minimum(top + 1, ZOOM - 1), columns]
    values, bounds = _at_peaks(source, times)
    times = at_breaks(times, breaks, *ends)
    labels = source.labels.every
    infinite_times = np.array([infinite.get((label.owner, label.word), np.nan) for label in labels])
    infinite_times = np.where(np.isnan(infinite_times), _jumps(source, trajectory), infinite_times)
    jumped = np.isfinite(infinite_times)
    times, bounds = np.where(jumped, infinite_times, times), np.where(jumped, np.abs(bounds), bounds)
    values, peaks = (np.where(jumped, np.inf, x) for x in (values, peaks))
    return [
        LimitRow(
            labels[k].owner,
            labels[k].word,
            labels[k].unit,
            float(values[k]),
            float(times[k]),
            float(bounds[k]),
            float(peaks[k]),
        )
        for k in np.flatnonzero(is_limited | jumped)
        if np.isfinite(bounds[k])
    ]


def _jumps(source: RobotQuantities, trajectory: JointTrajectory) -> np.ndarray:
    """Return the first times of infinite jounce, and infinite speeds and accelerations of points, or NaN."""
    labels, points = source.labels, source.limits.points
    times = np.full(len(labels.every), np.nan)
    if not (points or source.with_jounce):
        return times
    followed = FollowedTrajectory(source.robot, trajectory, given=False)
    grid = np.linspace(trajectory.start, trajectory.stop, 2001)
    jumps = jumps_of(followed, grid, followed.coordinates(grid, 4))
    if not len(jumps.times):
        return times
    changes = [np.abs(source.point(jumps.after, p) - source.point(jumps.before, p))[:, :2].max(axis=-1) for p in points]
    sizes = [np.abs(source.point(jumps.after, p))[:, :2].max(axis=-1) for p in points]
    has_jumped = [change > SMALL * (size + change) for change, size in zip(changes, sizes, strict=True)]
    fast = [x[:, 0] for x, p in zip(has_jumped, points, strict=True) if p.speed is not None]
    forced = [x.any(axis=1) for x, p in zip(has_jumped, points, strict=True) if p.acceleration is not None]
    fourth = [x != 0 for x in jumps.above(4)[:, source.with_jounce].T]
    for quantity_index, stop in ((fast, len(labels.first)), (fourth, len(labels.every))):
        times[stop - len(quantity_index) : stop] = [_first(jumps.times, x) for x in quantity_index]
    stop = len(labels.every) - len(labels.fourth)
    times[stop - len(forced) : stop] = [_first(jumps.times, x) for x in forced]
    return times


def _first(times: np.ndarray, mask: np.ndarray) -> float:
    return float(times[np.argmax(mask)]) if mask.any() else np.nan


def _curves(source: RobotQuantities, times: np.ndarray) -> Curves:
    shape = np.zeros((5, len(times)))
    shape[0], shape[1] = times, 1.0
    return Curves(source(times), shape)


def _at_peaks(source: RobotQuantities, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the value of each curve at its own instant, and its bound with the sign of the value."""
    curves = _curves(source, times)
    arrays = curves.values(np.tile(EVEN[:, None], len(times)))
    values, (_, second, rates, *_), q = np.concatenate(arrays, axis=1), arrays, curves.quantities
    side = np.where(second / q.upper >= second / q.lower, q.upper, -q.lower)
    rates = np.where(rates >= 0, q.rate_upper, -q.rate_lower)
    bounds = np.concatenate([q.first_bounds, side, rates, q.vector_bounds, q.fourth_bounds], axis=1)
    value, bound = np.diagonal(values), np.diagonal(bounds)
    return value, np.where(value < 0, -bound, bound)
