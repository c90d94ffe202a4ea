"""Make the reference files beside this one: forces of robots and their rates in thirty digits, computed with fifty.

Run from the root of the repository: ``python -m tests.robot.references.make``. Every number is a decimal string; inputs
are floats in full, so that what is read back as a float is what the oracle was given.
"""

import json
from pathlib import Path

import numpy as np
from mpmath import mp, mpf

from tests.oracles import mp_urdf
from tests.oracles.mp_robot import State, from_numbers, motion
from tests.oracles.mp_series import Series

HERE = Path(__file__).parent
ROBOTS = HERE.parents[2] / "examples" / "robots"
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
RATES = 6
ARM_START, ARM_FREQUENCIES = [0, -0.4, 0, -1.8, 0, 1.6, 0.5], [1.1, 2.3, 4.1]


def text(value, digits=30):
    """Return nested lists of decimal strings; floats in full."""
    if isinstance(value, Series):
        return text(value.derivatives(), digits)
    if isinstance(value, list | tuple | np.ndarray):
        return [text(x, digits) for x in value]
    return mp.nstr(value, digits, strip_zeros=True) if isinstance(value, mpf) else repr(float(value))


def by_level(series):
    """Return [level][item] from series for each item."""
    return [list(level) for level in zip(*(s.derivatives() for s in series), strict=True)]


def sines(seed, n, instants, order):
    """Return floats [sample][level][joint] of coordinates that are sums of three sines each."""
    rng = np.random.default_rng(seed)
    size, phase = rng.uniform(0.1, 0.35, (n, 3)), rng.uniform(0, 2 * np.pi, (n, 3))
    frequency = np.array([1.1, 2.3, 4.1]) * rng.uniform(0.8, 1.25, (n, 1))
    found = []
    for t in instants:
        turned = [np.sin(frequency * t + phase + k * np.pi / 2) * frequency**k * size for k in range(order + 1)]
        found.append([level.sum(axis=1) for level in turned])
    return np.array(found)


def write(name, **content):
    (HERE / f"{name}.json").write_text(json.dumps(content, indent=1) + "\n")


def torques_of_file(name, locked, seed, instants):
    """Write torques and six rates of a robot file along sums of sines."""
    robot = mp_urdf.load(ROBOTS / f"{name}.urdf").locked(locked)
    q = sines(seed, len(robot.moving), instants, RATES + 2)
    forces = [by_level(State(robot, [motion(column) for column in sample.T]).forces()) for sample in q]
    joints = [robot.bodies[k].joint for k in robot.moving]
    write(name, locked=list(locked), joints=joints, q=text(q), torque=text(forces))


def tree_bodies():
    """Return a tree of seven bodies with every kind of joint, as floats."""
    rng = np.random.default_rng(2025)
    parents, kinds = [-1, 0, 1, 1, 0, 4, 5], "revolute prismatic revolute fixed revolute prismatic revolute".split()
    bodies = []
    for parent, kind in zip(parents, kinds, strict=True):
        turned, square = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=(3, 3))
        second = 0.1 * square @ square.T
        body = {"parent": parent, "type": kind, "position": rng.uniform(-0.5, 0.5, 3), "axis": rng.normal(size=3)}
        body |= {"rotation": turned * np.linalg.det(turned), "mass": rng.uniform(0.5, 2)}
        bodies.append(body | {"center": rng.uniform(-0.3, 0.3, 3), "inertia": np.trace(second) * np.eye(3) - second})
    return bodies


def tree():
    """Write forces, reactions, energies, Jacobian and center of mass of the tree."""
    bodies, gravity = tree_bodies(), [0.3, -1.2, -9.7]
    robot = from_numbers(bodies, gravity)
    q = sines(7, len(robot.moving), [0.0, 0.7, 1.9], RATES + 2)
    point = [0.2, -0.3, 0.4]
    forces, wrenches, energies, jacobians, centers = [], [], [], [], []
    for sample in q:
        state = State(robot, [motion(column) for column in sample.T])
        forces.append(by_level(state.forces()))
        wrenches.append([by_level([*force, *moment]) for force, moment in (state.wrench(k) for k in robot.moving)])
        per_order = []
        for p in range(4):
            parts = [part for k in range(len(bodies)) for part in state.energies(k, p)]
            per_order.append([mp.fsum(level) for level in by_level(parts)])
        energies.append(per_order)
        jacobians.append([by_level(column) for column in state.jacobian(6, point)])
        centers.append(by_level(state.center_of_mass()))
    plain = [{k: v if isinstance(v, str | int) else text(v) for k, v in body.items()} for body in bodies]
    results = {"torque": forces, "wrench": wrenches, "energy": energies, "jacobian": jacobians, "center": centers}
    write(
        "tree", bodies=plain, gravity=text(gravity), point=point, q=text(q), **{k: text(v) for k, v in results.items()}
    )


def arm():
    """Write torque and two rates of the panda at 21 of 10,000 samples of the trajectory that the benchmark uses."""
    robot = mp_urdf.load(ROBOTS / "panda.urdf").locked(FINGERS)
    rng = np.random.default_rng(7)
    size, phase = rng.uniform(0.1, 0.35, (7, 3)), rng.uniform(0, 2 * np.pi, (7, 3))
    instants, torque, q = np.arange(10_000) * 1e-3, [], []
    samples = np.linspace(0, 9_999, 21).astype(int)
    for t in instants[samples]:
        columns = []
        for start, sizes, phases in zip(ARM_START, size, phase, strict=True):
            column = [mpf(start)] + [mpf(0)] * 4
            for a, w, angle in zip(sizes, ARM_FREQUENCIES, phases, strict=True):
                for k in range(5):
                    column[k] += mpf(a) * mpf(w) ** k * mp.sin(mpf(w) * mpf(t) + mpf(angle) + k * mp.pi / 2)
            columns.append(column)
        q.append([[float(x) for x in level] for level in zip(*columns, strict=True)])
        torque.append(by_level(State(robot, [motion(column) for column in columns]).forces()))
    joints = [robot.bodies[k].joint for k in robot.moving]
    write("arm", locked=list(FINGERS), joints=joints, time=text(instants[samples]), q=text(q), torque=text(torque))


def main():
    with mp.workdps(50):
        arm()
        torques_of_file("panda", FINGERS, 3, [0.0, 0.4, 1.1, 2.3, 3.9])
        torques_of_file("solo12", (), 5, [0.3, 1.7])
        tree()


if __name__ == "__main__":
    main()
