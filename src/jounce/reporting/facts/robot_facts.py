"""The contents of a robot file: links, joints with their limits, masses, and loops with their assembly."""

from __future__ import annotations

import dataclasses
from os import PathLike, fspath
from typing import Any, Literal, NotRequired

from typing_extensions import TypedDict

from jounce.errors import RobotError
from jounce.io.robots.other_readers import FREE_BASE, READERS, as_read_by, permutation
from jounce.reporting.text.summaries import freedom_words
from jounce.robot import Joint, Robot
from jounce.robot.closed_loops.closures import closure_wrenches


class LinkFacts(TypedDict):
    """A link: its mass properties (kg, m, kg m^2), and the link with which it moves."""

    name: str
    moves_with: str
    mass: float | None
    center_of_mass: list[float] | None
    inertia: list[list[float]] | None


class LimitFacts(TypedDict):
    """Limits of a joint; None is no limit."""

    lower: float | None
    upper: float | None
    velocity: float | None
    acceleration: float | None
    jerk: float | None
    effort: float | None
    effort_rate: float | None
    deceleration: float | None


class MimicFacts(TypedDict):
    """The joint, or joints, that a joint follows."""

    joint: str | list[str]
    multiplier: float | list[float]
    offset: float


class JointFacts(TypedDict):
    """A joint."""

    name: str
    type: str
    parent: str
    child: str
    axis: list[float] | None
    unit: str | None
    limits: LimitFacts | None
    mimic: MimicFacts | None
    armature: float
    damping: float
    friction: float | list[float]
    stiffness: float
    spring_reference: float


class ClosureFacts(TypedDict):
    """The closure of a loop; the numbers of independent and redundant equations are None if the loop cannot close."""

    name: str
    type: str
    links: list[str]
    equations: NotRequired[int | None]
    redundant: NotRequired[int | None]


class FreedomFacts(TypedDict):
    """The coordinates, and the degrees of freedom left by the equations of loops; None if unknown."""

    coordinates: int
    equations: int
    left: int | None
    words: str


class LoopFacts(TypedDict):
    """Whether the loops close."""

    status: Literal["assembled", "open"]
    message: str | None


class RobotFacts(TypedDict):
    """The contents of a robot file."""

    kind: Literal["robot"]
    title: str
    gravity: list[float]
    base: str
    mass: float
    links: list[LinkFacts]
    joints: list[JointFacts]
    closures: list[ClosureFacts]


class OtherJoint(TypedDict):
    """A joint of the file in the vectors of another program; `factors` turn our velocities into those of the program.

    They are None if they vary.
    """

    joint: str
    coordinates: list[str]
    position: int
    velocity: int
    positions: list[str]
    velocities: list[str]
    factors: list[dict[str, float]] | None
    offset: float
    note: str


class OtherReader(TypedDict):
    """The coordinates in another program, whose velocities are ``factors * ours[indices]`` if these exist."""

    name: str
    version: str
    positions: int
    velocities: int
    indices: list[int] | None
    factors: list[float] | None
    joints: list[OtherJoint]
    note: str


class InspectedRobot(RobotFacts):
    """The contents of a robot file, and its start; ``ok`` is whether the loops close."""

    file: str | None
    freedom: FreedomFacts
    assembly: LoopFacts
    ok: bool
    other_reader: NotRequired[OtherReader]


def robot_facts(robot: Robot) -> dict[str, Any]:
    """Return the contents of a robot, before an examination of its loops: RobotFacts.

    Parameters
    ----------
    robot : Robot
    """
    return {
        "kind": "robot",
        "title": robot.name,
        "gravity": robot.gravity.tolist(),
        "base": robot.base,
        "mass": robot.mass,
        "links": [_link(robot, name) for name in robot.links],
        "joints": [_joint(joint) for joint in robot.joints.values()],
        "closures": [{"name": name, "type": x.type, "links": list(x.links)} for name, x in robot.closures.items()],
    }


