"""Torque with two rates against the number of joints: chains, and a humanoid."""

import numpy as np

import jounce as jn
from benchmarks.cases import Case, Cases, Contestant, ready
from tests.problems.robots import humanoid, random_robot


def cases(quick: bool) -> Cases:
    """Yield chains of hinges of any shape, and a tree of 36; the first call compiles."""
    chains = [
        random_robot(n, n, tree=False, prismatic=0.0, fixed=0.0) for n in ((4, 8) if quick else (4, 8, 16, 32, 64))
    ]
    samples = 1000 if quick else 10_000
    for robot in (*chains, humanoid()):
        joints = len(robot.joint_names)
        q = np.random.default_rng(joints).normal(size=(samples, 5, joints))
        name = f"{'humanoid' if robot.name == 'humanoid' else 'chain'} of {joints} joints, torque and two rates"
        run = ready(lambda robot=robot, q=q: jn.inverse_dynamics(robot, q, drives=False))
        yield Case(f"{name}, first call", [Contestant("jounce", run)], rounds=0, at={"joints": joints})
        yield Case(
            f"{name}, {samples:,} samples",
            [Contestant("jounce", run)],
            count=samples * joints,
            unit="sample and joint",
            at={"joints": joints},
        )
