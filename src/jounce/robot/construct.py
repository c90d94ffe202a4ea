"""Robots from tables: Denavit-Hartenberg parameters and screw axes."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from jounce.base.shapes import ArrayLike
from jounce.errors import RobotError, check_choice
from jounce.rigid.inertia import Inertia, finite_numbers, vector_numbers
from jounce.robot.model.links_and_joints import UNLIMITED, Joint, Limits, Link
from jounce.robot.model.tree import turn_about
from jounce.robot.robot import Robot

CONVENTIONS = ("standard", "modified")
X, Y, Z = np.eye(3)


@dataclasses.dataclass(frozen=True)
class DenavitHartenberg:
    """One row of a Denavit-Hartenberg table; the variable parameter has its value at coordinate zero.

    Parameters
    ----------
    a : float, default 0
        Length of the link along x, m.
    alpha : float, default 0
        Twist of the link about x, rad.
    d : float, default 0
        Offset along z, m.
    theta : float, default 0
        Angle about z, rad.
    type : {"revolute", "continuous", "prismatic"}, default "revolute"
        The coordinate is added to theta, or to d of a prismatic joint.
    inertia : Inertia, optional
        Inertia of the moved link, in its Denavit-Hartenberg frame.
    limits : Limits, optional
        Limits of the joint.
    """

    a: float = 0.0
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    type: str = "revolute"
    inertia: Inertia | None = None
    limits: Limits = UNLIMITED


@dataclasses.dataclass(frozen=True, eq=False)
class JointAxis:
    """A joint, given by its screw axis in the frame of the base at coordinates zero. Negrean 2025, equations 31-34.

    Parameters
    ----------
    axis : array_like of shape (3,)
        Direction of the axis.
    point : array_like of shape (3,), default zero
        A point on the axis, m.
    type : {"revolute", "continuous", "prismatic"}, default "revolute"
        Whether the joint turns about the axis or slides along it.
    inertia : Inertia, optional
        Inertia of the moved link, in the frame of the base at coordinates zero.
    limits : Limits, optional
        Limits of the joint.
    """

    axis: Any
    point: Any = (0.0, 0.0, 0.0)
    type: str = "revolute"
    inertia: Inertia | None = None
    limits: Limits = UNLIMITED


def from_denavit_hartenberg(
    rows: Sequence[DenavitHartenberg], convention: str = "standard", name: str = "robot"
) -> Robot:
    """Return a serial robot from a table of Denavit-Hartenberg parameters.

    Links link_1 to link_n have their Denavit-Hartenberg frames; the joints are joint_1 to joint_n, the base is base.

    Parameters
    ----------
    rows : sequence of DenavitHartenberg
        One row for each joint, from the base outwards.
    convention : {"standard", "modified"}, default "standard"
        Standard: ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``, frames at the far end of links. Modified (Craig): ``Rx(alpha)
        Tx(a) Rz(theta) Tz(d)``, frames at the near end.
    name : str, default "robot"
        Name of the robot.

    Returns
    -------
    Robot
        On a fixed base, z up.

    Raises
    ------
    RobotError
        If the convention is unknown, or a row does not define a valid joint.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[-0.5, 0, 0])
    >>> arm = jn.robot.from_denavit_hartenberg([jn.robot.DenavitHartenberg(a=1.0, inertia=rod)] * 2)
    >>> arm.joint_names
    ('joint_1', 'joint_2')
    """
    check_choice("convention", convention, CONVENTIONS, RobotError)
    links, joints = [Link("base")], []
    for k, row in enumerate(rows, 1):
        for field in ("a", "alpha", "d", "theta"):
            finite_numbers(f"row {k}.{field}", getattr(row, field), ())
        parent, about_z, about_x = links[-1].name, turn_about(Z, row.theta), turn_about(X, row.alpha)
        options = {"type": row.type, "limits": row.limits}
        if convention == "modified":
            transform = about_x @ (row.a * X + row.d * Z)
            joints.append(
                Joint(f"joint_{k}", parent, f"link_{k}", position=transform, rotation=about_x @ about_z, **options)
            )
        else:  # the joint axis does not pass through the origin of the link frame: add a frame on the axis in between
            joints.append(Joint(f"joint_{k}", parent, f"axis_{k}", **options))
            links.append(Link(f"axis_{k}"))
            transform = about_z @ (row.a * X) + row.d * Z
            joints.append(Joint(f"fixed_{k}", f"axis_{k}", f"link_{k}", "fixed", transform, about_z @ about_x))
        links.append(Link(f"link_{k}", row.inertia))
    return Robot(name, links, joints)


def from_screws(screws: Sequence[JointAxis], tool: ArrayLike | None = None, name: str = "robot") -> Robot:
    """Return a serial robot from the screw axes of its joints, as in a product of exponentials.

    Links are named link_1 to link_n; at coordinates zero their frames coincide with that of the base. The frame tool is
    fixed to the last link.

    Parameters
    ----------
    screws : sequence of JointAxis
        One axis for each joint, from the base outwards.
    tool : array_like of shape (4, 4), optional
        Pose of the tool in the frame of the base at coordinates zero.
    name : str, default "robot"
        Name of the robot.

    Returns
    -------
    Robot
        On a fixed base, z up.

    Raises
    ------
    RobotError
        If an axis has no direction, a value is not finite, or the tool is not a rigid pose.

    Examples
    --------
    >>> import jounce as jn
    >>> load = jn.Inertia(2.0, center_of_mass=[1.0, 0, 0])
    >>> slide = jn.robot.JointAxis([0, 0, 1], type="prismatic", inertia=jn.Inertia(1.0))
    >>> arm = jn.robot.from_screws([slide, jn.robot.JointAxis([0, 0, 1], inertia=load)])
    >>> jn.inverse_dynamics(arm, [[0.0, 0.0], [0.0, 0.0], [0.0, 3.0]]).round(12).tolist()
    [[29.43, 6.0]]
    """
    links, joints, parent = [Link("base")], [], "base"
    for k, screw in enumerate(screws, 1):
        point = vector_numbers(f"screw {k}.point", screw.point, (3,))
        options = {"type": screw.type, "axis": screw.axis, "limits": screw.limits}
        joints.append(Joint(f"joint_{k}", parent, f"axis_{k}", position=point, **options))
        joints.append(Joint(f"fixed_{k}", f"axis_{k}", f"link_{k}", "fixed", position=-point))
        links += [Link(f"axis_{k}"), Link(f"link_{k}", screw.inertia)]
        parent = f"link_{k}"
    if tool is not None:
        pose = finite_numbers("tool", tool, (4, 4))
        if not np.array_equal(pose[3], [0, 0, 0, 1]):
            raise RobotError("must have the last row 0, 0, 0, 1", name="tool", value=pose[3].tolist())
        joints.append(Joint("tool", parent, "tool", "fixed", pose[:3, 3], pose[:3, :3]))
        links.append(Link("tool"))
    return Robot(name, links, joints)
