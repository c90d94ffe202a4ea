"""The command that tells what is in a file before anything moves."""

from __future__ import annotations

from pathlib import Path

from jounce.cli.arguments import check_ending
from jounce.cli.conversion import MECHANISMS, ROBOTS
from jounce.cli.file_kinds import expecting
from jounce.cli.mechanisms import loaded
from jounce.cli.writing import allowed
from jounce.errors import JounceError
from jounce.reporting.summaries import start_heading, start_summary
from jounce.reporting.tables import bodies_table, mechanism_tables, robot_tables
from jounce.reporting.terminal import say, say_json, show_table


def inspect(
    file: Path,
    /,
    *,
    set_: list[str] | None = None,
    import_: list[Path] | None = None,
    strict: bool = False,
    allow: list[Path] | None = None,
    json: bool = False,
) -> int:
    """Tell what is in a mechanism or robot file, and whether it can move.

    Bodies, joints, degrees of freedom, and the assembly that a motion starts from.

    The exit status is 0 where a motion can start, 1 where the bodies
    cannot be put together, equations are redundant, or bodies without
    mass are left to move.

    Parameters
    ----------
    file
        Mechanism file, or robot file: .urdf or .xml.
    set_
        NAME=VALUE of a parameter, with a unit; repeatable.
    import_
        Python file with your own joints; repeatable.
    strict
        Refuse a robot whose links are as those of no real one.
    allow
        Folder whose files it may name, besides its own; repeatable.
    json
        Print the result as JSON.
    """
    suffix = file.suffix.lower()
    with expecting(file, "mechanism", "robot"):
        check_ending(file, (*MECHANISMS, *ROBOTS))
    if suffix in ROBOTS:
        if set_:
            raise JounceError("is for mechanism files; a robot file has no parameters", name="--set", path=file)
        from jounce.io.robots.loader import load_robot
        from jounce.reporting.robot_facts import inspected_robot

        with expecting(file, "robot"):
            facts = inspected_robot(load_robot(file, strict=strict, allow=allowed(allow)), file)
    else:
        if strict:
            raise JounceError("is for robot files; mechanism files are always read so", name="--strict", path=file)
        from jounce.reporting.mechanism_facts import inspected

        mechanism = loaded(file, set_, import_, allow)
        try:
            facts = inspected(mechanism, file)
        except JounceError as error:
            raise error.located(path=file) from None
    if json:
        say_json("inspect", facts)
    else:
        say(start_heading(facts))
        robot = facts["kind"] == "robot"
        for table in robot_tables(facts) if robot else mechanism_tables(facts, bodies_table(facts)):
            show_table(table)
        say(f"\n{start_summary(facts)}")
    return 0 if facts["ok"] else 1
