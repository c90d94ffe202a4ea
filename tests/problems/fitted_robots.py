"""Robots with all that joints may be fitted with: springs, tendons, balls, rotors, followers, loads and loops.

The files are those of MuJoCo, which is a peer for the forces of each.
"""

import dataclasses
import functools
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import jounce as jn
from tests.problems.random_loops import random_loop

BODY = '<inertial pos="0.1 0.02 -0.03" mass="1.3" fullinertia="0.02 0.03 0.04 0.001 -0.002 0.003"/>'
HEAD = '<mujoco><compiler angle="radian"/><option gravity="0.3 -1 -9.7"/>'
CHAIN = f"""<worldbody><body name="a" pos="0.1 0 0.2" euler="0.2 0.1 0">
<joint name="h" axis="0 1 0.2" {{h}}/>{BODY}
<body name="b" pos="0.3 0 0" euler="0.2 0.3 0.5" gravcomp="0.4">
<joint name="s" type="slide" axis="1 0 0.3" {{s}}/>{BODY}
<body name="c" pos="0.1 0 0.2" gravcomp="1"><joint name="k" axis="0 0.2 1" {{k}}/>{BODY}
<body name="d" pos="0.1 0.1 0" euler="0.4 0 0"><joint name="e" axis="1 0 0" {{e}}/>{BODY}
</body></body></body></body></worldbody>"""
SPRUNG = {
    "h": 'stiffness="5" springref="0.3" ref="0.1" damping="0.3" frictionloss="0.2" armature="0.02"',
    "s": 'stiffness="40" springref="0.05" damping="0.7" frictionloss="0.4" armature="0.3"',
    "k": 'damping="0.1"',
    "e": 'stiffness="2" armature="0.01"',
}
BARE = dict.fromkeys("hske", "")
TENDONS = """<tendon>
<fixed name="line" stiffness="30" damping="0.7" springlength="0.2" armature="0.6" frictionloss="0.3">
<joint joint="h" coef="0.4"/><joint joint="s" coef="-1.5"/><joint joint="k" coef="0.2"/></fixed>
<fixed name="other" stiffness="3"><joint joint="h" coef="1"/><joint joint="e" coef="1"/></fixed></tendon>"""
ROTORS = """<actuator><motor joint="h" gear="50" armature="1e-4" damping="2e-4"/>
<motor joint="s" gear="-20" armature="1e-3"/></actuator>"""
FOLLOWS = '<equality><joint joint1="k" joint2="h" polycoef="0.1 -1.5 0 0 0"/></equality>'
MOUNTED = f"""<worldbody><body name="a" euler="0.3 0 0">
<joint name="h" axis="0 1 0" damping="0.1" armature="0.05"/>{BODY}
<body name="b" pos="0.3 0 0" euler="0.2 0.3 0.5"><joint name="ball" type="ball" pos="0.1 0 0.05" damping="0.4"
armature="0.05" frictionloss="0.2"/>{BODY}
<body name="c" pos="0 0.1 0.2"><joint name="s" type="slide" axis="0 1 0" stiffness="3"/>{BODY}</body></body></body>
</worldbody>"""
FLYING = f"""<worldbody><body name="cube" pos="1 1 1" euler="0.2 0.3 0.5">
<joint name="object" type="free" damping="0.3" armature="0.07" frictionloss="0.1"/>{BODY}
<body name="c" pos="0 0.1 0.2"><joint name="k" axis="0 1 1" stiffness="3" damping="0.2"/>{BODY}</body></body>
</worldbody>"""
TEXTS = {
    "springs": CHAIN.format(**SPRUNG),
    "tendons": CHAIN.format(**BARE) + TENDONS,
    "rotors": CHAIN.format(**BARE) + ROTORS,
    "mimic": CHAIN.format(**SPRUNG) + TENDONS + FOLLOWS,
    "ball": MOUNTED,
    "free": FLYING,
}
"""Files by name, of all but the head."""


def text_of(name):
    """Return the file of a robot."""
    return HEAD + TEXTS[name] + "</mujoco>"


