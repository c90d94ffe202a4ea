"""Accelerations of the Franka panda from torques, and their rates, beside Pinocchio and MuJoCo; against the joints.

The torques are those of Pinocchio's inverse dynamics for known accelerations, which are the reference. Of rates, the
highest derivatives of the same motion are.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

import jounce as jn
from benchmarks.arm import arm, motion, mujoco_model, pinocchio_arm
from benchmarks.cases import Case, Cases, Contestant, ready
from benchmarks.references import largest_error
from tests.problems.robots import random_robot

REFERENCE = "the motion that inverse dynamics made the torques of, by the peak of each derivative"
JOINTS = (4, 8, 16, 32, 64)


def pinocchio_accelerations(state: np.ndarray, torque: np.ndarray) -> Callable[[], Any]:
    """Return a loop over Pinocchio's Python function, which gives accelerations, (samples, 1, 7)."""
    import pinocchio

    model = pinocchio_arm()
    data, found, aba = model.createData(), np.empty_like(torque), pinocchio.aba
    rows = [np.ascontiguousarray(x) for x in (state[:, 0], state[:, 1], torque[:, 0])]

    def run() -> Any:
        for k, (q, v, t) in enumerate(zip(*rows, strict=True)):
            found[k, 0] = aba(model, data, q, v, t)
        return found

    return run


def mujoco_accelerations(state: np.ndarray, torque: np.ndarray) -> Callable[[], Any]:
    """Return a loop over MuJoCo's forward dynamics, (samples, 1, 7)."""
    import mujoco

    model = mujoco_model()
    data, found = mujoco.MjData(model), np.empty_like(torque)

    def run() -> Any:
        for k, ((q, v), (t,)) in enumerate(zip(state, torque, strict=True)):
            data.qpos, data.qvel, data.qfrc_applied = q, v, t
            mujoco.mj_forward(model, data)
            found[k, 0] = data.qacc
        return found

    return run


def cases(quick: bool) -> Cases:
    """Yield accelerations alone, with two and with six rates, and those of chains."""
    robot, samples = arm(), 2000 if quick else 10_000
    q = motion(samples)[0]
    torque = jn.inverse_dynamics(robot, q, drives=False)
    state, alone = np.ascontiguousarray(q[:, :2]), np.ascontiguousarray(torque[:, :1])

    def error(found: Any) -> float:
        found = np.asarray(found)
        return largest_error(found if found.shape[1] < 2 else found[:, 2:], q[:, 2:])

    ours = Contestant("jounce", ready(lambda: jn.forward_dynamics(robot, state, alone, drives=False)), error)
    python = Contestant(
        "Pinocchio, aba from Python", lambda: pinocchio_accelerations(state, alone), error, "pinocchio", aim=1.5
    )
    mujoco = Contestant("MuJoCo from Python", lambda: mujoco_accelerations(state, alone), error, "mujoco", extra="mjcf")
    name = f"acceleration of the panda from torques, {samples:,} samples"
    yield Case(name, [ours, python, mujoco], count=samples, unit="sample", reference=REFERENCE)
    ours = Contestant("jounce", ready(lambda: jn.forward_dynamics(robot, state, torque, drives=False)), error)
    name = f"acceleration of the panda and two rates, {samples:,} samples"
    yield Case(name, [ours], count=samples, unit="sample", reference=REFERENCE)
    for count in JOINTS[:2] if quick else JOINTS:
        yield _chain(count, samples // 5)


def _chain(count: int, samples: int) -> Case:
    robot = random_robot(1, count, tree=False)
    q = np.random.default_rng(count).uniform(-1, 1, (samples, 3, count))
    torque = jn.inverse_dynamics(robot, q, drives=False)

    def error(found: Any) -> float:
        return largest_error(np.asarray(found), q)

    ours = Contestant("jounce", ready(lambda: jn.forward_dynamics(robot, q[:, :2], torque, drives=False)), error)
    name = f"acceleration of a chain of {count} joints, {samples:,} samples"
    return Case(name, [ours], count=samples, unit="sample", reference=REFERENCE)
