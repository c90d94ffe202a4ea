"""Joint motion along paths of tools: closed forms, forward after inverse at every order, redundancy, faults."""

import functools

import mpmath
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.kinematics import Status
from tests.planning.tool_paths.arms import planar_chain, wrist_arm
from tests.problems.robots import robot_named

CIRCLE = ["0.8 + 0.2*cos(2*t)", "0.3*sin(2*t)", 0.0]


@functools.cache
def two_links():
    """Return the motion of two links along an ellipse."""
    path = jn.planning.ToolPath(CIRCLE, start=0.0, stop=4.0)
    return jn.planning.follow_tool_path(
        planar_chain([0.7, 0.6]), "link_1", path, order=6, point=[0.6, 0, 0], start=[-0.8, 1.6]
    )


@pytest.mark.slow
def test_two_links_have_the_derivatives_of_their_closed_form():
    motion = two_links()
    assert (motion.status == Status.OK).all()

    def elbow(t):
        x, y = 0.8 + 0.2 * mpmath.cos(2 * t), 0.3 * mpmath.sin(2 * t)
        return mpmath.acos((x**2 + y**2 - mpmath.mpf("0.7") ** 2 - mpmath.mpf("0.6") ** 2) / mpmath.mpf("0.84"))

    def shoulder(t):
        x, y = 0.8 + 0.2 * mpmath.cos(2 * t), 0.3 * mpmath.sin(2 * t)
        bend = elbow(t)
        return mpmath.atan2(y, x) - mpmath.atan2(0.6 * mpmath.sin(bend), 0.7 + 0.6 * mpmath.cos(bend))

    with mpmath.workdps(40):
        for index in (0, 37, 140):
            t = mpmath.mpf(motion.time[index])
            for joint, law in enumerate((shoulder, elbow)):
                exact = [float(c * mpmath.factorial(k)) for k, c in enumerate(mpmath.taylor(law, t, 6))]
                scale = np.maximum.accumulate(np.abs(exact)) + 1.0
                assert (np.abs(motion.q[index, :, joint] - exact) <= 2e-12 * scale).all()


@pytest.mark.slow
def test_other_instants_and_laws_of_the_joints():
    motion = two_links()
    times = np.array([0.123456, 1.7, 3.999])
    exact = motion.at(times, order=3)
    assert (exact.status == Status.OK).all()
    laws = motion.trajectory()
    assert laws.names == ("joint_0", "joint_1")
    # polynomials between instants magnify what positions are rounded by with the cube of the inverse spacing
    assert np.allclose(laws.derivatives(times, 3), exact.q, rtol=0, atol=1e-8)


@pytest.mark.slow
def test_another_time_law_along_the_same_path():
    again = jn.planning.ToolPath(CIRCLE, start=0.0, stop=1.0, progress="4*t**2")
    arm = planar_chain([0.7, 0.6])
    fast = jn.planning.follow_tool_path(arm, "link_1", again, [0.5], order=2, point=[0.6, 0, 0], start=[-0.8, 1.6])
    slow = two_links().at([1.0], order=2)
    q, rate, second = slow.q[0]  # by s = 4 t^2: s' = 4, s'' = 8 at t = 0.5
    assert np.allclose(fast.q[0], [q, 4 * rate, 16 * second + 8 * rate], rtol=0, atol=1e-11)
    assert np.allclose(again.position([0.5], 1)[0, 1], 4 * np.array([-0.4 * np.sin(2), 0.6 * np.cos(2), 0]), atol=1e-14)


@pytest.mark.parametrize("law", ["2*t", jn.laws.SplineMotion(np.linspace(0, 2, 21), 2 * np.linspace(0, 2, 21))])
def test_progress_that_turns_between_all_instants_that_are_looked_at_goes_as_far_as_its_law(law):
    path = jn.planning.ToolPath([law, 0, 0], start=0.0, stop=3.0, progress="2*sin(t)**4")
    times = np.pi / 2 + np.array([-1e-3, 0.0, 1e-4, 1e-3])
    np.testing.assert_allclose(path.position(times)[:, 0, 0], 4 * np.sin(times) ** 4, rtol=1e-15)


def test_progress_with_a_spike_that_was_not_seen_is_refused_there():
    spike = "t + exp(-((t - 0.31234567)/1e-6)**2)"
    path = jn.planning.ToolPath(["t", 0, 0], start=0.0, stop=1.0, progress=spike)
    with pytest.raises(TrajectoryError, match=r"progress: has a spike at 0\.31234567 s"):
        path.position([0.31234567])


