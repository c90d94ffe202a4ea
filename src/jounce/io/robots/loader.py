"""Reading of robot files."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from jounce.errors import RobotFileError, UnitWarning, warn_caller
from jounce.io.files import ROBOT_FILES
from jounce.io.files.reading import check_allowed, name_of
from jounce.io.robots.closure_files import with_closures
from jounce.io.robots.elements.faults import FEW, MACROS, Faults
from jounce.io.robots.elements.xml_elements import Element, read_markup
from jounce.io.robots.mjcf.reader import read_mjcf
from jounce.io.robots.sdf.reader import read_sdf
from jounce.io.robots.urdf.reader import read_urdf
from jounce.robot.robot import Robot
from jounce.settings import under_own_settings

SHAPES = ("visual", "collision")
XACRO_SOURCE = ("xacro:include", "xacro:macro", "xacro:property", "xacro:arg", "xacro:if", "xacro:unless")
OLD_XACRO = ("include", "macro", "property")  # tags of xacro before it had a prefix
LEAST_DEGREES = 45  # rad, more than seven turns: smaller ranges are not taken for degrees
WIDE = 20.0  # radii of gyration of published robots are up to 16 times the reach, those of kg mm^2 some 300
XACRO = "is a xacro file, which must first be expanded to a URDF; run: xacro FILE.urdf.xacro > FILE.urdf"


@under_own_settings
def load_robot(
    path: str | PathLike[str],
    *,
    floating_base: bool | str = False,
    massless: bool = False,
    strict: bool = False,
    model: str | None = None,
    closures: str | PathLike[str] | None = None,
    allow: Iterable[str | PathLike[str]] = (),
) -> Robot:
    """Read a robot from a URDF, MJCF or SDF file.

    The root element determines the format. The reader takes what moves: links, joints and their limits, masses and
    inertias, from MJCF also gravity and the forces of actuators; shapes and meshes need not exist. URDF needs the extra
    ``robots``, MJCF the extra ``mjcf``.

    Parameters
    ----------
    path
        File ending in .urdf, .xml or .sdf.
    floating_base : bool or str, default False
        Whether to free the base, by three slides and three turns, as `Robot.with_floating_base` does; three letters
        give the sequence of the turns. A base that is only a massless frame with one link fixed to it is left out.
    massless : bool, default False
        Whether moving URDF links without mass that carry others are intended, and need no warning.
    strict : bool, default False
        Whether to raise errors instead of warnings.
    model : str, optional
        Name of the model in an SDF file with several; required unless only one of them moves, or joints connect those
        that do.
    closures
        File with loops, springs and rotors that the robot file lacks; see `with_closures`.
    allow
        Folders besides that of the file below which included files, models and meshes may lie.

    Returns
    -------
    Robot
        Robot whose frames, links and joints have the names of the file.

    Raises
    ------
    RobotFileError
        If the file cannot be read or describes no possible robot: the message names the file, the line, the entry and
        the value.

    Warns
    -----
    RobotWarning
        If links have values that no real robot has: negative moments of inertia, one that exceeds the sum of the other
        two by more than rounding, moments without mass, moving links without mass, a mass without moments of inertia,
        or SDF links without a mass or all moments. All results are computed with the numbers of the file. Or if parts
        of the file are left out: nonlinear springs, fluids, contributions of tendons between points, elements that the
        format does not have, or ranges of joints that leave their leader no room to move. One warning names all links,
        joints and parts.

    Examples
    --------
    >>> from jounce.io.robots.loader import load_robot
    >>> robot = load_robot("examples/robots/scara.urdf")
    >>> robot.joint_names
    ('shoulder', 'elbow', 'quill', 'wrist')
    >>> robot.limits["quill"].effort
    220.0
    """
    name = name_of(path, RobotFileError)
    if not name:
        raise RobotFileError("the name of a file is needed", value=name)
    suffix = Path(name).suffix.lower()
    if suffix == ".xacro":
        raise RobotFileError(XACRO, path=name)
    if suffix not in ROBOT_FILES and not Path(name).is_dir():
        message = f"the kind of a robot file is given by its extension; valid: {', '.join(ROBOT_FILES)}"
        raise RobotFileError(message, path=name)
    faults = Faults(name, strict)
    root = read_markup(name, faults)
    if model is not None and root.tag != "sdf":
        raise root.error("only an SDF file holds models to choose from; leave the name of one out", value=model)
    if root.tag == "robot":
        _check_expanded(root, faults)
        robot = read_urdf(root, faults, massless)
    elif root.tag == "mujoco":
        if suffix != ".xml":
            raise RobotFileError("MuJoCo reads MJCF only from files whose names end in .xml; rename it", path=name)
        robot = read_mjcf(root, faults, check_allowed(allow))
    elif root.tag == "sdf":
        robot = read_sdf(root, faults, model, check_allowed(allow))
    else:
        message = (
            "is not a robot file; the root element of a URDF is <robot>, of an MJCF file <mujoco>, of an SDF <sdf>"
        )
        raise root.error(message, value=f"<{root.tag}>")
    if (warning := faults.warning()) is not None:
        warnings.warn(warning, stacklevel=2)
    _warn_of_degrees(robot, name)
    _warn_of_wide_inertias(robot, name)
    if closures is not None:
        robot = with_closures(robot, closures)
    if floating_base is False:
        return robot
    return _released(robot, "ZYX" if floating_base is True else floating_base, name)


def _warn_of_degrees(robot: Robot, path: str) -> None:
    """Warn of joints that turn by ranges as people write them in degrees, more than seven turns in fives."""
    doubtful = []
    for joint in robot.joints.values():
        ends = [joint.limits.lower, joint.limits.upper]
        if not joint.turning or None in ends:
            continue
        lower, upper = (float(end) for end in ends if end is not None)
        is_round = lower % 5 == 0 and upper % 5 == 0 and (lower % 50 != 0 or upper % 50 != 0)  # 100 stands for no limit
        if is_round and LEAST_DEGREES <= max(abs(lower), abs(upper)) <= 360:
            doubtful.append(f"{joint.name} ({lower:g} to {upper:g})")
    _warn_of_units("these ranges of joints look like degrees, and are read as radians", doubtful, "write radians", path)


def _warn_of_wide_inertias(robot: Robot, path: str) -> None:
    """Warn of links whose mass would lie much farther out than any joint or center of mass, as with kg mm^2."""
    inertias = {name: link.inertia for name, link in robot.links.items() if link.inertia is not None}
    vectors = [*(joint.position for joint in robot.joints.values()), *(x.center_of_mass for x in inertias.values())]
    reach = max((float(np.linalg.norm(vector)) for vector in vectors), default=0.0)
    doubtful = []
    for name, inertia in inertias.items():
        radius = np.sqrt(np.abs(inertia.tensor).max() / inertia.mass) if inertia.mass > 0 else 0.0
        if robot.moving_joints and reach > 0 and radius > max(1.0, WIDE * reach):
            doubtful.append(f"{name} ({radius:.3g} m)")
    message = f"these links have moments of inertia as if their mass were this far out, where all lies in {reach:.3g} m"
    _warn_of_units(message, doubtful, "write kg m^2", path)


def _warn_of_units(message: str, doubtful: Sequence[str], advice: str, path: str) -> None:
    if doubtful:
        excess = len(doubtful) - FEW
        phrase = ", ".join(doubtful if excess <= 0 else [*doubtful[:FEW], f"and {excess} more"])
        warn_caller(UnitWarning(f"{path}: {message}: {phrase}; {advice}"))


def _check_expanded(root: Element, faults: Faults) -> None:
    """Raise an error for unexpanded xacro code in links and joints; other calls left in a URDF are recorded."""
    elements = [root]
    source = any(child.tag in XACRO_SOURCE for child in root.children) or root.first("link") is None
    for child in root.children:
        if child.tag in OLD_XACRO or (child.tag.startswith("xacro:") and not source):
            message = f"{child.tag} is not expanded, and what it stands for is left out; run xacro, or take it out"
            faults.leave_out(MACROS, f"<{child.tag}>", child.error(message, value=f"<{child.tag}>"))
            continue
        if child.tag in ("link", "joint"):
            elements += [element for part in child.children if part.tag not in SHAPES for element in part.walk()]
        if child.tag in ("link", "joint") or child.tag.startswith("xacro:"):
            elements.append(child)
    for element in elements:
        if element.tag.startswith("xacro:"):
            raise element.error(XACRO, value=f"<{element.tag}>")
        for value in element.attributes.values():
            if "${" in value or "$(" in value:
                raise element.error(XACRO, value=value)


def _released(robot: Robot, sequence: str, path: str) -> Robot:
    """Return the robot on a floating base, which is named world."""
    joints = list(robot.joints.values())
    attached = [joint for joint in joints if joint.parent == robot.base]
    closed_links = {link for closure in robot.closures.values() for link in closure.links}
    frame = robot.links[robot.base].inertia is None and robot.base not in closed_links
    if len(attached) == 1 and not attached[0].moving and frame:
        links = [link for name, link in robot.links.items() if name != robot.base]
        joints = [joint for joint in joints if joint is not attached[0]]
        robot = robot.changed(links=links, joints=joints)
    if "world" in robot.links:
        message = (
            "the robot cannot have a floating base: a link named world carries it; rename that link, or set the robot "
            "free in the file, by a joint of type floating in a URDF or a <freejoint/> in MJCF"
        )
        raise RobotFileError(message, path=path, name="links.world")
    return robot.with_floating_base(sequence)
