"""Joints that follow several others: drives, locked joints, mechanisms, simulations, by closed forms and identities."""

import dataclasses

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.errors import RobotError
from jounce.robot import Closure, Mimic
from tests.problems.robots import random_inertia
from tests.robot.closed_loops.test_closed_loop import agrees_with_newton_euler

LOSSES = {"armature": 0.3, "damping": 0.7, "friction": 0.4, "stiffness": 5.0, "spring_reference": 0.2}


def gantry(**own):
    """Return three slides along x, masses 2, 3 and 5 kg; the last is at 0.1 - x + 2 y on the first two."""
    links = [jn.Link("base"), *(jn.Link(name, jn.Inertia(mass)) for name, mass in (("a", 2.0), ("b", 3.0), ("c", 5.0)))]
    rails = [jn.Joint(name, "base", link, "prismatic", axis=[1, 0, 0]) for name, link in (("x", "a"), ("y", "b"))]
    follower = jn.Joint("z", "base", "c", "prismatic", axis=[1, 0, 0], mimic=Mimic(["x", "y"], [-1, 2], 0.1), **own)
    return jn.Robot("gantry", links, [*rails, follower])


def leg(*, losses=True, several=True):
    """Return a leg of four joints whose last follows the two before it, or all three."""
    random = np.random.default_rng(4)
    links = [jn.Link("base"), *(jn.Link(name, random_inertia(random)) for name in "abcd")]
    mimic = Mimic(["i", "k"], [-1.0, -0.5], 0.2) if several else None
    own = LOSSES if losses else {"armature": 0.3, "stiffness": 5.0}
    joints = [
        jn.Joint("i", "base", "a", axis=[0, 0.2, 1]),
        jn.Joint("j", "a", "b", "prismatic", position=[0.1, 0, 0.2], axis=[1, 0.1, 0]),
        jn.Joint("k", "b", "c", position=[0.3, 0, 0], axis=[0, 1, 0.3]),
        jn.Joint("l", "c", "d", position=[0.3, 0, 0.1], axis=[0.1, 1, 0], mimic=mimic, **own),
    ]
    return jn.Robot("leg", links, joints)


def test_torques_and_drives_in_closed_form():
    q = np.array([[0.3, -0.2], [0.5, 1.1], [2.0, -3.0]])
    position, speed, acceleration = (x @ [-1.0, 2.0] for x in q)
    force = 5.3 * acceleration + 0.7 * speed + 0.4 * np.sign(speed) + 5 * (0.1 + position - 0.2)
    expected = [2 * q[2, 0] - force, 3 * q[2, 1] + 2 * force]
    np.testing.assert_allclose(jn.inverse_dynamics(gantry(**LOSSES), q)[0], expected, rtol=1e-14)
    mass = np.diag([2.0, 3.0]) + 5.3 * np.outer([-1, 2], [-1, 2])
    np.testing.assert_allclose(jn.mass_matrix(gantry(**LOSSES), q[0]), mass, rtol=1e-14)


def test_friction_by_direction_is_refused():
    with pytest.raises(RobotError, match=r"joints\.z\.friction: of a joint that follows several .*got \[1\.0, 2\.0\]"):
        gantry(friction=(1, 2))


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: Mimic([], []), r"mimic\.joint: must be a joint, or different ones"),
        (lambda: Mimic(["x", "x"], [1, 2]), r"mimic\.joint: must be a joint, or different ones"),
        (lambda: Mimic(["x", "y"], [1, 2, 3]), r"mimic\.multiplier"),
        (
            lambda: gantry().changed(joints=circle()),
            r"joints\.x\.mimic: must follow a moving joint that follows no other",
        ),
    ],
)
def test_followers_that_are_none(make, message):
    with pytest.raises(RobotError, match=message):
        make()


def circle():
    joints = list(gantry().joints.values())
    return [dataclasses.replace(joints[0], mimic=Mimic(["y", "z"])), *joints[1:]]


def test_one_leader_is_as_ever():
    assert Mimic(["x"], [2.0], 1.0) == Mimic("x", 2, 1.0)
    assert (Mimic(("x",)).joint, Mimic("x").multiplier, Mimic(["x", "y"], 3).weights) == (
        "x",
        1.0,
        {"x": 3.0, "y": 3.0},
    )
    assert hash(Mimic(["x", "y"])) == hash(Mimic(("x", "y"), (1.0, 1.0)))