@pytest.mark.slow
def test_forward_after_inverse_of_a_wrist_arm_in_any_frames_along_laws_and_samples():
    arm, _ = wrist_arm(7)
    q = np.array([0.2, -0.5, 1.3, 0.4, 0.9, -0.3])
    place, axes = [0.05, 0.02, 0.1], "ZYX"
    pose = jn.forward_kinematics(arm, q[None], "hand", place)
    x, y, z = np.asarray(pose.position)[0]
    angles = Rotation.from_matrix(np.asarray(pose.rotation)[0]).as_euler(axes)
    laws = [f"{x!r} + 0.1*sin(2*t)", f"{y!r} + 0.08*(1 - cos(2*t))", f"{z!r} - 0.05*t"]
    turns = [f"{a!r} + {b}*sin({w}*t)" for a, b, w in zip(angles.tolist(), (0.3, 0.2, -0.25), (1, 2, 1.5), strict=True)]
    path = jn.planning.ToolPath([law.replace("np.float64", "") for law in laws], (axes, turns), start=0.0, stop=2.0)
    settings = {"order": 4, "point": place, "start": q, "limits": False}
    motion = jn.planning.follow_tool_path(arm, "hand", path, np.linspace(0, 2, 41), **settings)
    assert (motion.status == Status.OK).all()
    assert np.allclose(motion.q[0, 0], q, rtol=0, atol=1e-9)
    found = jn.forward_kinematics(arm, motion.q, "hand", place)
    time = jn.Jet.variable(motion.time, 4)
    expected = path.position(motion.time, 4)
    scale = np.maximum.accumulate(np.abs(motion.q).max(axis=(0, 2)))
    assert (np.abs(found.position - expected).max(axis=(0, 2)) <= 1e-13 * scale).all()
    law = jn.JointTrajectory(dict(zip("abc", turns, strict=True)), 0.0, 2.0)
    attitude = jn.rigid.rotation_matrix(axes, law(time)).derivatives()  # (derivative, 3, 3, time)
    assert (np.abs(np.moveaxis(attitude, -1, 0) - found.rotation).max(axis=(0, 2, 3)) <= 1e-13 * scale).all()
    # and through samples of the same path
    places, turned = expected[:, 0], Rotation.from_matrix(np.moveaxis(attitude[0], -1, 0))
    path = jn.planning.ToolPath.through(motion.time, places, turned, degree=7)
    motion = jn.planning.follow_tool_path(arm, "hand", path, motion.time, **{**settings, "order": 3})
    there = jn.forward_kinematics(arm, motion.q, "hand", place)
    assert np.allclose(there.position[:, 0], places, rtol=0, atol=1e-11)
    assert np.allclose(there.rotation[:, 0], turned.as_matrix(), rtol=0, atol=1e-11)
    with pytest.raises(jn.errors.TrajectoryError, match="derivatives to 6"):
        jn.planning.follow_tool_path(arm, "hand", path, motion.time, **{**settings, "order": 7})


@pytest.mark.slow
def test_posture_makes_a_redundant_arm_a_function_of_its_path():
    arm, rest = planar_chain([0.5, 0.4, 0.3]), np.array([0.4, -0.9, 0.7])
    weights = np.array([1.0, 2.0, 0.5])
    path = jn.planning.ToolPath(["0.6 + 0.15*cos(2*pi*t)", "0.2*sin(2*pi*t)", 0.0], start=0.0, stop=1.0)
    motion = jn.planning.follow_tool_path(
        arm, "link_2", path, np.linspace(0, 1, 33), order=3, point=[0.3, 0, 0], posture=rest, weights=weights
    )
    assert (motion.status == Status.OK).all()
    there = jn.forward_kinematics(arm, motion.q, "link_2", [0.3, 0, 0])
    scale = np.maximum.accumulate(np.abs(motion.q).max(axis=(0, 2)))
    assert (np.abs(there.position - path.position(motion.time, 3)).max(axis=(0, 2)) <= 1e-13 * scale).all()
    assert np.allclose(motion.q[0], motion.q[-1], rtol=0, atol=1e-11 * scale[-1])  # a closed path closes
    # nearest to the posture: no self-motion of the arm takes it nearer, to first order, and second differences rise
    columns = jn.jacobian(arm, motion.q[:, :1], "link_2", [0.3, 0, 0])[:, 0, :2]
    loose = np.linalg.svd(columns)[2][:, -1]
    assert np.abs(np.sum(loose * weights * (motion.q[:, 0] - rest), axis=1)).max() < 1e-12
    # derivatives are those of the coordinates: differences of the fifth order in the step
    step = 1e-3
    near = motion.at(0.4 + step * np.arange(-3, 4)).q
    stencil = np.array([-1, 9, -45, 0, 45, -9, 1]) / (60 * step)
    slope = np.einsum("t,tkn->kn", stencil, near[:, :-1])
    assert np.allclose(slope, near[3, 1:], rtol=1e-8, atol=1e-6)


