"""The command for elastic joints: motor motions and torques that move links behind springs as prescribed."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from jounce.cli.file_kinds import explaining_other_kinds, kind_of
from jounce.cli.options import (
    NO_TABLE,
    PLAIN_ROBOT,
    MechanismReading,
    RobotReading,
    TableOutput,
    errors_about,
    spare_inputs,
    written,
)
from jounce.errors import JounceError, SampleWarning
from jounce.reporting.terminal import print_text, recorded_cautions, show_table

MOST_RATES = 24  # of torques of motors
ROBOTS = (".urdf", ".xml", ".sdf")


def feedforward(
    file: Path,
    trajectory: Path | None = None,
    /,
    *,
    drives: Path,
    rates: int = 0,
    no_losses: bool = False,
    simulate: bool = False,
    figure: Path | None = None,
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
    reading: RobotReading = PLAIN_ROBOT,
    output: TableOutput = NO_TABLE,
) -> int:
    r"""Compute the motor motion and torque for links behind springs.

    The links follow the given motion exactly. The exit status is 0 if
    all limits of the drives are satisfied, and 1 if one is violated.

    Parameters
    ----------
    file
        Robot file: .urdf, .xml or .sdf; or mechanism file with masses.
    trajectory
        Motion of a robot: samples (.csv) or laws (.yaml, .toml, .json).
    drives
        File of springs, gears and rotors.
    rates
        Highest rate of the motor torques, 0 to 24.
    no_losses
        Omit damping and friction of the robot file.
    simulate
        Simulate the system with its springs, and print link errors.
    figure
        Draw deflections and simulated errors: .png, .svg or .pdf.
    set_
        NAME=VALUE of a parameter of a mechanism, with a unit; repeatable.

    Examples
    --------
      jounce feedforward examples/robots/panda.urdf \
        examples/trajectories/panda_wave.yaml \
        --drives examples/drives/panda.yaml --out ff.csv
      jounce feedforward examples/sea_platform.yaml \
        --drives examples/drives/sea_platform.yaml --out motors.csv
    """
    from jounce.io import load_drives
    from jounce.planning import feedforward as computed
    from jounce.planning.elastic.link_errors import link_errors
    from jounce.reporting.facts import feedforward_facts as facts

    if not 0 <= rates <= MOST_RATES:
        raise JounceError(f"must be a whole number from 0 to {MOST_RATES}", name="--rates", value=rates)
    output.check()
    if figure is not None:
        from jounce.plot import check_figure

        check_figure(figure, overwrite=output.overwrite)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SampleWarning)
        system, motion = _driven(file, trajectory, set_, reading)
        springs = load_drives(drives, system)
        for target in (output.out, figure):
            spare_inputs(target, overwrite=output.overwrite)
        with errors_about(file if trajectory is None else trajectory, file):
            result = computed(system, motion, springs, rates=rates, losses=not no_losses)
            report = result.report
            errors = link_errors(result) if simulate or figure is not None else None
    if not output.json:
        print_text(facts.feedforward_words(result, getattr(result.system, "resting_joints", {})))
        show_table(facts.drives_table(report), "bold red")
        if (table := facts.expansion_table(result)) is not None:
            show_table(table)
    recorded_cautions(caught, json=output.json)
    if not output.json:
        print_text(f"\n{facts.drives_verdict(report)}")
        if errors is not None:
            print_text(f"\n{facts.link_error_words(errors)}")
    if figure is not None and errors is not None:
        from jounce.plot import draw_feedforward, save

        drawing = draw_feedforward(result, errors)
        written(lambda: save(drawing, figure, overwrite=output.overwrite))
    output.write(lambda: result.dataset)
    output.tell("feedforward", lambda: facts.feedforward_result(result, file, trajectory, errors, output.out))
    return 0 if report.kept else 1


def _driven(file: Path, trajectory: Path | None, changes: list[str] | None, reading: RobotReading) -> tuple[Any, Any]:
    """Return a robot and its trajectory, or a mechanism and None."""
    if file.suffix.lower() in ROBOTS:
        if changes:
            raise JounceError("belongs to mechanisms; a robot file has no parameters", name="--set", value=changes[0])
        if trajectory is None:
            raise JounceError(
                "a robot needs a trajectory: jounce feedforward ROBOT TRAJECTORY --drives FILE", path=file
            )
        robot = reading.robot(file)
        return robot, reading.trajectory(trajectory, robot)
    if trajectory is not None:
        if kind_of(file) == "mechanism":
            raise JounceError("is a mechanism, which its own drivers move; leave the trajectory out", path=file)
        with explaining_other_kinds(file, "robot"):
            reading.robot(file)  # raises the error that names the kind of the file
    if reading.payload:
        raise JounceError("belongs to robots; a mechanism has its masses in its file", name="--payload")
    return MechanismReading(set_=changes, allow=reading.allow).mechanism(file), None
