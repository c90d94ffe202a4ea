"""Programs for robots whose joints are parallel: the same motion with fewer products, and never for another robot."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jounce as jn
from jounce.integrate.marching.exact_numbers import ExactNumbers
from jounce.integrate.simulate_robot import _problem

Z, Y, X = np.eye(3)[::-1]
BODY = {"tensor": np.diag([0.1, 0.2, 0.25])}
TILTED = {"tensor": [[0.1, 0.01, 0.02], [0.01, 0.2, -0.03], [0.02, -0.03, 0.25]]}


def robot(*joints, inertia=BODY, center=(0.1, 0.05, 0.02), **first):
    """Return a tree of joints, each a parent, a type and an axis."""
    links = [jn.Link("base"), *(jn.Link(f"l{k}", jn.Inertia(1.0, center, **inertia)) for k in range(len(joints)))]
    made = []
    for k, (parent, kind, axis) in enumerate(joints):
        more = {"damping": 0.02} | (first if k == 0 else {})
        made.append(jn.Joint(f"j{k}", parent, f"l{k}", kind, axis=axis, position=[0.3, 0.1 * k, 0.2], **more))
    return jn.Robot("tree", links, made, gravity=[1.0, -9.0, 3.0])


def exact(tree):
    return ExactNumbers.of_parallel(_problem(tree, None, None, True, None, ()).equations)


CHAIN = ("base", "continuous", Z), ("l0", "continuous", Z)
PARALLEL = {
    "chain": robot(*CHAIN),
    "about y": robot(("base", "continuous", Y), ("l0", "continuous", -Y)),
    "branches": robot(*CHAIN, ("l0", "continuous", Z), inertia=TILTED),
    "slides": robot(("base", "prismatic", X), ("l0", "continuous", Z), ("l1", "prismatic", Z)),
    "springs": robot(*CHAIN, stiffness=2.0, armature=0.1),
    "friction": robot(*CHAIN, friction=0.3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PARALLEL)
def test_a_program_for_parallel_joints_gives_the_same_motion(name, monkeypatch):
    tree = PARALLEL[name]
    n = len(tree.joint_names)
    state = np.stack([np.linspace(0.2, 0.9, n), np.linspace(-0.5, 0.4, n)])

    def motion():
        return jn.simulate(
            tree, np.linspace(0.0, 0.5, 6), 3, state=state, torque={"j0": "0.2*sin(3*t)"}, tolerance=1e-11
        )

    assert exact(tree) is not None
    found = motion()
    monkeypatch.setattr(ExactNumbers, "of_parallel", classmethod(lambda *_: None))
    expected = motion()
    assert np.array_equal(found.status, expected.status)
    assert len(found.steps.start) == len(expected.steps.start)
    np.testing.assert_allclose(found.q, expected.q, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize(
    "tree",
    [
        robot(("base", "continuous", Z), ("l0", "continuous", Y)),
        robot(("base", "continuous", [0.0, 0.6, 0.8]), ("l0", "continuous", [0.0, 0.6, 0.8])),
        robot(("base", "prismatic", X)),
        robot(*CHAIN, ("l0", "continuous", X)),
    ],
)
def test_other_robots_have_the_program_of_all(tree):
    assert exact(tree) is None


def test_a_number_that_is_no_longer_zero_has_another_program():
    keys = {exact(robot(*CHAIN, center=center)) for center in ((0.1, 0.0, 0.0), (0.1, 1e-300, 0.0), (1.0, 0.0, 0.0))}
    assert len(keys) == 3
    assert exact(robot(*CHAIN, center=(0.1, 0.0, 0.0))) == exact(robot(*CHAIN, center=(0.7, 0.0, -0.0)))
    branch = robot(*CHAIN, ("base", "continuous", Z))
    assert exact(branch) != exact(robot(*CHAIN, ("l0", "continuous", Z)))


@pytest.mark.slow
@pytest.mark.parametrize("center", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.8, 0.0), (0.0, -0.5, 0.3)])
def test_pendulums_with_other_zeros_swing_as_one_equation_says(center):
    rod = jn.Link("rod", jn.Inertia(1.0, center, tensor=np.diag([0.1, 0.1, 0.1])))
    pin = jn.Joint("pin", "base", "rod", "continuous", axis=Z)
    tree = jn.Robot("one", [jn.Link("base"), rod], [pin], gravity=[0.0, -9.81, 0.0])
    assert exact(tree) is not None
    length, start = np.hypot(*center[:2]), np.arctan2(center[1], center[0])

    def slope(_, state):
        return state[1], -9.81 * length * np.cos(state[0] + start) / (0.1 + length**2)

    expected = solve_ivp(slope, (0.0, 1.0), [0.3, 0.5], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    found = jn.simulate(tree, [0.0, 1.0], 1, state=[[0.3], [0.5]]).q[-1, :, 0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)
