"""Jumps at the ends of a trajectory: a joint that moves at an end jumps from rest, or to rest."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from jounce.dynamics.limits.limit_jumps import Jumps
from jounce.dynamics.limits.trajectories import FollowedTrajectory
from jounce.robot.robot import Robot
from jounce.trajectory import JointTrajectory, SplineMotion
from jounce.trajectory.law_checks.seen_jumps import level_sizes

ORDER = 3  # up to jerk
SMALL = 1e-6  # fraction of the size of a derivative: a smaller value is rest
LEAST = np.array([0.0, 1e-9, 1e-6, 1e-3])  # absolute thresholds of rest by order, rad or m by s^order
LOOKS = 201  # instants that show the sizes of derivatives
INSIDE = 1e-10  # fraction of the duration: distance of the additional instant from the stop
UNSUPPORTED = 0.5  # relative error of a derivative above which samples do not support it
SAFE = 3.0  # ratio to the estimated error: a smaller value is rest
SLOW, FAR = (
    0.02,
    4.0,
)  # fraction of the largest velocity, and standard deviations: less is rest for noisy samples
FITTED, PART = 12, 20  # samples of a fit at an end: at least this number, or one in so many
FEW = 2  # ratio of samples to degree below which the spline, not noise, determines the derivatives


@dataclasses.dataclass(frozen=True)
class TrajectoryEnd:
    """The first or the last instant of a trajectory, and the joints that move at it.

    Parameters
    ----------
    end : {"start", "stop"}
        Which end.
    time : float
        s.
    velocities, accelerations, jerks : dict of str to float
        Nonzero derivatives by joint: the heights of the jumps of a robot that rests before the start and after the
        stop; rad or m by s to the power of the order.
    breaks : tuple of (str, str)
        Joints, or links, with the limited quantities that such a jump makes infinite.

    Examples
    --------
    >>> import jounce as jn
    >>> pin = jn.Joint("pin", "base", "rod", limits=jn.Limits(velocity=2.0, acceleration=9.0))
    >>> robot = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", jn.Inertia(1.0))], [pin])
    >>> report = jn.check_limits(robot, jn.JointTrajectory({"pin": "t"}, start=0.0, stop=1.0))
    >>> report.ends[0].at_rest, report.ends[0].breaks, report.kept
    (False, (('pin', 'acceleration'),), False)
    """

    end: str
    time: float
    velocities: Mapping[str, float]
    accelerations: Mapping[str, float]
    jerks: Mapping[str, float]
    breaks: tuple[tuple[str, str], ...] = ()

    @property
    def at_rest(self) -> bool:
        """Whether velocities and accelerations vanish."""
        return not (self.velocities or self.accelerations)


def trajectory_ends(robot: Robot, trajectory: JointTrajectory) -> tuple[TrajectoryEnd, TrajectoryEnd]:
    """Return the jumps at the start and stop of a trajectory for a robot that rests before and after it.

    Parameters
    ----------
    robot : Robot
        The robot.
    trajectory : JointTrajectory
        Trajectory of some or all of its joints.

    Raises
    ------
    TrajectoryError
        If the robot does not have a joint of the trajectory, or a value is not finite.

    Examples
    --------
    >>> import jounce as jn
    >>> robot = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", jn.Inertia(1.0))], [jn.Joint("pin", "base", "rod")])
    >>> from jounce.dynamics import trajectory_ends
    >>> start, stop = trajectory_ends(robot, jn.JointTrajectory({"pin": "t - t**2/4"}, 0.0, 2.0))
    >>> dict(start.velocities), dict(stop.velocities), dict(stop.accelerations)
    ({'pin': 1.0}, {}, {'pin': -0.5})
    """
    followed = FollowedTrajectory(robot, trajectory)
    times = np.linspace(trajectory.start, trajectory.stop, LOOKS)
    return ends_of_jumps(robot.joint_names, end_jumps(followed, followed.coordinates(times, ORDER)))


def end_jumps(followed: FollowedTrajectory, values: Float[np.ndarray, "time derivative joint"]) -> Jumps:
    """Return the jumps from rest at the start of a trajectory, and to rest at its stop.

    Parameters
    ----------
    followed : FollowedTrajectory
        The robot on its trajectory.
    values : array of shape (time, derivative, joint)
        Coordinates and derivatives, at least to jerk, at many instants, which show their sizes.
    """
    trajectory, order = followed.trajectory, values.shape[1] - 1
    times = np.array([trajectory.start, trajectory.stop])
    offset = INSIDE * float(times[1] - times[0])
    *ends, last = followed.coordinates(np.append(times, times[1] - offset), order)
    sizes = level_sizes(values, float(times[1] - times[0]))
    floors = np.zeros(order + 1)
    floors[: len(LEAST)] = LEAST[: order + 1]
    tolerances = np.maximum(SMALL * sizes, floors[:, None])
    tolerances[:-1] = np.maximum(tolerances[:-1], 2 * offset * sizes[1:])
    tolerances = np.stack([tolerances, tolerances])
    duration = float(times[1] - times[0])
    # at its last instant a piecewise law, such as polynomials between points, may already be on its next piece
    ends = np.stack([ends[0], np.where(np.abs(ends[1] - last) > tolerances[1], last, ends[1])])
    for column, name in zip(followed.columns, trajectory.names, strict=True):
        law = trajectory.laws[name]
        if not isinstance(law, SplineMotion) or not law.samples.value:
            continue
        if len(law.samples.value[0]) <= FEW * law.degree + 1:
            continue
        errors = trajectory.estimate_error(order, [name])[:, 0]
        # the estimated errors are relative to peaks
        wave = np.ptp(values[:, 0, column]) / 2 * (2 * np.pi / duration) ** np.arange(order + 1)
        noise = np.where(errors > UNSUPPORTED, np.inf, SAFE * errors * np.maximum(sizes[:, column], wave))
        tolerances[:, :, column] = np.maximum(tolerances[:, :, column], noise)
        if noise[1] > SLOW * sizes[1, column]:
            for k, end in enumerate((1, -1)):
                speed, scatter = _fitted_speed(*(x[::end] for x in law.samples.value))
                ends[k, 1, column] = speed
                tolerances[k, 1, column] = max(FAR * scatter, SLOW * sizes[1, column])
    ends[:, 1:] = np.where(np.abs(ends) > tolerances, ends, 0.0)[:, 1:]
    rest_values = ends.copy()
    rest_values[:, 1:] = 0.0
    return Jumps(times, np.stack([rest_values[0], ends[1]]), np.stack([ends[0], rest_values[1]]))


def _fitted_speed(times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"]) -> tuple[float, float]:
    """Return the velocity at the first sample by a least-squares parabola, and its standard deviation."""
    count = min(len(times), max(FITTED, len(times) // PART))
    reach = times[count - 1] - times[0]
    table = np.vander((times[:count] - times[0]) / reach, 3, increasing=True)
    fitted, *_ = np.linalg.lstsq(table, values[:count], rcond=None)
    left = values[:count] - table @ fitted
    spread = np.linalg.inv(table.T @ table)[1, 1] * (left @ left) / max(count - 3, 1)
    return float(fitted[1] / reach), float(np.sqrt(spread) / abs(reach))


def ends_of_jumps(names: Sequence[str], jumps: Jumps) -> tuple[TrajectoryEnd, TrajectoryEnd]:
    """Return both ends of a trajectory from the jumps of its joints."""
    states = jumps.after[0], jumps.before[1]

    def nonzero(k: int, level: int) -> dict[str, float]:
        return {name: float(x) for name, x in zip(names, states[k][level], strict=True) if x}

    start, stop = (
        TrajectoryEnd(end, float(jumps.times[k]), nonzero(k, 1), nonzero(k, 2), nonzero(k, 3))
        for k, end in enumerate(("start", "stop"))
    )
    return start, stop
