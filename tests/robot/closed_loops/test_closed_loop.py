"""Robots as mechanisms: open chains against recursive Newton-Euler, loops against Pinocchio, MuJoCo, closed forms."""

import dataclasses
import math
import pickle

import mujoco
import numpy as np
import pytest
from mpmath import mp
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.robot.closed_loops.closures import Loops
from jounce.robot.model.floating_base import floating_joints
from tests.problems.closed_robots import FIVE_BAR, forward, in_contact, in_pinocchio, inverse
from tests.problems.random_loops import random_loop

TIME = np.linspace(0.1, 0.7, 4)
ROD = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0.01, 1 / 12, 1 / 12])


def coordinates(motion, robot):
    """Return the coordinates of the tree and their derivatives, (time, order + 1, n)."""
    return np.stack([motion.outputs[name] for name in robot.joint_names], axis=-1)


def torques(motion, robot):
    """Return forces of the drives with rates, (time, rates + 1, n), zero where there is no drive."""
    found = np.zeros((len(motion.time), motion.order - 1, len(robot.joint_names)))
    for k, name in enumerate(robot.joint_names):
        if f"{name}_drive" in motion.mechanism.drivers:
            found[:, :, k] = jn.driver_force(motion, f"{name}_drive").values[:, : motion.order - 1]
    return found


def error(found, expected):
    """Return the largest error of each order, by the peak."""
    return np.abs(found - expected).max(axis=(0, 2)) / np.abs(expected).max(axis=(0, 2))


def waves(robot, seed=3):
    """Return laws for all joints of a robot, sums of sines."""
    random = np.random.default_rng(seed)
    laws = {}
    for name in robot.joint_names:
        size = 1.0 if robot.joints[name].turning else 0.05
        a, b, c = size * random.uniform(0.1, 0.4, 3)
        v, w, phase = random.uniform(0.5, 3.0, 3)
        laws[name] = f"{a} + {b}*sin({v}*t + {phase}) + {c}*sin({w}*t)"
    return jn.JointTrajectory(laws, 0.0, 1.0, times=TIME)


def agrees_with_newton_euler(robot, laws, outputs=None, order=3, cancelled=0.0, **settings):
    """Return the motion of an open chain driven at every joint, after a check of coordinates, torques and rates.

    Errors count by the largest torque, or by the moments that cancel in it, where those are larger.
    """
    motion = jn.solve(robot.mechanism(drivers=laws, outputs=outputs, **settings), order=order)
    q = laws.derivatives(laws.times, order=order, names=robot.joint_names)
    np.testing.assert_allclose(coordinates(motion, robot), q, rtol=0, atol=1e-12 * np.abs(q).max())
    expected = jn.inverse_dynamics(robot, q, **settings)
    share = np.minimum(1.0, np.abs(expected).max() / max(cancelled, 1e-300))
    assert (share * error(torques(motion, robot), expected) <= 1e-13).all()  # 2e-15 measured
    return motion


def branched(**changes):
    """Return a robot with a fixed link, a slide, a branch, and joints that follow others in every way."""
    links = [jn.Link("base"), *(jn.Link(name, ROD) for name in "abcde"), jn.Link("plate", ROD)]
    tilt = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    joints = [
        jn.Joint("A", "base", "a", axis=[0, 1, 2], position=[0.1, 0, 0.2], **changes),
        jn.Joint("flange", "a", "plate", "fixed", [0.3, 0.1, 0], tilt),
        jn.Joint("B", "plate", "b", position=[0, 0.2, 0], axis=[1, 0, 0], mimic=jn.robot.Mimic("A", -1.5, 0.4)),
        jn.Joint("C", "a", "c", "prismatic", [0.2, 0, 0], axis=[1, 1, 0], mimic=jn.robot.Mimic("A", 0.3, 0.1)),
        jn.Joint("D", "base", "d", "prismatic", rotation=tilt, axis=[0, 0, 1]),
        jn.Joint("E", "d", "e", axis=[0, 1, 0], mimic=jn.robot.Mimic("D", 2.0, -0.3)),
    ]
    return jn.Robot("branched", links, joints, gravity=[1.0, 2.0, -9.0])


