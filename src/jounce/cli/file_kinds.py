"""The kind of a file given in place of another, for messages that name the command for it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from jounce.errors import JounceError, MechanismFileError, RobotError, TrajectoryError
from jounce.io.files import DATA_FILES

ADVICE = {
    "mechanism": "is a mechanism; run, simulate, modes, plot, report, view and inspect take mechanisms",
    "robot": "is a robot; check, torques, simulate, inspect, modes and view take it, and this makes it a mechanism: "
    "jounce convert {path} {stem}.yaml --hold",
    "trajectory": "is a trajectory, which goes with its robot; jounce check ROBOT {path}, or jounce view ROBOT {path}",
    "cam": "is a plate cam; jounce cam {path} finds its profile",
    "drives": "holds drives, which go with a robot or mechanism; jounce feedforward FILE --drives {path}",
    "limits": "holds limits, which go with robot and trajectory; jounce check ROBOT TRAJECTORY --limits {path}",
}
_ROOT = re.compile(rb"<(robot|mujoco)[\s>/]")


def is_data_file(argument: object) -> bool:
    """Return whether an argument of a command is the path of a YAML, TOML or JSON file."""
    return isinstance(argument, Path) and argument.suffix.lower() in DATA_FILES


def kind_of(path: str | PathLike[str]) -> str | None:
    """Return ``mechanism``, ``robot``, ``trajectory``, ``cam``, ``drives`` or ``limits``; None if unknown.

    Examples
    --------
    >>> from jounce.cli.file_kinds import kind_of
    >>> kind_of("examples/robots/panda.urdf"), kind_of("examples/four_bar.yaml"), kind_of("README.md")
    ('robot', 'mechanism', None)
    """
    from jounce.io.files.reading import read_file
    from jounce.io.files.source import read_source

    name = fspath(path)
    suffix = Path(name).suffix.lower()
    try:
        content = read_file(name)
        if content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<") and _ROOT.search(content):
            return "robot"
        if suffix == ".csv" and content.lstrip(b'\xef\xbb\xbf"').startswith((b"time", b"__time", b"%time")):
            return "trajectory"
        return _kind_of_data(read_source(name, many=True).data) if suffix in DATA_FILES else None
    except JounceError:
        return None


def _kind_of_data(data: Any) -> str | None:
    from jounce.io.robots.drives import KEYS as OF_DRIVES
    from jounce.io.robots.limits import KEYS
    from jounce.io.trajectories.ros.messages import is_message

    if is_message(data):
        return "trajectory"
    if not isinstance(data, dict):
        return None
    if "cam" in data and "follower" in data:
        return "cam"
    if "bodies" in data or "space" in data:
        return "mechanism"
    if "point_to_point" in data or "motion" in data:
        return "trajectory"
    joints = data.get("joints")
    rows = list(joints.values()) if isinstance(joints, dict) else []
    if rows and all(isinstance(row, dict) and row.keys() <= {*KEYS} for row in rows):
        return "limits"
    entries = data["drivers"].values() if isinstance(data.get("drivers"), dict) else rows
    if entries and all(isinstance(row, dict) and row.keys() <= {*OF_DRIVES} for row in entries if row is not None):
        return "drives"
    if rows and all(isinstance(row, str | int | float) or "samples" in row for row in rows):
        return "trajectory"
    return None


@contextmanager
def explaining_other_kinds(path: str | PathLike[str], *kinds: str) -> Iterator[None]:
    """Replace the error for an unreadable file by one that names its actual kind and the command for it.

    Raises
    ------
    JounceError
        The original error, or one that names the other kind.
    """
    try:
        yield
    except (MechanismFileError, RobotError, TrajectoryError) as error:
        kind = kind_of(path)
        if kind is None or kind in kinds:
            raise
        advice = ADVICE[kind].format(path=path, stem=Path(fspath(path)).stem)
        if kinds == ("trajectory",) and kind in ("mechanism", "robot"):
            advice = f"is a {kind}; a trajectory is needed: times and positions of joints (.csv), or laws of joints"
        if kinds == ("limits",) and kind == "robot":
            advice = "is a robot, whose own limits count without --limits; a file of limits is needed here (.yaml)"
        raise type(error)(advice, path=path) from None
