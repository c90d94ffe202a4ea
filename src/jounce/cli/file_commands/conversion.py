"""The command that converts a mechanism file to another format, and a robot to a mechanism file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.cli.arguments import check_ending
from jounce.cli.file_kinds import explaining_other_kinds
from jounce.cli.options import Overwrite, RobotReading, allowed, errors_about, import_files
from jounce.errors import JounceError
from jounce.io.files import DATA_FILES, ROBOT_FILES
from jounce.reporting.terminal import print_text, print_warning

if TYPE_CHECKING:
    from jounce.robot import Robot


def convert(
    source: Path,
    target: Path,
    /,
    *,
    drive: list[str] | None = None,
    start: list[str] | None = None,
    hold: bool = False,
    no_drives: bool = False,
    strict: bool = False,
    model: str | None = None,
    closures: Path | None = None,
    import_: list[Path] | None = None,
    allow: list[Path] | None = None,
    overwrite: Overwrite = False,
) -> int:
    r"""Turn a mechanism file into another format, a robot into a mechanism.

    Mechanism files are YAML, TOML or JSON, robot files URDF, MJCF or SDF.

    Values keep their units and expressions; comments are lost. The file
    is written to a temporary place and read back before it is moved.

    Parameters
    ----------
    source
        Mechanism file, or robot file: .urdf, .xml or .sdf.
    target
        Mechanism file to write: .yaml, .yml, .toml or .json.
    drive
        JOINT=LAW, a value or an expression of t; repeatable.
    start
        JOINT=VALUE, the starting position, with a unit; repeatable.
    hold
        Lock the joints of a robot that are not driven.
    no_drives
        Leave out armature, damping and friction of a robot.
    strict
        Refuse a robot whose inertias no real body can have.
    model
        Model to read from an SDF file with several.
    closures
        File with loops, springs and rotors to add to the robot.
    import_
        Python file with your own joints; repeatable.
    allow
        Another folder from which the file may read others; repeatable.
    overwrite
        Replace existing files.

    Examples
    --------
      jounce convert examples/four_bar.yaml four_bar.toml
      jounce convert examples/robots/ur5.urdf ur5.yaml --hold \
        --drive "elbow_joint=45*deg*sin(t)"
      jounce convert examples/robots/panda.urdf panda.yaml \
        --start "panda_joint4=-90 deg"
    """
    from jounce.io.files.writing import check_target
    from jounce.io.mechanisms.starters import refuse_existing

    suffix = source.suffix.lower()
    with explaining_other_kinds(source, "mechanism", "robot"):
        check_ending(source, (*DATA_FILES, *ROBOT_FILES))
    check_target(target, DATA_FILES, "mechanism file", overwrite=overwrite)
    refuse_existing(target, overwrite=overwrite)
    if suffix in ROBOT_FILES:
        robot = RobotReading(strict=strict, allow=allow, model=model, closures=closures).robot(source)
        return _robot(source, robot, target, drive, start, hold, not no_drives)
    given = {"--drive": drive, "--start": start, "--hold": hold, "--no-drives": no_drives, "--strict": strict}
    for option, value in {**given, "--model": model, "--closures": closures}.items():
        if value:
            raise JounceError("is for robots; a mechanism file keeps its drivers", name=option, path=source)
    return _mechanism(source, target, import_, allowed(allow), overwrite)


def _mechanism(source: Path, target: Path, imports: list[Path] | None, allow: Sequence[Path], overwrite: bool) -> int:
    from jounce.io.files.dumping import dumped
    from jounce.io.files.reading import MAX_SAMPLES, read_file
    from jounce.io.files.writing import check_target, replacing
    from jounce.io.mechanisms.conversion import converted
    from jounce.io.mechanisms.starters import refuse_existing

    import_files(imports)
    with explaining_other_kinds(source, "mechanism"):
        data, samples = converted(source, target, allow)
    text = dumped(data, target.suffix.lower(), str(target))
    for table_file in samples:  # checks all before the first is written
        check_target(table_file, overwrite=overwrite)
        refuse_existing(table_file, overwrite=overwrite)
    for table_file, path in samples.items():
        with replacing(table_file, overwrite=overwrite) as scratch:
            scratch.write_bytes(read_file(path, MAX_SAMPLES, what="the samples"))
    _put(text, target, allow, overwrite)
    print_text(f"Written to {', '.join(str(path) for path in (target, *samples))}")
    if source.suffix.lower() != ".json" and "#" in source.read_text(encoding="utf-8-sig"):
        print_warning(f"the comments of {source} are not in {target}")
    return 0


def _robot(
    source: Path, model: Robot, target: Path, drive: list[str] | None, start: list[str] | None, hold: bool, drives: bool
) -> int:
    from jounce.io.files.dumping import dumped
    from jounce.io.mechanisms.conversion import assigned, robot_mechanism, with_file_names
    from jounce.io.mechanisms.writing.writer import mechanism_data
    from jounce.mechanism.masses import body_mass

    robot, renamed = with_file_names(model)
    laws = assigned(robot, drive or (), "--drive", law=True)
    begin: dict[str, Any] = assigned(robot, start or (), "--start", law=False)
    with errors_about(source):
        mechanism = robot_mechanism(robot, begin, laws, hold=hold, drives=drives)
        for name, body in mechanism.rigid_bodies.items():
            body_mass(name, body, {}, 3)  # mechanism files allow real bodies only
        data, _ = mechanism_data(mechanism, target.stem)
    _put(dumped(data, target.suffix.lower(), str(target)), target, (), True)
    is_driven = hold or len(laws) == len(robot.joint_names)
    next_commands = [] if robot.closures else [f"jounce {'run' if is_driven else 'simulate'} {target}"]
    print_text(f"Written to {target}\n\nTry now:\n  " + "\n  ".join([f"jounce inspect {target}", *next_commands]))
    for old, new in renamed.items():
        print_warning(f"'{old}' is called '{new}' in {target}, where names have letters, digits, _ and -")
    return 0


def _put(text: str, target: Path, allow: Sequence[Path], overwrite: bool) -> None:
    """Write a file to a temporary place, read it back, and move it to its place."""
    from jounce.io import load
    from jounce.io.files.writing import replacing

    with replacing(target, overwrite=overwrite) as scratch:
        scratch.write_text(text, encoding="utf-8")
        try:
            load(scratch, allow=allow)
        except JounceError as error:
            error.path = str(target)
            raise