@pytest.mark.slow
def test_joints_follow_over_many_turns_and_load_the_ones_they_follow_also_by_damping_and_armature():
    robot, times = branched(damping=0.7, armature=0.3), np.linspace(0.0, 3.0, 61)
    laws = jn.JointTrajectory({"A": "9*t + 0.2*sin(2*t)", "D": "0.1*sin(3*t)"}, 0.0, 3.0, times=times)
    turned = 9 * times + 0.2 * np.sin(2 * times)
    centrifugal = (0.3 * turned.max()) ** 2 * 9.4**2  # N m, of the 1 kg that slides out 8 m, by its distance
    settings = {"outputs": {name: name for name in "ABCD"}, "order": 2, "drives": True}
    motion = agrees_with_newton_euler(robot, laws, cancelled=centrifugal, **settings)  # 9e-15 measured
    for name, angle in (("A", turned), ("B", 0.4 - 1.5 * turned), ("C", 0.1 + 0.3 * turned)):
        np.testing.assert_allclose(motion.outputs[name][:, 0], angle, atol=1e-11)


@pytest.fixture(scope="module")
def five_bar():
    robot = jn.load_robot(FIVE_BAR)
    laws = {"left_motor": "0.3*sin(4*t)", "right_motor": "0.2*sin(6*t) - 0.1"}
    return robot, jn.solve(robot.mechanism(drivers=laws), TIME, order=3)


def five_bar_tip(angles):
    """Return the absolute angles of the four links and the tip, by the intersection of two circles."""
    left, right = angles[0] + mp.radians(120), angles[1] + mp.radians(60)
    elbows = [mp.mpc(x, 0) + mp.mpf("0.16") * mp.expj(a) for x, a in (("-0.06", left), ("0.06", right))]
    across = elbows[1] - elbows[0]
    height = mp.sqrt(mp.mpf("0.22") ** 2 - abs(across) ** 2 / 4)
    tip = (elbows[0] + elbows[1]) / 2 + mp.mpc(0, 1) * across / abs(across) * height
    return (left, mp.arg(tip - elbows[0]), right, mp.arg(tip - elbows[1])), elbows, tip


@pytest.mark.slow
def test_five_bar_against_its_closed_form(five_bar):
    robot, motion = five_bar
    found = torques(motion, robot)[:, :2, [0, 2]]
    centers = [("-0.06", 0, 0.075, 0.0), (None, 1, 0.115, 0.004), ("0.06", 2, 0.075, 0.0), (None, 3, 0.118, 0.0)]
    masses, moments = [0.21, 0.26, 0.21, 0.34], [4.1e-4, 1.12e-3, 4.1e-4, 1.31e-3]

    def placed(*angles):
        """Return centers of mass and angles of the links."""
        turned, elbows, _ = five_bar_tip(angles)
        starts = [mp.mpc("-0.06"), elbows[0], mp.mpc("0.06"), elbows[1]]
        ends = [s + mp.mpc(x, z) * mp.expj(a) for s, a, (_, _, x, z) in zip(starts, turned, centers, strict=True)]
        return [*ends, *turned]

    def angles(t):
        return mp.mpf("0.3") * mp.sin(4 * t), mp.mpf("0.2") * mp.sin(6 * t) - mp.mpf("0.1")

    def torque(t, k):
        """Return the virtual work of inertia and weight per angle of a motor."""
        here, step = angles(t), mp.mpf(10) ** -15
        series = [mp.diff(lambda s, i=i: placed(*angles(s))[i], t, 2) for i in range(8)]
        moved = [[h + sign * step * (j == k) for j, h in enumerate(here)] for sign in (1, -1)]
        slopes = [(a - b) / (2 * step) for a, b in zip(*(placed(*m) for m in moved), strict=True)]
        work = mp.mpf(0)
        for i in range(4):
            force = masses[i] * (series[i] + mp.mpc(0, "9.80665"))
            work += mp.re(force * mp.conj(slopes[i])) + moments[i] * mp.re(series[4 + i] * slopes[4 + i])
        return work

    with mp.workdps(40):
        tip = motion.point("right_forearm", [0.22, 0, 0]).values[:, 0]
        expected = [complex(five_bar_tip(angles(mp.mpf(t)))[2]) for t in TIME]
        np.testing.assert_allclose(tip[:, 0] + 1j * tip[:, 2], expected, rtol=0, atol=1e-15)
        at = mp.mpf(TIME[2])
        for k in range(2):
            assert abs(found[2, 0, k] - torque(at, k)) <= 1e-13  # N m, of at most 0.5
            step = mp.mpf(10) ** -4
            weights = {1: mp.mpf(3) / 4, 2: mp.mpf(-3) / 20, 3: mp.mpf(1) / 60}
            rate = sum(w * (torque(at + j * step, k) - torque(at - j * step, k)) for j, w in weights.items()) / step
            assert abs(found[2, 1, k] - rate) <= 1e-12


