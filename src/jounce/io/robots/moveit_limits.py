"""Limits of joints as ``joint_limits.yaml`` of MoveIt and of ros2_control has them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from jounce.errors import RobotWarning, no_such, warn_caller
from jounce.io.files.located_data import Location, Source, dotted
from jounce.robot.robot import Robot

OURS = ("default", "joints", "points")
LIMITS_KEY = "joint_limits"
PARAMETERS = ("ros__parameters", "robot_description_planning", "robot_description_kinematics")
MOST_NESTED = 8
CARTESIAN = "cartesian_limits"
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
SOFT = "has_soft_limits"
UNREAD = ("angle_wraparound", SOFT, "k_position", "k_velocity", "soft_lower_limit", "soft_upper_limit")
KEYS = {key for pair in LIMITS.values() for key in pair} | set(UNREAD)


def moveit_limits(source: Source, robot: Robot) -> dict[str, dict[str, tuple[Any, Location]]] | None:
    """Return limits of joints by our keys, each as written and where; None if the file is not of this kind.

    A flag that is false takes a limit away, also that of the robot; without a flag a value counts. Decelerations may
    have either sign: the Pilz planner of MoveIt wants them below zero, ros2_control above.

    Raises
    ------
    RobotError
        If a key of a joint is unknown, a flag is none, or no joint is one of the robot.
    """
    if not isinstance(source.data, dict) or source.data.keys() & set(OURS):
        return None
    locations = list(_locations(source.data))
    if not locations:
        node = next((key for key, entry in source.data.items() if _has_parameters(key, entry)), None)
        if node is None:
            return None
        message = f"these parameters hold no {LIMITS_KEY}; a limits file of jounce has the keys {', '.join(OURS)}"
        raise source.error(message, (node,))
    if len(locations) > 1:
        lines = ", ".join(f"{dotted(location)} (line {source.line(location)})" for location in locations)
        raise source.error(f"{LIMITS_KEY} are in several places: {lines}; keep one", locations[1])
    (base,) = locations
    data = source.data
    for key in base[:-1]:
        data = data[key]
    joints = source.mapping(base)
    unknown = [name for name in joints if name not in robot.joint_names]
    if len(unknown) == len(joints):
        raise source.error(no_such(f"moving joint of {robot.name}", unknown[0], robot.joint_names), (*base, unknown[0]))
    notes = [f"left out, as no coordinates of {robot.name}: {', '.join(unknown)}"] if unknown else []
    scales = [f"{key}: {data[key]}" for key in SCALES if data.get(key, 1) != 1]
    if scales:
        notes.append(f"{', '.join(scales)} do not count, as limits are those of joint_limits")
    if others := [str(key) for key in data if "limit" in str(key) and key not in (LIMITS_KEY, CARTESIAN)]:
        notes.append(f"left out: {', '.join(others)}")
    if CARTESIAN in data:
        notes.append(f"{CARTESIAN} are left out: limits of the speed of a tool are `points` of a limits file of jounce")
    if soft := [name for name in joints if name not in unknown and source.mapping((*base, name)).get(SOFT) is True]:
        notes.append(f"soft limits do not count: {', '.join(soft)}")
    if notes:
        warn_caller(RobotWarning(f"{source.path}, line {source.line(base)}, {dotted(base)}: {'; '.join(notes)}"))
    return {name: _of(source, (*base, name)) for name in joints if name not in unknown}


def _locations(data: dict[Any, Any], outer: Location = ()) -> Iterator[Location]:
    """Yield the locations of limits of joints among the parameters of nodes."""
    for key, entry in data.items():
        if key == LIMITS_KEY:
            yield (*outer, key)
        elif isinstance(entry, dict) and len(outer) < MOST_NESTED:
            yield from _locations(entry, (*outer, key))


def _has_parameters(key: Any, entry: Any) -> bool:
    """Return whether an entry of a file has parameters of ROS, or of the planning of MoveIt."""
    return key in PARAMETERS or (isinstance(entry, dict) and any(_has_parameters(*item) for item in entry.items()))


def _of(source: Source, location: Location) -> dict[str, tuple[Any, Location]]:
    entry, limits = source.mapping(location, sorted(KEYS)), {}
    for key, (value, flag) in LIMITS.items():
        counts = entry.get(flag, value in entry)
        if not isinstance(counts, bool):
            raise source.error("must be true or false", (*location, flag), value=counts)
        if not counts and flag in entry:
            limits[key] = (None, (*location, flag))
        elif value in entry:
            number = entry[value]
            signed = key == "deceleration" and isinstance(number, int | float) and not isinstance(number, bool)
            limits[key] = (abs(number) if signed else number, (*location, value))
    return limits
