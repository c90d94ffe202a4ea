"""Robots of the bank written as SDF files in the many ways that the format has to say one thing."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.problems.robots import poses


def numbers(values):
    return " ".join(f"{float(value):.17g}" for value in np.ravel(values))


def pose(matrix, form="euler_rpy", attributes=""):
    """Return a pose as an element, its turns in one of the forms of SDF."""
    turn = Rotation.from_matrix(matrix[:3, :3])
    if form == "quat_xyzw":
        return f'<pose rotation_format="{form}" {attributes}>{numbers(matrix[:3, 3])} {numbers(turn.as_quat())}</pose>'
    if form == "degrees":
        turns = turn.as_euler("xyz", degrees=True)
        return f'<pose degrees="true" {attributes}>{numbers(matrix[:3, 3])} {numbers(turns)}</pose>'
    return f"<pose {attributes}>{numbers(matrix[:3, 3])} {numbers(turn.as_euler('xyz'))}</pose>"


def random_pose(generator):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.random(rng=generator).as_matrix(), generator.uniform(-0.5, 0.5, 3)
    return matrix


def inertial(inertia, form):
    """Return the element of an inertia, in axes of its own."""
    own = np.eye(4)
    own[:3, 3] = inertia.center_of_mass
    own[:3, :3] = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    tensor = own[:3, :3].T @ np.array(inertia.tensor) @ own[:3, :3]
    entries = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    moments = "".join(f"<{key}>{numbers(tensor[place])}</{key}>" for key, place in entries.items())
    return f"<inertial>{pose(own, form)}<mass>{numbers(inertia.mass)}</mass><inertia>{moments}</inertia></inertial>"


def sdf(robot, version, seed=0, form="euler_rpy", beside=True, turned=()):
    """Return an SDF file of a robot without joints that follow others, in the dialect of a version.

    `beside` moves the origins of joints away from those of their children, along the axis or anywhere; of the joints
    `turned`, which are named, parent and child change places. From 1.7 on, poses are relative to one frame or another.
    """
    generator = np.random.default_rng(seed)
    new = tuple(map(int, version.split("."))) >= (1, 7)
    model = random_pose(generator)  # of the model in the world
    base = random_pose(generator)  # of the base in the model
    where = {name: base @ at for name, at in poses(robot, dict.fromkeys(robot.joints, 0.0)).items()}
    parts = [pose(model)]
    if new:
        where["mark"] = where[robot.base] @ random_pose(generator)
        attached = np.linalg.inv(where[robot.base]) @ where["mark"]
        parts.append(f'<frame name="mark" attached_to="{robot.base}">{pose(attached, form)}</frame>')
    placed = [robot.base]
    for name, link in robot.links.items():
        at, attributes = where[name], ""
        if new and name != robot.base and generator.random() < 0.7:
            other = ["mark", *placed][generator.integers(len(placed) + 1)]
            at, attributes = np.linalg.inv(where[other]) @ at, f'relative_to="{other}"'
        placed.append(name)
        body = inertial(link.inertia, form) if link.inertia else "<inertial><mass>0</mass>" + NOTHING
        parts.append(f'<link name="{name}">{pose(at, form, attributes)}{body}</link>')
    for joint in robot.joints.values():
        parts.append(_joint(joint, where, generator, version, form, beside, joint.name in turned))
    return f'<?xml version="1.0"?><sdf version="{version}"><model name="robot">{"".join(parts)}</model></sdf>', model


NOTHING = (
    "<inertia>" + "".join(f"<i{x}>0</i{x}>" for x in ("xx", "xy", "xz", "yy", "yz", "zz")) + "</inertia></inertial>"
)


def _joint(joint, where, generator, version, form, beside, turned):
    parent, child, sign = (joint.child, joint.parent, -1) if turned else (joint.parent, joint.child, 1)
    axis = sign * where[joint.child][:3, :3] @ joint.axis
    at = where[joint.child].copy()  # the joint is where the child of the robot is, or anywhere along a slide
    if beside:
        away = generator.uniform(-0.3, 0.3, 3) if joint.type in ("prismatic", "fixed") else axis * generator.normal()
        at[:3, 3] += away
        at[:3, :3] = Rotation.random(rng=generator).as_matrix()
    relative = np.linalg.inv(where[child]) @ at
    numbered = tuple(map(int, version.split(".")))
    frame, attributes, flag = at[:3, :3], "", ""
    if numbered >= (1, 7) and generator.random() < 0.5:
        frame, attributes = where["mark"][:3, :3], 'expressed_in="mark"'
    elif numbered < (1, 5):
        frame = np.eye(3)
    elif numbered < (1, 7) and generator.random() < 0.5:
        frame, flag = np.eye(3), "<use_parent_model_frame>1</use_parent_model_frame>"
    limits, drive = joint.limits, f"<damping>{joint.damping:.17g}</damping><friction>{joint.friction:.17g}</friction>"
    bounds = "".join(
        f"<{key}>{value:.17g}</{key}>"
        for key in ("lower", "upper", "velocity", "effort")
        if (value := getattr(limits, key)) is not None
    )
    axes = (
        f"<axis><xyz {attributes}>{numbers(frame.T @ axis)}</xyz>{flag}<limit>{bounds}</limit>"
        f"<dynamics>{drive}</dynamics></axis>"
    )
    kind = "revolute" if joint.type == "continuous" else joint.type
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return (
        f'<joint name="{joint.name}" type="{kind}">{ends}{pose(relative, form)}{axes if joint.moving else ""}</joint>'
    )