@pytest.mark.slow
def test_five_bar_is_closed_where_mujoco_closes_it(five_bar):
    robot, motion = five_bar
    model = mujoco.MjModel.from_xml_path(str(FIVE_BAR))
    data = mujoco.MjData(model)
    for k, q in enumerate(coordinates(motion, robot)[:, 0]):
        data.qpos[:] = [q[robot.joint_names.index(model.joint(j).name)] for j in range(model.njnt)]
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos[:3]).max() <= 1e-15
        for body in robot.moving_links:
            here = motion.point(body, [0, 0, 0]).values[k, 0]
            np.testing.assert_allclose(here, data.body(body).xpos, rtol=0, atol=1e-15)


def agrees_with_pinocchio(robot, motion):
    """Check that the torques found make Pinocchio's constrained model accelerate as the motion does."""
    model, places = in_pinocchio(robot)
    (closure,) = robot.closures.values()
    q, torque = coordinates(motion, robot), torques(motion, robot)
    reactions = jn.joint_reaction(motion, closure.name).force.values[:, 0]
    for k in range(len(TIME)):
        acceleration, force = forward(model, in_contact(model, places, closure), q[k], torque[k, 0])
        np.testing.assert_allclose(acceleration, q[k, 2], rtol=0, atol=1e-12 * np.abs(q[k, 2]).max())
        ours = np.linalg.norm(reactions[k])
        assert abs(ours - np.linalg.norm(force[:3])) <= 1e-11 * ours
    return model, q, torque


@pytest.mark.slow
def test_five_bar_against_pinocchio(five_bar):
    agrees_with_pinocchio(*five_bar)


@pytest.mark.slow
def test_free_motion_of_a_loop_with_redundant_equations_accelerates_as_in_pinocchio():
    # at the start: what marches from there is the same for all mechanisms
    robot = jn.load_robot(FIVE_BAR)
    initial = {"left_motor": "0.1 + 0.5*t", "right_motor": "-0.2 + 0.3*t"}
    motion = jn.simulate(robot.mechanism(initial=initial, time=[0.0], redundant_reactions="unique"), order=2)
    (state,) = coordinates(motion, robot)
    np.testing.assert_allclose(state[:2, [0, 2]], [[0.1, -0.2], [0.5, 0.3]], rtol=0, atol=1e-13)
    model, places = in_pinocchio(robot)
    acceleration, borne = forward(model, in_contact(model, places, robot.closures["tip"]), state, np.zeros(4))
    np.testing.assert_allclose(acceleration, state[2], rtol=0, atol=1e-12 * np.abs(state[2]).max())
    force = jn.joint_reaction(motion, "tip").force.values[0, 0]
    assert np.isnan(force[1])  # across the plane of the linkage, which the hinges hold already
    size = np.linalg.norm(borne[:3])
    assert abs(np.linalg.norm(force[[0, 2]]) - size) <= 1e-10 * size


@pytest.mark.slow
def test_spatial_loop_against_pinocchio():
    robot = random_loop()
    borne, redundant = jn.robot.closure_wrenches(robot)["weld"]
    assert (borne.shape, redundant.shape) == ((6, 6), (0, 6))
    motion = jn.solve(robot.mechanism(drivers={"joint_1": "0.2*sin(3*t)"}), TIME, order=3)
    model, q, torque = agrees_with_pinocchio(robot, motion)
    for k in range(len(TIME)):  # with one degree of freedom, the power of the tree is that of the drive
        share = q[k, 1] / q[k, 1, 0]
        change = (q[k, 2] - share * q[k, 2, 0]) / q[k, 1, 0]
        force, rate = inverse(model, q[k])
        assert abs(share @ force - torque[k, 0, 0]) <= 1e-13 * np.abs(force).max()
        assert abs(share @ rate + change @ force - torque[k, 1, 0]) <= 1e-12 * np.abs(rate).max()