def test_held_joints_leave_the_rest():
    held = gantry().locked({"y": 0.5})
    assert held.joints["z"].mimic == Mimic("x", -1.0, 1.1)
    both = gantry().locked({"x": 1.0, "y": 0.5})
    assert not both.joint_names
    np.testing.assert_allclose(both.joints["z"].position, [0.1 - 1 + 1, 0, 0], atol=1e-16)


def test_all_quantities_agree():
    """Torques, mass matrix, bias, motions, energies, Jacobian, and the six forms of the equations of motion."""
    robot = leg()
    q = np.random.default_rng(0).normal(size=(2, 5, 3)) * 0.6
    tau = np.asarray(jn.inverse_dynamics(robot, q))
    np.testing.assert_allclose(jn.forward_dynamics(robot, q[:, :2], tau), q, rtol=0, atol=1e-11)
    mass, bias = (np.asarray(f(robot, q, rates=True)) for f in (jn.mass_matrix, jn.bias_forces))
    second = sum(np.einsum("sij,sj->si", mass[:, 1 - k], q[:, 2 + k]) for k in (0, 1)) + bias[:, 1]
    np.testing.assert_allclose(second, tau[:, 1], rtol=0, atol=1e-12)
    energy = np.asarray(jn.energy.kinetic_energy(robot, q[:, :3]).total)
    np.testing.assert_allclose(energy[:, 0], np.einsum("si,sij,sj->s", q[:, 1], mass[:, 0], q[:, 1]) / 2, atol=1e-13)
    jacobian = np.asarray(jn.jacobian(robot, q[:, :1], "d", [0.1, 0.2, 0.3]))[:, 0]
    moved = jn.forward_kinematics(robot, q[:, :2], "d", [0.1, 0.2, 0.3])
    twist = np.concatenate([moved.position[:, 1], moved.angular_velocity[:, 0]], axis=1)
    np.testing.assert_allclose(np.einsum("sij,sj->si", jacobian, q[:, 1]), twist, rtol=0, atol=1e-13)
    bare = np.asarray(jn.dynamics.newton_euler(robot, q[:, :3]))
    for form in ("lagrange", "gibbs_appell", "virtual_work"):
        found = np.asarray(getattr(jn.dynamics, form)(robot, q[:, :3])).reshape(bare.shape)
        np.testing.assert_allclose(found, bare, rtol=0, atol=1e-11)


def test_the_follower_is_a_joint_whose_torque_is_shared():
    """Torques of the tree without followers, by how the joint follows."""
    robot, tree = leg(), leg(several=False)
    spread = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, -0.5]])
    q = np.random.default_rng(1).normal(size=(3, 5, 3)) * 0.5
    whole = q @ spread.T
    whole[:, 0, 3] += 0.2
    expected = np.asarray(jn.inverse_dynamics(tree, whole)) @ spread
    np.testing.assert_allclose(jn.inverse_dynamics(robot, q), expected, rtol=0, atol=1e-12)
    with jax.enable_x64(True):
        slope = jax.grad(lambda m: jn.inverse_dynamics(robot.with_inertia("d", mass=m), q)[0, 0, 2])(1.3)
        other = jax.grad(lambda m: (jn.inverse_dynamics(tree.with_inertia("d", mass=m), whole)[0, 0] @ spread)[2])(1.3)
    np.testing.assert_allclose(slope, other, rtol=1e-12)


@pytest.mark.parametrize("base", [False, True])
def test_simulations_keep_the_energy(base):
    robot = leg(losses=False).with_floating_base() if base else leg(losses=False)
    energy = np.asarray(jn.simulate(robot, np.linspace(0, 0.5, 5)).energy)
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-9)


def test_the_mechanism_needs_the_same_torques():
    """Of a follower of two turns, and of one of a turn and a slide, with armature, springs and losses."""
    robot = leg()
    mixed = [
        *list(robot.joints.values())[:3],
        dataclasses.replace(robot.joints["l"], mimic=Mimic(["i", "j"], [0.5, -2.0])),
    ]
    for one in (robot, robot.changed(joints=mixed)):
        laws = {"i": "0.3 + 0.4*t", "j": "0.1*t**2 + 0.2*t", "k": "0.5*t - 0.2*t**2"}
        times = np.array([0.0, 0.3])
        laws = jn.JointTrajectory(laws, 0.0, 1.0, times=times)
        agrees_with_newton_euler(one, laws, order=4, drives=True)


