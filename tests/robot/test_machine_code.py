"""Machine code for many samples: the numbers of XLA's programs to rounding, the same ones by any number of threads."""

import numpy as np
import pytest

import jounce as jn
from jounce.execution.backends import VARIABLE
from jounce.execution.llvm.self_test import is_usable
from jounce.robot.algorithms.forward_dynamics import _forward_dynamics
from jounce.robot.algorithms.inverse_dynamics import generalized_forces
from jounce.robot.recursions.batches import LEAST_THREADED
from tests.problems.robots import random_robot, robot_named

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not is_usable(), reason="there is no compiler, or a system where it was not tried"),
]
COUNTS = (0, 1, 7, 129, 5000)
CONTINUOUS = jn.Robot(
    "wheel",
    [jn.Link("base"), jn.Link("rod", jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0.1, 0.2, 0.2]))],
    [jn.Joint("axle", "base", "rod", "continuous", axis=[0, -1, 0])],
)
ROBOTS = {
    "panda": lambda: robot_named("panda"),
    "sliding": lambda: random_robot(2, 4, tree=False, prismatic=1.0),
    "branched": lambda: random_robot(3, 6, prismatic=0.4),
    "followers": lambda: random_robot(4, 6, mimic=0.5),
    "wheel": lambda: CONTINUOUS,
    "long": lambda: random_robot(6, 40, tree=False),
    "floating": lambda: robot_named("floating_solo12"),
}


def both_ways(monkeypatch, call):
    """Return what a call gives by XLA's programs and by machine code."""
    found = []
    for native in "01":
        monkeypatch.setenv(VARIABLE, native)
        found.append(call())
    return found


def assert_same(found, expected):
    scale = np.abs(expected).max(initial=1e-300, axis=tuple(k for k in range(expected.ndim) if k != expected.ndim - 2))
    assert found.shape == expected.shape
    assert found.dtype == expected.dtype
    assert found.flags.writeable
    assert (np.abs(found - expected) <= 1e-13 * np.expand_dims(scale, -1)).all()


def motion(robot, count, levels):
    return np.random.default_rng(count).uniform(-1, 1, (count, levels, len(robot.joint_names)))


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("robot", ["panda", "floating"])
def test_torques_agree(monkeypatch, robot, count):
    robot = ROBOTS[robot]()
    q = motion(robot, count, 4)
    expected, found = both_ways(monkeypatch, lambda: jn.inverse_dynamics(robot, q, drives=True))
    assert_same(found, expected)
    assert generalized_forces.mapped.program((robot.tree, ()), (q,), static=((), True)).backend == "llvm"


@pytest.mark.slow
@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("robot", [name for name in ROBOTS if name not in ("panda", "floating")])
def test_torques_of_other_robots_agree(monkeypatch, robot, count):
    robot = ROBOTS[robot]()
    q = motion(robot, count, 4)
    expected, found = both_ways(monkeypatch, lambda: jn.inverse_dynamics(robot, q, drives=True))
    assert_same(found, expected)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_other_quantities_agree(monkeypatch, robot):
    robot = ROBOTS[robot]()
    q, link = motion(robot, 129, 4), robot.moving_links[-1]
    push = jn.robot.Wrench(link, [1.0, 2.0, 3.0], point=[0.0, 0.0, 0.1], frame="base")
    calls = [
        lambda: jn.inverse_dynamics(robot, q, wrenches=[push]),
        lambda: jn.robot.joint_wrenches(robot, q)[:, 0],
        lambda: jn.jacobian(robot, q, link)[:, 0],
        lambda: jn.forward_kinematics(robot, q, link).position,
        lambda: jn.robot.center_of_mass(robot, q),
        lambda: jn.mass_matrix(robot, q[:, 0]),
        lambda: jn.energy.kinetic_energy(robot, q).total[..., None],
    ]
    for call in calls:
        assert_same(*reversed(both_ways(monkeypatch, call)))


@pytest.mark.slow
@pytest.mark.parametrize("levels", [1, 2, 3, 7])
@pytest.mark.parametrize("robot", ["panda", "branched", "floating"])
def test_free_motion_gives_back_its_torques(monkeypatch, robot, levels):
    robot = ROBOTS[robot]()
    q, tau = motion(robot, 9, 2), np.random.default_rng(1).uniform(-1, 1, (9, levels, len(robot.joint_names)))
    monkeypatch.setenv(VARIABLE, "1")
    found = jn.forward_dynamics(robot, q, tau, drives=True)
    monkeypatch.setenv(VARIABLE, "0")
    again = jn.inverse_dynamics(robot, found, drives=True)
    size = np.abs(found[:, 2:]).max(axis=(0, 2)) * np.abs(jn.mass_matrix(robot, q[:, 0])).max() + 1.0
    assert (np.abs(again - tau) <= 1e-12 * size[:, None]).all()
    assert len(_forward_dynamics.mapped.machine_code)


def test_threads_change_no_bit(monkeypatch):
    robot = ROBOTS["panda"]()
    q, found = motion(robot, 3 * LEAST_THREADED + 5, 3), []
    for threads in "123":
        monkeypatch.setenv("JOUNCE_THREADS", threads)
        found.append(jn.inverse_dynamics(robot, q))
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])
    assert np.array_equal(found[0][1234:1241], jn.inverse_dynamics(robot, q[1234:1241]))