def carrier():
    """Return an arm that a load is joined to by a ball and welded to besides, so that it is a payload."""
    joints, count = floating_joints("load", prefix="J", world="arm")[1][3:], 3
    names = [joint.child for joint in joints[:-1]]
    load = jn.Inertia(0.7, [0.1, 0.2, -0.1], [0.02, 0.03, 0.04])
    links = [jn.Link("base"), jn.Link("arm", ROD), *map(jn.Link, names), jn.Link("load", load)]
    first = jn.Joint(joints[0].name, "arm", joints[0].child, joints[0].type, [0.3, 0.1, 0.2], axis=joints[0].axis)
    joints = [jn.Joint("hinge", "base", "arm", axis=[0, 1, 0]), first, *joints[1:]]
    weld = jn.robot.Closure("weld", ("arm", "load"), "weld", [0.4, -0.3, 0.1])
    return jn.Robot("carrier", links, joints, closures=[weld]), load, count


@pytest.mark.slow
def test_what_is_welded_is_a_payload():
    robot, load, count = carrier()
    borne, redundant = jn.robot.closure_wrenches(robot)["weld"]
    assert (len(borne), len(redundant)) == (count, 6 - count)
    mechanism = robot.mechanism(drivers={"hinge": "0.5 + sin(2*t)"})
    assert (*mechanism.bodies,) == ("arm", "load")
    assert "J_angle_1" in mechanism.joints
    motion = jn.solve(mechanism, TIME, order=2)
    plain = jn.Robot("arm", [jn.Link("base"), jn.Link("arm", ROD)], [robot.joints["hinge"]])
    plain = plain.with_payload("arm", load.moved([0.3, 0.1, 0.2], np.eye(3)))
    expected = jn.inverse_dynamics(plain, motion.outputs["hinge"][:, :, None])
    assert (error(torques(motion, robot)[:, :, :1], expected) <= 1e-13).all()


@pytest.mark.slow
def test_a_ball_driven_along_its_coordinates_keeps_its_joints():
    """The turns of a floating base; its slides are joints like others."""
    links, joints = floating_joints("rod", world="base_frame_3")
    robot = jn.Robot("rod", [*links[3:], jn.Link("rod", ROD)], joints[3:])
    agrees_with_newton_euler(robot, waves(robot), order=2)


@pytest.mark.parametrize("kind, count", [("weld", 6), ("slider", 5), ("pin", 5)])
def test_closures_of_a_free_body_hold_it_as_they_say_from_any_attitude_between(kind, count):
    """The sine of a missing turn also vanishes for bodies half a turn apart, and for a pin that is turned by half."""
    axis = None if kind == "weld" else [0, 0, 1]
    for seed in range(12):
        turn = Rotation.random(random_state=seed) if seed else Rotation.from_rotvec([0, 0, np.pi])
        free = jn.Robot("free", [jn.Link("load", ROD)], []).with_floating_base()
        points = [[0.1, 0.2, 0.3], [0, 0, 0.1]]
        held = jn.robot.Closure("held", (free.base, "load"), kind, points, axis=axis, rotation=turn.as_matrix())
        robot = jn.Robot("held", [*free.links.values()], [*free.joints.values()], closures=[held])
        borne, redundant = jn.robot.closure_wrenches(robot)["held"]
        assert (len(borne), len(redundant)) == (count, 0)
        q = Loops(robot).closed(robot.coordinates())
        frame = jn.forward_kinematics(robot.opened(), q[None], "load", point=points[1])
        left = frame.rotation[0] @ turn.as_matrix().T
        assert np.abs(frame.position[0][:2] - points[0][:2]).max() <= 1e-12
        assert np.abs(left @ [0, 0, 1] - [0, 0, 1]).max() <= 1e-12
        assert kind == "pin" or np.abs(left - np.eye(3)).max() <= 1e-12


