"""The command that fits a smooth motion within a deviation of noisy samples."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.cli.options import NO_TABLE, PLAIN_ROBOT, RobotReading, TableOutput, errors_about, spare_inputs, written
from jounce.cli.robot_commands.joint_tables import joint_table
from jounce.cli.robot_commands.retiming import deviation_of
from jounce.cli.robot_commands.servo import frequency_of
from jounce.errors import SampleWarning
from jounce.reporting.terminal import print_text, show_table

if TYPE_CHECKING:
    from jounce.robot import Robot
    from jounce.trajectory import JointTrajectory

BLOCK = 50_000  # rows per part


def smooth(
    robot: Path,
    trajectory: Path,
    /,
    *,
    deviation: str,
    rate: str = "1kHz",
    figure: Path | None = None,
    reading: RobotReading = PLAIN_ROBOT,
    output: TableOutput = NO_TABLE,
) -> int:
    r"""Fit a smooth motion to noisy samples within a deviation.

    Its derivatives to the sixth are continuous, it stands still where the
    samples do, and its jerk is that of the motion, not of the noise. With
    --out, positions to jerk are written. It needs Clarabel: pip install
    'jounce[planning]'.

    Parameters
    ----------
    robot
        Robot file: URDF (.urdf), MJCF (.xml) or SDF (.sdf).
    trajectory
        A log: samples (.csv), joint states (.yaml), a bag.
    deviation
        Largest distance from a sample, such as 0.01deg; else in rad or m.
    rate
        Rate of the rows, such as 1kHz; a plain number is in Hz.
    figure
        Draw distances from the samples, and jerk: .png, .svg or .pdf.

    Examples
    --------
      jounce smooth examples/robots/panda.urdf \
        examples/trajectories/panda_good.csv --deviation 0.001deg \
        --out smooth.csv --figure smooth.png
    """
    from jounce.mechanism import TimeGrid, time_grid
    from jounce.planning import smooth as find
    from jounce.reporting.smoothing_facts import smoothing_result, smoothing_table
    from jounce.units.instants import interval_text

    output.check()
    if figure is not None:
        from jounce.plot import check_figure

        check_figure(figure, overwrite=output.overwrite)
    frequency, allowed = frequency_of(rate), deviation_of(deviation)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        model = reading.robot(robot)
        allowed = deviation_of(deviation, model)
        given = reading.trajectory(trajectory, model, samples=True)
        for file in (output.out, figure):
            spare_inputs(file, overwrite=output.overwrite)
        with errors_about(trajectory, robot):
            motion = find(given, allowed)
    times = time_grid(TimeGrid(motion.start, motion.stop, 1 / frequency), {})
    if not output.json:
        rows = "" if output.out is None else f"{len(times)} rows "
        print_text(
            f"{rows}from {interval_text(motion.start, motion.stop)}, within {allowed:.3g} rad or m of each sample"
        )
        show_table(smoothing_table(motion))
        print_text("\nDerivatives above the jerk, and second torque rates with them, are not known.")
    if output.out is not None:
        output.write_parts(_parts(model, motion, times), len(times))
    if figure is not None:
        from jounce.plot import save
        from jounce.plot.charts.smoothing import draw_smoothing

        drawing = draw_smoothing(given, motion, f"{trajectory.name} within {allowed:.3g} rad or m")
        written(lambda: save(drawing, figure, overwrite=output.overwrite))
    files = (output.out, figure)
    output.tell("smooth", lambda: smoothing_result(motion, (robot, trajectory), len(times), files))
    return 0


def _parts(model: Robot, motion: JointTrajectory, times: Any) -> Iterator[Any]:
    """Yield the positions of the joints and their derivatives to jerk, in parts along time."""
    for first in range(0, len(times), BLOCK):
        yield joint_table(model, motion, times[first : first + BLOCK])
