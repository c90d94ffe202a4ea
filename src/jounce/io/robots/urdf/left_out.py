"""Parts of URDF files that affect motions or forces besides links and joints: rotors are read, others warned of.

Drake, Gazebo, Isaac Sim and MuJoCo have elements of their own, which a reader of links and joints does not see.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping

from jounce.errors import no_such
from jounce.io.robots.elements.faults import (
    BUSHINGS,
    JOINT_SPRINGS,
    LEAVE,
    MASS_OF_SHAPES,
    PLUGINS,
    ROTORS,
    Faults,
    left_out,
)
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.joints import RATIO, ROTOR
from jounce.io.robots.sdf.left_out import DECAY, KINEMATIC, STATIC, follower, note_fluids
from jounce.robot.model.links_and_joints import Joint
from jounce.robot.robot import Robot

IN_GAZEBO = "links and joints that <gazebo> adds"
INTO_LINKS = "inertia and poses that <gazebo> gives links"
INTO_JOINTS = "axes, dynamics and poses that <gazebo> gives joints"
WEIGHT = "the weight of links that <gazebo> takes out of gravity, which other readers of URDF count"
FORCE_ELEMENTS = "<force_element>, which is a force"
REDUCTIONS = "<mechanicalReduction> of transmissions with rotors, which count with <drake:gear_ratio>, or 1 without it"
CONTROL_LIMITS = "limits of <ros2_control> that are tighter than <limit>"
SOFT_LIMITS = "soft limits of <safety_controller> that are tighter than <limit>"
QUATERNIONS = "quat_xyzw, which the version of this file does not have"
LINK_PARTS = ("inertial", "mass", "inertia", "pose")
JOINT_PARTS = ("axis", "axis2", "dynamics", "mimic", "pose", "gearbox_ratio")
OF_MUJOCO = "settings of gravity and fluids in <mujoco>"
OF_FILE = {
    "force_element": FORCE_ELEMENTS,
    "drake:linear_bushing_rpy": BUSHINGS,
}
OF_DYNAMICS = dict.fromkeys(("stiffness", "spring_k"), JOINT_SPRINGS) | dict.fromkeys(
    ("armature", "rotor_inertia"), ROTORS
)
SPRINGS = ("springStiffness", "spring_stiffness")
OTHER_ROTORS = ("rotorInertia", "rotor_inertia", "motorInertia", "motor_inertia")  # of actuators, undocumented
VERSIONS = ((1, 0), (1, 1), (1, 2))
YES, NO = ("true", "1"), ("false", "0")


def check_version(root: Element, faults: Faults) -> None:
    """Remove ``quat_xyzw`` from a file whose version does not have it, and record it: there it has no effect.

    The reference parser, urdfdom, reads it from version 1.1 on. In version 1.0, which is the default, it takes the
    identity, or ``rpy``. Unknown versions are refused, as in urdfdom.

    Raises
    ------
    RobotFileError
        If the version does not exist, or if a part that is left out is an error.
    """
    text = root.attributes.get("version", "1.0")
    match = re.fullmatch(r"(\d+)\.(\d+)", text.strip(), re.ASCII)
    if match is None or tuple(map(int, match.groups())) not in VERSIONS:
        valid = ", ".join(f"{major}.{minor}" for major, minor in VERSIONS)
        raise root.error(f"there is no such version of URDF; valid: {valid}", "version", value=text)
    if tuple(map(int, match.groups())) > (1, 0):
        return
    for element in root.children:
        holders = [element] if element.tag == "joint" else element.every("inertial") if element.tag == "link" else []
        for origin in (origin for holder in holders for origin in holder.every("origin")):
            if (value := origin.attributes.pop("quat_xyzw", None)) is not None:
                name = element.attributes.get("name", "")
                message = (
                    "quat_xyzw turns nothing below version 1.1 of URDF, and no version means 1.0: give rpy, or write "
                    '<robot version="1.1">'
                )
                faults.leave_out(
                    QUATERNIONS, name, origin.error(message, f"{element.tag}s", name, "origin", value=value)
                )


def rotors(root: Element, faults: Faults) -> dict[str, float]:
    """Return the inertia of rotors seen at the joints, by name: ``rotor_inertia * gear_ratio^2`` of transmissions.

    As in Drake, the ratio is 1 by default, and ``mechanicalReduction`` does not count; it is recorded where it would be
    the ratio. Transmissions of several joints or actuators are left out.
    """
    inertias: dict[str, float] = {}
    joint_names = dict.fromkeys(element.attributes.get("name", "") for element in root.every("joint"))
    for transmission in root.every("transmission"):
        actuators, joints = transmission.every("actuator"), transmission.every("joint")
        for actuator in actuators:
            rotor, gear = actuator.first(ROTOR), actuator.first(RATIO)
            if rotor is None:
                continue
            name = transmission.attributes.get("name") or actuator.attributes.get("name") or "transmission"
            location = ("transmissions", name)
            inertia = rotor.number("value", *location, ROTOR)
            ratio = 1.0 if gear is None else gear.number("value", *location, RATIO)
            if gear is None and (reduction := _reduction(transmission)) is not None:
                message = f"give <drake:gear_ratio>, by the square of which the rotor counts; {LEAVE.format('it')}"
                faults.leave_out(
                    REDUCTIONS, name, reduction.error(message, *location, reduction.tag, value=reduction.content)
                )
            if inertia < 0:
                raise rotor.error("must be zero or greater", *location, ROTOR, value=inertia)
            if inertia == 0:
                continue
            if len(actuators) != 1 or len(joints) != 1:
                faults.leave_out(ROTORS, name, rotor.error(left_out(ROTORS), *location, ROTOR, value=inertia))
                continue
            joint = joints[0].text("name", *location, "joint")
            if joint not in joint_names:
                raise joints[0].error(no_such("joint", joint, joint_names), *location, "joint", value=joint)
            inertias[joint] = inertias.get(joint, 0.0) + inertia * ratio**2
    return inertias


def _reduction(transmission: Element) -> Element | None:
    """Return the reduction of a transmission that is not 1, of its actuator or its joint."""
    parts = [part for holder in transmission.children for part in holder.every("mechanicalReduction")]
    return next((part for part in parts if part.content_numbers(1, "transmissions") not in ([1.0], [-1.0])), None)


def note_left_out(root: Element, robot: Robot, names: Mapping[str, list[Joint]], faults: Faults) -> None:
    """Record other parts of a file that change motions or forces, after the robot is made.

    Parameters
    ----------
    root : Element
        Element ``<robot>``.
    robot : Robot
        Robot made from the element.
    names : dict of str to list of Joint
        Joints of the robot that represent each joint of the file.
    faults : Faults
        Records the parts.

    Raises
    ------
    RobotFileError
        If a part that is left out is an error.
    """
    elements = {element.attributes.get("name", ""): element for element in root.every("joint")}
    moving = bool(robot.moving_joints)
    for element in root.children:
        if element.tag in OF_FILE:
            heading = OF_FILE[element.tag]
            _leave(faults, heading, element.attributes.get("name") or f"<{element.tag}>", element, LEAVE)
        elif element.tag == "joint":
            _note_dynamics(element, faults)
            _note_soft_limits(element, robot, faults)
        elif element.tag == "gazebo":
            for heading, label, part in _of_gazebo(element, elements, robot, names, moving=moving):
                _leave(faults, heading, label, part, LEAVE)
            note_fluids(element, faults)
        elif element.tag == "transmission":
            for part in (part for actuator in element.every("actuator") for part in actuator.children):
                if part.tag in OTHER_ROTORS:
                    _leave(faults, ROTORS, element.attributes.get("name") or part.tag, part, LEAVE)
        elif element.tag == "ros2_control":
            _note_control(element, elements, robot, faults)
        elif element.tag == "mujoco":
            _note_mujoco(element, faults)


def _leave(faults: Faults, heading: str, label: str, element: Element, message: str) -> None:
    error = element.error(message.format(heading), label, value=element.content.strip() or f"<{element.tag}>")
    faults.leave_out(heading, label, error)


def _note_dynamics(joint: Element, faults: Faults) -> None:
    """Record the extensions of simulators in the dynamics of a joint."""
    dynamics, name = joint.first("dynamics"), joint.attributes["name"]
    for key, heading in OF_DYNAMICS.items() if dynamics is not None and joint.attributes["type"] != "fixed" else ():
        location = ("joints", name, "dynamics", key)
        if dynamics is not None and (value := dynamics.numbers(key, 1, *location, infinite=True)) not in (None, [0.0]):
            faults.leave_out(heading, name, dynamics.error(left_out(heading), *location, value=value))


def _note_soft_limits(joint: Element, robot: Robot, faults: Faults) -> None:
    """Record a range that a controller keeps within that of a joint; both ends are zero if there is none."""
    soft, name = joint.first("safety_controller"), joint.attributes["name"]
    if soft is None or name not in robot.joints:
        return
    location = ("joints", name, "safety_controller")
    low, high = (
        (soft.numbers(f"soft_{end}_limit", 1, *location, infinite=True) or [0.0])[0] for end in ("lower", "upper")
    )
    limits = robot.joints[name].limits
    lower, upper = (
        -math.inf if limits.lower is None else limits.lower,
        math.inf if limits.upper is None else limits.upper,
    )
    if low < high and (low > lower or high < upper):
        error = soft.error(LEAVE.format(SOFT_LIMITS), *location, value=[low, high])
        faults.leave_out(SOFT_LIMITS, f"{name} from {low:g} to {high:g}", error)


def _note_control(control: Element, joints: Mapping[str, Element], robot: Robot, faults: Faults) -> None:
    """Record joints that follow others by a controller only, and limits that a controller keeps."""
    for interface in control.every("joint"):
        name = interface.attributes.get("name", "")
        joint = joints.get(name)
        for part in interface.every("param") if joint is not None and joint.first("mimic") is None else ():
            if part.attributes.get("name") == "mimic":
                _leave(faults, PLUGINS, name, part, LEAVE)
        if name not in robot.joints:
            continue
        limits = robot.joints[name].limits
        velocity, effort = ((None, None) if x is None else (-x, x) for x in (limits.velocity, limits.effort))
        bounds = {"position": (limits.lower, limits.upper), "velocity": velocity, "effort": effort}
        for command in interface.every("command_interface"):
            ends = bounds.get(command.attributes.get("name", ""))
            for part in command.every("param"):
                if ends is not None and _is_tighter(part, ends):
                    label = f"{name} {command.attributes['name']} {part.attributes['name']} {part.content.strip()}"
                    _leave(faults, CONTROL_LIMITS, label, part, LEAVE)


def _is_tighter(part: Element, ends: tuple[float | None, float | None]) -> bool:
    """Return whether a parameter is the end of a range within given ends."""
    key = part.attributes.get("name")
    if key not in ("min", "max"):
        return False
    try:
        value = float(part.content)
    except ValueError:  # an expression of a controller
        return False
    lower, upper = (-math.inf if ends[0] is None else ends[0]), (math.inf if ends[1] is None else ends[1])
    return value > lower if key == "min" else value < upper


def _note_mujoco(element: Element, faults: Faults) -> None:
    """Record settings of MuJoCo for forces and masses."""
    for part in element.children:
        given = [key for key in ("gravity", "density", "viscosity") if part.tag == "option" and key in part.attributes]
        for key in given:
            _leave(faults, OF_MUJOCO, f"{key} {part.attributes[key]}", part, LEAVE)
        shapes = part.attributes.get("inertiafromgeom") == "true" or "settotalmass" in part.attributes
        if part.tag == "compiler" and shapes:
            _leave(faults, MASS_OF_SHAPES, "<mujoco>", part, LEAVE)


def _of_gazebo(
    gazebo: Element,
    joints: Mapping[str, Element],
    robot: Robot,
    names: Mapping[str, list[Joint]],
    *,
    moving: bool,
) -> Iterator[tuple[str, str, Element]]:
    """Yield the changes by an element for Gazebo: heading, name of the link or joint, and element."""
    link = gazebo.attributes.get("reference", "").strip()
    moves = any(joint.moving for joint in names.get(link, ()))
    frame = robot.frames.get(link)
    on_moving = frame is not None and frame.body >= 0
    table: dict[str, tuple[str, bool, Callable[[Element], bool]]] = {
        **dict.fromkeys(SPRINGS, (JOINT_SPRINGS, moves and len(names.get(link, ())) > 1, _counts)),
        "gravity": (WEIGHT, on_moving, lambda x: x.content.strip() in NO),
        "turnGravityOff": (WEIGHT, on_moving, lambda x: x.content.strip() in YES),
        "kinematic": (KINEMATIC, on_moving, lambda x: x.content.strip() in YES),
        "static": (STATIC, moving and not link, lambda x: x.content.strip() in YES),
        "dampingFactor": (DECAY, on_moving, _counts),
        "velocity_decay": (DECAY, on_moving, lambda x: any(map(_counts, x.children))),
        **dict.fromkeys(LINK_PARTS, (INTO_LINKS, frame is not None, lambda _: True)),
        **(dict.fromkeys(JOINT_PARTS, (INTO_JOINTS, True, lambda _: True)) if moves else {}),
        "joint": (IN_GAZEBO, not link, lambda x: x.attributes.get("name") not in robot.closures),
        "link": (IN_GAZEBO, not link, lambda _: True),
        "plugin": (PLUGINS, True, lambda x: _followed(x, joints)),
    }
    for part in gazebo.children:
        heading, bears, counts = table.get(part.tag.partition(":")[0], ("", False, _counts))  # <joint:hinge>, once
        if bears and counts(part):
            label = link or part.attributes.get("name") or robot.name
            yield heading, follower(part) if part.tag == "plugin" else label, part


def _counts(element: Element) -> bool:
    """Return whether the content of an element is other than zero; content that is no number counts."""
    try:
        return float(element.content) != 0 and not math.isnan(float(element.content))
    except ValueError:
        return True


def _followed(plugin: Element, joints: Mapping[str, Element]) -> bool:
    """Return whether a plugin makes a joint follow another that does not follow it by itself."""
    joint = joints.get(follower(plugin))
    return joint is not None and joint.first("mimic") is None
