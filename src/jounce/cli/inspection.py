"""The command that tells what is in a file before anything moves."""

from __future__ import annotations

from pathlib import Path

from jounce.cli.conversion import MECHANISMS, ROBOTS
from jounce.cli.mechanisms import loaded
from jounce.cli.writing import allowed
from jounce.errors import JounceError, did_you_mean
from jounce.io.terminal import say_json


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
    if suffix not in (*MECHANISMS, *ROBOTS) and not file.is_dir():
        message = f"the kind of a file is told by its ending; {did_you_mean(suffix, (*MECHANISMS, *ROBOTS))}"
        raise JounceError(message, path=file)
    if suffix in ROBOTS:
        if set_:
            raise JounceError("is for mechanism files; a robot file has no parameters", name="--set", path=file)
        from jounce.io.briefing import brief_robot as tell
        from jounce.io.robot_inspection import inspected_robot
        from jounce.io.robots import load_robot

        facts = inspected_robot(load_robot(file, strict=strict, allow=allowed(allow)), file)
    else:
        if strict:
            raise JounceError("is for robot files; mechanism files are always read so", name="--strict", path=file)
        from jounce.io.briefing import brief as tell
        from jounce.io.inspection import inspected

        mechanism = loaded(file, set_, import_, allow)
        try:
            facts = inspected(mechanism, file)
        except JounceError as error:
            raise error.located(path=file) from None
    if json:
        say_json("inspect", facts)
    else:
        tell(facts)
    return 0 if facts["ok"] else 1