def read(text, suffix=".xml"):
    """Return the robot of a text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"robot{suffix}"
        path.write_text(text, encoding="utf-8")
        return jn.load_robot(path, strict=True)


@functools.cache
def fitted(name):
    """Return a robot of the bank."""
    if name == "payload":
        load = jn.Inertia(0.7, [0.1, -0.2, 0.05], np.diag([0.01, 0.02, 0.025]))
        return fitted("springs").with_payload("b", load).with_payload("d", load)
    if name == "one-sided":  # friction that differs by direction, which files of MuJoCo do not have
        robot = fitted("mimic")
        sides = {"h": (0.3, 0.1), "s": (0.2, 0.5), "k": (0.6, 0.4)}
        joints = [dataclasses.replace(x, friction=sides.get(x.name, x.friction)) for x in robot.joints.values()]
        return robot.changed(joints=joints)
    return read(text_of(name))


NAMES = (*TEXTS, "payload", "one-sided")


def kept_frames(robot):
    """Return the links whose frames a ball tells: those of its turns."""
    balls = [x for x in robot.couplings.values() if isinstance(x, jn.robot.BallDrive)]
    return {robot.joints[name].child for ball in balls for name in ball.joints}


def redrawn(robot, random):
    """Return the same robot with frames of links, the base too, drawn elsewhere and turned, and where they were drawn.

    Of each link the latter has the origin and the axes of the new frame in the old one.
    """
    kept, moves = kept_frames(robot), {}
    frames = {robot.base: None, **{joint.child: joint for joint in robot.joints.values()}}
    for link, joint in frames.items():
        if link in kept:
            moves[link] = np.zeros(3), np.eye(3)
            continue
        shift = random.uniform(-0.3, 0.3, 3)
        if joint is not None and joint.turning:
            shift = joint.axis * shift[0]  # the origin stays on the axis
        moves[link] = shift, Rotation.random(rng=random).as_matrix()
    links = []
    for link in robot.links.values():
        shift, turn = moves[link.name]
        inertia = None if link.inertia is None else link.inertia.moved(-turn.T @ shift, turn.T)
        links.append(dataclasses.replace(link, inertia=inertia))
    joints = []
    for joint in robot.joints.values():
        (at, turned), (shift, turn) = moves[joint.parent], moves[joint.child]
        position = turned.T @ (joint.position + joint.rotation @ shift - at)
        rotation = turned.T @ joint.rotation @ turn
        joints.append(dataclasses.replace(joint, position=position, rotation=rotation, axis=turn.T @ joint.axis))
    closures = []
    for closure in robot.closures.values():
        (first, turned), (second, other) = (moves[link] for link in closure.links)
        points = [turned.T @ (closure.points[0] - first), other.T @ (closure.points[1] - second)]
        rotation = turned.T @ closure.rotation @ other
        axis = None if closure.axis is None else turned.T @ closure.axis
        closures.append(dataclasses.replace(closure, points=points, rotation=rotation, axis=axis))
    gravity = moves[robot.base][1].T @ robot.gravity
    return robot.changed(links=links, joints=joints, closures=closures, gravity=gravity), moves


# -- loops ------------------------------------------------------------------------------------------------------------

CLOSED = f"""<worldbody><body name="crank"><joint name="A" axis="0 0 1" {{A}}/>{BODY}
<body name="rod" pos="0.5 0 0"><joint name="B" axis="0 0 1" {{B}}/>{BODY}
<site name="tip" pos="0.9 0.1 0.05"/></body></body>
<body name="rocker" pos="1 0.1 0" gravcomp="0.6"><joint name="D" axis="0 0 1" {{D}}/>{BODY}
<site name="end" pos="0.6 0 0.05"/>
<body name="hand" pos="0 0.2 0.1"><joint name="F" axis="1 0 0" {{F}}/>{BODY}</body></body></worldbody>
<equality><connect site1="tip" site2="end"/>"""
DRIVEN = {
    "A": 'stiffness="5" springref="0.3" damping="0.3" frictionloss="0.2" armature="0.2"',
    "B": 'damping="0.4" armature="0.1"',
    "D": 'stiffness="7" springref="-0.2" damping="0.5" frictionloss="0.1"',
    "F": 'armature="0.3" damping="0.2"',
}
LINKAGE = """<?xml version="1.0"?><robot name="linkage"><link name="base"/>
{links}
<joint name="A" type="continuous"><parent link="base"/><child link="crank"/><axis xyz="0 0 1"/>
<dynamics damping="0.3" friction="0.2"/></joint>
<joint name="B" type="{kind}"><parent link="crank"/><child link="rod"/><origin xyz="0.5 0 0"/>{axis}
<dynamics damping="0.4"/></joint>
<joint name="D" type="continuous"><parent link="base"/><child link="rocker"/><origin xyz="{at}"/>
<axis xyz="0 0 1"/><dynamics damping="0.5"/></joint>{loop}</robot>"""
LINK = """<link name="{}"><inertial><origin xyz="0.1 0.02 -0.03" rpy="0.1 0.2 0.3"/><mass value="1.3"/>
<inertia ixx="0.02" ixy="0.001" ixz="-0.002" iyy="0.03" iyz="0.003" izz="0.04"/></inertial></link>"""
PIN = """<loop_joint name="tip" type="continuous"><link1 link="rod" xyz="0.9 0.1 0.05" rpy="0 0 0"/>
<link2 link="rocker" xyz="0.6 0 0.05" rpy="0 0 0"/><axis xyz="0 0 1"/></loop_joint>"""
BESIDE = """joints:
  A: {stiffness: 5 N*m/rad, reference: 0.3 rad, rotor_inertia: 1e-4 kg*m^2, gear_ratio: 40}
  D: {friction: [0.3, 0.2], stiffness: 7 N*m/rad}