@pytest.mark.slow
def test_held_joints_keep_their_laws():
    arm = planar_chain([0.5, 0.4, 0.3])
    path = jn.planning.ToolPath(["0.7 + 0.1*t", "0.1 + 0.2*t", 0.0], start=0.0, stop=1.0)
    motion = jn.planning.follow_tool_path(
        arm, "link_2", path, [0.0, 0.3, 1.0], order=3, point=[0.3, 0, 0], hold={"joint_0": "0.3 + 0.2*sin(t)"}
    )
    t = motion.time
    exact = np.stack([0.3 + 0.2 * np.sin(t), 0.2 * np.cos(t), -0.2 * np.sin(t), -0.2 * np.cos(t)], axis=1)
    assert np.allclose(motion.q[:, :, 0], exact, rtol=0, atol=1e-13)
    there = jn.forward_kinematics(arm, motion.q, "link_2", [0.3, 0, 0])
    assert np.allclose(there.position, path.position(t, 3), rtol=0, atol=1e-11)


@pytest.mark.slow
def test_more_rows_than_joints_that_agree_and_that_do_not():
    arm, generator = planar_chain([0.5, 0.4]), np.random.default_rng(0)
    place = [0.3, 0, 0]
    q = generator.uniform(0.3, 0.9, 2)
    pose = jn.forward_kinematics(arm, q[None], "link_1", place)
    x, y, _ = np.asarray(pose.position)[0]
    length, turn = np.hypot(x, y), np.arctan2(y, x)
    # all of the arm turned about the base: the one motion of position and orientation that two joints can follow
    laws = [f"{float(length)!r}*cos({float(turn)!r} + t)", f"{float(length)!r}*sin({float(turn)!r} + t)", 0.0]
    path = jn.planning.ToolPath(laws, ("ZYX", [f"{float(q.sum())!r} + t", 0, 0]), start=0.0, stop=1.0)
    motion = jn.planning.follow_tool_path(arm, "link_1", path, [0.0, 0.5, 1.0], order=3, point=place, start=q)
    assert np.allclose(motion.q[:, 0], q + np.stack([motion.time, 0 * motion.time], axis=1), rtol=0, atol=1e-12)
    assert np.allclose(motion.q[:, 1], [1.0, 0.0], rtol=0, atol=1e-12)
    off = jn.planning.ToolPath(laws, ("ZYX", [f"{float(q.sum())!r} + t + 0.1*t**2", 0, 0]), start=0.0, stop=1.0)
    found = jn.planning.follow_tool_path(
        arm, "link_1", off, [0.0, 0.5, 1.0], order=3, point=place, start=q, strict=False
    )
    assert (found.status[1:] == Status.NOT_ASSEMBLED).all()
    assert "cannot keep the tool" in found.explain(1)


@pytest.mark.slow
def test_singular_position_ends_the_path_and_names_the_joints():
    path = jn.planning.ToolPath(["0.9 + 0.5*t", 0.1, 0.0], start=0.0, stop=1.0)
    arm = planar_chain([0.7, 0.6])
    motion = jn.planning.follow_tool_path(arm, "link_1", path, point=[0.6, 0, 0], start=[-0.5, 1.2], strict=False)
    reach = (np.sqrt(1.3**2 - 0.01) - 0.9) / 0.5  # stretched, on the line
    first = int(np.argmax(motion.status != Status.OK))
    assert motion.status[first] == Status.SINGULAR
    assert (motion.status[first + 1 :] == Status.NOT_REACHED).all()
    assert motion.time[first - 1] < reach < motion.time[first] + 1e-3
    assert "joint_1" in motion.ending
    assert np.isnan(motion.q[first:]).all()
    with pytest.raises(jn.errors.SingularityError, match=r"singular position at t = 0\.79"):
        jn.planning.follow_tool_path(arm, "link_1", path, point=[0.6, 0, 0], start=[-0.5, 1.2])


