"""Limits of joints from files, laid over those that the robot has."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from os import PathLike
from typing import Any

from jounce.errors import RobotError, did_you_mean
from jounce.io.files.located_data import Location, Source
from jounce.io.files.source import read_source
from jounce.robot.model import Joint, Limits
from jounce.robot.robot import Robot
from jounce.trajectory.dimensions import Dimension, describe_dimension

KEYS = tuple(field.name for field in dataclasses.fields(Limits))
RANGE = ("lower", "upper")
POWERS = dict(zip(KEYS, (0, 0, 1, 2, 3, 2, 3, 2), strict=True))
"""Powers of 1/s in the units of each key."""
EXAMPLES = {
    True: ("rad", "rad", "rad/s", "rad/s^2", "rad/s^3", "N*m", "N*m/s", "rad/s^2"),
    False: ("m", "m", "m/s", "m/s^2", "m/s^3", "N", "N/s", "m/s^2"),
}
"""Units of the keys for a joint that turns, and for one that slides."""


def load_limits(path: str | PathLike[str], robot: Robot) -> dict[str, Limits]:
    """Read limits of the joints of a robot from a file, in addition to those that it has or in their place.

    The file has the keys ``joints``, with an entry for each joint, and ``default``, for all joints; each entry has some
    of the keys ``lower``, ``upper``, ``velocity``, ``acceleration``, ``deceleration``, ``jerk``, ``effort`` (torque or
    force) and ``effort_rate``. A value is a number in SI units or a number with a unit; ``null`` takes a limit away. An
    entry of a joint goes before ``default``, and that before the robot's own. A default with a unit of angle or torque
    is for the joints that turn, one with a unit of length or force for those that slide.

    Parameters
    ----------
    path
        A file ending in .yaml, .yml, .toml or .json.
    robot : Robot
        The robot that the names of joints belong to.

    Returns
    -------
    dict of str to Limits
        For every joint of `robot.joint_names`, as `check_limits` takes it.

    Raises
    ------
    RobotError
        The file cannot be read or something in it is wrong: the message names the file, the line, the entry and the
        value.

    Examples
    --------
    >>> from jounce.io.robots.limits import load_limits
    >>> from jounce.io.robots.loader import load_robot
    >>> limits = load_limits("examples/limits/franka_panda.yaml", load_robot("examples/robots/panda.urdf"))
    >>> limits["panda_joint2"].jerk
    3750.0
    """
    return _LimitsFile(read_source(path, kind="limits", error_type=RobotError), robot).limits()


class _LimitsFile:
    """Reads limits from the plain data of a file; every error names the file, the line and the entry."""

    def __init__(self, source: Source, robot: Robot) -> None:
        self.source, self.robot = source, robot

    def limits(self) -> dict[str, Limits]:
        """Return the limits of every joint."""
        data = self.source.mapping((), ("title", "default", "joints"))
        if "default" not in data and "joints" not in data:
            raise self.source.error("a limits file has the key 'joints', 'default', or both", value=list(data))
        default = self.source.mapping(("default",), KEYS) if "default" in data else {}
        joints = self.source.mapping(("joints",)) if "joints" in data else {}
        for name in joints:
            if name not in self.robot.joint_names:
                raise self.source.error(self._why_not(name), ("joints", name))
            self.source.mapping(("joints", name), KEYS)
        for key in default:
            self._check_default(key)
        return {name: self._of(name, default, joints.get(name, {})) for name in self.robot.joint_names}

    def _of(self, name: str, default: Mapping[str, Any], own: Mapping[str, Any]) -> Limits:
        joint = self.robot.joints[name]
        values = dataclasses.asdict(joint.limits)
        places: dict[str, Location] = {}
        for key, raw in default.items():
            if self._fits(raw, key, joint):
                places[key] = ("default", key)
                values[key] = self._value(raw, key, places[key], joint)
        for key, raw in own.items():
            places[key] = ("joints", name, key)
            values[key] = self._value(raw, key, places[key], joint)
        lower, upper = values["lower"], values["upper"]
        if None not in (lower, upper) and lower > upper:
            at = places.get("lower") or places["upper"]
            message = f"the lower limit of {name}, {lower:g}, must not exceed the upper one, {upper:g}"
            raise self.source.error(f"{message}; the one not given in this file is the robot's own", at)
        return Limits(**values)

    def _value(self, raw: Any, key: str, at: Location, joint: Joint) -> float | None:
        """Return a limit in SI units; None where there is none."""
        if raw is None:
            return None
        number, dimension = self._parsed(raw, at)
        if dimension and dimension not in _dimensions(key, joint.turning):
            unit = EXAMPLES[joint.turning][KEYS.index(key)]
            kind = "turns" if joint.turning else "slides"
            message = f"{_wrong_unit(dimension)}; a joint that {kind} has {key} in {unit}"
            raise self.source.error(message, at, value=raw)
        self._check_size(number, raw, key, at)
        return number

    def _parsed(self, raw: Any, at: Location) -> tuple[float, Dimension | None]:
        found = self.source.value(at, raw)
        assert isinstance(found.value, float)  # no names are allowed, so that expressions are worked out
        return found.value, found.dimension

    def _check_size(self, number: float, raw: Any, key: str, at: Location) -> None:
        if not math.isfinite(number):
            raise self.source.error("must be a finite number; null is no limit", at, value=raw)
        if key not in RANGE and number <= 0:
            raise self.source.error("must be greater than zero; null is no limit", at, value=raw)

    def _check_default(self, key: str) -> None:
        """Check an entry of the defaults by itself: it may be one that fits no joint of this robot."""
        at: Location = ("default", key)
        raw = self.source.data["default"][key]
        if raw is None:
            return
        number, dimension = self._parsed(raw, at)
        if dimension and dimension not in (*_dimensions(key, True), *_dimensions(key, False)):
            turning, sliding = (EXAMPLES[kind][KEYS.index(key)] for kind in (True, False))
            message = f"{_wrong_unit(dimension)}; {key} is in {turning} or {sliding}"
            raise self.source.error(message, at, value=raw)
        self._check_size(number, raw, key, at)

    def _fits(self, raw: Any, key: str, joint: Joint) -> bool:
        """Whether a default is meant for a joint: one with the unit of the other kind of joint is not."""
        dimension = None if raw is None else self._parsed(raw, ("default", key))[1]
        return not dimension or dimension in _dimensions(key, joint.turning)

    def _why_not(self, name: str) -> str:
        joint = self.robot.joints.get(name)
        if joint is not None and joint.mimic is not None:
            return f"this joint follows {joint.mimic.joint}; give limits of that one"
        if joint is not None:
            return "this joint is fixed and has no limits; leave it out"
        return f"{self.robot.name} has no moving joint of this name; {did_you_mean(name, self.robot.joint_names)}"


def _wrong_unit(dimension: Dimension) -> str:
    words = {_dimensions("effort", turning)[0]: word for turning, word in ((True, "a torque"), (False, "a force"))}
    return f"the unit is that of {words.get(dimension) or describe_dimension(dimension)}"


def _dimensions(key: str, turning: bool) -> tuple[Dimension, ...]:
    """Return the dimensions that the unit of a key may have; a pure number counts as an angle."""
    time = POWERS[key]
    if key.startswith("effort"):
        return (tuple(sorted({"mass": 1, "length": 2 if turning else 1, "time": -time}.items())),)
    bases: tuple[dict[str, int], ...] = ({"angle": 1}, {}) if turning else ({"length": 1},)
    rate = {"time": -time} if time else {}
    return tuple(tuple(sorted((base | rate).items())) for base in bases)
