"""Springs, tendons, drives of balls, friction by direction, links out of gravity: against identities of mechanics."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.robot import BallDrive, Tendon


def body(generator):
    tensor = np.diag([0.02, 0.03, 0.04]) + 0.001
    return jn.Inertia(generator.uniform(0.5, 2), center_of_mass=generator.normal(size=3) * 0.1, tensor=tensor)


def robot(*, smooth=False, followers=True):
    """Return a robot that has all of it, on request without what loses energy."""
    random = np.random.default_rng(0)
    links = [jn.Link("base"), jn.Link("a", body(random)), jn.Link("b1"), jn.Link("b2")]
    links += [jn.Link("b", body(random), gravity=0.3), jn.Link("c", body(random), gravity=0.0)]
    lossy = 0.0 if smooth else 1.0
    spring = {"stiffness": 3.0, "spring_reference": 0.2, "damping": 0.1 * lossy, "friction": (0.3 * lossy, 0.2 * lossy)}
    mimic = jn.robot.Mimic("j", -0.5, 0.1) if followers else None
    other = {"stiffness": 7.0, "spring_reference": 0.05, "friction": (0.1 * lossy, 0.4 * lossy), "mimic": mimic}
    joints = [
        jn.Joint("j", "base", "a", axis=[0, 1, 0], **spring),
        jn.Joint("z", "a", "b1", "continuous", position=[0.1, 0.2, 0.3]),
        jn.Joint("y", "b1", "b2", "continuous", axis=[0, 1, 0]),
        jn.Joint("x", "b2", "b", "continuous", axis=[1, 0, 0]),
        jn.Joint("s", "b", "c", "prismatic", position=[0, 0.1, 0.1], axis=[1, 1, 0], **other),
    ]
    couplings = [
        BallDrive("ball", ("z", "y", "x"), armature=0.05, damping=0.2 * lossy, friction=0.01 * lossy),
        Tendon(
            "line",
            {"j": 0.3, "x": -0.2, "s": 1.0},
            11.0,
            rest=0.1,
            damping=0.5 * lossy,
            friction=0.02 * lossy,
            armature=0.7,
        ),
    ]
    return jn.Robot("all", links, joints, couplings=couplings)


@pytest.mark.parametrize("followers", [True, False])
@pytest.mark.slow
def test_torques_move_it_as_they_were_computed_for(followers):
    one = robot(followers=followers)
    q = np.random.default_rng(1).normal(size=(3, 5, len(one.joint_names))) * 0.5
    tau = np.asarray(jn.inverse_dynamics(one, q))
    np.testing.assert_allclose(jn.forward_dynamics(one, q[:, :2], tau), q, rtol=0, atol=1e-11)
    mass, bias = (np.asarray(f(one, q, rates=True)) for f in (jn.mass_matrix, jn.bias_forces))
    first = np.einsum("sij,sj->si", mass[:, 0], q[:, 2]) + bias[:, 0]
    np.testing.assert_allclose(first, tau[:, 0], rtol=0, atol=1e-12)
    second = sum(np.einsum("sij,sj->si", mass[:, 1 - k], q[:, 2 + k]) for k in (0, 1)) + bias[:, 1]
    np.testing.assert_allclose(second, tau[:, 1], rtol=0, atol=1e-12)
    energy = np.asarray(jn.energy.kinetic_energy(one, q[:, :3]).total)
    np.testing.assert_allclose(energy[:, 0], np.einsum("si,sij,sj->s", q[:, 1], mass[:, 0], q[:, 1]) / 2, atol=1e-12)


@pytest.mark.slow
def test_energy_stays_where_nothing_is_lost():
    one = robot(smooth=True)
    state = np.full((2, len(one.joint_names)), 0.3)
    energy = np.asarray(jn.simulate(one, np.linspace(0, 1, 5), state=state).energy)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


def test_springs_and_friction_by_direction_in_closed_form():
    rail = jn.Joint("x", "base", "a", "prismatic", axis=[1, 0, 0], stiffness=4.0, spring_reference=0.5, friction=(2, 3))
    one = jn.Robot("cart", [jn.Link("base"), jn.Link("a", jn.Inertia(2.0))], [rail])
    q = [[[1.0], [1.5], [3.0], [5.0]], [[1.0], [-1.5], [3.0], [5.0]], [[0.0], [0.0], [0.0], [0.0]]]
    expected = [[4 * 0.5 + 2 + 6, 4 * 1.5 + 10], [4 * 0.5 - 3 + 6, -4 * 1.5 + 10], [-2.0, 0.0]]
    np.testing.assert_allclose(jn.inverse_dynamics(one, q)[..., 0], expected, rtol=0, atol=1e-14)
    assert rail.friction == (2.0, 3.0)
    assert dataclasses.replace(rail, friction=(2, 2)).friction == 2.0


def test_held_joints_leave_a_tendon_shorter():
    one = robot()
    left = one.locked({"z": 0.1, "y": 0.2, "x": 0.3})
    line = left.couplings["line"]
    assert tuple(left.couplings) == ("line",)
    assert line.weights == {"j": 0.3, "s": 1.0}
    np.testing.assert_allclose(line.rest, 0.1 + 0.2 * 0.3)
    with pytest.raises(jn.errors.RobotError, match="is one turn of the ball"):
        one.locked({"y": 0.1})


def test_a_weightless_link_on_a_base_that_moves():
    one = jn.Robot(
        "two",
        [jn.Link("base", jn.Inertia(1.0, tensor=[1.0, 1, 1])), jn.Link("a", jn.Inertia(2.0, [0.3, 0, 0]), gravity=0.0)],
        [jn.Joint("j", "base", "a", axis=[0, 1, 0])],
    )
    turn = np.array([np.cos(0.4), 0, np.sin(0.4), 0])
    base = jn.robot.BaseMotion([0.0, 0, 0], turn, np.zeros((2, 6)))
    forces = np.asarray(jn.inverse_dynamics(one, np.array([[0.7], [0.0], [0.0]]), base=base))[0]
    up = np.array([-np.sin(0.8), 0, np.cos(0.8)]) * 9.81  # the weight of the base alone, in its axes
    np.testing.assert_allclose(forces, [*up, 0, 0, 0, 0], rtol=0, atol=1e-12)


def test_what_cannot_be_is_refused():
    one = robot(followers=False)
    parts = (list(one.links.values()), list(one.joints.values()))
    for coupling, says in (
        (Tendon("line", {"k": 1.0}, 2.0), "no moving joint has this name"),
        (BallDrive("ball", ("x", "y", "z"), damping=1.0), "must be three turns in a row about z, y and x"),
    ):
        with pytest.raises(jn.errors.RobotError, match=says):
            jn.Robot("bad", *parts, couplings=[coupling])
    with pytest.raises(jn.errors.RobotError, match="must be zero or greater"):
        Tendon("line", {"j": 1.0}, stiffness=-1.0)
    with pytest.raises(jn.errors.RobotError, match="must be three joints"):
        BallDrive("ball", ("z", "z", "x"))


@pytest.mark.slow
def test_the_mechanism_moves_as_the_robot():
    """Springs, weightless links and the damping of a ball are forces of the mechanism."""
    given = robot()
    ball = BallDrive("ball", ("z", "y", "x"), damping=0.2)
    joints = [dataclasses.replace(joint, friction=0.0, mimic=None) for joint in given.joints.values()]
    one = given.changed(joints=joints, couplings=[ball])
    state = {"j": 0.1, "z": 0.2, "y": -0.3, "x": 0.4, "s": 0.05}
    times = np.linspace(0, 0.3, 4)
    single = jn.simulate(one, times, state=state)
    outputs = {name: name for name in ("j", "s")}
    whole = jn.simulate(one.mechanism(list(state.values()), outputs=outputs), times)
    for name in outputs:
        column = one.joint_names.index(name)
        np.testing.assert_allclose(whole.outputs[name][:, 0], np.asarray(single.q)[:, 0, column], atol=1e-9)


def test_couplings_without_a_counterpart_in_a_mechanism_are_refused():
    one = robot(followers=False)
    ball, line = one.couplings.values()
    with pytest.raises(jn.errors.RobotError, match="the armature of a ball whose parent turns has no counterpart"):
        one.changed(couplings=[ball]).mechanism()
    with pytest.raises(jn.errors.RobotError, match="a tendon along joints has no counterpart"):
        one.changed(couplings=[line]).mechanism()
    assert one.mechanism(drives=False).bodies