@pytest.mark.slow
def test_limits_jumps_and_starts_are_reported():
    arm = planar_chain([0.7, 0.6], lower=-1.0, upper=1.8)
    settings = {"point": [0.6, 0, 0], "start": [-0.8, 1.6], "order": 1}
    path = jn.planning.ToolPath(CIRCLE, start=0.0, stop=4.0)
    with pytest.raises(jn.errors.RobotError, match="joint_1 leaves its range at t = "):
        jn.planning.follow_tool_path(arm, "link_1", path, **settings)
    kept = jn.planning.follow_tool_path(arm, "link_1", path, strict=False, **settings)
    low = kept.q[:, 0, 0] < -1.0
    assert low.any()
    assert np.array_equal(kept.status == Status.INADMISSIBLE, low | (kept.q[:, 0, 1] > 1.8))
    law = jn.laws.PiecewiseMotion(["0.8", "0.9"], until=[0.5])
    with pytest.raises(jn.errors.RobotError, match=r"jumps at t = 0\.49"):
        jn.planning.follow_tool_path(
            arm, "link_1", jn.planning.ToolPath([law, 0.1, 0.0], start=0.0, stop=1.0), limits=False, **settings
        )
    with pytest.raises(jn.errors.RobotError, match="beginning of the path is not reached"):
        jn.planning.follow_tool_path(
            arm, "link_1", jn.planning.ToolPath([3.0, "t", 0.0], start=0.0, stop=1.0), **settings
        )


@pytest.mark.slow
def test_panda_with_a_posture():
    robot = robot_named("panda")
    robot = robot.locked({name: 0.02 for name in robot.joint_names if "finger" in name})
    laws = ["0.45 + 0.1*cos(2*t)", "0.1*sin(2*t)", "0.4 + 0.05*sin(t)"]
    path = jn.planning.ToolPath(laws, [0, 1, 0, 0], start=0.0, stop=2 * np.pi)
    motion = jn.planning.follow_tool_path(robot, "panda_hand", path, order=3)
    assert (motion.status == Status.OK).all()
    there = jn.forward_kinematics(robot, motion.q, "panda_hand")
    scale = np.maximum.accumulate(np.abs(motion.q).max(axis=(0, 2)))
    assert (np.abs(there.position - path.position(motion.time, 3)).max(axis=(0, 2)) <= 2e-13 * scale).all()
    assert np.abs(there.angular_velocity).max() <= 1e-9
    assert np.allclose(motion.q[0, :3], motion.q[-1, :3], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: jn.planning.ToolPath(start=0.0, stop=1.0), "to follow"),
        (lambda: jn.planning.ToolPath([0, 0], start=0.0, stop=1.0), "three laws"),
        (lambda: jn.planning.ToolPath([0, 0, "u"], start=0.0, stop=1.0), "u"),
        (lambda: jn.planning.ToolPath([0, 0, 0], start=1.0, stop=1.0), "after the start"),
        (lambda: jn.planning.ToolPath(orientation=("ZZX", [0, 0, 0]), start=0.0, stop=1.0), "neighbors|valid|sequence"),
        (lambda: jn.planning.ToolPath(orientation=np.stack([np.eye(3)] * 2), start=0.0, stop=1.0), "through"),
        (lambda: jn.planning.ToolPath(orientation=[1, 0, 0, 0], direction=[1, 0, 0], start=0.0, stop=1.0), "not both"),
        (lambda: jn.planning.ToolPath(["t", 0, 0], start=0.0, stop=1.0, progress=2.0), "must change"),
        (lambda: jn.planning.ToolPath(["t", 0, 0], start=0.0, stop=1.0).position([2.0]), "within"),
        (lambda: jn.planning.ToolPath.through([0, 1], [[0, 0, 0]] * 2), "at least"),
    ],
)
def test_bad_paths_are_reported(make, words):
    with pytest.raises(jn.errors.JounceError, match=words):
        make()


@pytest.mark.parametrize(
    "settings, words",
    [
        ({"hold": {"joint_9": 0}}, "joint_9"),
        ({"hold": {"joint_0": 0}}, "beginning of the path is not reached"),
        ({"weights": [1.0, 0.0]}, "greater than zero"),
        ({"posture": [1.0]}, "2 finite numbers"),
        ({"time": [5.0]}, "instants from 0"),
        ({"time": np.array([0.5j])}, "time: must be real numbers"),
        ({"order": -1}, "whole number"),
    ],
)
def test_bad_settings_are_reported(settings, words):
    path = jn.planning.ToolPath(["0.8 + 0.1*t", 0.1, 0.0], start=0.0, stop=1.0)
    with pytest.raises(jn.errors.JounceError, match=words):
        jn.planning.follow_tool_path(planar_chain([0.7, 0.6]), "link_1", path, point=[0.6, 0, 0], **settings)
