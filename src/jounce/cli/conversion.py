"""The command that turns a file into one of another format, and a robot into a mechanism file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jounce.cli.arguments import check_ending, named_once
from jounce.errors import JounceError
from jounce.io.kinds import expecting
from jounce.io.terminal import caution, say

MECHANISMS = (".yaml", ".yml", ".toml", ".json")
ROBOTS = (".urdf", ".xml")


def convert(
    source: Path,
    target: Path,
    /,
    *,
    drive: list[str] | None = None,
    start: list[str] | None = None,
    hold: bool = False,
    drives: bool = False,
    force: bool = False,
    import_: list[Path] | None = None,
) -> int:
    """Turn a mechanism file into another format, a robot into a mechanism.

    Mechanism files are YAML, TOML or JSON, robot files URDF or MJCF.

    Values keep their units and expressions; comments are lost. What is
    written is read back before it takes its place.

    Parameters
    ----------
    source
        Mechanism file, or robot file: .urdf or .xml.
    target
        Mechanism file to write: .yaml, .yml, .toml or .json.
    drive
        JOINT=LAW, a value or an expression of t; repeatable.
    start
        JOINT=VALUE with a unit, where a joint starts; repeatable.
    hold
        Hold the joints of a robot that are not driven.
    drives
        Take over damping and armature of a robot's drives.
    force
        Replace a file that is there.
    import_
        Python file with your own joints; repeatable.
    """
    from jounce.io.files import check_target
    from jounce.io.formats import SUFFIXES
    from jounce.io.templates import refuse_existing

    suffix = source.suffix.lower()
    with expecting(source, "mechanism", "robot"):
        check_ending(source, (*MECHANISMS, *ROBOTS))
    check_target(target, SUFFIXES, "mechanism file")
    refuse_existing(target, force=force)
    if suffix in ROBOTS:
        named_once(drive, "--drive")
        named_once(start, "--start")
        return _robot(source, target, drive, start, hold, drives)
    given = {"--drive": drive, "--start": start, "--hold": hold, "--drives": drives}
    for option, value in given.items():
        if value:
            raise JounceError("is for robots; a mechanism file keeps its drivers", name=option, path=source)
    return _mechanism(source, target, import_)


def _mechanism(source: Path, target: Path, imports: list[Path] | None) -> int:
    from jounce.io.conversion import converted
    from jounce.io.formats import dumped

    if imports:
        from jounce.io.own import import_file

        for path in imports:
            import_file(path)
    with expecting(source, "mechanism"):
        data = converted(source, target)
    _put(dumped(data, target.suffix.lower(), str(target)), target)
    say(f"Written to {target}")
    if source.suffix.lower() != ".json" and "#" in source.read_text(encoding="utf-8-sig"):
        caution(f"the comments of {source} are not in {target}")
    return 0


def _robot(
    source: Path, target: Path, drive: list[str] | None, start: list[str] | None, hold: bool, drives: bool
) -> int:
    from jounce.io.conversion import assigned, robot_mechanism, with_file_names
    from jounce.io.formats import dumped
    from jounce.io.robots import load_robot
    from jounce.io.writer import mechanism_data

    with expecting(source, "robot"):
        robot, renamed = with_file_names(load_robot(source))
    laws = assigned(robot, drive or (), "--drive", law=True)
    begin: dict[str, Any] = assigned(robot, start or (), "--start", law=False)
    try:
        mechanism = robot_mechanism(robot, begin, laws, hold=hold, drives=drives)
        data, _ = mechanism_data(mechanism, target.stem)
    except JounceError as error:
        raise error.located(path=source) from None
    _put(dumped(data, target.suffix.lower(), str(target)), target)
    driven = hold or len(laws) == len(robot.joint_names)
    following = [] if robot.closures else [f"jounce {'run' if driven else 'simulate'} {target}"]
    say(f"Written to {target}\n\nTry now:\n  " + "\n  ".join([f"jounce inspect {target}", *following]))
    for old, new in renamed.items():
        caution(f"'{old}' is called '{new}' in {target}, where names have letters, digits, _ and -")
    return 0


def _put(text: str, target: Path) -> None:
    """Write a file, and read it before it takes its place."""
    from jounce.io import load
    from jounce.io.files import replacing

    with replacing(target) as scratch:
        scratch.write_text(text, encoding="utf-8")
        try:
            load(scratch)
        except JounceError as error:
            error.path = str(target)
            raise
