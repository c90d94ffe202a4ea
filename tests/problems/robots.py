"""A bank of robots: the files of the examples, and random ones by seed; with a plain forward kinematics beside it."""

import pathlib

import numpy as np
from scipy.spatial.transform import Rotation

from jounce.io.robots.loader import load_robot
from jounce.rigid.inertia import Inertia
from jounce.robot.model.links_and_joints import Joint, Limits, Link
from jounce.robot.model.mimics import Mimic
from jounce.robot.robot import Robot

FILES = pathlib.Path(__file__).parents[2] / "examples" / "robots"
OF_FILES = ("panda", "ur5", "solo12", "scara", "planar_arm")
NAMES = (*OF_FILES, "serial", "branched", "mimic", "several", "floating_solo12")
"""Names of `bank`: every one is a robot that `robot_named` makes."""


def random_inertia(generator):
    """Return the inertia of a real body: the moments of a few point masses about their common center."""
    masses = generator.uniform(0.2, 1.0, 5)
    points = generator.uniform(-0.2, 0.2, (5, 3))
    points -= masses @ points / masses.sum()
    tensor = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
    return Inertia(masses.sum(), generator.uniform(-0.15, 0.15, 3), tensor)


def random_robot(seed, joints, tree=True, prismatic=0.25, mimic=0.0, fixed=0.2, several=False):
    """Return a robot of random joints, axes, poses and inertias; a chain unless `tree`.

    `prismatic`, `mimic` and `fixed` are the shares of joints that slide, follow an earlier one, or up to three if
    `several`, and carry a fixed link.
    """
    generator = np.random.default_rng(seed)
    links, made, ends, masters = [Link("base")], [], ["base"], []
    for k in range(joints):
        parent = ends[generator.integers(max(0, len(ends) - 3), len(ends))] if tree else ends[-1]
        slides = generator.random() < prismatic
        follows = None
        led = masters and generator.random() < mimic
        if led and several and len(masters) > 1:
            count = int(generator.integers(2, min(3, len(masters)) + 1))
            leaders = generator.choice(masters, count, replace=False).tolist()
            follows = Mimic(leaders, generator.uniform(-1.5, 1.5, count).tolist(), generator.uniform(-1, 1))
        elif led:
            follows = Mimic(
                masters[generator.integers(len(masters))], generator.uniform(-1.5, 1.5), generator.uniform(-1, 1)
            )
        else:
            masters.append(f"joint_{k}")
        made.append(
            Joint(
                f"joint_{k}",
                parent,
                f"link_{k}",
                "prismatic" if slides else "revolute",
                generator.uniform(-0.4, 0.4, 3),
                Rotation.random(rng=generator).as_matrix(),
                generator.normal(size=3),
                limits=Limits(lower=-2.0, upper=2.0, velocity=3.0, effort=100.0),
                mimic=follows,
                armature=0.0 if follows else generator.uniform(0.01, 0.2),
                damping=0.0 if follows else generator.uniform(0.1, 1.0),
                friction=0.0 if follows else generator.uniform(0.1, 1.0),
            )
        )
        links.append(Link(f"link_{k}", random_inertia(generator)))
        ends.append(f"link_{k}")
        if generator.random() < fixed:
            pose = generator.uniform(-0.2, 0.2, 3), Rotation.random(rng=generator).as_matrix()
            made.append(Joint(f"fixed_{k}", f"link_{k}", f"part_{k}", "fixed", *pose))
            links.append(Link(f"part_{k}", random_inertia(generator)))
            ends[-1] = f"part_{k}"
    return Robot(f"random_{seed}", links, made)


def humanoid():
    """Return a robot of 36 joints: waist and neck of 3, two legs of 6, two arms of 7 with a thumb and a finger each."""
    generator = np.random.default_rng(36)
    links, made = [Link("pelvis", random_inertia(generator))], []

    def chain(prefix, parent, count):
        for k in range(1, count + 1):
            name, axis = f"{prefix}_{k}", np.eye(3)[(k + 1) % 3]
            rotation = Rotation.from_euler("xyz", generator.uniform(-0.3, 0.3, 3)).as_matrix()
            made.append(
                Joint(name, parent, f"{name}_link", "revolute", generator.uniform(-0.3, 0.3, 3), rotation, axis)
            )
            links.append(Link(f"{name}_link", random_inertia(generator)))
            parent = f"{name}_link"
        return parent

    chest = chain("waist", "pelvis", 3)
    for side in ("left", "right"):
        chain(f"{side}_leg", "pelvis", 6)
        hand = chain(f"{side}_arm", chest, 7)
        chain(f"{side}_thumb", hand, 1)
        chain(f"{side}_finger", hand, 1)
    chain("neck", chest, 3)
    return Robot("humanoid", links, made)


def robot_named(name):
    """Return a robot of the bank."""
    if name == "floating_solo12":
        return load_robot(FILES / "solo12.urdf", floating_base=True)
    if name == "planar_arm":
        return load_robot(FILES / "planar_arm.xml")
    if name in ("panda", "ur5", "solo12", "scara"):
        return load_robot(FILES / f"{name}.urdf")
    made = {
        "serial": lambda: random_robot(5, 6, tree=False),
        "branched": lambda: random_robot(2, 9),
        "mimic": lambda: random_robot(3, 8, mimic=0.4),
        "several": lambda: random_robot(13, 8, mimic=0.5, several=True),
        "humanoid": humanoid,
    }
    return made[name]()


def bank():
    """Return the robots by name."""
    return {name: robot_named(name) for name in NAMES}


def coordinates(robot, seed=0):
    """Return coordinates of the joints by name, those that follow another included."""
    generator = np.random.default_rng(seed)
    values = {name: generator.uniform(-1, 1) for name in robot.joint_names}
    for joint in robot.joints.values():
        if joint.moving and joint.mimic is not None:
            values[joint.name] = sum(by * values[x] for x, by in joint.mimic.weights.items()) + joint.mimic.offset
    return values


def poses(robot, values):
    """Return the pose of every link in the frame of the base, (4, 4), from the joints alone, step by step."""
    found = {robot.base: np.eye(4)}
    for joint in robot.joints.values():
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = joint.rotation, joint.position
        if joint.moving:
            move = np.eye(4)
            if joint.type == "prismatic":
                move[:3, 3] = joint.axis * values[joint.name]
            else:
                move[:3, :3] = Rotation.from_rotvec(joint.axis * values[joint.name]).as_matrix()
            step = step @ move
        found[joint.child] = found[joint.parent] @ step
    return found


def body_poses(robot, values):
    """Return the poses of the bodies of the tree in the frame of the base, (bodies, 4, 4), from its arrays."""
    tree, parents = robot.tree, []
    for k in range(tree.shape.bodies):  # the ancestors of a body are those of its parent and itself
        rows = [
            j for j in range(k) if np.array_equal(tree.ancestors[j], tree.ancestors[k] - np.eye(tree.shape.bodies)[k])
        ]
        parents.append(rows[0] if rows else -1)
    q = np.array([values[name] for name in robot.joint_names])
    found = []
    for k, parent in enumerate(parents):
        amount = tree.multiplier[:, k] @ q[tree.coordinate[:, k]] + tree.offset[k]
        pose, move = np.eye(4), np.eye(4)
        pose[:3, :3], pose[:3, 3] = tree.rotation[k], tree.position[k]
        if tree.turning[k]:
            move[:3, :3] = Rotation.from_euler("z", amount).as_matrix()
        else:
            move[2, 3] = amount
        found.append((np.eye(4) if parent < 0 else found[parent]) @ pose @ move)
    return np.array(found)
