"""Joint limits from files, which complete or replace those of the robot."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from os import PathLike
from typing import Any

import numpy as np

from jounce.errors import RobotError, UnitWarning, no_such, warn_caller
from jounce.io.files.located_data import Location, Source, dotted
from jounce.io.files.source import read_source
from jounce.io.robots.moveit_limits import moveit_limits
from jounce.jet import Jet
from jounce.mechanism.laws.angle_laws import IN_SI, number_doubt
from jounce.planning.retiming.quantities.limits import VARYING, MotionLimits, PointLimits, PositionLaw
from jounce.robot.model.links_and_joints import Joint, Limits
from jounce.robot.robot import Robot
from jounce.settings import under_own_settings
from jounce.trajectory import Expression
from jounce.units.dimensions import Dimension, describe_dimension

FIELDS = tuple(field.name for field in dataclasses.fields(Limits))
KEYS = (*FIELDS, "jounce")
RANGE = ("lower", "upper")
POWERS = dict(zip(KEYS, (0, 0, 1, 2, 3, 2, 3, 2, 4), strict=True))
"""Powers of 1/s in the units of the keys."""
OTHER_WORDS = {
    **dict.fromkeys(("torque", "force", "max_torque", "max_force", "max_effort"), "effort"),
    **dict.fromkeys(("torque_rate", "force_rate", "rotatum", "yank"), "effort_rate"),
    **dict.fromkeys(("min", "min_position", "lower_limit"), "lower"),
    **dict.fromkeys(("max", "max_position", "upper_limit"), "upper"),
    "max_velocity": "velocity",
    "max_acceleration": "acceleration",
    "max_deceleration": "deceleration",
    "max_jerk": "jerk",
    "snap": "jounce",
}
EXAMPLES = {
    True: ("rad", "rad", "rad/s", "rad/s^2", "rad/s^3", "N*m", "N*m/s", "rad/s^2", "rad/s^4"),
    False: ("m", "m", "m/s", "m/s^2", "m/s^3", "N", "N/s", "m/s^2", "m/s^4"),
}
"""Units of the keys for a joint that turns, and for one that slides."""
DEGREES, MILLIMETERS = math.degrees(1.0), 1000.0
FAR_OFF = 10.0  # ratio to the robot's own limit that other limits rarely exceed
ALIKE = 5.0  # largest ratio of a converted limit to the robot's own
FAST = {True: 60.0, False: 20.0}  # rad/s and m/s, which robot joints hardly reach


@under_own_settings
def load_limits(path: str | PathLike[str], robot: Robot) -> dict[str, Limits]:
    """Read limits of the joints of a robot from a file, which complete or replace its own limits.

    The file has the keys ``joints``, with an entry for each joint, and ``default``, for all joints; each entry has some
    of the keys ``lower``, ``upper``, ``velocity``, ``acceleration``, ``deceleration``, ``jerk``, ``effort`` (torque or
    force) and ``effort_rate``. A value is a number in SI units or a number with a unit; ``null`` removes a limit. The
    entry of a joint precedes ``default``, which precedes the robot's own limits; limits of joints that follow others
    hold as well. A default with a unit of angle or torque holds for joints that turn, one with a unit of length or
    force for joints that slide. The ``joint_limits`` of MoveIt and ros2_control are read, with the keys
    ``max_velocity``, ``has_velocity_limits`` and so on, wherever they are among the parameters of nodes.

    Parameters
    ----------
    path
        File ending in .yaml, .yml, .toml or .json.
    robot : Robot
        Robot with the named joints.

    Returns
    -------
    dict of str to Limits
        Limits of every joint of `robot.joint_names`, for `check_limits`.

    Raises
    ------
    RobotError
        If the file cannot be read or contains an error: the message names the file, the line, the entry and the value.

    Examples
    --------
    >>> from jounce.io.robots.limits import load_limits
    >>> from jounce.io.robots.loader import load_robot
    >>> limits = load_limits("examples/limits/franka_panda.yaml", load_robot("examples/robots/panda.urdf"))
    >>> limits["panda_joint2"].jerk
    3750.0
    """
    limits_file = _LimitsFile(read_source(path, kind="limits", error_type=RobotError), robot)
    limits = limits_file.limits()
    if limits_file.jounce or limits_file.varying or limits_file.backward or limits_file.points():
        message = (
            "has limits of jounce, of points, or that depend on the position or the direction; read it with "
            "load_motion_limits"
        )
        raise limits_file.source.error(message)
    return limits


@under_own_settings
def load_motion_limits(path: str | PathLike[str], robot: Robot) -> MotionLimits:
    """Read limits of all kinds that `retime` and ``jounce check`` observe from a file.

    In addition to what `load_limits` reads, entries have the key ``jounce``. A limit of a joint may depend on its
    position ``q``, as an expression or as a table, ``{q: [0, 1 rad], value: [2, 1 rad/s]}``, which is interpolated
    linearly, or on the direction, ``[-1 rad/s, 2 rad/s]``: the lowest and the highest value. The key ``points`` gives
    links, with the keys ``point`` (in the frame of the link), ``speed`` and ``acceleration``.

    Parameters
    ----------
    path
        File ending in .yaml, .yml, .toml or .json.
    robot : Robot
        Robot with the named joints and links.

    Returns
    -------
    MotionLimits
        Limits of every joint of `robot.joint_names`.

    Raises
    ------
    RobotError
        If the file cannot be read or contains an error: the message names the file, the line, the entry and the value.

    Examples
    --------
    >>> import jounce as jn
    >>> robot = jn.load_robot("examples/robots/panda.urdf")
    >>> limits = jn.io.load_motion_limits("examples/limits/panda_careful.yaml", robot)
    >>> limits.points[0].link, limits.points[0].speed
    ('panda_hand', 1.0)
    """
    limits_file = _LimitsFile(read_source(path, kind="limits", error_type=RobotError), robot)
    joints = limits_file.limits()
    backward = {name: Limits(**values) for name, values in limits_file.backward.items()}
    return MotionLimits(joints, limits_file.jounce, limits_file.varying, limits_file.points(), backward)


class _LimitsFile:
    """Reads limits from the data of a file; every error names the file, the line and the entry."""

    def __init__(self, source: Source, robot: Robot) -> None:
        self.source, self.robot = source, robot
        self.jounce: dict[str, float] = {}
        self.varying: dict[str, dict[str, PositionLaw]] = {}
        self.backward: dict[str, dict[str, float]] = {}
        self.doubts: dict[Location, str] = {}

    def limits(self) -> dict[str, Limits]:
        """Return the limits of every joint."""
        default: Mapping[str, Any] = {}
        joints = moveit_limits(self.source, self.robot)
        if joints is None:
            data = self.source.mapping((), ("title", "default", "joints", "points"))
            if not data.keys() & {"default", "joints", "points"}:
                raise self.source.error("a limits file has the keys 'joints', 'default' or 'points'", value=list(data))
            default = self.source.mapping(("default",), KEYS, others=OTHER_WORDS) if "default" in data else {}
            joints = self._joints() if "joints" in data else {}
        for key in default:
            self._check_default(key)
        limits = {name: self._of(name, default, joints.get(name, {})) for name in self.robot.joint_names}
        if doubt := next(iter(self.doubts.values()), None):
            similar = f" (and {count - 1} like it)" if (count := len(self.doubts)) > 1 else ""
            warn_caller(UnitWarning(f"{doubt}{similar} {IN_SI}"))
        try:
            return self.robot.limits_with(limits)
        except RobotError as error:
            location: Location = next(
                (location[:-1] for _, location in joints.get(error.name or "", {}).values()), ("default",)
            )
            raise self.source.error(error.message, location, value=error.value) from None

    def _joints(self) -> dict[str, dict[str, tuple[Any, Location]]]:
        """Return the entries of joints by key, each with its place."""
        entries = {}
        for name in self.source.mapping(("joints",)):
            location: Location = ("joints", name)
            if name not in self.robot.joint_names:
                raise self.source.error(self._why_not(name), location)
            entry = self.source.mapping(location, KEYS, others=OTHER_WORDS)
            entries[name] = {key: (raw, (*location, key)) for key, raw in entry.items()}
        return entries

    def _of(self, name: str, default: Mapping[str, Any], entries: Mapping[str, tuple[Any, Location]]) -> Limits:
        joint = self.robot.joints[name]
        values = dataclasses.asdict(joint.limits) | {"jounce": None}
        locations: dict[str, Location] = {}
        for key, raw in default.items():
            if self._fits(raw, key, joint):
                locations[key] = ("default", key)
                values[key] = self._value(raw, key, locations[key], joint)
        for key, (raw, location) in entries.items():
            locations[key] = location
            if isinstance(raw, list) and key in VARYING and key != "jounce":
                minimum, values[key] = self._range(raw, key, locations[key], joint)
                self.backward.setdefault(name, {})[key] = minimum
                continue
            if key in VARYING and (law := self._law(raw, key, locations[key], joint)):
                self.varying.setdefault(name, {})[key] = law
                continue
            values[key] = self._value(raw, key, locations[key], joint)
        lower, upper = values["lower"], values["upper"]
        if lower is not None and upper is not None and lower > upper:
            location = locations.get("lower") or locations["upper"]
            message = f"the lower limit of {name}, {lower:g}, must not exceed the upper one, {upper:g}"
            raise self.source.error(f"{message}; the one not given in this file is the robot's own", location)
        if (jounce := values.pop("jounce")) is not None:
            self.jounce[name] = jounce
        return Limits(**values)

    def _range(self, raw: list[Any], key: str, location: Location, joint: Joint) -> tuple[float, float]:
        """Return the magnitudes of the lowest and the highest value of a limit that depends on the direction."""
        if len(raw) != 2:
            raise self.source.error("must be one value, or the lowest and the highest", location, value=raw)
        low, high = (self._number(x, key, (*location, k), joint) for k, x in enumerate(raw))
        if not (math.isfinite(low) and math.isfinite(high) and low < 0 < high):
            message = "must be the lowest value, below zero, and the highest, above it, both finite"
            raise self.source.error(message, location, value=raw)
        return -low, high

    def _law(self, raw: Any, key: str, location: Location, joint: Joint) -> PositionLaw | None:
        """Return a position-dependent limit, from an expression of q or a table; None for a constant one."""
        if isinstance(raw, dict):
            data = self.source.mapping(location, ("q", "value"))
            columns = []
            for part, kind in (("q", "lower"), ("value", key)):
                entries = data.get(part)
                if not isinstance(entries, list) or len(entries) < 2:
                    raise self.source.error("must be a list of two values or more", (*location, part), value=entries)
                numbers = [self._value(x, kind, (*location, part, k), joint) for k, x in enumerate(entries)]
                columns.append(np.array(numbers, float))
            q, values = columns
            if len(q) != len(values) or not bool((np.diff(q) > 0).all()):
                raise self.source.error("needs positions q that increase, and as many values", location)
            return lambda position: np.interp(position, q, values)
        if not isinstance(raw, str) or not re.search(r"\bq\b", raw):
            return None
        law = self.source.value(location, raw, "any", ("q",)).value
        assert isinstance(law, Expression)

        def limit(position: Any) -> Any:
            value = law.evaluate({"q": Jet.constant(position, 0)})
            return value.coefficients[0] if isinstance(value, Jet) else value

        return limit

    def points(self) -> tuple[PointLimits, ...]:
        """Return the limits of points of links."""
        data = self.source.mapping(("points",)) if "points" in self.source.data else {}
        points = []
        for link in data:
            location: Location = ("points", link)
            if link not in self.robot.frames:
                raise self.source.error(no_such("link", link, self.robot.frames), location)
            entry = self.source.mapping(location, ("point", "speed", "acceleration"))
            values = {
                k: self._measured(entry[k], p, (*location, k))
                for p, k in ((1, "speed"), (2, "acceleration"))
                if k in entry
            }
            point = entry.get("point", [0.0, 0.0, 0.0])
            if not isinstance(point, list) or len(point) != 3:
                raise self.source.error("must be three lengths", (*location, "point"), value=point)
            x, y, z = (self._measured(x, 0, (*location, "point", k)) for k, x in enumerate(point))
            points.append(PointLimits(link, **values, point=(x, y, z)))
        return tuple(points)

    def _measured(self, raw: Any, rate: int, location: Location) -> float:
        """Return a length, speed or acceleration, by the order `rate` of the derivative; a rate must be positive."""
        number, dimension = self._parsed(raw, location)
        expected = tuple(sorted(({"length": 1} | ({"time": -rate} if rate else {})).items()))
        if dimension and dimension != expected:
            raise self.source.error(
                f"{_wrong_unit(dimension)}; it is in {('m', 'm/s', 'm/s^2')[rate]}", location, value=raw
            )
        if not math.isfinite(number) or (rate and number <= 0):
            raise self.source.error("must be a finite number" + " greater than zero" * bool(rate), location, value=raw)
        return number

    def _value(self, raw: Any, key: str, location: Location, joint: Joint) -> float | None:
        """Return a limit in SI units; None if there is none."""
        if raw is None:
            return None
        number = self._number(raw, key, location, joint)
        self._check_size(number, raw, key, location)
        return number

    def _number(self, raw: Any, key: str, location: Location, joint: Joint) -> float:
        number, dimension = self._parsed(raw, location)
        if isinstance(raw, int | float) and (doubt := _doubt(number, key, joint)):
            self.doubts[location] = (
                f"{self.source.path}, line {self.source.line(location)}, {dotted(location)}: {doubt}"
            )
        if dimension and dimension not in _dimensions(key, joint.turning):
            unit = EXAMPLES[joint.turning][KEYS.index(key)]
            kind = "turns" if joint.turning else "slides"
            message = f"{_wrong_unit(dimension)}; a joint that {kind} has {key} in {unit}"
            raise self.source.error(message, location, value=raw)
        return number

    def _parsed(self, raw: Any, location: Location) -> tuple[float, Dimension | None]:
        parsed = self.source.value(location, raw)
        assert isinstance(parsed.value, float)  # expressions are evaluated, since no names are allowed
        return parsed.value, parsed.dimension

    def _check_size(self, number: float, raw: Any, key: str, location: Location) -> None:
        if not math.isfinite(number):
            raise self.source.error("must be a finite number; null means no limit", location, value=raw)
        if key not in RANGE and number <= 0:
            raise self.source.error("must be greater than zero; null means no limit", location, value=raw)

    def _check_default(self, key: str) -> None:
        """Raise an error for an invalid entry of the defaults, which may suit no joint of this robot."""
        location: Location = ("default", key)
        raw = self.source.data["default"][key]
        if raw is None:
            return
        number, dimension = self._parsed(raw, location)
        if dimension and dimension not in (*_dimensions(key, True), *_dimensions(key, False)):
            turning, sliding = (EXAMPLES[kind][KEYS.index(key)] for kind in (True, False))
            message = f"{_wrong_unit(dimension)}; {key} is in {turning} or {sliding}"
            raise self.source.error(message, location, value=raw)
        self._check_size(number, raw, key, location)

    def _fits(self, raw: Any, key: str, joint: Joint) -> bool:
        """Return whether the unit of a default suits a joint."""
        dimension = None if raw is None else self._parsed(raw, ("default", key))[1]
        return not dimension or dimension in _dimensions(key, joint.turning)

    def _why_not(self, name: str) -> str:
        joint = self.robot.joints.get(name)
        if joint is not None and joint.mimic is not None:
            pronoun = "those" if joint.mimic.several else "that one"
            return f"this joint follows {', '.join(joint.mimic.weights)}; give limits of {pronoun}"
        if joint is not None:
            return "this joint is fixed and has no limits; leave it out"
        return no_such(f"moving joint of {self.robot.name}", name, self.robot.joint_names)


def _doubt(number: float, key: str, joint: Joint) -> str:
    """Return why a number without a unit is likely in degrees or millimeters; an empty text if it is not."""
    if key not in (*RANGE, "velocity") or not math.isfinite(number):
        return ""
    unit = EXAMPLES[joint.turning][KEYS.index(key)]
    other = unit.replace("rad", "deg") if joint.turning else unit.replace("m", "mm", 1)
    size, part = abs(number), DEGREES if joint.turning else MILLIMETERS
    limits = joint.limits
    bounds = (limits.velocity,) if key == "velocity" else (limits.lower, limits.upper)
    bound = max((abs(x) for x in bounds if x is not None), default=0.0)
    if bound:
        if not (size > FAR_OFF * bound and bound / ALIKE < size / part < bound * ALIKE):
            return ""
        return f"{number:g} {unit} is {size / bound:.2g} times the robot's own {bound:.4g} {unit}: {number:g} {other}?"
    if key == "velocity" and size > FAST[joint.turning]:
        return f"{number:g} {unit}: {number:g} {other}?"
    return number_doubt(number) if key in RANGE and joint.turning else ""


def _wrong_unit(dimension: Dimension) -> str:
    nouns = {_dimensions("effort", turning)[0]: word for turning, word in ((True, "a torque"), (False, "a force"))}
    return f"the unit is that of {nouns.get(dimension) or describe_dimension(dimension)}"


def _dimensions(key: str, turning: bool) -> tuple[Dimension, ...]:
    """Return the valid dimensions of the unit of a key; a pure number counts as an angle."""
    time = POWERS[key]
    if key.startswith("effort"):
        return (tuple(sorted({"mass": 1, "length": 2 if turning else 1, "time": -time}.items())),)
    bases: tuple[dict[str, int], ...] = ({"angle": 1}, {}) if turning else ({"length": 1},)
    rate = {"time": -time} if time else {}
    return tuple(tuple(sorted((base | rate).items())) for base in bases)