def bennett(a=0.3, b=0.4, alpha=0.7):
    """Return a closed loop of four skew hinges, which moves although it has equations enough not to; and its ratio."""
    beta = math.asin(b * math.sin(alpha) / a)
    row, other = (
        jn.robot.DenavitHartenberg(a=length, alpha=twist, inertia=ROD) for length, twist in ((a, alpha), (b, beta))
    )
    chain = jn.robot.from_denavit_hartenberg([row, other, row, other])
    fixed = chain.joints["fixed_4"]  # the base stands for the fourth link, behind the fourth hinge
    links = [link for link in chain.links.values() if link.name not in ("axis_4", "link_4")]
    joints = [joint for joint in chain.joints.values() if joint.child not in ("axis_4", "link_4")]
    points = [[0, 0, 0], -fixed.rotation.T @ fixed.position]
    pin = jn.robot.Closure("D", ("link_3", "base"), "pin", points, axis=[0, 0, 1], rotation=fixed.rotation)
    ratio = math.sin((beta + alpha) / 2) / math.sin((beta - alpha) / 2)
    return jn.Robot("bennett", links, joints, closures=[pin]), ratio


@pytest.mark.slow
def test_linkage_with_more_equations_than_its_mobility_allows():
    robot, ratio = bennett()
    start = {"joint_1": 0.9, "joint_2": 3.0, "joint_3": -0.8}
    borne, redundant = jn.robot.closure_wrenches(robot, start)["D"]
    assert (len(borne), len(redundant)) == (2, 3)
    motion = jn.solve(robot.mechanism(start, drivers={"joint_1": "0.9 + 0.5*sin(t)"}), TIME, order=1)
    q = coordinates(motion, robot)
    np.testing.assert_allclose(np.tan(q[:, 0, 0] / 2) * np.tan(q[:, 0, 1] / 2), ratio, rtol=1e-12)  # Bennett's equation
    np.testing.assert_allclose(q[:, :, 0], -q[:, :, 2], rtol=0, atol=1e-13)


