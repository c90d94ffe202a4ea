"""The command that finds the fastest motion along a path within the limits of a robot."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.cli.file_kinds import explaining_other_kinds
from jounce.cli.options import (
    NO_TABLE,
    PLAIN_ROBOT,
    RobotReading,
    TableOutput,
    allowed,
    errors_about,
    positive_quantity,
    spare_inputs,
    written,
)
from jounce.cli.robot_commands.joint_tables import joint_table
from jounce.cli.robot_commands.servo import frequency_of
from jounce.errors import JounceError, SampleWarning, UnitWarning, warn_caller
from jounce.io.files import DATA_FILES
from jounce.reporting.terminal import print_text, show_table

if TYPE_CHECKING:
    from jounce.mechanism import Mechanism
    from jounce.planning import RetimedTrajectory
    from jounce.robot import Robot

DOUBTFUL = 0.1  # rad or m: a larger deviation without a unit is likely in degrees or millimeters


def retime(
    file: Path,
    path: Path | None = None,
    /,
    *,
    limits: Path | None = None,
    repair: bool = False,
    hand_over: bool = False,
    rate: str = "1 kHz",
    order: int | None = None,
    cells: int | None = None,
    deviation: str | None = None,
    duration: str | None = None,
    running: Path | None = None,
    at: str | None = None,
    in_motion: bool = False,
    figure: Path | None = None,
    reading: RobotReading = PLAIN_ROBOT,
    output: TableOutput = NO_TABLE,
) -> int:
    r"""Find the fastest motion along a path within limits.

    Velocity, acceleration, jerk, jounce, torque and torque rate can be
    limited, and the motion of points of links. The written trajectory of
    a robot keeps the limits also when a controller interpolates it by
    splines. The path of a mechanism is that of its drivers' laws. This
    command needs Clarabel: pip install 'jounce[planning]'.

    Parameters
    ----------
    file
        Robot (.urdf, .xml, .sdf), or mechanism (.yaml, .toml, .json).
    path
        Waypoints or samples (.csv), expressions of s, laws (.yaml, ...).
    limits
        File of limits, which override those of the robot file.
    repair
        Keep the times of a trajectory, and slow it only as needed.
    hand_over
        Accept a trajectory that starts or stops in motion.
    rate
        Rate of the rows, such as 1kHz; a plain number is in Hz.
    order
        Highest continuous derivative [as the limits require].
    cells
        Pieces of the spline of the rate, 20 or more [160].
    deviation
        Largest distance of the path from straight lines between samples,
        such as 0.1deg; a plain number is in rad or m [0.001, or 0.001 of
        its size if less]. Without it, splines connect waypoints.
    duration
        Duration instead of the shortest one, such as 2.5s.
    running
        Trajectory that the robot follows now; start from its state at --at.
    at
        Instant of --running, such as 0.8s.
    in_motion
        Do not stop where loads change (--payload hand=3kg@0.8s:2s).
    figure
        Draw which limits are active when: .png, .svg or .pdf.

    Examples
    --------
      jounce retime examples/robots/panda.urdf \
        examples/trajectories/panda_too_fast.csv --out fast.csv \
        --limits examples/limits/franka_panda.yaml --figure fast.png
      jounce retime examples/robots/panda.urdf \
        examples/trajectories/panda_too_fast.csv --repair --out slow.csv \
        --limits examples/limits/franka_panda.yaml
      jounce retime examples/press.yaml --out stroke.csv \
        --limits examples/limits/press.yaml --figure stroke.png
    """
    output.check()
    if figure is not None:
        from jounce.plot import check_figure

        check_figure(figure, overwrite=output.overwrite)
    frequency = frequency_of(rate)
    settings: dict[str, Any] = {"order": order} | ({} if cells is None else {"cells": cells})
    settings |= {} if deviation is None else {"deviation": deviation_of(deviation)}
    settings |= {} if duration is None else {"duration": duration_of(duration)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        if (running is None) != (at is None):
            name, other = ("--at", "--running") if running is None else ("--running", "--at")
            raise JounceError(f"has no effect without {other}; give both", name=name)
        if running is not None and output.out is not None and duration is None:
            message = (
                "the rows of a motion that starts in motion cannot be slowed to whole periods; give its duration in s"
            )
            raise JounceError(message, name="--duration")
        if file.suffix.lower() in DATA_FILES:
            if running is not None:
                raise JounceError("is for robots; a mechanism starts at rest or with rates", name="--running")
            if in_motion:
                raise JounceError("belongs to robots; a mechanism has its masses in its file", name="--in-motion")
            if path is not None or repair or deviation is not None:
                name = "--repair" if repair else "path" if path is not None else "--deviation"
                raise JounceError("the path of a mechanism is that of its drivers, which is not repaired", name=name)
            result = _of_mechanism(file, limits, frequency, settings, reading)
        else:
            if path is None:
                raise JounceError("a robot needs a path; give its file", name="path")
            result = _of_robot(
                file,
                path,
                limits,
                frequency,
                settings | {"repair": repair, "hand_over": hand_over},
                reading,
                output,
                None if running is None or at is None else (running, instant_of(at)),
                deviation,
                moving=in_motion,
            )
    _write_result(result, (file, path), figure, output)
    return 0 if result.retimed.report.kept else 1


def deviation_of(text: str, robot: Robot | None = None) -> float:
    """Return the deviation in a text, an angle or a length, rad or m, with a UnitWarning if its unit is in doubt."""
    from jounce.units.dimensions import ANGLE, LENGTH

    allowed, noun = (ANGLE, LENGTH), "an angle or a length, such as 0.1deg or 1mm"
    moving_joints = () if robot is None else robot.moving_joints
    if moving_joints and all(joint.turning for joint in moving_joints):
        allowed, noun = (ANGLE,), "an angle, such as 0.1deg: all joints turn"
    elif moving_joints and all(joint.type == "prismatic" for joint in moving_joints):
        allowed, noun = (LENGTH,), "a length, such as 1mm: all joints slide"
    deviation = positive_quantity("--deviation", text, allowed, noun)
    if deviation >= DOUBTFUL and text.strip()[-1] in ".0123456789":
        units = " or ".join(unit for unit, dimension in (("rad", ANGLE), ("m", LENGTH)) if dimension in allowed)
        message = f"{deviation:g} {units}, since a number without a unit is in SI; write a unit, such as"
        smaller = " or ".join(f"{deviation:g}{'deg' if unit == 'rad' else 'mm'}" for unit in units.split(" or "))
        warn_caller(UnitWarning(f"--deviation: {message} {smaller}"))
    return deviation


def duration_of(text: str) -> float:
    """Return the duration in a text, s."""
    from jounce.units.dimensions import TIME

    return positive_quantity("--duration", text, (TIME,), "a time, such as 2.5s")


def instant_of(text: str) -> float:
    """Return the instant in a text, s, which may be zero."""
    from jounce.units.dimensions import TIME

    return (
        0.0 if text.strip() in ("0", "0s", "0 s") else positive_quantity("--at", text, (TIME,), "an instant, as 0.8s")
    )


def _state(model: Any, names: Any, running: tuple[Path, float], reading: RobotReading) -> Any:
    """Return positions, velocities and accelerations of the joints of a path on a running trajectory."""
    import numpy as np

    from jounce.units.instants import interval_text

    file, instant = running
    motion = reading.trajectory(file, model)
    for name in names:
        if name not in motion.names:
            raise JounceError("the running trajectory does not name this joint of the path", path=file, name=name)
    if not motion.start <= instant <= motion.stop:
        message = f"the running trajectory goes from {interval_text(motion.start, motion.stop)}"
        raise JounceError(message, path=file, name="--at", value=instant)
    values = motion.derivatives(np.array([instant]), 2)[0]
    return values[:, [motion.names.index(name) for name in names]]


@dataclasses.dataclass(frozen=True)
class _Result:
    system: Robot | Mechanism
    retimed: RetimedTrajectory
    free: float  # duration before it was fitted to rows, s
    before: float | None
    read: Any = None


def _of_mechanism(file: Path, limits: Path | None, rate: float, settings: Any, reading: RobotReading) -> _Result:
    from jounce.io import load, load_drive_limits
    from jounce.planning import retime as find

    with explaining_other_kinds(file, "mechanism"):
        mechanism = load(file, allow=allowed(reading.allow))
    if limits is None:
        raise JounceError("a mechanism has no limits of its own; give a file of limits with --limits", path=file)
    bounds = load_drive_limits(limits, mechanism)
    with errors_about(file):
        retimed = find(mechanism, None, bounds, **settings)
    from jounce.mechanism import TimeGrid, time_grid

    retimed.times = time_grid(TimeGrid(0.0, retimed.stop, 1 / rate), {})
    return _Result(mechanism, retimed, retimed.stop, retimed.path.stop - retimed.path.start)


def _of_robot(
    file: Path,
    path: Path,
    limits: Path | None,
    rate: float,
    settings: Any,
    reading: RobotReading,
    output: TableOutput,
    running: tuple[Path, float] | None,
    deviation: str | None,
    *,
    moving: bool,
) -> _Result:
    from jounce.io import load_motion_limits, load_path
    from jounce.planning import retime as find
    from jounce.planning.retiming.quantities.limits import limits_of
    from jounce.trajectory import JointTrajectory

    model = reading.robot(file, carries=True)
    if deviation is not None:
        settings = settings | {"deviation": deviation_of(deviation, model)}
    settings = settings | {"loads": reading.loads(model, moving=moving)}
    if moving and not settings["loads"]:
        raise JounceError(
            "says nothing without loads that change; give --payload LINK=MASS@FROM:TO", name="--in-motion"
        )
    bounds = limits_of(model, None)
    if limits is not None:
        with explaining_other_kinds(limits, "limits"):
            bounds = load_motion_limits(limits, model)
    with explaining_other_kinds(path, "trajectory"):
        given = load_path(
            path, reading.degree, allowed(reading.allow), topic=reading.topic, robot=model, only=reading.chosen
        )
    if running is not None:
        settings = settings | {"state": _state(model, given.names, running, reading)}
    spare_inputs(output.out, overwrite=output.overwrite)
    with errors_about(path, file):
        retimed = find(model, given, bounds, **settings)
        free, read = retimed.stop, None
        if output.out is not None:
            retimed, read = _at_rate(model, retimed, bounds, rate, reading.degree, "duration" in settings)
    before = given.stop - given.start if isinstance(given, JointTrajectory) else None
    return _Result(model, retimed, free, before, read)


def _write_result(result: _Result, files: tuple[Path, Path | None], figure: Path | None, output: TableOutput) -> None:
    """Print, draw and write the result of a retiming."""
    from jounce.reporting.retiming_facts import binding_table, retimed_words, retiming_result

    retimed = result.retimed
    for file in (output.out, figure):
        spare_inputs(file, overwrite=output.overwrite)
    if not output.json:
        names = [file.name for file in files if file is not None]
        print_text(retimed_words(retimed, result.before, result.free, names, result.read))
        table = binding_table(retimed)
        if table.rows:
            show_table(table)
        else:
            print_text("\nno limit binds")
    output.write(lambda: joint_table(result.system, retimed, retimed.times, retimed.report.robot))
    if figure is not None:
        from jounce.plot import save
        from jounce.plot.charts.retiming import draw_retiming

        title = f"{retimed.report.robot}: {files[1].name}" if files[1] is not None else retimed.report.robot
        written(lambda: save(draw_retiming(retimed, title), figure, overwrite=output.overwrite))
    written_files = (output.out, figure)
    output.tell("retime", lambda: retiming_result(retimed, result.before, result.free, files, written_files))


def _at_rate(
    model: Any, retimed: RetimedTrajectory, bounds: Any, rate: float, degree: int, lasting: bool
) -> tuple[Any, Any]:
    """Return the trajectory in whole periods of a rate, with limits kept by splines through its rows."""
    from jounce.planning.retiming.sampling import fit_to_samples

    try:
        return fit_to_samples(model, retimed, bounds, rate, degree=degree, lasting=lasting)
    except JounceError as error:
        raise error.located(name="--rate") from None
