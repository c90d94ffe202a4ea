"""What a robot file holds: links, joints with their limits, masses, loops and whether they close."""

from __future__ import annotations

import dataclasses
from os import PathLike, fspath
from typing import Any

from jounce.errors import RobotError
from jounce.reporting.summaries import count
from jounce.robot import Robot
from jounce.robot.closures import closure_wrenches

__all__ = ["inspected_robot"]


def inspected_robot(robot: Robot, path: str | PathLike[str] | None = None) -> dict[str, Any]:
    """Return what there is to know of a robot, as plain data in SI units.

    Parameters
    ----------
    robot : Robot
        One whose loops cannot be closed is told of too.
    path : optional
        Its file.

    Returns
    -------
    dict
        links, joints, closures, ``freedom`` and ``assembly`` as for mechanisms. ``ok`` is whether its loops close.

    Examples
    --------
    >>> import jounce as jn
    >>> facts = inspected_robot(jn.load_robot("examples/robots/scara.urdf"))
    >>> facts["freedom"]["words"], [joint["name"] for joint in facts["joints"] if joint["type"] == "prismatic"]
    ('4 degrees of freedom', ['quill'])
    """
    closures, message, borne = [], None, 0
    wrenches: Any = {}
    try:
        wrenches = closure_wrenches(robot)
    except RobotError as error:
        message = error.message
    for name, closure in robot.closures.items():
        kept, rest = (len(part) for part in wrenches[name]) if name in wrenches else (None, None)
        borne += kept or 0
        closures.append({
            "name": name, "type": closure.type, "links": list(closure.links), "equations": kept, "redundant": rest,
        })  # fmt: skip
    coordinates = len(robot.joint_names)
    freedom = None if message else coordinates - borne
    words = "unknown" if freedom is None else count(freedom, "degree of freedom", "degrees of freedom")
    return {
        "kind": "robot",
        "file": None if path is None else fspath(path),
        "title": robot.name,
        "gravity": robot.gravity.tolist(),
        "base": robot.base,
        "mass": robot.mass,
        "links": [_link(robot, name) for name in robot.links],
        "joints": [_joint(joint) for joint in robot.joints.values()],
        "closures": closures,
        "freedom": {"coordinates": coordinates, "equations": borne, "left": freedom, "words": words},
        "assembly": {"status": "open" if message else "assembled", "message": message},
        "ok": message is None,
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


def _joint(joint: Any) -> dict[str, Any]:
    mimic = None if joint.mimic is None else dataclasses.asdict(joint.mimic)
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
    }
