"""The command that prints the contents of a file and its start."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from jounce.cli.arguments import check_ending
from jounce.cli.file_kinds import explaining_other_kinds
from jounce.cli.options import PLAIN_MECHANISM, MechanismReading, RobotReading, errors_about, options_named
from jounce.errors import JounceError
from jounce.io.files import DATA_FILES, ROBOT_FILES
from jounce.reporting.terminal import print_text, say_json, show_table


def inspect(
    file: Path,
    /,
    *,
    reading: MechanismReading = PLAIN_MECHANISM,
    strict: bool = False,
    json: bool = False,
    range_: Annotated[bool, Parameter(name="--range")] = False,
    driver: str | None = None,
    as_: Annotated[str | None, Parameter(name="--as")] = None,
    model: str | None = None,
    closures: Path | None = None,
) -> int:
    """Print what a mechanism or robot file contains, and if it can move.

    The command lists bodies, joints, degrees of freedom, the assembly at
    the start, and redundant constraints: which joint repeats equations of
    which others.

    The exit status is 0 if a motion can start, and 1 if the bodies cannot
    be assembled, the start is a singular position, or bodies without mass
    are free to move.

    Parameters
    ----------
    file
        Mechanism file, or robot file: .urdf, .xml or .sdf.
    strict
        Refuse a robot whose inertias no real body can have.
    json
        Print the result as JSON.
    range_
        Print the range of a driver, and the transmission at its ends.
    driver
        Driver of the range, if there are several.
    as_
        Show how another program numbers the coordinates of a robot file:
        pinocchio, mujoco, drake, pybullet or yourdfpy.
    model
        Model to read from an SDF file with several.
    closures
        File with loops, springs and rotors to add to the robot.

    Examples
    --------
      jounce inspect examples/six_bar_watt.yaml
      jounce inspect examples/four_bar.yaml --range
      jounce inspect examples/robots/panda.urdf --json
      jounce inspect examples/robots/solo12.urdf --as pinocchio
    """
    from jounce.reporting.text.summaries import start_heading, start_summary
    from jounce.reporting.text.tables import bodies_table, mechanism_tables, robot_tables

    with explaining_other_kinds(file, "mechanism", "robot"):
        check_ending(file, (*DATA_FILES, *ROBOT_FILES))
    if file.suffix.lower() in ROBOT_FILES:
        robot = RobotReading(strict=strict, allow=reading.allow, model=model, closures=closures)
        facts = _robot(file, reading, robot, as_)
    else:
        given_options = {"--strict": strict or None, "--as": as_, "--model": model, "--closures": closures}
        for name, given in given_options.items():
            if given is not None:
                raise JounceError("is for robot files", name=name, path=file)
        facts = _mechanism(file, reading, driver, range_=range_)
    if json:
        say_json("inspect", facts)
    else:
        print_text(start_heading(facts))
        of_robot = facts["kind"] == "robot"
        for table in robot_tables(facts) if of_robot else mechanism_tables(facts, bodies_table(facts)):
            show_table(table)
        if "other_reader" in facts:
            _show_other_reader(facts["other_reader"])
        print_text(f"\n{start_summary(facts)}")
        if range_found := facts.get("range"):
            from jounce.reporting.facts.mechanism.range_facts import range_words

            print_text(f"\n{range_words(dict(range_found))}")
    return 0 if facts["ok"] else 1


def _robot(file: Path, reading: MechanismReading, of_robot: RobotReading, reader: str | None) -> dict[str, Any]:
    """Return the facts of a robot file, and the numbering of its coordinates by another program."""
    reading.refuse_times(file)
    if reading.set_:
        raise JounceError("is for mechanism files; a robot file has no parameters", name="--set", path=file)
    if reading.units:
        raise JounceError("is for mechanism files; results for robots are in SI units", name="--units", path=file)
    from jounce.reporting.facts.robot_facts import inspected_robot, other_reader

    robot = of_robot.robot(file)
    facts = inspected_robot(robot, file)
    if reader is not None:
        try:
            facts["other_reader"] = other_reader(reader, file, robot)
        except JounceError as error:
            error.name = "--as" if error.name == "reader" else error.name
            raise
    return facts


def _mechanism(file: Path, reading: MechanismReading, driver: str | None, *, range_: bool) -> dict[str, Any]:
    """Return the facts of a mechanism file, and the range of a driver."""
    from jounce.reporting.facts.mechanism.mechanism_facts import inspected

    mechanism = reading.mechanism(file)
    with errors_about(file):
        facts: dict[str, Any] = inspected(mechanism, file)
        if range_ and facts["ok"]:
            from jounce.reporting.facts.mechanism.range_facts import range_facts

            with options_named():
                facts["range"] = range_facts(mechanism, driver)
    return facts


def _show_other_reader(facts: dict[str, Any]) -> None:
    from jounce.reporting.text.tables import other_reader_table

    show_table(other_reader_table(facts))
    if facts["indices"] is not None:
        is_identity = all(factor == 1 for factor in facts["factors"])
        times = "" if is_identity else f"{[round(x, 12) for x in facts['factors']]} * "
        print_text(f"\n  velocities of {facts['name']} = {times}ours[{facts['indices']}]")
    if facts["note"]:
        print_text(f"\n  {facts['note']}")
