"""Simulations of robots in joint coordinates: closed forms, conservation, and the mechanism that a robot is."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.kinematics import Status
from tests.problems.robots import random_inertia, random_robot

TIME = np.linspace(0.0, 2.0, 9)


def slider(mass=2.0, **settings):
    """Return a mass that slides along x."""
    joint = jn.Joint("slide", "base", "block", "prismatic", axis=[1, 0, 0], **settings)
    return jn.Robot("slider", [jn.Link("base"), jn.Link("block", jn.Inertia(mass))], [joint])


def swing(time, order):
    """Return q = exp(-t) cos 2t and its derivatives: a spring of 10 N/m and a damper of 4 N s/m on 2 kg."""
    series = [((-1 + 2j) ** k * np.exp((-1 + 2j) * time)).real for k in range(order + 1)]
    return np.stack(series, axis=1)


@pytest.mark.slow
def test_spring_and_damper_in_closed_form_with_events():
    events = [jn.integrate.JointEvent("slide", direction=-1), jn.integrate.JointEvent("slide", derivative=1)]
    law = {"slide": "-10*slide - 4*slide_d1"}
    found = jn.simulate(slider(), TIME, 4, state=[[1.0], [-1.0]], torque=law, events=events)
    assert np.abs(found.q[:, :, 0] - swing(TIME, 4)).max() <= 1e-11
    assert np.abs(found.torque[:, 0, 0] - 2 * swing(TIME, 2)[:, 2]).max() <= 1e-12
    assert np.abs(found.applied[:, 0] - found.torque[:, 0, 0]).max() <= 1e-12
    assert found.events[0] == pytest.approx([np.pi / 4], abs=1e-13)
    turns = (np.arctan2(-1.0, 2.0) + np.pi * np.arange(1, 3)) / 2  # of tan 2t = -1/2
    assert found.events[1] == pytest.approx(turns[turns < 2], abs=1e-13)
    assert not found.kinks
    half = found.at([0.3], order=2)
    assert np.abs(half.q[0, :, 0] - swing(np.array([0.3]), 2)[0]).max() <= 1e-13
    assert found.dataset["slide"].attrs["units"] == "m"


@pytest.mark.slow
def test_wrenches_of_state_and_time_in_closed_form():
    # a pendulum, at its end pushed across the link and pulled upright: torques of 0.5 m times the forces
    def spring(time, q, rate):
        return jnp.array([0.0, 3.0, -2 * q[0] - 0.4 * rate[0]])

    rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    arm = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    push = jn.robot.Wrench("rod", lambda t: jnp.array([0.0, 0.0, 2 * jnp.sin(3 * t)]), point=[0.5, 0, 0], frame="link")
    pull = jn.robot.Wrench("rod", spring, point=[0.5, 0, 0])
    found = jn.simulate(arm, TIME, 3, state=[[-1.5], [0.0]], wrenches=[push, pull])
    q, rate, second, third = found.q[:, :, 0].T
    sine, cosine, upright = np.sin(q), np.cos(q), -q - 0.2 * rate - 4.905
    assert np.abs(second - 3 * (np.sin(3 * TIME) + upright * cosine)).max() <= 1e-11
    change = (-rate - 0.2 * second) * cosine - upright * sine * rate
    assert np.abs(third - 3 * (3 * np.cos(3 * TIME) + change)).max() <= 1e-11
    assert np.abs(found.torque).max() <= 1e-10  # nothing of it comes from the joint, at no rate
    fine = np.linspace(0, 2, 4001)
    q, rate = found.at(fine).q[:, :2, 0].T
    work = np.trapezoid((np.sin(3 * fine) - (q + 0.2 * rate) * np.cos(q)) * rate, fine)
    assert np.isclose(found.energy[-1] - found.energy[0], work, rtol=0, atol=1e-6)
    for bad, words in (
        ([jn.robot.Wrench("base", [1, 0, 0])], "fixed to the base"),
        ([jn.robot.Wrench("rod", [[1, 0, 0]])], "three finite numbers"),
        ([jn.robot.Wrench("rod", lambda t: t)], "three components"),
    ):
        with pytest.raises(jn.errors.RobotError, match=words):
            jn.simulate(arm, TIME, 2, wrenches=bad)


def satellite():
    """Return a robot of two joints on a massive base, that nothing pulls."""
    robot = random_robot(4, 2)
    links = [jn.Link(robot.base, random_inertia(np.random.default_rng(5))), *list(robot.links.values())[1:]]
    return jn.Robot("satellite", links, list(robot.joints.values()), gravity=[0, 0, 0])


FLIGHT = np.array([0.0, 0.3, 0.6])


def flown(robot, time, state, base, force):
    """Return a simulation with a force on the last link, also where it is zero: so the program is compiled once."""
    wrench = jn.robot.Wrench(robot.moving_links[-1], force)
    return jn.simulate(robot, time, 2, state=state, base=base, wrenches=[wrench], drives=False)


@pytest.mark.slow
def test_force_on_a_free_base_moves_its_center_of_mass():
    robot = satellite()
    force = np.array([1.0, -2.0, 0.5])
    base = jn.robot.BaseMotion([0, 0, 0], [1, 0, 0, 0], np.zeros((1, 6)))
    found = flown(robot, FLIGHT, np.zeros((2, 2)), base, force)
    own = jn.robot.center_of_mass(robot, found.q[:, :1])[:, 0]
    w, x, y, z = found.base.quaternion.T
    turned = np.stack(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    center = found.base.position + np.einsum("ijt,tj->ti", turned, own)
    expected = center[0] + 0.5 * FLIGHT[:, None] ** 2 * force / robot.mass
    assert np.abs(center - expected).max() <= 1e-12


@pytest.mark.slow
def test_pulse_and_jumps_are_not_passed_over():
    mass, width = 2.0, 1e-3

    def law(time, q, rate):
        pulse = jnp.exp(-(((time - 0.7) / width) ** 2))
        return jnp.array([pulse + jnp.where(time < 1.0, 3.0, -1.0)])

    found = jn.simulate(slider(mass), TIME, 2, torque=law)
    late = TIME >= 1.25
    speed = (3.0 - (TIME[late] - 1.0) + width * np.sqrt(np.pi)) / mass
    assert np.abs(found.q[late, 1, 0] - speed).max() <= 1e-11
    assert found.kinks == pytest.approx([1.0], abs=1e-11)


@pytest.mark.slow
def test_sticking_friction_ends_with_a_reason():
    robot = slider(friction=1.0)
    with pytest.raises(jn.errors.SolveError, match="a force of a joint switches without end at t = 1 s") as caught:
        jn.simulate(robot, TIME, 2, state=[[0.0], [0.5]], drives=True)
    assert caught.value.motion.q[4, 0, 0] == pytest.approx(0.25, abs=1e-9)
    assert caught.value.motion.status[-1] != Status.OK


@pytest.mark.slow
def test_arm_is_the_mechanism_that_it_is():
    robot = random_robot(3, 2, tree=False, prismatic=0.0)
    q = np.array([0.4, -0.3])
    time = np.array([0.0, 0.2, 0.4])
    found = jn.simulate(robot, time, 2, state=[q, np.zeros(2)], drives=False)
    link = robot.moving_links[-1]
    whole = jn.simulate(robot.mechanism(q, time=time, drives=False), time, 2)
    points = whole.point(*jn.robot.body_point(robot, link)).values
    own = jn.forward_kinematics(robot, found.q, link).position
    assert np.abs(points - own).max() <= 1e-9 * np.abs(own).max()
    energy = found.energy
    assert np.ptp(energy) <= 1e-12 * np.abs(energy).max()


@pytest.mark.slow
@pytest.mark.parametrize("driving", ["0.3*sin(2*t)", lambda t: 0.3 * jnp.sin(2 * t)])
def test_driven_joint_and_feedback(driving):
    robot = random_robot(3, 3, tree=False, prismatic=0.0)
    names = robot.joint_names
    law = "0.3*sin(2*t)"

    def damped(time, q, rate):
        return -0.2 * rate

    found = jn.simulate(robot, TIME, 4, torque=damped, driven={names[1]: driving}, drives=False)
    expected = jn.laws.ExpressionMotion(law)(jn.Jet.variable(TIME, 4)).derivatives().T
    assert np.abs(found.q[:, :, 1] - expected).max() <= 1e-12
    free = [0, 2]
    assert np.abs(found.torque[:, 0, free] + 0.2 * found.q[:, 1, free]).max() <= 1e-12
    assert np.abs(found.torque[:, 2, free] + 0.2 * found.q[:, 3, free]).max() <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    "law, value, until",
    [
        ("0.3*sign(t - 0.77)", lambda t: 0.3 * np.sign(t - 0.77), 0.77),
        ("0.3*(t + abs(t - 0.77))", lambda t: 0.3 * (t + np.abs(t - 0.77)), 0.77),
        (lambda t: jnp.abs(t - 0.6), lambda t: np.abs(t - 0.6), 0.6),
        (jn.laws.PiecewiseMotion(["t", "0.7"], until=[0.7]), lambda t: np.minimum(t, 0.7), 0.7),
        ("0.3*(t - 0.77)*abs(t - 0.77)", lambda t: 0.3 * (t - 0.77) * np.abs(t - 0.77), None),
        ("0.5*(1 + tanh((t - 1)/1e-3))", lambda t: 0.5 * (1 + np.tanh((t - 1) / 1e-3)), None),
        ("sin(30*t)", lambda t: np.sin(30 * t), None),
    ],
)
def test_a_driven_joint_follows_its_law_or_the_run_ends(law, value, until):
    """The equations have accelerations of the law only; where its value or velocity jumps, the run ends."""
    found = jn.simulate(slider(), TIME, 1, driven={"slide": law}, strict=False)
    reached = TIME <= 2.0 if until is None else until > TIME
    assert ((found.status == int(Status.OK)) == reached).all()
    assert np.abs(found.q[reached, 0, 0] - value(TIME[reached])).max() <= 1e-9
    if until is not None:
        assert found.ended_at == pytest.approx(until, abs=1e-8)
        assert found.faults[int(np.argmin(reached))].startswith("driven.slide: the law or its velocity jumps at t = ")


@pytest.mark.slow
def test_a_terminal_event_before_a_driven_joint_leaves_its_law_ends_the_run():
    law, event = "abs(t - 0.75)", jn.integrate.JointEvent("slide", value=0.25, terminal=True)
    found = jn.simulate(slider(), TIME, 1, driven={"slide": law}, events=[event])
    assert found.events == [[pytest.approx(0.5, abs=1e-12)]]
    assert found.status[-1] == int(Status.NOT_REACHED)
    assert not found.faults
    with pytest.raises(jn.errors.SolveError, match=r"driven\.slide: the law or its velocity jumps at t = 0\.75 s"):
        jn.simulate(slider(), TIME, 1, driven={"slide": law})


@pytest.mark.slow
def test_free_base_keeps_its_momenta_and_energy():
    robot = satellite()
    base = jn.robot.BaseMotion([0, 0, 0], [1, 0, 0, 0], [[0.1, 0.2, 0.3, 3.0, -1.0, 2.0]])
    found = flown(robot, FLIGHT, [[0.1, 0.2], [0.5, -0.5]], base, np.zeros(3))
    assert np.ptp(found.energy) <= 1e-12 * found.energy.max()
    forces = jn.inverse_dynamics(robot, found.q, base=jn.robot.BaseMotion(*vars(found.base).values()), drives=False)
    assert np.abs(forces[:, 0]).max() <= 1e-11  # nothing pushes the base, nor the joints
    assert np.abs((found.base.quaternion**2).sum(axis=1) - 1).max() <= 1e-14
    there = jn.robot.BaseMotion(found.base.position[-1], found.base.quaternion[-1], found.base.twist[-1, :1])
    again = flown(robot, FLIGHT[::-1], found.q[-1, :2], there, np.zeros(3))
    assert np.abs(again.q[-1, 0] - [0.1, 0.2]).max() <= 1e-9
    assert np.abs(again.base.position[-1]).max() <= 1e-9


def test_bad_input_is_reported():
    robot = slider()
    with pytest.raises(jn.errors.RobotError, match=r"driven.slide: the motion law cannot be used: .* of jax.numpy"):
        jn.simulate(robot, TIME, driven={"slide": lambda t: math.sin(t)})
    with pytest.raises(jn.errors.RobotError, match=r"driven.slide: must be a law of time"):
        jn.simulate(robot, TIME, driven={"slide": [1.0]})
    with pytest.raises(jn.errors.RobotError, match=r"driven.slide: unknown name 'slide'"):
        jn.simulate(robot, TIME, driven={"slide": "2*slide + t"})
    with pytest.raises(jn.errors.RobotError, match="torque: no moving joint has this name"):
        jn.simulate(robot, TIME, torque={"slider": 1.0})
    with pytest.raises(jn.errors.RobotError, match=r"the function must return an array of 1 forces"):
        jn.simulate(robot, TIME, torque=lambda t, q, v: jnp.zeros(3))
    with pytest.raises(jn.errors.ExpressionError, match="wheel"):
        jn.simulate(robot, TIME, torque={"slide": "2*wheel"})
    with pytest.raises(jn.errors.RobotError, match=r"state: must hold q and q', the shape"):
        jn.simulate(robot, TIME, state=[0.0])
    with pytest.raises(jn.JounceError, match=r"torques: .*did you mean 'torque'"):
        jn.simulate(robot, TIME, torques=[1.0])
    with pytest.raises(jn.errors.RobotError, match=r"derivative"):
        jn.integrate.JointEvent(lambda t, q, v: q[0], derivative=2)
