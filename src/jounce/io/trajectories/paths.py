"""Paths of robots from files: waypoints in CSV, waypoints or expressions of s in YAML, TOML or JSON, trajectories."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

from jounce.errors import JounceError, TrajectoryError
from jounce.io.files import DATA_FILES
from jounce.io.files.reading import name_of
from jounce.io.files.samples import has_column, read_table
from jounce.io.files.source import read_source
from jounce.io.trajectories.loader import load_trajectory
from jounce.io.trajectories.table_columns import TIMES
from jounce.planning.paths.paths import Path, path_of
from jounce.robot import Robot
from jounce.settings import under_own_settings
from jounce.trajectory import JointTrajectory


@under_own_settings
def load_path(
    path: str | PathLike[str],
    degree: int = 5,
    allow: Iterable[str | PathLike[str]] = (),
    *,
    topic: str | None = None,
    robot: Robot | None = None,
    only: Iterable[str] | None = None,
) -> Path | JointTrajectory:
    """Read the path of a robot: a path without time, or a trajectory, of which only the geometry matters.

    A CSV file with a column ``time`` is a trajectory; otherwise its rows are waypoints, rad or m, and its columns
    joints. A YAML, TOML or JSON file has the key ``path``: for each joint an expression of ``s``, which runs from 0 to
    1, or the list of its positions at the waypoints; or it is a trajectory file.

    Parameters
    ----------
    path
        File ending in .csv, .yaml, .yml, .toml or .json.
    degree : int, default 5
        Degree of the splines through samples of a trajectory.
    allow
        Folders besides its own below which files named in it may lie.
    topic, robot, only
        See `load_trajectory`.

    Returns
    -------
    Path or JointTrajectory
        Path for `retime`.

    Raises
    ------
    TrajectoryError
        If the file cannot be read or contains an error: the message names the file, and the line or the entry.
    """
    name = name_of(path, TrajectoryError)
    suffix = FilePath(name).suffix.lower()
    if suffix == ".csv" and not has_column(name, TIMES):
        columns = read_table(name)
        return _path_in_file(name, {joint: values.tolist() for joint, values in columns.items()})
    if suffix in DATA_FILES:
        source = read_source(name, allow, kind="trajectory", error_type=TrajectoryError, many=True)
        if isinstance(source.data, dict) and "path" in source.data:
            data = source.mapping((), ("title", "path"))
            given: dict[str, Any] = {}
            for joint, raw in source.mapping(("path",)).items():
                location = ("path", joint)
                if isinstance(raw, list):
                    given[joint] = [_number(source, entry, (*location, k)) for k, entry in enumerate(raw)]
                else:
                    given[joint] = raw if isinstance(raw, str) else str(_number(source, raw, location))
            del data
            return _path_in_file(name, given)
    return load_trajectory(path, degree, allow, topic=topic, robot=robot, only=only)


def _number(source: Any, raw: Any, location: tuple[Any, ...]) -> float:
    value = source.value(location, raw).value
    if not isinstance(value, float):
        raise source.error("must be a number", location, value=raw)
    return value


def _path_in_file(name: str, given: dict[str, Any]) -> Path:
    try:
        return path_of(given)
    except JounceError as error:
        raise error.located(path=name) from None