def test_a_loop_closed_over_a_follower():
    """Two cranks and a rod that turns as far as both: the closure is met where trigonometry says."""
    closure = Closure("tip", ("c", "base"), points=[[0.3, 0, 0], [0.7, 0.4, 0]])
    links = [jn.Link("base"), *(jn.Link(name, jn.Inertia(1.0, [0.1, 0, 0], [0.01] * 3)) for name in "abc")]
    joints = [
        jn.Joint("p", "base", "a"),
        jn.Joint("q", "a", "b", position=[0.5, 0, 0]),
        jn.Joint("r", "b", "c", position=[0.4, 0, 0], mimic=Mimic(["p", "q"], [-1.0, -1.0])),
    ]
    robot = jn.Robot("loop", links, joints, closures=[closure])
    motion = jn.solve(robot.mechanism(outputs={"p": "p", "q": "q", "r": "r"}), [0.0], order=2)
    p, q, r = (float(motion.outputs[name][0, 0]) for name in "pqr")
    assert abs(p + q + r) < 1e-12
    tip = 0.5 * np.exp(1j * p) + 0.4 * np.exp(1j * (p + q)) + 0.3
    np.testing.assert_allclose([tip.real, tip.imag], [0.7, 0.4], rtol=0, atol=1e-12)


LIMITED = {"lower": -0.2, "upper": 0.6, "velocity": 1.5, "acceleration": 8.0}


def test_limits_of_what_follows_several_are_checked():
    """The last slide is at 0.1 - x + 2 y: its extremes are those of a parabola."""
    robot = gantry(limits=jn.Limits(**LIMITED))
    laws = jn.JointTrajectory({"x": "0.3*t", "y": "0.5*t**2"}, 0.0, 0.5)
    rows = {(row.joint, row.quantity): row for row in jn.check_limits(robot, laws, hand_over=True).rows}
    place, speed = rows["z", "position"], rows["z", "velocity"]
    assert (speed.value, speed.limit, speed.time) == pytest.approx((0.7, 1.5, 0.5), rel=1e-9)
    assert (place.value, place.time) == pytest.approx((0.1 - 0.15**2, 0.15), rel=1e-6)  # nearest to an end of its range
    assert rows["z", "acceleration"].value == pytest.approx(2.0, rel=1e-9)
    assert ("z", "force") not in rows
    fast = jn.check_limits(robot, jn.JointTrajectory({"x": "-2*t", "y": 0.0}, 0.0, 0.5))
    assert {(row.joint, row.quantity) for row in fast.broken} == {("z", "position"), ("z", "velocity")}
    assert ("z", "acceleration") in fast.ends[0].breaks  # it starts at once
    cancelled = jn.check_limits(robot, jn.JointTrajectory({"x": "2*t", "y": "t"}, 0.0, 0.5))
    assert not [x for end in cancelled.ends for x in end.breaks]  # the last slide stays where it is


def test_retiming_keeps_them():
    """Nothing but the last slide has limits: it goes by 2 y - x = 0.25 m from rest to rest, at 8 m/s^2."""
    robot = gantry(limits=jn.Limits(velocity=1.5, acceleration=8.0))
    path = [[0.0, 0.0], [0.15, 0.2]]
    retimed = jn.retime(robot, path)
    assert 1 - 1e-9 < retimed.stop / (2 * np.sqrt(0.25 / 8.0)) < 1.003
    assert retimed.report.kept
    beyond = gantry(limits=jn.Limits(upper=0.2, velocity=1.5, acceleration=8.0))
    with pytest.raises(jn.errors.TrajectoryError, match=r"^z: the path leaves the range of this joint"):
        jn.retime(beyond, path)


