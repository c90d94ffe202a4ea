"""Motor torques of a panda with elastic joints, beside differences of Pinocchio's torques.

What motors need beyond the rigid arm is the second rate of the torque. Without rates it is differenced: torques at five
instants, of fourth order in their distance, which is chosen best.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import jounce as jn
from benchmarks.arm import arm, motion, pinocchio_arm
from benchmarks.cases import Case, Cases, Contestant, ready

REFERENCE = "fifty digits at 21 samples (tests/robot/references/arm.json), of the second rate of the torque"
STIFFNESS, ROTOR, GEAR = 1e4, 5e-5, 100.0
STEPS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0  # of the second derivative
DISTANCE = 3e-3  # s


def differenced(q: np.ndarray) -> Callable[[], Any]:
    """Return a loop over Pinocchio's Python function at five instants, which gives motor torques, (samples, 7)."""
    import pinocchio

    model = pinocchio_arm()
    data, rnea = model.createData(), pinocchio.rnea
    count, n = q.shape[0], q.shape[2]
    times = DISTANCE * STEPS
    states = np.zeros((len(STEPS), 3, count, n))
    for level in range(3):  # along the polynomials that the derivatives say; not timed
        for power in range(level, q.shape[1]):
            weight = times ** (power - level) / math.factorial(power - level)
            states[:, level] += weight[:, None, None] * q[:, power]
    torques = np.empty((len(STEPS), count, n))

    def run() -> Any:
        for k in range(len(STEPS)):
            for sample, (x, v, a) in enumerate(zip(*states[k], strict=True)):
                torques[k, sample] = rnea(model, data, x, v, a)
        rate = np.tensordot(SECOND, torques, 1) / DISTANCE**2
        return torques[2] + GEAR**2 * ROTOR * (q[:, 2] + rate / STIFFNESS)

    return run


def cases(quick: bool) -> Cases:
    """Yield the motor torques of many states."""
    robot, samples = arm(), 2000 if quick else 10_000
    q, torque = motion(samples)
    drive = jn.planning.Drive(stiffness=STIFFNESS, rotor_inertia=ROTOR, gear_ratio=GEAR)
    drives = dict.fromkeys(robot.joint_names, drive)
    known = len(torque)
    springs = GEAR**2 * ROTOR * torque[:, 2] / STIFFNESS
    rigid = torque[:, 0] + GEAR**2 * ROTOR * q[:known, 2]

    def error(found: Any) -> float:
        return float(np.abs(np.asarray(found)[:known] - rigid - springs).max() / np.abs(springs).max())

    ours = Contestant(
        "jounce", ready(lambda: jn.planning.feedforward(robot, q, drives, losses=False).torque[:, 0]), error
    )
    peer = Contestant("Pinocchio from Python, differenced", lambda: differenced(q), error, "pinocchio")
    name = f"motor torques of a panda with elastic joints, {samples:,} samples"
    yield Case(name, [ours, peer], count=samples, unit="sample", reference=REFERENCE)