def test_a_dead_point_does_not_make_equations_redundant():
    links = [jn.Link("base"), *(jn.Link(name, ROD) for name in "abc")]
    joints = [jn.Joint("A", "base", "a"), jn.Joint("B", "a", "b", position=[1, 0, 0])]
    joints.append(jn.Joint("C", "base", "c", position=[1, 0, 0]))
    tip = jn.robot.Closure("tip", ("b", "c"), points=[[1, 0, 0], [1, 0, 0]])
    robot = jn.Robot("flat", links, joints, closures=[tip])
    borne, redundant = jn.robot.closure_wrenches(robot)["tip"]
    assert np.abs(borne[:, 2]).max() == 0
    assert redundant.tolist() == [[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]


def four_bar(on_crank=None):
    links = [jn.Link("base"), *(jn.Link(name, ROD) for name in ("crank", "rod", "rocker"))]
    joints = [jn.Joint("A", "base", "crank"), jn.Joint("B", "crank", "rod", position=[1, 0, 0], **(on_crank or {}))]
    joints.append(jn.Joint("D", "base", "rocker", position=[1, 1, 0]))
    tip = jn.robot.Closure("C", ("rod", "rocker"), points=[[1, 0, 0], [1, 0, 0]])
    return jn.Robot("four-bar", links, joints, closures=[tip])


def test_closures_are_kept():
    robot = four_bar()
    copy = pickle.loads(pickle.dumps(robot))
    assert copy.closures["C"].points.tolist() == robot.closures["C"].points.tolist()
    for changed in (
        robot.with_gravity([0, 0, -1]),
        robot.with_payload("rod", ROD),
        robot.locked({"D": 0.2}),
        robot.with_floating_base(),
        robot.opened().with_closures([*robot.closures.values()]),
    ):
        assert (*changed.closures,) == ("C",)
        assert changed.closures["C"].rotation.tolist() == robot.closures["C"].rotation.tolist()
    assert repr(robot) == "<Robot four-bar: 3 joints, 4 links, closed by C>"
    assert robot.opened().tree.shape.bodies == 3


def test_the_second_point_follows_from_coordinates_zero():
    links = [jn.Link("base"), jn.Link("a", ROD), jn.Link("b", ROD)]
    joints = [jn.Joint("A", "base", "a", axis=[0, 1, 0]), jn.Joint("S", "base", "b", "prismatic", [1, 2, 3])]
    closure = jn.Robot("two", links, joints, closures=[jn.robot.Closure("c", ("a", "b"), points=[0.5, 0, 0])]).closures[
        "c"
    ]
    assert closure.points.tolist() == [[0.5, 0, 0], [-0.5, -2, -3]]


@pytest.mark.parametrize(
    "settings, says",
    [
        ({"type": "pinn"}, "closures.c.type: no closure has this type, got 'pinn'; did you mean 'pin'?"),
        ({"links": ("rod",)}, "closures.c.links: must be two different links, got"),
        ({"links": ("rod", "rod")}, "closures.c.links: must be two different links"),
        ({"points": [1, 2]}, "closures.c.points: must have the shape (3,) or (2, 3), not (2,)"),
        ({"points": [1, 2, np.nan]}, "closures.c.points: must be finite"),
        ({"type": "pin"}, "closures.c.axis: a pin needs the direction of its axis, got nothing"),
        ({"type": "slider", "axis": [0, 0, 0]}, "closures.c.axis: a slider needs the direction of its axis"),
        ({"rotation": np.ones((3, 3))}, "closures.c.rotation: must be a rotation matrix"),
        ({"links": ("rod", "rocket")}, "closures.c: no link has this name, got 'rocket'; did you mean 'rocker'?"),
        ({"name": "D"}, "closures.D: a joint and a closure have the same name"),
        ({"name": "C"}, "closures: this name is given twice, got 'C'"),
    ],
)
def test_bad_closures(settings, says):
    with pytest.raises(jn.errors.RobotError) as caught:
        four_bar().with_closures([jn.robot.Closure(**{"name": "c", "links": ("rod", "rocker"), **settings})])
    assert str(caught.value).startswith(says)


@pytest.mark.slow
def test_coordinates_of_joints_whose_names_columns_have():
    names = ("time", "time_", "a_d1")
    links = [jn.Link("base"), *(jn.Link(f"link {k}", ROD) for k in range(3))]
    joints = [jn.Joint(name, "base", link.name, axis=[0, 1, 0]) for name, link in zip(names, links[1:], strict=True)]
    robot = jn.Robot("three", links, joints)
    motion = jn.solve(robot.mechanism(drivers={name: f"{k}*t" for k, name in enumerate(names, 1)}), [0.0, 0.1], order=1)
    rates = {name: round(float(values[0, 1]), 9) for name, values in motion.outputs.items()}
    assert rates == {"time__": 1.0, "time_": 2.0, "a_d1_": 3.0}


@pytest.mark.parametrize(
    "ask, says",
    [
        (lambda r: jn.inverse_dynamics(r, np.zeros((3, 3))), "four-bar: the loops of this robot make its coordinates"),
        (lambda r: jn.forward_kinematics(r, np.zeros((1, 3)), "rod"), "four-bar: the loops of this robot make"),
        (lambda r: r.mechanism(drivers={"E": "t"}), "drivers: no moving joint that follows no other has this name"),
        (lambda r: r.mechanism(initial={"E": "t"}), "initial: no moving joint that follows no other has this name"),
        (lambda r: r.mechanism([0, 0]), "q: must have the shape (3,), not (2,)"),
        (lambda r: r.mechanism({"E": 1.0}), "joint: no moving joint has this name"),
        (lambda r: r.mechanism(outputs={"x": "E"}), "outputs.x: no moving joint has this name"),
        (lambda r: r.mechanism(drivers={"A": "1/t"}), "drivers.A: the law has no finite value at t = 0 s"),
        (lambda r: r.mechanism(drivers={"A": "2*pi*f*t"}), "drivers.A: "),
        (
            lambda r: r.mechanism(drivers={"A": 0.0, "D": np.pi}),
            "closures.C: the loops cannot be closed from the coord",
        ),
        (lambda r: jn.robot.body_point(r, "rot"), "link: no link has this name, got 'rot'; did you mean 'rod'?"),
    ],
)
def test_bad_requests(ask, says):
    with pytest.raises(jn.JounceError) as caught:
        ask(four_bar())
    assert str(caught.value).startswith(says)


@pytest.mark.slow
def test_drives_count_within_loops_too():
    """The driver bears the drives of all joints, by how fast these move for it; nothing else of the motion changes."""
    drive = {"armature": 0.4, "damping": 0.3, "friction": 0.2}
    robot, laws = four_bar(on_crank=drive), {"A": "0.3 + 0.5*t + 0.2*t**2"}
    mechanisms = [robot.mechanism({"B": -1.0}, drivers=laws, time=TIME, drives=drives) for drives in (True, False)]
    whole, bare = (jn.solve(mechanism, order=3) for mechanism in mechanisms)
    q = coordinates(whole, robot)
    assert np.abs(q - coordinates(bare, robot)).max() <= 1e-12
    a, b = q[..., 0], q[..., 1]
    share = b[:, 1] / a[:, 1]
    expected = share * (drive["armature"] * b[:, 2] + drive["damping"] * b[:, 1] + drive["friction"] * np.sign(b[:, 1]))
    found = torques(whole, robot)[:, 0, 0] - torques(bare, robot)[:, 0, 0]
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.slow
def test_drives_of_a_joint_that_slides_and_of_one_far_from_the_base():
    robot = branched(armature=0.3, damping=0.7, friction=0.4)
    joints = [dataclasses.replace(x, armature=0.2, friction=0.1) if x.moving else x for x in robot.joints.values()]
    robot = jn.Robot("branched", list(robot.links.values()), joints, robot.gravity)
    agrees_with_newton_euler(robot, waves(robot), order=3)


def test_turns_with_drives_stay_joints_of_their_own():
    rods = [jn.Link("base"), jn.Link("a"), jn.Link("b"), jn.Link("c", ROD)]
    axes = zip("XYZ", ("base", "a", "b"), "abc", np.eye(3), strict=True)
    ball = [jn.Joint(name, parent, child, axis=axis, damping=0.1) for name, parent, child, axis in axes]
    robot = jn.Robot("ball", rods, ball)
    assert tuple(robot.mechanism().outputs) == ("X", "Y", "Z")
    assert tuple(robot.mechanism(drives=False).outputs) == ()


def test_a_moving_link_named_ground():
    robot = jn.Robot("odd", [jn.Link("base"), jn.Link("ground", ROD)], [jn.Joint("A", "base", "ground")])
    with pytest.raises(jn.errors.RobotError, match="a link of this name moves"):
        robot.mechanism()


def crank_rocker(turn, side):
    """The angles of coupler and rocker of a four-bar with links of 1, 3, 2 and 3 m, by the law of cosines."""
    pin, far = np.array([np.cos(turn), np.sin(turn)]), np.array([3.0, 0.0])
    diagonal = far - pin
    length = np.hypot(*diagonal)
    along = np.arctan2(diagonal[1], diagonal[0]) + side * np.arccos((9.0 + length**2 - 4.0) / (6.0 * length))
    tip = pin + 3.0 * np.array([np.cos(along), np.sin(along)]) - far
    return along, np.arctan2(tip[1], tip[0])


@pytest.mark.parametrize("side", [1, -1])
def test_a_loop_stays_in_the_assembly_in_which_it_is_drawn(side):
    """Wherever the law of the crank starts: the crank is moved there, and turns round."""
    drawn = np.radians(60)
    coupler, rocker = crank_rocker(drawn, side)
    angles = {"crank": drawn, "coupler": coupler - drawn, "rocker": rocker}
    turned = {name: Rotation.from_euler("z", angle).as_matrix() for name, angle in angles.items()}
    rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    robot = jn.Robot(
        "four-bar",
        [jn.Link("base"), *(jn.Link(name, rod) for name in angles)],
        [
            jn.Joint("A", "base", "crank", rotation=turned["crank"]),
            jn.Joint("B", "crank", "coupler", position=[1, 0, 0], rotation=turned["coupler"]),
            jn.Joint("D", "base", "rocker", position=[3, 0, 0], rotation=turned["rocker"]),
        ],
        closures=[jn.robot.Closure("C", ("coupler", "rocker"), "pin", points=[[3, 0, 0], [2, 0, 0]], axis=[0, 0, 1])],
    )
    for turn in np.radians([-360, -225, -120, -30, 45, 150, 210, 330]):
        found = jn.solve(robot.mechanism(drivers={"A": float(turn)}), [0.0], order=0).outputs["D"][0, 0]
        expected = crank_rocker(drawn + turn, side)[1] - rocker
        assert abs(np.exp(1j * found) - np.exp(1j * expected)) < 1e-9
