"""Limits of joints as ``joint_limits.yaml`` of MoveIt and of ros2_control has them."""

from __future__ import annotations

from typing import Any

from jounce.errors import RobotWarning, no_such, warn_caller
from jounce.io.files.located_data import Location, Source, dotted
from jounce.robot.robot import Robot

WRAPPERS = ("/**", "ros__parameters", "robot_description_planning")
"""Keys that may stand around ``joint_limits``, one within the other."""
SCALES = ("default_velocity_scaling_factor", "default_acceleration_scaling_factor")
LIMITS = {
    "lower": ("min_position", "has_position_limits"),
    "upper": ("max_position", "has_position_limits"),
    "velocity": ("max_velocity", "has_velocity_limits"),
    "acceleration": ("max_acceleration", "has_acceleration_limits"),
    "deceleration": ("max_deceleration", "has_deceleration_limits"),
    "jerk": ("max_jerk", "has_jerk_limits"),
    "effort": ("max_effort", "has_effort_limits"),
}
"""Each limit by our key: its key there, and the key of the flag that says whether it counts."""
UNREAD = ("angle_wraparound", "has_soft_limits", "k_position", "k_velocity", "soft_lower_limit", "soft_upper_limit")
KEYS = {key for pair in LIMITS.values() for key in pair} | set(UNREAD)


def moveit_limits(source: Source, robot: Robot) -> dict[str, dict[str, tuple[Any, Location]]] | None:
    """Return limits of joints by our keys, each as written and where; None if the file is not of this kind.

    A flag that is false takes a limit away, also that of the robot; without a flag a value counts.

    Raises
    ------
    RobotError
        If a key is unknown, a flag is none, or no joint is one of the robot.
    """
    base: Location = ()
    data = source.data
    while isinstance(data, dict) and len(data) == 1 and (key := next(iter(data))) in WRAPPERS:
        base, data = (*base, key), data[key]
    if not isinstance(data, dict) or "joint_limits" not in data:
        return None
    source.mapping(base, ("joint_limits", *SCALES))
    base = (*base, "joint_limits")
    joints = source.mapping(base)
    unknown = [name for name in joints if name not in robot.joint_names]
    if len(unknown) == len(joints):
        raise source.error(no_such(f"moving joint of {robot.name}", unknown[0], robot.joint_names), (*base, unknown[0]))
    notes = [f"left out, as no coordinates of {robot.name}: {', '.join(unknown)}"] if unknown else []
    scales = [f"{key}: {data[key]}" for key in SCALES if data.get(key, 1) != 1]
    if scales:
        notes.append(f"{', '.join(scales)} do not count, as limits are those of joint_limits")
    if notes:
        warn_caller(RobotWarning(f"{source.path}, line {source.line(base)}, {dotted(base)}: {'; '.join(notes)}"))
    return {name: _of(source, (*base, name)) for name in joints if name not in unknown}


def _of(source: Source, location: Location) -> dict[str, tuple[Any, Location]]:
    entry, limits = source.mapping(location, sorted(KEYS)), {}
    for key, (value, flag) in LIMITS.items():
        counts = entry.get(flag, value in entry)
        if not isinstance(counts, bool):
            raise source.error("must be true or false", (*location, flag), value=counts)
        if not counts and flag in entry:
            limits[key] = (None, (*location, flag))
        elif value in entry:
            limits[key] = (entry[value], (*location, value))
    return limits
