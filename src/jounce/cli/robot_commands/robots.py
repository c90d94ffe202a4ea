"""The commands that compare a trajectory with the limits of a robot, and compute its torques."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from jounce.cli.file_kinds import explaining_other_kinds
from jounce.cli.options import (
    NO_TABLE,
    PLAIN_ROBOT,
    RobotReading,
    TableOutput,
    errors_about,
    print_result,
    spare_inputs,
    written,
)
from jounce.errors import JounceError, SampleWarning
from jounce.reporting.terminal import print_text, recorded_cautions, show_peaks, show_table

MOST_RATES = 28  # of torques: the highest derivative of a law is 30


def check(
    robot: Path,
    trajectory: Path,
    /,
    *,
    limits: Path | None = None,
    hand_over: bool = False,
    out: Path | None = None,
    deviation: str | None = None,
    reading: RobotReading = PLAIN_ROBOT,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    r"""Compare a trajectory with the limits of a robot, to torque rate.

    The exit status is 0 if all limits are satisfied, and 1 if one is
    violated, also by a jump from rest at the start or to rest at the stop.

    Parameters
    ----------
    robot
        Robot file: URDF (.urdf), MJCF (.xml) or SDF (.sdf).
    trajectory
        Samples (.csv), laws or a motion (.yaml, .toml, .json).
    limits
        File of limits, which override those of the robot file.
    hand_over
        The robot moves before the start and after the stop.
    out
        Draw each quantity as a share of its limit: .png, .svg or .pdf.
    deviation
        Smooth the samples first, within this deviation: 0.01deg.
    overwrite
        Let --out replace a file that is read here.
    json
        Print the result as JSON.

    Examples
    --------
      jounce check examples/robots/panda.urdf examples/trajectories/panda_good.csv
      jounce check examples/robots/panda.urdf \
        examples/trajectories/panda_pick.yaml --out pick.png \
        --limits examples/limits/franka_panda.yaml
      jounce check examples/robots/panda.urdf \
        examples/trajectories/panda_wave.yaml --payload "panda_hand=3 kg"
    """
    from jounce.io import load_motion_limits
    from jounce.planning.retiming.quantities.limits import limits_of
    from jounce.planning.retiming.quantities.motion_limits_check import check_motion
    from jounce.reporting.json.results import limits_result
    from jounce.reporting.text.summaries import limits_summary, verdict
    from jounce.reporting.text.tables import limits_table

    if out is not None:
        from jounce.plot import check_figure

        check_figure(out, overwrite=overwrite)
    model = reading.robot(robot, carries=True)
    loads = reading.loads(model)
    bounds = limits_of(model, None)
    if limits is not None:
        with explaining_other_kinds(limits, "limits"):
            bounds = load_motion_limits(limits, model)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SampleWarning)
        motion = _smoothed(reading.trajectory(trajectory, model), model, deviation, trajectory)
        with errors_about(trajectory, robot):
            spare_inputs(out, overwrite=overwrite)
            report = check_motion(model, motion, bounds, hand_over=hand_over, loads=loads)
    if report.worst is None:
        raise JounceError("there are no limits to compare with; give a file of limits with --limits", path=robot)
    if not json:
        print_text(limits_summary(report, motion, robot, trajectory))
        show_table(limits_table(report), "bold red")
    recorded_cautions(caught, json=json)
    if not json:
        print_text(f"\n{verdict(report)}")
    if out is not None:
        from jounce.plot import draw_limits, save

        written(lambda: save(draw_limits(report, f"{report.robot}: {trajectory.name}"), out, overwrite=overwrite))
    print_result("check", lambda: limits_result(report, robot, trajectory, out, motion), out, json=json)
    return 0 if report.kept else 1


def torques(
    robot: Path,
    trajectory: Path,
    /,
    *,
    rates: int = 2,
    no_drives: bool = False,
    deviation: str | None = None,
    reading: RobotReading = PLAIN_ROBOT,
    output: TableOutput = NO_TABLE,
) -> int:
    r"""Compute the joint torques of a trajectory, and their rates.

    The command prints the peaks at the instants of the trajectory, at
    2000 or more in total, and on both sides of jumps and kinks.

    Parameters
    ----------
    robot
        Robot file: URDF (.urdf), MJCF (.xml) or SDF (.sdf).
    trajectory
        Samples (.csv), laws or a motion (.yaml, .toml, .json).
    rates
        Highest rate of the torques, 0 to 28.
    no_drives
        Omit armature, damping and friction.
    deviation
        Smooth the samples first, within this deviation: 0.01deg.

    Examples
    --------
      jounce torques examples/robots/panda.urdf \
        examples/trajectories/panda_good.csv --rates 2 --out tau.csv
      jounce torques examples/robots/panda.urdf \
        examples/trajectories/panda_wave.yaml --payload "panda_hand=3 kg"
    """
    from jounce.dynamics.limits.motion_ends import trajectory_ends
    from jounce.dynamics.limits.trajectories import trajectory_torques
    from jounce.reporting.json.results import torques_result
    from jounce.reporting.peaks import table_peaks
    from jounce.reporting.text.summaries import torques_summary

    if not 0 <= rates <= MOST_RATES:
        raise JounceError(f"must be a whole number from 0 to {MOST_RATES}", name="--rates", value=rates)
    output.check()
    model = reading.robot(robot, carries=True)
    loads = reading.loads(model)
    motion = _smoothed(reading.trajectory(trajectory, model), model, deviation, trajectory)
    spare_inputs(output.out, overwrite=output.overwrite)
    with errors_about(trajectory, robot):
        dataset = trajectory_torques(model, motion, rates, drives=not no_drives, loads=loads)
        ends = trajectory_ends(model, motion)
        between = _torques_between(model, motion, rates, loads, drives=not no_drives)
    largest = table_peaks(dataset, between)
    if not output.json:
        print_text(
            "\n".join([torques_summary(dataset, motion, ends, robot, trajectory), *(load.words for load in loads)])
        )
        show_peaks(largest)
    output.write(lambda: dataset)
    output.tell("torques", lambda: torques_result(dataset, largest, motion, ends, (robot, trajectory), output.out))
    return 0


def _torques_between(robot: Any, motion: Any, rates: int, loads: Any, *, drives: bool) -> Any:
    """Return the torques between the instants of a motion: at both sides of breaks, and densely if there are few."""
    from jounce.dynamics.limits.check_limits import instants_between
    from jounce.dynamics.limits.trajectories import trajectory_torques
    from jounce.robot.algorithms.carried_loads import LoadedRobot

    times, named = instants_between(motion, rates + 2, LoadedRobot(robot, loads, motion.start, motion.stop).changes)
    if not len(times):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)  # the message covers all instants
        torques_there = trajectory_torques(robot, motion, rates, times=times, drives=drives, loads=loads)
    return torques_there.assign_coords(time=named)


def _smoothed(motion: Any, robot: Any, deviation: str | None, file: Path) -> Any:
    """Return a motion smoothed within a deviation, if one is given."""
    if deviation is None:
        return motion
    from jounce.cli.robot_commands.retiming import deviation_of
    from jounce.planning import smooth

    allowed = deviation_of(deviation, robot)
    with errors_about(file):
        return smooth(motion, allowed)
