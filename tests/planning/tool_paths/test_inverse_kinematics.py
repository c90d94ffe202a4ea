"""Poses of tools: closed forms of planar and wrist-partitioned arms, other libraries, limits, and what is told."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.kinematics import Status
from tests.planning.tool_paths.arms import planar_chain, wrist_arm
from tests.problems.robots import robot_named


@pytest.mark.slow
def test_two_links_reach_what_their_closed_form_says():
    arm, generator = planar_chain([0.7, 0.5]), np.random.default_rng(0)
    radius, angle = generator.uniform(0.25, 1.15, 40), generator.uniform(-3, 3, 40)
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    found = jn.inverse_kinematics(arm, "link_1", places, point=[0.5, 0, 0])
    assert (found.status == Status.OK).all()
    assert not found.singular.any()
    cosine = (radius**2 - 0.7**2 - 0.5**2) / (2 * 0.7 * 0.5)
    elbow = np.sign(np.sin(found.q[:, 1])) * np.arccos(cosine)
    shoulder = angle - np.arctan2(0.5 * np.sin(elbow), 0.7 + 0.5 * np.cos(elbow))
    assert np.allclose(np.cos(found.q - np.stack([shoulder, elbow], axis=1)), 1.0, rtol=0, atol=1e-14)
    beyond, within = [0.0, 2.0, 0.0], [0.01, 0.0, 0.0]
    far = jn.inverse_kinematics(arm, "link_1", [beyond, within], point=[0.5, 0, 0], most_steps=2000)
    assert far.status.tolist() == [Status.NOT_ASSEMBLED] * 2
    assert np.allclose(far.distance, [2.0 - 1.2, 0.2 - 0.01], rtol=0, atol=1e-7)
    assert np.isnan(far.q).all()
    assert np.isfinite(far.closest).all()
    assert far.singular.all()
    assert "0.8 m" in far.explain(0)
    assert "joint_1" in far.explain(0)


@pytest.mark.slow
def test_wrist_arm_meets_its_closed_form_in_any_frames():
    arm, parts = wrist_arm(3)
    generator = np.random.default_rng(1)
    q = generator.uniform(-1.2, 1.2, (30, 6))
    q[:, 4] = np.where(np.abs(q[:, 4]) < 0.2, 0.5, q[:, 4])
    place = [0.03, -0.05, 0.1]
    there = jn.forward_kinematics(arm, q[:, None], "hand", place)
    turned = Rotation.from_matrix(np.asarray(there.rotation)[:, 0])
    found = jn.inverse_kinematics(arm, "hand", there.position[:, 0], turned, point=place, limits=False)
    assert (found.status == Status.OK).all()
    assert found.distance.max() < 1e-9
    assert found.angle.max() < 1e-9
    # the wrist center follows from the pose alone; the arm before it has a closed form
    center = np.asarray(there.position)[:, 0] + turned.apply(parts["center"] - np.array(place))
    x, y, z = ((center - parts["origin"]) @ parts["axes"]).T
    upper, lower = parts["lengths"]
    assert np.allclose(np.sin(found.q[:, 0] - np.arctan2(y, x)), 0.0, rtol=0, atol=1e-9)
    cosine = (x**2 + y**2 + z**2 - upper**2 - lower**2) / (2 * upper * lower)
    assert np.allclose(np.cos(found.q[:, 2]), cosine, rtol=0, atol=1e-9)
    single = jn.inverse_kinematics(
        arm, "hand", there.position[4, 0], turned[4].as_quat(scalar_first=True), point=place, limits=False
    )
    assert np.allclose(single.q, found.q[4], rtol=0, atol=1e-9)
    # a straight wrist: its first and its last joint turn the hand alike
    q = np.array([0.3, 0.4, 0.9, 0.7, 0.0, -0.2])
    pose = jn.forward_kinematics(arm, q[None], "hand", place)
    straight = jn.inverse_kinematics(arm, "hand", pose.position[0], pose.rotation[0], point=place, start=q + 1e-9)
    assert straight.status == Status.OK
    assert straight.singular
    assert "joint_3, joint_5" in straight.explain() or "joint_5, joint_3" in straight.explain()


def test_limits_hold_and_are_named():
    arm = planar_chain([0.7, 0.5], lower=-0.4, upper=0.3)
    found = jn.inverse_kinematics(arm, "link_1", [0.0, 1.0, 0.0], point=[0.5, 0, 0])
    assert found.status == Status.NOT_ASSEMBLED
    assert (found.closest >= -0.4).all()
    assert (found.closest <= 0.3).all()
    tip = 0.7 * np.exp(0.3j) + 0.5 * np.exp(0.6j)  # both joints at their upper limits
    assert np.isclose(found.distance, abs(tip - 1j), rtol=0, atol=1e-12)
    assert "at their limits: joint_0, joint_1" in found.explain()
    free = jn.inverse_kinematics(arm, "link_1", [0.0, 1.0, 0.0], point=[0.5, 0, 0], limits=False)
    assert free.status == Status.OK


@pytest.mark.slow
@pytest.mark.parametrize("name, link, share", [("panda", "panda_hand", 0.97), ("ur5", "tool0", 0.97)])
def test_published_arms_against_pinocchio(name, link, share):
    pinocchio = pytest.importorskip("pinocchio")
    from tests.problems.robots import FILES

    robot = robot_named(name)
    link = link if link in robot.frames else robot.link_names[-1]
    model = pinocchio.buildModelFromUrdf(str(FILES / f"{name}.urdf"))
    data, generator = model.createData(), np.random.default_rng(2)
    frame = model.getFrameId(link)
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    poses = []
    for q in generator.uniform(np.maximum(lower, -3), np.minimum(upper, 3), (100, model.nq)):
        pinocchio.framesForwardKinematics(model, data, q)
        poses.append((data.oMf[frame].translation.copy(), data.oMf[frame].rotation.copy()))
    places, turned = (np.array(x) for x in zip(*poses, strict=True))
    found = jn.inverse_kinematics(robot, link, places, turned)
    good = np.flatnonzero(found.status == Status.OK)
    assert len(good) >= share * len(places)
    for k in good:
        values = dict(zip(robot.joint_names, found.q[k], strict=True))
        q = np.array([values[robot.joints[n].mimic.joint if robot.joints[n].mimic else n] for n in model.names[1:]])
        assert (q >= lower).all()
        assert (q <= upper).all()
        pinocchio.framesForwardKinematics(model, data, q)
        assert np.allclose(data.oMf[frame].translation, places[k], rtol=0, atol=1e-9)
        assert np.allclose(data.oMf[frame].rotation, turned[k], rtol=0, atol=1e-9)


@pytest.mark.slow
def test_direction_leaves_the_turn_about_it_free():
    robot, axis = robot_named("mimic"), np.array([1.0, 2.0, -0.5])
    link = robot.moving_links[-1]
    q = np.random.default_rng(5).uniform(-1, 1, (20, len(robot.joint_names)))
    there = jn.forward_kinematics(robot, q[:, None], link)
    direction = np.asarray(there.rotation)[:, 0] @ axis
    found = jn.inverse_kinematics(robot, link, there.position[:, 0], direction=3 * direction, axis=axis, limits=False)
    assert (found.status == Status.OK).all()
    again = jn.forward_kinematics(robot, found.q[:, None], link)
    assert np.allclose(np.asarray(again.rotation)[:, 0] @ axis, direction, rtol=0, atol=1e-8)
    assert np.allclose(again.position, there.position, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "settings, words",
    [
        ({}, "no goal for the tool"),
        ({"position": [0, 0]}, r"\(\.\.\., 3\)"),
        ({"position": [0, 0, np.nan]}, "finite"),
        ({"position": np.zeros((0, 3))}, "no pose to reach"),
        ({"orientation": [2, 0, 0, 0]}, "unit length"),
        ({"orientation": [1, 0, 0]}, "scalar first"),
        ({"orientation": 2 * np.eye(3)}, "orthonormal"),
        ({"orientation": [1, 0, 0, 0], "direction": [1, 0, 0]}, "not both"),
        ({"direction": [0, 0, 0]}, "not zero"),
        ({"position": [0, 0, 0], "start": [0, 0, 0]}, "n = 2"),
        ({"position": [[0, 0, 0]] * 2, "orientation": [[1, 0, 0, 0]] * 3}, "same number"),
        ({"position": [0, 0, 0], "starts": 0}, "whole number"),
        ({"position": [0, 0, 0], "tolerance": -1.0}, "greater than zero"),
        ({"position": [0, 0, 0], "link": "link_7"}, "link"),
        ({"position": [0, 0, 0], "link": "base"}, "no joint moves it"),
    ],
)
def test_bad_input_is_reported(settings, words):
    link = settings.pop("link", "link_1")
    with pytest.raises(jn.errors.JounceError, match=words):
        jn.inverse_kinematics(planar_chain([0.7, 0.5]), link, **settings)
