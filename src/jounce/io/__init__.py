"""Files of mechanisms, robots, trajectories and results; libraries are imported when a file is read."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jounce.io.files.column_units import in_units as in_units
    from jounce.io.mechanisms.cam_files import load_cam as load_cam
    from jounce.io.mechanisms.drive_limits import load_drive_limits as load_drive_limits
    from jounce.io.mechanisms.loader import load as load
    from jounce.io.mechanisms.schema.json_schema import json_schema as json_schema
    from jounce.io.mechanisms.writing.writer import write_mechanism as write_mechanism
    from jounce.io.result_reading import read as read
    from jounce.io.results import check_writable as check_writable, write as write, write_parts as write_parts
    from jounce.io.robots.drives import load_drives as load_drives
    from jounce.io.robots.limits import load_limits as load_limits, load_motion_limits as load_motion_limits
    from jounce.io.robots.loader import load_robot as load_robot
    from jounce.io.trajectories.controller_files import export_trajectory as export_trajectory
    from jounce.io.trajectories.loader import load_trajectory as load_trajectory
    from jounce.io.trajectories.paths import load_path as load_path


def __getattr__(name: str) -> Any:
    home = _of_mechanisms(name) or _of_robots(name) or _of_trajectories(name) or _of_results(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(home, name)


def _of_mechanisms(name: str) -> ModuleType | None:
    """Return the module that defines a name for mechanisms; None for other names."""
    match name:
        case "load":
            from jounce.io.mechanisms import loader as home
        case "load_cam":
            from jounce.io.mechanisms import cam_files as home
        case "load_drive_limits":
            from jounce.io.mechanisms import drive_limits as home
        case "json_schema":
            from jounce.io.mechanisms.schema import json_schema as home
        case "write_mechanism":
            from jounce.io.mechanisms.writing import writer as home
        case _:
            return None
    return home


def _of_robots(name: str) -> ModuleType | None:
    """Return the module that defines a name for robots; None for other names."""
    match name:
        case "load_robot":
            from jounce.io.robots import loader as home
        case "load_limits" | "load_motion_limits":
            from jounce.io.robots import limits as home
        case "load_drives":
            from jounce.io.robots import drives as home
        case _:
            return None
    return home


def _of_trajectories(name: str) -> ModuleType | None:
    """Return the module that defines a name for trajectories; None for other names."""
    match name:
        case "load_trajectory":
            from jounce.io.trajectories import loader as home
        case "load_path":
            from jounce.io.trajectories import paths as home
        case "export_trajectory":
            from jounce.io.trajectories import controller_files as home
        case _:
            return None
    return home


def _of_results(name: str) -> ModuleType | None:
    """Return the module that defines a name for results; None for other names."""
    match name:
        case "read":
            from jounce.io import result_reading as home
        case "check_writable" | "write" | "write_parts":
            from jounce.io import results as home
        case "in_units":
            from jounce.io.files import column_units as home
        case _:
            return None
    return home
