"""Samples of retimed trajectories for a controller: whole periods, and splines through samples within the limits."""

import dataclasses
import warnings

import numpy as np

from jounce.dynamics.limits.limit_report import LimitReport
from jounce.errors import SampleWarning, TrajectoryError
from jounce.planning.retiming.quantities.limits import MotionLimits
from jounce.planning.retiming.quantities.motion_limits_check import check_motion
from jounce.planning.retiming.retimed import RetimedTrajectory
from jounce.robot.robot import Robot
from jounce.trajectory import JointTrajectory

WHOLE = 1e-9  # fraction of a period
ATTEMPTS = 12
LEAST = 11  # samples


def fit_to_samples(
    robot: Robot,
    trajectory: RetimedTrajectory,
    limits: MotionLimits,
    rate: float,
    *,
    degree: int = 5,
    lasting: bool = False,
) -> tuple[RetimedTrajectory, LimitReport]:
    """Return a trajectory slowed to whole periods, and until splines through its samples keep the limits as well.

    Between samples, such splines swing by about a percent at 1 kHz where a limited derivative bends.

    Parameters
    ----------
    robot : Robot
        The robot, with its payload.
    trajectory : RetimedTrajectory
        Trajectory from `retime`.
    limits : MotionLimits
        Limits of the trajectory.
    rate : float
        Samples per second.
    degree : int, default 5
        Degree of the splines that a reader puts through the samples.
    lasting : bool, default False
        Whether to keep the duration.

    Returns
    -------
    RetimedTrajectory
        The trajectory, with the instants of the samples as `times`.
    LimitReport
        Report of the splines through the samples.

    Raises
    ------
    TrajectoryError
        If the rate gives too few samples, the splines exceed the limits at any speed tried, or a kept duration is not a
        whole number of periods.
    """
    period, hand_over = 1 / rate, trajectory.report.hand_over
    if trajectory.stop < LEAST * period:
        raise TrajectoryError(f"gives fewer than {LEAST} samples in {trajectory.stop:g} s; choose more", value=rate)
    is_whole = abs(trajectory.stop / period - round(trajectory.stop / period)) <= WHOLE * trajectory.stop / period
    if lasting and not is_whole:
        message = f"{trajectory.stop:.9g} s are not a number of whole periods; choose another rate, or duration"
        raise TrajectoryError(message, value=rate)
    slowed = 1.0
    note = ""
    for _ in range(1 if lasting else ATTEMPTS):
        periods = round(trajectory.stop / period) if lasting else np.ceil(slowed * trajectory.stop / period - WHOLE)
        slower = trajectory.slower(periods * period / trajectory.stop)
        times = np.linspace(0.0, slower.stop, int(periods) + 1)
        slower.times = times
        positions = slower.derivatives(times, 0)[:, 0]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SampleWarning)
            sampled = JointTrajectory.from_samples(times, positions, slower.names, degree)
            report = checked = check_motion(robot, sampled, limits, hand_over=hand_over, loads=slower.loads)
        if report.kept:
            checked = check_motion(robot, slower, limits, hand_over=True, loads=slower.loads)
            if checked.kept:
                slower.report = dataclasses.replace(checked, ends=trajectory.report.ends, hand_over=hand_over)
                return slower, report
        excess = max((checked.worst.ratio or 1.0) if checked.worst else 1.0, 1.0) - 1
        note = "" if checked.worst is None else f" of the {checked.worst.quantity} of {checked.worst.joint}"
        slowed = max(slowed, float(periods) * period / trajectory.stop) * (1 + min(excess / 2, 0.05)) + period / 10
    message = (
        f"splines of degree {degree} through samples at this rate break the limit{note}; "
        f"choose a higher rate, or a smoother motion (order){', or a longer duration' if lasting else ''}"
    )
    raise TrajectoryError(message, value=rate)