closures:
  tip:
    type: slider
    frames: [{link: rod, xyz: [0.3 m, 0, 0]}, {link: rocker, xyz: [0.2 m, 0, 0]}]
    axis: [1, 0, 0]
"""


def _linkage(kind, axis, loop, at):
    links = "".join(LINK.format(name) for name in ("crank", "rod", "rocker"))
    return LINKAGE.format(links=links, kind=kind, axis=axis, loop=loop, at=at)


@functools.cache
def closed(name):
    """Return a robot with a loop, coordinates near which it is assembled, and the laws of its motors."""
    if name == "connect":  # redundant across the plane, and a hand that is free of the loop
        robot = read(HEAD + CLOSED.format(**DRIVEN) + "</equality></mujoco>")
        return robot, {"A": 0.5, "B": 0.3, "D": 1.5}, {"A": "0.5 + 0.4*sin(t)", "F": "0.3*cos(2*t)"}
    if name == "mimic":
        follows = '<joint joint1="F" joint2="B" polycoef="0.1 2 0 0 0"/></equality></mujoco>'
        robot = read(HEAD + CLOSED.format(**DRIVEN) + follows)
        return robot, {"A": 0.5, "B": 0.3, "D": 1.5}, {"A": "0.5 + 0.4*sin(t)"}
    if name == "payload":
        robot, near, laws = closed("connect")
        load = jn.Inertia(0.7, [0.1, -0.2, 0.05], np.diag([0.01, 0.02, 0.025]))
        return robot.with_payload("hand", load).with_payload("rod", load), near, laws
    if name == "pin":
        robot = read(_linkage("continuous", '<axis xyz="0 0 1"/>', PIN, "1 0.1 0"), ".urdf")
        return robot, {"A": 0.5, "B": 0.3, "D": 1.5}, {"A": "0.5 + 0.4*sin(t)"}
    if name == "slider":
        with tempfile.TemporaryDirectory() as folder:
            path, beside = Path(folder) / "robot.urdf", Path(folder) / "loops.yaml"
            path.write_text(_linkage("continuous", '<axis xyz="0 0 1"/>', "", "1 0.1 0"), encoding="utf-8")
            beside.write_text(BESIDE, encoding="utf-8")
            robot = jn.load_robot(path, closures=beside)
        return robot, {"A": 0.5, "B": 0.3, "D": 0.5}, {"A": "0.5 + 0.4*sin(t)"}
    robot = random_loop()  # a weld of seven skew hinges
    fitting = {"stiffness": 3.0, "spring_reference": 0.2, "damping": 0.4, "armature": 0.2, "friction": (0.2, 0.1)}
    joints = [dataclasses.replace(joint, **fitting) for joint in robot.joints.values()]
    return robot.changed(joints=joints), {}, {"joint_1": "0.3*sin(t)"}


CLOSED_NAMES = ("connect", "mimic", "payload", "pin", "slider", "weld")
