"""Numbering of the coordinates of a robot file in other programs, and the conversion of vectors to it.

The rules are those of the versions below, found by reading files with each program; ``docs/other_readers.md`` has the
measurements.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike, fspath
from typing import Any

import numpy as np

from jounce.errors import RobotError, RobotFileError, check_choice
from jounce.io.robots.elements.xml_elements import Element, read_markup
from jounce.robot.model.floating_base import floating_joints
from jounce.robot.model.tree import axes_with_z_along
from jounce.robot.robot import Robot

READERS = {"pinocchio": "4.1", "mujoco": "4.0", "drake": "1.51", "pybullet": "3.2.7", "yourdfpy": "0.0.60"}
"""Programs whose numbering is known, and the examined version of each."""
OF_FORMAT = {"robot": tuple(READERS), "mujoco": ("mujoco",)}
FREE_BASE = {
    "drake": "the base is free, with 7 positions and 6 velocities before these, unless it is welded to the world",
    "pybullet": "the base is free, and no part of these, unless useFixedBase=True",
}
VALUE = ("value",)
PLACE, TURN = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
SPIN, SPEED = ("wx", "wy", "wz"), ("vx", "vy", "vz")
FREE = {  # positions and velocities of a floating joint
    "pinocchio": ((*PLACE, "qx", "qy", "qz", "qw"), (*SPEED, *SPIN), "velocities along the axes of the link"),
    "mujoco": ((*PLACE, *TURN), (*SPEED, *SPIN), "wx, wy, wz along the axes of the link, vx, vy, vz of the parent"),
    "drake": ((*TURN, *PLACE), (*SPIN, *SPEED), "velocities along the axes of the parent"),
    "pybullet": ((), (), "PyBullet holds the link in place, as if the joint were fixed"),
}


@dataclasses.dataclass(frozen=True)
class ForeignJoint:
    """A joint of a file in the vectors of another program.

    Parameters
    ----------
    joint : str
        Name of the joint in the file.
    coordinates : tuple of str
        Names of the coordinates that represent it here, as in `Robot.joints`.
    positions, velocities : tuple of str
        Components of the joint in the other program: ``value``, or parts such as ``cos``, ``qw``, ``vx``.
    factors : tuple of dict of str to float, optional
        Each velocity of the other program as a sum of velocities here, as factors by the name in `Robot.joint_names`;
        None if it depends on the position.
    offset : float, default 0
        Constant added to the sum for a position of a single value, rad or m.
    note : str
        Further remark.
    """

    joint: str
    coordinates: tuple[str, ...]
    positions: tuple[str, ...] = VALUE
    velocities: tuple[str, ...] = VALUE
    factors: tuple[Mapping[str, float], ...] | None = None
    offset: float = 0.0
    note: str = ""


def as_read_by(reader: str, path: str | PathLike[str], robot: Robot) -> list[ForeignJoint]:
    """Return the joints of a robot file in the order in which another program numbers its coordinates.

    Parameters
    ----------
    reader : str
        ``"pinocchio"``, ``"mujoco"``, ``"drake"``, ``"pybullet"`` or ``"yourdfpy"``; for MJCF files only ``"mujoco"``,
        and for SDF files none.
    path
        Robot file.
    robot : Robot
        Robot read from the file.

    Raises
    ------
    RobotError
        If the program is unknown, or its reading of such files or joints has not been examined.

    Examples
    --------
    >>> import jounce as jn
    >>> path = "examples/robots/solo12.urdf"
    >>> [x.joint for x in as_read_by("pinocchio", path, jn.load_robot(path))][:4]
    ['FL_HAA', 'FL_HFE', 'FL_KFE', 'FR_HAA']
    """
    check_choice("reader", reader, tuple(READERS), RobotError)
    root = read_markup(fspath(path))
    valid = OF_FORMAT.get(root.tag, ())
    if reader not in valid:
        readers = f"known readers of it: {', '.join(valid)}" if valid else "no reader of this format is known"
        raise root.error(f"how {reader} reads this format has not been examined; {readers}", "reader", value=reader)
    return list(_of_mjcf(path, robot) if root.tag == "mujoco" else _of_urdf(reader, root, robot))


def permutation(joints: Sequence[ForeignJoint], robot: Robot) -> tuple[list[int], list[float]] | None:
    """Return indices and factors with ``theirs = factors * ours[indices]`` for velocities.

    None if a velocity of the other program is no multiple of one of ours, or depends on the position.
    """
    indices, factors = [], []
    for joint in joints:
        if joint.factors is None or any(len(row) != 1 for row in joint.factors):
            return None
        for row in joint.factors:
            ((name, factor),) = row.items()
            indices.append(robot.joint_names.index(name))
            factors.append(factor)
    return indices, factors


def _of_urdf(reader: str, root: Element, robot: Robot) -> Iterator[ForeignJoint]:
    elements = {element.attributes.get("name", ""): element for element in root.every("joint")}
    by_name = reader == "pinocchio"  # its parser sorts joints by name
    for name in list(elements) if reader == "yourdfpy" else _depth_first(elements, by_name):
        element = elements[name]
        kind = element.attributes.get("type", "")
        if kind in ("floating", "planar", "spherical"):
            yield _of_several(reader, name, kind, element, first=name == _first(elements))
        elif kind != "fixed" and not (reader == "yourdfpy" and robot.joints[name].mimic):
            yield _single(reader, name, robot)


def _depth_first(elements: Mapping[str, Element], by_name: bool) -> list[str]:
    """Return joints from the base outward, depth first; those of one link by name or in the order of the file."""
    names = sorted(elements, key=str.encode) if by_name else list(elements)
    ends = {name: [_link(elements[name], role) for role in ("parent", "child")] for name in names}
    children_of: dict[str, list[str]] = {}
    for name in names:
        children_of.setdefault(ends[name][0], []).append(name)
    children = {child for _, child in ends.values()}
    pending = [name for name in reversed(names) if ends[name][0] not in children]
    ordered = []
    while pending:
        ordered.append(pending.pop())
        pending += reversed(children_of.get(ends[ordered[-1]][1], []))
    return ordered


def _first(elements: Mapping[str, Element]) -> str:
    moving = [x for x in _depth_first(elements, False) if elements[x].attributes.get("type") != "fixed"]
    return moving[0]


def _link(joint: Element, role: str) -> str:
    part = joint.first(role)
    return "" if part is None else part.attributes.get("link", "")


def _single(reader: str, name: str, robot: Robot) -> ForeignJoint:
    """Return a joint of one coordinate, which may follow another."""
    joint = robot.joints[name]
    endless = joint.type == "continuous" and reader == "pinocchio"
    positions = ("cos", "sin") if endless else VALUE
    if joint.mimic is None:
        return ForeignJoint(name, (name,), positions, factors=({name: 1.0},))
    follows = "a constraint holds it there" if reader in ("mujoco", "drake") else "nothing holds it there"
    note = f"a coordinate of its own, where we have it follow {', '.join(joint.mimic.weights)}; {follows}"
    factors = (joint.mimic.weights,)
    return ForeignJoint(name, (name,), positions, factors=factors, offset=joint.mimic.offset, note=note)


def _of_several(reader: str, name: str, kind: str, element: Element, *, first: bool) -> ForeignJoint:
    """Return a joint of several coordinates."""
    readers = {"planar": ("pinocchio", "mujoco", "drake"), "floating": tuple(FREE), "spherical": ("mujoco",)}[kind]
    if reader not in readers or (kind == "floating" and reader == "drake" and not first):
        message = f"how {reader} numbers this {kind} joint has not been examined"
        raise element.error(message, "joints", name, value=kind)
    if kind == "planar":
        return _planar(reader, name, element)
    names = tuple(joint.name for joint in floating_joints("", prefix=name)[1])
    if kind == "spherical":
        return ForeignJoint(name, names[3:], TURN, SPIN, note="velocities along the axes of the link")
    positions, velocities, note = FREE[reader]
    return ForeignJoint(name, names, positions, velocities, note=note)


def _planar(reader: str, name: str, element: Element) -> ForeignJoint:
    """Return a planar joint: all programs but Pinocchio turn x and y by the shortest turn of z onto the axis."""
    names = tuple(f"{name}_{suffix}" for suffix in ("x", "y", "angle"))
    if reader == "pinocchio":
        note = "in the plane of x and y whatever the axis; velocities along the axes of the link"
        return ForeignJoint(name, names, ("x", "y", "cos", "sin"), ("vx", "vy", "wz"), note=note)
    axis = element.first("axis")
    direction = np.array((None if axis is None else axis.numbers("xyz", 3, "joints", name)) or [1.0, 0.0, 0.0])
    direction /= np.linalg.norm(direction)
    if direction[2] < 0:
        message = f"how {reader} chooses the directions of a planar joint with this axis has not been examined"
        raise element.error(message, "joints", name, value=direction.tolist())
    from scipy.spatial.transform import Rotation

    turn = np.cross([0.0, 0.0, 1.0], direction)
    sine = float(np.linalg.norm(turn))
    shortest = Rotation.from_rotvec(turn / sine * np.arctan2(sine, direction[2]) if sine else turn).as_matrix()
    components = shortest[:, :2].T @ axes_with_z_along(direction)[:, :2]
    rows = [{names[k]: float(x) for k, x in enumerate(row) if abs(x) > 1e-15} for row in components]
    return ForeignJoint(name, names, ("x", "y", "angle"), ("vx", "vy", "wz"), (*rows, {names[2]: 1.0}))


def _of_mjcf(path: str | PathLike[str], robot: Robot) -> Iterator[ForeignJoint]:
    """Yield the joints of an MJCF file by their number in MuJoCo; those of the robot have the same order."""
    import mujoco as package

    from jounce.io.robots.mjcf.files import quiet_mujoco

    mujoco: Any = package
    with quiet_mujoco(mujoco):
        spec = mujoco.MjSpec.from_file(fspath(path))
    names = [joint.name or f"joint_{number}" for number, joint in enumerate(spec.joints)]
    pending = [joint for joint in robot.joints.values() if joint.moving or joint.name in names]
    for name, joint in zip(names, spec.joints, strict=True):
        count = {mujoco.mjtJoint.mjJNT_FREE: 6, mujoco.mjtJoint.mjJNT_BALL: 3}.get(joint.type, 1)
        parts, pending = pending[:count], pending[count:]
        if len(parts) < count:
            raise RobotFileError("MuJoCo has more joints than were read", path=fspath(path), name=name)
        ours = tuple(part.name for part in parts)
        if count == 6:
            positions, velocities, note = FREE["mujoco"]
            yield ForeignJoint(name, ours, positions, velocities, note=note)
        elif count == 3:
            yield ForeignJoint(name, ours, TURN, SPIN, note="velocities along the axes of the link")
        elif parts[0].moving:
            yield _single("mujoco", parts[0].name, robot)
        else:
            yield ForeignJoint(name, (), factors=({},), note="an equality holds it where it is; we have it fixed")
