"""The commands for robots: a trajectory compared with limits, and the torques that it needs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jounce.cli.file_kinds import expecting
from jounce.cli.writing import allowed, spared, written
from jounce.errors import JounceError, RobotError, SampleWarning
from jounce.reporting.summaries import limits_summary, torques_summary, verdict
from jounce.reporting.tables import limits_table
from jounce.reporting.terminal import caution, say, say_json, show_peaks, show_table

MOST_RATES = 28  # of torques: the highest derivative of a law is 30


def check(
    robot: Path,
    trajectory: Path,
    /,
    *,
    limits: Path | None = None,
    out: Path | None = None,
    payload: list[str] | None = None,
    degree: int = 5,
    strict: bool = False,
    allow: list[Path] | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Compare a trajectory with the limits of a robot, to torque rate.

    The exit status is 0 where all limits are kept, 1 where one is broken.

    Parameters
    ----------
    robot
        Robot file: URDF (.urdf) or MJCF (.xml).
    trajectory
        Samples (.csv), laws or a motion (.yaml, .toml, .json).
    limits
        File of limits, which go before those of the robot file.
    out
        Draw the joints' shares of their limits: .png, .svg or .pdf.
    payload
        LINK=MASS with a unit, held in its origin; repeatable.
    degree
        Of the splines through samples, odd from 3 to 11.
    strict
        Refuse a robot whose links are as those of no real one.
    allow
        Folder whose files it may name, besides its own; repeatable.
    overwrite
        Let --out replace a file that is read here.
    json
        Print the result as JSON.
    """
    import warnings

    from jounce.dynamics.limits import check_limits
    from jounce.io.robots.loader import load_robot
    from jounce.io.robots.trajectories import load_trajectory

    if out is not None:
        from jounce.plot import check_figure

        check_figure(out, overwrite=overwrite)
    with expecting(robot, "robot"):
        model = load_robot(robot, strict=strict, allow=allowed(allow))
    laid = _laid_down(limits, model)
    if payload:
        from jounce.io.robots.payloads import with_payloads

        model = with_payloads(model, payload)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SampleWarning)
        with expecting(trajectory, "trajectory"):
            motion = load_trajectory(trajectory, degree, allowed(allow))
        try:
            spared(out, overwrite)
            report = check_limits(model, motion, laid)
        except RobotError as error:
            raise error.located(path=robot) from None
        except JounceError as error:
            raise error.located(path=trajectory) from None
    if report.worst is None:
        raise JounceError("there are no limits to compare with; give a file of limits with --limits", path=robot)
    if not json:
        say(limits_summary(report, motion, robot, trajectory))
        show_table(limits_table(report), "bold red")
    for warning in caught:
        caution(warning.message, json=json)
    if not json:
        say(f"\n{verdict(report)}")
    if out is not None:
        from jounce.plot import draw_limits, save

        written(lambda: save(draw_limits(report, f"{report.robot}: {trajectory.name}"), out, overwrite=overwrite))
    if json:
        from jounce.reporting.records import limits_record

        say_json("check", limits_record(report, robot, trajectory, out))
    elif out is not None:
        say(f"\nWritten to {out}")
    return 0 if report.kept else 1


def torques(
    robot: Path,
    trajectory: Path,
    /,
    *,
    rates: int = 2,
    out: Path | None = None,
    payload: list[str] | None = None,
    degree: int = 5,
    no_drives: bool = False,
    strict: bool = False,
    allow: list[Path] | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Compute the joint torques of a trajectory, and their rates.

    Printed are the peaks at the instants of the trajectory.

    Parameters
    ----------
    robot
        Robot file: URDF (.urdf) or MJCF (.xml).
    trajectory
        Samples (.csv), laws or a motion (.yaml, .toml, .json).
    rates
        Highest rate of the torques, 0 to 28.
    out
        Write all values to this .csv or .nc (NetCDF) file.
    payload
        LINK=MASS with a unit, held in its origin; repeatable.
    degree
        Of the splines through samples, odd from 3 to 11.
    no_drives
        Leave out armature, damping and friction.
    strict
        Refuse a robot whose links are as those of no real one.
    allow
        Folder whose files it may name, besides its own; repeatable.
    overwrite
        Let --out replace a file that is read here.
    json
        Print the result as JSON.
    """
    from jounce import io
    from jounce.dynamics.trajectories import trajectory_torques
    from jounce.io.robots.loader import load_robot
    from jounce.io.robots.trajectories import load_trajectory
    from jounce.reporting.peaks import table_peaks

    if not 0 <= rates <= MOST_RATES:
        raise JounceError(f"must be a whole number from 0 to {MOST_RATES}", name="--rates", value=rates)
    if out is not None:
        io.check_writable(out, overwrite=overwrite)
    with expecting(robot, "robot"):
        model = load_robot(robot, strict=strict, allow=allowed(allow))
    if payload:
        from jounce.io.robots.payloads import with_payloads

        model = with_payloads(model, payload)
    with expecting(trajectory, "trajectory"):
        motion = load_trajectory(trajectory, degree, allowed(allow))
    spared(out, overwrite)
    try:
        found = trajectory_torques(model, motion, rates, drives=not no_drives)
    except RobotError as error:
        raise error.located(path=robot) from None
    except JounceError as error:
        raise error.located(path=trajectory) from None
    if not json:
        say(torques_summary(found, motion, robot, trajectory))
        show_peaks(table_peaks(found))
    if out is not None:
        written(lambda: io.write(found, out, overwrite=overwrite))
    if json:
        from jounce.reporting.records import torques_record

        say_json("torques", torques_record(found, motion, robot, trajectory, out))
    elif out is not None:
        say(f"\nWritten to {out}")
    return 0


def _laid_down(limits: Path | None, model: Any) -> Any:
    """Return the limits of a file, None without one."""
    from jounce.io.robots.limits import load_limits

    if limits is None:
        return None
    with expecting(limits, "limits"):
        return load_limits(limits, model)
