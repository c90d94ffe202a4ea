"""Files of mechanisms, robots, trajectories and results; libraries are imported when a file is read, not before."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jounce.io.files.column_units import in_units as in_units
    from jounce.io.mechanisms.cam_files import load_cam as load_cam
    from jounce.io.mechanisms.drive_limits import load_drive_limits as load_drive_limits
    from jounce.io.mechanisms.json_schema import json_schema as json_schema
    from jounce.io.mechanisms.loader import load as load
    from jounce.io.mechanisms.writer import write_mechanism as write_mechanism
    from jounce.io.result_reading import read as read
    from jounce.io.results import check_writable as check_writable, write as write, write_parts as write_parts
    from jounce.io.robots.controller_files import export_trajectory as export_trajectory
    from jounce.io.robots.drives import load_drives as load_drives
    from jounce.io.robots.limits import load_limits as load_limits, load_motion_limits as load_motion_limits
    from jounce.io.robots.loader import load_robot as load_robot
    from jounce.io.robots.paths import load_path as load_path
    from jounce.io.robots.trajectories import load_trajectory as load_trajectory

_HOMES = {
    "in_units": "files.column_units",
    "load": "mechanisms.loader",
    "json_schema": "mechanisms.json_schema",
    "load_cam": "mechanisms.cam_files",
    "check_writable": "results",
    "read": "result_reading",
    "write": "results",
    "load_drives": "robots.drives",
    "export_trajectory": "robots.controller_files",
    "load_drive_limits": "mechanisms.drive_limits",
    "load_limits": "robots.limits",
    "load_motion_limits": "robots.limits",
    "load_path": "robots.paths",
    "load_robot": "robots.loader",
    "load_trajectory": "robots.trajectories",
    "write_mechanism": "mechanisms.writer",
    "write_parts": "results",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(f"jounce.io.{_HOMES[name]}"), name)