def level_foot(**limits):
    """Return two links of 0.5 and 0.4 m in a plane, and a foot that stays level, as it turns by less the angles."""
    links = [jn.Link("base"), *(jn.Link(name, jn.Inertia(1.0, [0.1, 0, 0], [0.01] * 3)) for name in "abc")]
    joints = [
        jn.Joint("p", "base", "a"),
        jn.Joint("q", "a", "b", position=[0.5, 0, 0]),
        jn.Joint("r", "b", "c", position=[0.4, 0, 0], mimic=Mimic(["p", "q"], -1.0), limits=jn.Limits(**limits)),
    ]
    return jn.Robot("leg", links, joints)


def elbows(x, y):
    """Return both solutions (p, q) for the foot of the level leg, by trigonometry."""
    knee = np.arccos((x**2 + y**2 - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4))
    return [
        (np.arctan2(y, x) - np.arctan2(0.4 * np.sin(q), 0.5 + 0.4 * np.cos(q)), q) for q in (float(knee), -float(knee))
    ]


def test_inverse_kinematics_finds_the_solution_within_their_ranges():
    """The range of the foot admits one of both solutions, whichever the start is near to."""
    goals = np.stack([np.linspace(0.3, 0.7, 9), np.linspace(0.4, -0.2, 9), np.zeros(9)], axis=1)
    both = np.array([elbows(x, y) for x, y, _ in goals])
    ankles = -both.sum(axis=2)
    bound = ankles.mean(axis=1)
    assert (ankles[:, 0] < bound).all()
    for k, goal in enumerate(goals):
        for chosen, limits in enumerate(({"upper": bound[k]}, {"lower": bound[k]})):
            robot = level_foot(**limits)
            found = jn.inverse_kinematics(robot, "c", goal, start=both[k, 1 - chosen])
            np.testing.assert_allclose(found.q, both[k, chosen], rtol=0, atol=1e-9)
    wrong = jn.inverse_kinematics(level_foot(upper=bound[0]), "c", goals[0], start=both[0, 1], limits=False)
    np.testing.assert_allclose(wrong.q, both[0, 1], rtol=0, atol=1e-9)


def test_inverse_kinematics_stops_at_their_ranges():
    """The last slide ends at 0.6 m, and the first ones have ranges of their own."""
    robot = gantry(limits=jn.Limits(**LIMITED))
    found = jn.inverse_kinematics(robot, "c", [[0.3, 0, 0], [0.6, 0, 0], [0.9, 0, 0]])
    np.testing.assert_allclose(found.q[:2] @ [-1, 2] + 0.1, [0.3, 0.6], atol=1e-9)
    assert found.status[2] == jn.kinematics.Status.NOT_ASSEMBLED
    np.testing.assert_allclose(found.distance[2], 0.3, rtol=1e-4)
    assert found.limited_names == ("x", "y", "z")
    assert found.limited[2].tolist() == [False, False, True]
    assert found.explain(2).endswith("at their limits: z")


def test_tool_paths_name_the_follower_that_leaves_its_range():
    """The foot goes along a line; its angle is that of trigonometry, and passes 0.2 rad on the way."""
    path = jn.planning.ToolPath(["0.4 + 0.3*t", 0.2, 0.0], start=0.0, stop=1.0)
    start = np.array(elbows(0.4, 0.2)[0])
    times = np.linspace(0, 1, 21)
    ankle = -np.array([elbows(0.4 + 0.3 * t, 0.2)[0] for t in times]).sum(axis=1)
    bound = float(ankle[9:11].mean())
    limits = {"upper" if ankle[-1] > ankle[0] else "lower": bound}
    motion = jn.planning.follow_tool_path(level_foot(**limits), "c", path, times, start=start, strict=False)
    assert (motion.status == jn.kinematics.Status.INADMISSIBLE).tolist() == [False] * 10 + [True] * 11
    assert motion.explain(10).startswith(f"r leaves its range at t = 0.5 s, where it is {ankle[10]:.6g};")
    with pytest.raises(RobotError, match=r"c: r leaves its range at t = 0\.5 s"):
        jn.planning.follow_tool_path(level_foot(**limits), "c", path, times, start=start)
    free = jn.planning.follow_tool_path(level_foot(**limits), "c", path, times, start=start, limits=False)
    np.testing.assert_allclose(-free.q[:, 0].sum(axis=1), ankle, rtol=0, atol=1e-9)
