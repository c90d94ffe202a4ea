"""Loops, springs and rotors that a robot file lacks, from a small file beside it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np

from jounce.errors import RobotError, UnitWarning, no_such, warn_caller
from jounce.io.files.located_data import Location, Source
from jounce.io.files.source import read_source
from jounce.robot.closed_loops.closures import Loops, given_coordinates
from jounce.robot.model.links_and_joints import CLOSURES, Closure, Joint
from jounce.robot.robot import Robot
from jounce.units.dimensions import Dimension, describe_dimension, dimension_of

CLOSED_BY = {"fixed": "weld", "revolute": "pin", "continuous": "pin", "prismatic": "slider"}
HEAVY = 0.05  # kg m^2, above the inertia of any rotor behind gears: a number without a unit may be in kg cm^2
GEARED = 5.0  # least gear ratio of a motor behind gears
CLOSED_BY |= {"ball": "connect", "spherical": "connect"}
TYPES = {**{name: name for name in CLOSURES}, **CLOSED_BY}
OF_CLOSURE = ("type", "frames", "axis")
OF_FRAME = ("link", "xyz", "rpy")
OF_JOINT = ("stiffness", "reference", "damping", "friction", "rotor_inertia", "gear_ratio")
STARTS = 16  # number of positions from which the closing of loops is attempted
ANGLE, LENGTH = dimension_of(angle=1), dimension_of(length=1)


def with_closures(robot: Robot, path: str | PathLike[str]) -> Robot:
    """Return a robot with the loops, springs and rotors of a file.

    The file has the keys ``closures``, by name of the loop joint, and ``joints``, by name of a moving joint, or one of
    them. A closure has a ``type``: revolute, continuous or pin; prismatic or slider; ball or connect; fixed or weld.
    Its two ``frames``, each a link, or ``{link: NAME, xyz: [x, y, z], rpy: [r, p, y]}`` with the pose in that link,
    coincide where the loop is closed, except for the freedoms of the type. ``axis``, in the first frame, is z by
    default. A joint has ``stiffness`` and ``reference`` of a spring, ``damping``, ``friction`` (one value, or
    ``[forward, backward]``), and ``rotor_inertia`` of its motor with ``gear_ratio``: the inertia at the joint is that
    of the rotor times the square of the ratio. These values replace those of the robot file. Values are numbers in SI
    units or have a unit.

    Parameters
    ----------
    robot : Robot
        Robot from its file.
    path
        File ending in .yaml, .yml, .toml or .json.

    Raises
    ------
    RobotError
        If the file cannot be read or contains an error, or the loops cannot be closed from any of several positions:
        the message names the file, the line and the entry.
    """
    return _ClosureFile(read_source(path, kind="closures", error_type=RobotError), robot).robot()


def loop_closure(
    name: str,
    kind: str,
    frames: Sequence[tuple[str, Sequence[float], Sequence[float]]],
    axis: Sequence[float] | None = None,
) -> Closure:
    """Return the closure that holds two frames together, except for the freedoms of a type of joint.

    Parameters
    ----------
    name : str
        Name of the closure.
    kind : str
        Type of a closure or of a joint.
    frames : sequence of two tuples of str and two sequences of 3 floats
        For each frame, the link, the origin in it, m, and turns about its fixed axes x, y, z, rad.
    axis : sequence of 3 floats, optional
        Axis in the first frame; z by default.

    Raises
    ------
    RobotError
        If the links are the same, or the axis has no direction.
    """
    from scipy.spatial.transform import Rotation

    kind = TYPES[kind]
    links, origins, turns = zip(*frames, strict=True)
    first, second = (Rotation.from_euler("xyz", turn).as_matrix() for turn in turns)
    direction = first @ np.asarray([0.0, 0.0, 1.0] if axis is None else axis, float)
    axis_of = direction if kind in ("pin", "slider") else None
    rotation = None if kind == "connect" else first @ second.T
    return Closure(name, links, kind, np.array(origins, float), axis_of, rotation)


class _ClosureFile:
    """Reads closures, springs and rotors from the data of a file; every error names the line."""

    def __init__(self, source: Source, robot: Robot):
        self.source, self.given = source, robot

    def robot(self) -> Robot:
        """Return the robot with everything in the file."""
        data = self.source.mapping((), ("title", "closures", "joints"))
        if not {"closures", "joints"} & data.keys():
            raise self.source.error("the file has neither closures nor joints", value=list(data))
        robot = self.given
        if "joints" in data:
            joints = {name: self._joint(name) for name in self.source.mapping(("joints",))}
            robot = robot.changed(joints=[joints.get(name, joint) for name, joint in robot.joints.items()])
        if "closures" not in data:
            return robot
        closures = []
        for name in self.source.mapping(("closures",)):
            if name in robot.closures or name in robot.joints:
                raise self.source.error("a joint or closure of the robot file has this name", ("closures", name))
            closures.append(self._closure(name))
        try:
            robot = robot.with_closures(closures)
            _check_closed(robot)
        except RobotError as error:
            location = tuple((error.name or "closures").split(".")[:2])
            raise self.source.error(
                error.message, location if self.source.at(location) is not None else ("closures",)
            ) from None
        return robot

    def _joint(self, name: str) -> Joint:
        place = ("joints", name)
        joint = self.given.joints.get(name)
        moving = [x.name for x in self.given.moving_joints]
        if joint is None or not joint.moving:
            raise self.source.error(no_such("moving joint", name, moving), place)
        entry = self.source.mapping(place, OF_JOINT)
        changes: dict[str, Any] = {}
        for key in ("stiffness", "damping"):
            if key in entry:
                changes[key] = self._number((*place, key), entry[key], _dimensions(key, joint.turning))
        if "reference" in entry:
            kind = (ANGLE,) if joint.turning else (LENGTH,)
            changes["spring_reference"] = self._number((*place, "reference"), entry["reference"], kind)
        if "friction" in entry:
            raw, location = entry["friction"], (*place, "friction")
            parts = raw if isinstance(raw, list) else [raw]
            numbers = [self._number(location, part, _dimensions("friction", joint.turning)) for part in parts]
            if len(numbers) not in (1, 2):
                raise self.source.error("must be one value, or two: forward and backward", location, value=raw)
            changes["friction"] = numbers if len(numbers) > 1 else numbers[0]
        if "gear_ratio" in entry and "rotor_inertia" not in entry:
            raise self.source.error("is of no use without rotor_inertia", (*place, "gear_ratio"))
        if "rotor_inertia" in entry:
            kinds = _dimensions("rotor_inertia", joint.turning)
            inertia = self._number((*place, "rotor_inertia"), entry["rotor_inertia"], kinds)
            ratio = self._number((*place, "gear_ratio"), entry.get("gear_ratio", 1.0), ())
            if joint.turning and (hint := rotor_doubt(inertia, ratio, entry)):
                warn_caller(UnitWarning(str(self.source.error(hint, (*place, "rotor_inertia")))))
            changes["armature"] = inertia * ratio**2
        try:
            return dataclasses.replace(joint, **changes)
        except RobotError as error:
            key = {"spring_reference": "reference", "armature": "rotor_inertia"}
            last = (error.name or "").rpartition(".")[2]
            raise self.source.error(error.message, (*place, key.get(last, last)), value=error.value) from None

    def _closure(self, name: str) -> Closure:
        location = ("closures", name)
        entry = self.source.mapping(location, OF_CLOSURE)
        kind = entry.get("type")
        if kind not in TYPES:
            raise self.source.error(no_such("closure", kind, TYPES, "type"), (*location, "type"), value=kind)
        frames = entry.get("frames")
        if not isinstance(frames, list) or len(frames) != 2:
            raise self.source.error(
                "must be two frames, each a link or {link, xyz, rpy}", (*location, "frames"), value=frames
            )
        located = [self._frame((*location, "frames"), frame) for frame in frames]
        axis = None
        if "axis" in entry:
            if TYPES[kind] not in ("pin", "slider"):
                raise self.source.error(
                    f"a closure of type {kind} has no axis", (*location, "axis"), value=entry["axis"]
                )
            axis = self._vector((*location, "axis"), entry["axis"], ())
        try:
            return loop_closure(name, kind, located, axis)
        except RobotError as error:
            raise self.source.error(error.message, location, value=error.value) from None

    def _frame(self, location: Location, frame: Any) -> tuple[str, list[float], list[float]]:
        given: Mapping[str, Any] = {"link": frame} if isinstance(frame, str) else frame
        if not isinstance(given, Mapping) or not set(given) <= set(OF_FRAME) or "link" not in given:
            raise self.source.error("a frame is a link or {link, xyz, rpy}", location, value=frame)
        if given["link"] not in self.given.links:
            raise self.source.error(no_such("link", given["link"], self.given.links), location, value=given["link"])
        xyz, rpy = (
            self._vector(location, given.get(key, [0.0] * 3), kinds)
            for key, kinds in (("xyz", (LENGTH,)), ("rpy", (ANGLE,)))
        )
        return given["link"], xyz, rpy

    def _vector(self, location: Location, raw: Any, kinds: tuple[Dimension, ...]) -> list[float]:
        if not isinstance(raw, list) or len(raw) != 3:
            raise self.source.error("must be three numbers", location, value=raw)
        return [self._number(location, part, kinds) for part in raw]

    def _number(self, location: Location, raw: Any, kinds: tuple[Dimension, ...]) -> float:
        parsed = self.source.value(location, raw)
        if parsed.dimension and parsed.dimension not in kinds:
            expected = " or ".join(describe_dimension(kind) for kind in kinds) or "a number without unit"
            message = f"the unit is that of {describe_dimension(parsed.dimension)}; needed is {expected}"
            raise self.source.error(message, location, value=raw)
        if not isinstance(parsed.value, float) or not math.isfinite(parsed.value):
            raise self.source.error("must be a finite number", location, value=raw)
        return parsed.value


def rotor_doubt(inertia: float, ratio: float, values: Mapping[str, Any]) -> str:
    """Return a doubt about a rotor without a unit that is too heavy for a motor behind gears, or an empty text."""
    if not isinstance(values.get("rotor_inertia"), int | float) or inertia < HEAVY or abs(ratio) < GEARED:
        return ""
    doubt = f"a rotor of {inertia:g} kg*m^2 is {inertia * ratio**2:.3g} kg*m^2 behind a gear ratio of {ratio:g}"
    return f"{doubt}: {inertia:g} kg*cm^2? A number without a unit is in SI"


def _dimensions(key: str, turning: bool) -> tuple[Dimension, ...]:
    """Return the valid dimensions of the unit of a value of a joint."""
    time = {"stiffness": -2, "damping": -1, "friction": -2, "rotor_inertia": 0}[key]
    length = 0 if not turning else 2
    if key == "friction":
        length = 2 if turning else 1
    base = dimension_of(mass=1, length=length, time=time)
    per_angle = key in ("stiffness", "damping") and turning
    return (base, dimension_of(mass=1, length=length, time=time, angle=-1)) if per_angle else (base,)


def _check_closed(robot: Robot) -> None:
    """Raise RobotError if loops cannot be closed from any of several positions within the joint limits."""
    loops, random = Loops(robot), np.random.default_rng(1)
    limits = [robot.joints[name].limits for name in robot.joint_names]
    lower = np.array([-math.pi / 2 if x.lower is None else x.lower for x in limits])
    upper = np.array(
        [max(math.pi / 2, low) if x.upper is None else x.upper for x, low in zip(limits, lower, strict=True)]
    )
    lower = np.minimum(lower, upper)
    first: RobotError | None = None
    for k in range(STARTS):
        q = given_coordinates(robot, None) if k == 0 else random.uniform(lower, upper)
        try:
            loops.closed(q)
            return
        except RobotError as error:
            first = first or error
    assert first is not None
    raise first