def inspected_robot(robot: Robot, path: str | PathLike[str] | None = None) -> dict[str, Any]:
    """Return the facts of a robot before a motion, as plain data in SI units: InspectedRobot.

    Parameters
    ----------
    robot : Robot
        The robot; its loops may be impossible to close.
    path : optional
        File of the robot.

    Examples
    --------
    >>> import jounce as jn
    >>> facts = inspected_robot(jn.load_robot("examples/robots/scara.urdf"))
    >>> facts["freedom"]["words"], [joint["name"] for joint in facts["joints"] if joint["type"] == "prismatic"]
    ('4 degrees of freedom', ['quill'])
    """
    facts, message, borne, wrenches = robot_facts(robot), None, 0, {}
    try:
        wrenches = closure_wrenches(robot)
    except RobotError as error:
        message = error.message
    for closure in facts["closures"]:
        name = closure["name"]
        transmitted, rest = (len(part) for part in wrenches[name]) if name in wrenches else (None, None)
        borne += transmitted or 0
        closure.update(equations=transmitted, redundant=rest)
    coordinates = len(robot.joint_names)
    freedom = None if message else coordinates - borne
    phrase = "unknown" if freedom is None else freedom_words(freedom, ())
    return facts | {
        "file": None if path is None else fspath(path),
        "freedom": {"coordinates": coordinates, "equations": borne, "left": freedom, "words": phrase},
        "assembly": {"status": "open" if message else "assembled", "message": message},
        "ok": message is None,
    }


def other_reader(reader: str, path: str | PathLike[str], robot: Robot) -> OtherReader:
    """Return the coordinates of a robot file in another program.

    Raises
    ------
    RobotError
        If the program is unknown, or does not read such a file.
    """
    joints, position, velocity = as_read_by(reader, path, robot), 0, 0
    made: list[OtherJoint] = []
    for joint in joints:
        made.append(
            {
                "joint": joint.joint,
                "coordinates": list(joint.coordinates),
                "position": position,
                "velocity": velocity,
                "positions": list(joint.positions),
                "velocities": list(joint.velocities),
                "factors": None if joint.factors is None else [dict(row) for row in joint.factors],
                "offset": joint.offset,
                "note": joint.note,
            }
        )
        position += len(joint.positions)
        velocity += len(joint.velocities)
    indices, factors = permutation(joints, robot) or (None, None)
    return {
        "name": reader,
        "version": READERS[reader],
        "positions": position,
        "velocities": velocity,
        "indices": indices,
        "factors": factors,
        "joints": made,
        "note": FREE_BASE.get(reader, ""),
    }


def _link(robot: Robot, name: str) -> dict[str, Any]:
    inertia, frame = robot.links[name].inertia, robot.frames[name]
    return {
        "name": name,
        "moves_with": robot.base if frame.body < 0 else robot.moving_links[frame.body],
        "mass": None if inertia is None else float(inertia.mass),
        "center_of_mass": None if inertia is None else inertia.center_of_mass.tolist(),
        "inertia": None if inertia is None else inertia.tensor.tolist(),
    }


def _joint(joint: Joint) -> dict[str, Any]:
    mimic: MimicFacts | None = None
    if joint.mimic is not None:
        leaders, multipliers = joint.mimic.joint, joint.mimic.multiplier
        if joint.mimic.several:
            leaders, multipliers = list(leaders), list(multipliers)
        mimic = {"joint": leaders, "multiplier": multipliers, "offset": joint.mimic.offset}
    return {
        "name": joint.name,
        "type": joint.type,
        "parent": joint.parent,
        "child": joint.child,
        "axis": joint.axis.tolist() if joint.moving else None,
        "unit": "rad" if joint.turning else "m" if joint.moving else None,
        "limits": dataclasses.asdict(joint.limits) if joint.moving else None,
        "mimic": mimic,
        "armature": joint.armature,
        "damping": joint.damping,
        "friction": joint.friction,
        "stiffness": joint.stiffness,
        "spring_reference": joint.spring_reference,
    }
