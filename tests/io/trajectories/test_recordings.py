"""Recordings and messages that other tools write: read with right numbers, or refused by line."""

import json
import warnings

import numpy as np
import pytest
import yaml

import jounce as jn
from jounce.errors import TrajectoryError

JOINTS = ("shoulder", "elbow")
TIMES = np.arange(0.0, 1.0001, 0.02)


def motion(times, order=0):
    """Two sines, or a derivative of them."""
    return np.stack([w**order * np.sin(w * times + order * np.pi / 2) for w in (2.0, 3.0)], axis=-1)


def table(folder, header, columns, name="log.csv"):
    path = folder / name
    rows = [",".join(x if isinstance(x, str) else f"{x:.17g}" for x in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def check(trajectory, names=JOINTS, order=2, tolerance=1e-3, start=0.0):
    """Positions and derivatives are those of the motion, between samples too."""
    assert trajectory.names == tuple(names)
    times = np.linspace(0.1, 0.9, 37)
    found = trajectory.derivatives(times + start, order)
    for k in range(order + 1):
        assert np.abs(found[:, k] - motion(times, k)).max() <= tolerance * 3.0**k


Q, V, A = (motion(TIMES, k).T for k in range(3))
EPOCH = [f"1732686000.{round(t * 1e9):09d}" if t < 1 else "1732686001.000000000" for t in TIMES]
RPM = 30 / np.pi  # of 1 rad/s
NANO = [x.replace(".", "") for x in EPOCH]


@pytest.mark.parametrize(
    "header, columns, names",
    [
        ("__time,/joint_states/shoulder/position,/joint_states/elbow/position", [EPOCH, *Q], JOINTS),
        (
            "__time,/js/shoulder/position,/js/shoulder/velocity,/js/shoulder/effort,/js/elbow/position,"
            "/js/elbow/velocity,/js/elbow/effort",
            [EPOCH, Q[0], V[0], A[0], Q[1], V[1], A[1]],
            JOINTS,
        ),
        (
            "%time,field.header.seq,field.header.stamp,field.name0,field.name1,field.position0,field.position1,"
            "field.velocity0,field.velocity1",
            [NANO, TIMES, NANO, ["shoulder"] * 51, ["elbow"] * 51, *Q, *V],
            JOINTS,
        ),
        ("time,q_0,q_1,dq_0,dq_1,tau_J_0,tau_J_1", [TIMES, *Q, *V, *A], ("q_0", "q_1")),
        (
            "time, success_rate, state.q[0], state.q[1],state.q_d[0], state.dq[0], state.dq[1]",
            [1000 * TIMES, TIMES, *Q, Q[0], *V],
            ("state.q[0]", "state.q[1]"),
        ),
        ("time,shoulder_pos,elbow_pos,shoulder_vel,elbow_vel", [TIMES, *Q, *V], JOINTS),
        ("elbow,shoulder,time,elbow_velocity,shoulder_velocity,elbow_effort", [*Q[::-1], TIMES, *V[::-1], A[0]], None),
        ("time,shoulder,elbow,shoulder_vel,elbow_vel,shoulder_acc,elbow_acc", [TIMES, *Q, *V, *A], JOINTS),
        ("time [ms],shoulder [deg],elbow [deg]", [1000 * TIMES, *np.rad2deg(Q)], JOINTS),
        ("time (ms),shoulder (deg),elbow (mm)", [1000 * TIMES, np.rad2deg(Q[0]), 1000 * Q[1]], JOINTS),
        ("time_ms,shoulder_deg,elbow_rad", [1000 * TIMES, np.rad2deg(Q[0]), Q[1]], JOINTS),
        (
            "t_us,shoulder_deg,elbow_mm,shoulder_deg_s",
            [1e6 * TIMES, np.rad2deg(Q[0]), 1e3 * Q[1], np.rad2deg(V[0])],
            JOINTS,
        ),
        ("t,shoulder_pos_deg,elbow_pos_deg,elbow_vel_deg_per_s", [TIMES, *np.rad2deg(Q), np.rad2deg(V[1])], JOINTS),
        (
            "t,shoulder_deg,elbow_rad,shoulder_dps,elbow_rpm",
            [TIMES, np.rad2deg(Q[0]), Q[1], np.rad2deg(V[0]), V[1] * RPM],
            JOINTS,
        ),
    ],
)
def test_tables_of_other_tools(tmp_path, header, columns, names):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.RecordingWarning)
        trajectory = jn.load_trajectory(table(tmp_path, header, columns))
    assert trajectory.start == 0.0
    if names is None:
        names = ("elbow", "shoulder")
        trajectory = jn.JointTrajectory({k: trajectory.laws[k] for k in JOINTS}, trajectory.start, trajectory.stop)
        names = JOINTS
    check(trajectory, names)
    if "_acc" in header:
        assert all(law.degree == 7 for law in trajectory.laws.values())


@pytest.mark.parametrize(
    "time, stamps, unit",
    [("__time", EPOCH, "s"), ("time [s]", EPOCH, "s"), ("time [ns]", NANO, "ns"), ("stamp_ns", NANO, "ns")],
)
def test_epoch_stamps_lose_no_digits(tmp_path, time, stamps, unit):
    """In double precision 1732686000.123 s has 0.2 us: differences of the texts have none of that."""
    path = table(tmp_path, f"{time},/js/shoulder/position,/js/elbow/position", [stamps, *Q])
    with pytest.warns(jn.errors.RecordingWarning, match=rf"epoch, in {unit}: t = 0 is 1732686000\.000000000 s"):
        trajectory = jn.load_trajectory(path)
    np.testing.assert_allclose(trajectory.times, TIMES, rtol=0, atol=1e-15)


def test_series_at_stamps_of_their_own(tmp_path):
    """PlotJuggler leaves cells empty where another series alone has a sample."""
    rows = ["__time,/js/shoulder/position,/js/elbow/position"]
    rows += [f"{t:.9g},{np.sin(2 * t):.17g},\n{t + 0.005:.9g},,{np.sin(3 * (t + 0.005)):.17g}" for t in TIMES]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows) + "\n")
    trajectory = jn.load_trajectory(path)
    assert (trajectory.start, trajectory.stop) == (0.005, 1.0)
    check(trajectory)


def test_rows_out_of_order_and_repeated_ones_are_reported(tmp_path):
    order = [*range(20), 21, 20, *range(22, 40), 39, *range(40, 51)]
    path = table(tmp_path, "time,shoulder,elbow", [TIMES[order], *Q[:, order]])
    with pytest.warns(
        jn.errors.RecordingWarning, match=r"1 rows were out of order.*\(the first in line 23\); 1 repeated"
    ):
        trajectory = jn.load_trajectory(path)
    assert len(trajectory.times) == 51
    check(trajectory)


@pytest.mark.parametrize(
    "header, columns, words",
    [
        ("time,a,b", [np.append(TIMES, TIMES), *np.hstack([Q, Q])], "line 53, time: .*times start again"),
        ("time,a,b", [np.repeat(TIMES[::3], 3), *Q], "line 3, time: 34 of 51 stamps repeat"),
        ("time,a,a_vel", [TIMES, Q[0], np.rad2deg(V[0])], "line 2, a: velocities say a change .* contradict"),
        ("time,a,a_vel", [TIMES, Q[0], -V[0]], "a: velocities say a change of -.* contradict"),
        ("time,a,b,a_vel,b_vel", [TIMES, *Q, *V[::-1]], "line [0-9]+, [ab]: velocities .* contradict"),
        ("time,a,a_vel,a_acc", [TIMES, Q[0], V[0], 2 * A[0]], "a: accelerations say a change"),
        ("time,a,a_d1", [TIMES, Q[0], 2 * V[0]], "line [0-9]+, a: velocities .* contradict"),
        ("__time,/a/j/position,/b/j/position", [TIMES, *Q], "line 1, j: two series are of this joint"),
        ("time,q_0,position_0", [TIMES, *Q], "line 1, position_0: two columns are of the same joint"),
        ("time,a_deg,a_rad", [TIMES, *Q], "line 1, a: two columns are of the same joint, a_deg and a_rad"),
        ("time,q_deg_0,q_deg_1", [TIMES, *Q], r"line 1: .* seems to say deg, .*'q_deg_0'.* write NAME \[deg\]"),
        ("time,aDeg", [TIMES, Q[0]], "line 1: this name seems to say deg"),
        ("time,a,a_pos", [TIMES, *Q], "line 1, a: two columns are of the same joint"),
        ("%time,field.name0,field.position0", [NANO, ["a"] * 50 + ["b"], Q[0]], "line 52, field.name0: .* changes"),
        (
            "__time,/js/j/position,/js/k/position",
            [TIMES, Q[0], ["x"] * 51],
            r"line 2, /js/k/position: must be a finite",
        ),
    ],
)
def test_what_does_not_agree_is_refused(tmp_path, header, columns, words):
    path = table(tmp_path, header, columns)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.RecordingWarning)
        with pytest.raises(TrajectoryError, match=words):
            jn.load_trajectory(path)


@pytest.mark.parametrize("speed, line", [(0.5, 631), (-1.3, 244)])
def test_angles_within_one_turn_are_refused_where_they_start_again(tmp_path, speed, line):
    times = np.arange(0.0, 9.0, 0.01)
    noisy = speed * times + 1e-3 * np.random.default_rng(0).normal(size=len(times))
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([times, (noisy + np.pi) % (2 * np.pi) - np.pi]), "%.9f", ",", header="time,a")
    with pytest.raises(jn.errors.TrajectoryError, match=rf"log.csv, line {line}, a: goes by -?6\.2.* numpy\.unwrap"):
        jn.load_trajectory(path)


def test_a_joint_that_turns_about_once_from_sample_to_sample_is_read(tmp_path):
    path = table(tmp_path, "time,a", [TIMES, 6.1 * np.maximum(np.arange(51) - 3.0, 0.0)])
    assert jn.load_trajectory(path).derivatives(TIMES[-1:], order=0)[0, 0, 0] == pytest.approx(6.1 * 47, abs=1e-12)


def test_a_single_outlier_of_a_velocity_is_refused_and_a_knock_is_not(tmp_path):
    generator = np.random.default_rng(3)
    noisy = [TIMES, Q[0] + 1e-5 * generator.normal(size=51), V[0] + 1e-3 * generator.normal(size=51)]
    spike = np.where(np.arange(51) == 20, 3.0, 0.0)
    path = table(tmp_path, "time,a,a_vel", [*noisy[:2], noisy[2] + spike])
    with pytest.raises(TrajectoryError, match=r"line 22, a: velocities have an outlier at t = 0.4 s: .* leave the row"):
        jn.load_trajectory(path)
    knock = np.clip(1.0 - np.abs(np.arange(51) - 20) / 1.5, 0.0, None)  # of some samples, in positions too
    moved = np.append(0.0, np.cumsum(np.diff(TIMES) * (knock[1:] + knock[:-1]) / 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.RecordingWarning)
        jn.load_trajectory(table(tmp_path, "time,a,a_vel", [TIMES, Q[0] + moved, V[0] + knock]))


def test_the_index_of_pandas_counts_rows_or_is_the_time(tmp_path):
    rows = np.arange(51)
    check(jn.load_trajectory(table(tmp_path, ",time,shoulder,elbow", [rows, TIMES, *Q])))
    check(jn.load_trajectory(table(tmp_path, ",shoulder,elbow", [TIMES, *Q])))
    with pytest.raises(TrajectoryError, match="no column has this name, got 'time'"):
        jn.load_trajectory(table(tmp_path, ",shoulder,elbow", [rows, *Q]))  # numbers of rows are no seconds
    waypoints = jn.io.load_path(table(tmp_path, ",shoulder,elbow", [rows, *Q]))
    assert waypoints.names == ("shoulder", "elbow")
    with pytest.raises(TrajectoryError, match="column 1 has no name"):
        jn.load_trajectory(table(tmp_path, ",time,shoulder", [Q[1], TIMES, Q[0]]))


@pytest.mark.parametrize("gap, told", [(0.15, False), (1.6, True)])
def test_gaps_between_samples_are_reported(tmp_path, gap, told):
    """Within one and a quarter periods without samples, the spline is off by more than the amplitude."""
    times = np.arange(200) * 0.01
    times = np.concatenate([times, times + 2 + gap])
    path = table(tmp_path, "time,axis,still", [times, np.sin(5 * times + 0.3), 0 * times + 1])
    if not told:
        read = jn.load_trajectory(path)
    else:
        words = (
            r"no samples between t = 1\.99 and 3\.6 s \(line 202\), of axis, still: the motion there is what a spline"
        )
        with pytest.warns(jn.errors.RecordingWarning, match=words):
            read = jn.load_trajectory(path)
    middle = 1.995 + gap / 2 + np.linspace(-0.3, 0.3, 7) * gap
    error = np.abs(read.derivatives(middle, 0)[:, 0, 0] - np.sin(5 * middle + 0.3)).max()
    assert error > 1 if told else error < 1e-3


def test_two_positions_at_one_stamp(tmp_path):
    times = np.insert(TIMES, 25, TIMES[25])
    path = table(tmp_path, "time,shoulder,elbow", [times, *np.insert(Q, 25, Q[:, 25] + 1e-4, axis=1)])
    with pytest.warns(jn.errors.RecordingWarning, match="1 of them by the mean of different values"):
        check(jn.load_trajectory(path), order=0)
    path = table(tmp_path, "time,shoulder,elbow", [times, *np.insert(Q, 25, Q[:, 25] + 1.0, axis=1)])
    with pytest.raises(TrajectoryError, match=r"line 28, shoulder: times must increase, .* is at .* then"):
        jn.load_trajectory(path)


def test_slow_and_noisy_velocities_are_read(tmp_path):
    """A filtered velocity lags by some ms, and noise of 1 percent is no contradiction."""
    generator = np.random.default_rng(5)
    late = motion(TIMES - 0.004, 1).T + 0.02 * generator.normal(size=V.shape)
    path = table(tmp_path, "time,shoulder,elbow,shoulder_vel,elbow_vel", [TIMES, *Q, *late])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        trajectory = jn.load_trajectory(path)
        check(trajectory, order=0)
    with pytest.warns(jn.errors.SampleWarning, match="do not support"):
        trajectory.derivatives([0.5], 3)


def message(points, **more):
    return {"joint_names": list(JOINTS), "points": points} | more


def point(t, levels=3, **change):
    keys = ("positions", "velocities", "accelerations")
    own = {key: motion(np.array(t), k).tolist() if k < levels else [] for k, key in enumerate(keys)}
    whole = round(t * 1e9)
    return own | {"effort": [], "time_from_start": {"sec": whole // 10**9, "nanosec": whole % 10**9}} | change


POINTS = [point(t) for t in np.arange(0.0, 1.01, 0.1)]
HEADER = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
MULTI = {"header": HEADER, "joint_names": [], "points": []}


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
@pytest.mark.parametrize(
    "data",
    [
        message(POINTS, header=HEADER),
        {"joint_trajectory": message(POINTS, header=HEADER), "multi_dof_joint_trajectory": MULTI},
        {"trajectory": message(POINTS), "goal_tolerance": [], "goal_time_tolerance": {"sec": 0, "nanosec": 0}},
        {"header": HEADER, "goal_id": {"id": ""}, "goal": {"trajectory": message(POINTS), "path_tolerance": []}},
        {
            "model_id": "arm",
            "trajectory": [{"joint_trajectory": message(POINTS), "multi_dof_joint_trajectory": MULTI}],
            "trajectory_start": {"joint_state": {"name": ["elbow", "shoulder"], "position": [0.0, 0.0]}},
        },
        {"trajectory": {"joint_trajectory": message(POINTS), "multi_dof_joint_trajectory": MULTI}},
        {"goal": {"trajectory": {"joint_trajectory": message(POINTS)}, "controller_names": []}},
        {"planned_trajectory": {"joint_trajectory": message(POINTS)}, "planning_time": 0.1},
        {"motion_plan_response": {"group_name": "arm", "trajectory": {"joint_trajectory": message(POINTS)}}},
        {
            "model_id": "arm",
            "trajectory": [{"joint_trajectory": message(POINTS[:6])}, {"joint_trajectory": message(POINTS[5:])}],
        },
    ],
)
def test_messages_and_goals(tmp_path, data, suffix):
    path = tmp_path / f"message{suffix}"
    path.write_text(json.dumps(data) if suffix == ".json" else plain_yaml(data))
    check(jn.load_trajectory(path), tolerance=1e-4)


def plain_yaml(data):
    """YAML without aliases, which no tool of ROS writes."""
    return yaml.safe_dump(json.loads(json.dumps(data)))


def test_messages_as_they_are_echoed(tmp_path):
    path = tmp_path / "echo.yaml"
    path.write_text(yaml.safe_dump(message(POINTS)) + "---\n")
    check(jn.load_trajectory(path), tolerance=1e-4)
    path.write_text("---\n" + yaml.safe_dump(message(POINTS)))
    check(jn.load_trajectory(path), tolerance=1e-4)
    path.write_text(2 * (yaml.safe_dump(message(POINTS)) + "---\n"))
    with pytest.raises(TrajectoryError, match=r"line [0-9]+, \[1\]: the file has 2 messages"):
        jn.load_trajectory(path)


def states(times, stamp=("sec", "nanosec"), origin=1732686000):
    for k, t in enumerate(times):
        whole = origin * 10**9 + round(t * 1e9)
        names = JOINTS[:: 1 if k % 2 else -1]
        values = {"position": motion(np.array(t)), "velocity": motion(np.array(t), 1)}
        yield {
            "header": {"stamp": {stamp[0]: whole // 10**9, stamp[1]: whole % 10**9}, "frame_id": ""},
            "name": list(names),
            **{key: x.tolist()[:: 1 if k % 2 else -1] for key, x in values.items()},
            "effort": [],
        }


@pytest.mark.parametrize("stamp", [("sec", "nanosec"), ("secs", "nsecs")])
def test_joint_states_as_they_are_echoed(tmp_path, stamp):
    """Joints in any sequence in each message, stamps since an epoch."""
    path = tmp_path / "echo.yaml"
    path.write_text("".join(yaml.safe_dump(state) + "---\n" for state in states(TIMES, stamp)))
    with pytest.warns(jn.errors.RecordingWarning, match="epoch"):
        trajectory = jn.load_trajectory(path)
    np.testing.assert_allclose(trajectory.times, TIMES, rtol=0, atol=1e-12)
    check(jn.JointTrajectory({k: trajectory.laws[k] for k in JOINTS}, 0.0, trajectory.stop))


@pytest.mark.parametrize(
    "points, words",
    [
        ([point(0, velocities=[]), point(1)], r"points\[0\]|accelerations without velocities"),
        ([point(0), point(1, positions=[1.0, "..."])], r"points\[1\]\.positions: was cut .* --full-length"),
        ([point(0), point(0, positions=[1.0, 2.0])], "must come after that of the point before, which is another"),
        ([point(0.5), point(0)], r"points\[1\]\.time_from_start: must come after"),
        ([point(0), "..."], "points: was cut"),
        ([point(0), point(1, positions=[10**400, 0])], r"points\[1\]\.positions: must be 2 finite numbers"),
        ([point(0), point(1, time_from_start=10**400)], r"points\[1\]\.time_from_start: must be a time"),
        ([point(0), point(1, time_from_start={"sec": 10**400})], r"time_from_start\.sec: must be a whole number"),
    ],
)
def test_points_that_no_controller_takes(tmp_path, points, words):
    path = tmp_path / "message.json"
    path.write_text(json.dumps(message(points)))
    with pytest.raises(TrajectoryError, match=words):
        jn.load_trajectory(path)


def test_positions_may_be_whole_numbers_of_any_size(tmp_path):
    path = tmp_path / "message.json"
    path.write_text(json.dumps(message([point(0), point(1, positions=[10**20, 1])])))
    assert jn.load_trajectory(path).derivatives([1.0], 0)[0, 0].tolist() == [1e20, 1.0]


def test_between_a_point_without_accelerations_and_another_the_law_is_a_cubic(tmp_path):
    path = tmp_path / "message.json"
    path.write_text(json.dumps(message([point(0), point(1, accelerations=[])])))
    assert jn.load_trajectory(path).laws["shoulder"].degree == 3


def test_a_robot_that_is_not_where_its_trajectory_starts(tmp_path):
    start = {"joint_state": {"name": list(JOINTS), "position": [0.0, 0.2]}}
    moves = {"joint_trajectory": message(POINTS)}
    planned = {"trajectory": moves, "trajectory_start": start}
    path = tmp_path / "message.json"
    for data in ({"model_id": "arm", **planned, "trajectory": [moves]}, {"motion_plan_response": planned}):
        path.write_text(json.dumps(data))
        with pytest.raises(TrajectoryError, match=r"starts at 0\.2, and the trajectory of elbow at 0: it would jump"):
            jn.load_trajectory(path)


def test_the_line_of_a_point_that_no_controller_takes(tmp_path):
    path = tmp_path / "message.yaml"
    path.write_text(plain_yaml(message([point(0), point(1, velocities=[]), point(2)])))
    lines = path.read_text().splitlines()
    second = [k for k, line in enumerate(lines, 1) if line.startswith("- accelerations")][1]
    with pytest.raises(TrajectoryError, match="accelerations without velocities") as raised:
        jn.load_trajectory(path)
    assert raised.value.line == second


def test_as_the_controller_goes(tmp_path):
    """Closed forms of joint_trajectory_controller: lines, cubics and quintics between points, part by part."""
    points = [point(0.0, 1), point(0.5, 1), point(0.7, 2), point(0.9, 3), point(1.0, 3)]
    path = tmp_path / "message.json"
    path.write_text(json.dumps(message(points)))
    trajectory = jn.load_trajectory(path, as_controller=True)
    q = [motion(np.array(t)) for t in (0.0, 0.5, 0.7, 0.9, 1.0)]
    found = trajectory.derivatives([0.25, 0.6, 0.8, 0.95], 2)
    np.testing.assert_allclose(found[0], [(q[0] + q[1]) / 2, (q[1] - q[0]) / 0.5, 0 * q[0]], atol=1e-13)
    np.testing.assert_allclose(found[1, 1], (q[2] - q[1]) / 0.2, atol=1e-13)
    v = [motion(np.array(t), 1) for t in (0.7, 0.9, 1.0)]
    middle = (q[2] + q[3]) / 2 + 0.2 / 8 * (v[0] - v[1])  # of a cubic
    np.testing.assert_allclose(found[2, 0], middle, atol=1e-13)
    a = [motion(np.array(t), 2) for t in (0.9, 1.0)]
    middle = (q[3] + q[4]) / 2 + 0.1 * 5 / 32 * (v[1] - v[2]) + 0.01 / 64 * (a[0] + a[1])  # of a quintic
    np.testing.assert_allclose(found[3, 0], middle, atol=1e-13)


def test_as_the_controller_goes_through_samples(tmp_path):
    path = table(tmp_path, "time,shoulder,elbow", [TIMES, *Q])
    trajectory = jn.load_trajectory(path, as_controller=True)
    found = trajectory.derivatives([0.21], 2)[0]
    np.testing.assert_allclose(
        found, [(Q[:, 10] + Q[:, 11]) / 2, (Q[:, 11] - Q[:, 10]) / 0.02, 0 * Q[:, 10]], atol=1e-12
    )
    path = table(tmp_path, "time,shoulder,elbow,shoulder_vel,elbow_vel", [TIMES, *Q, *V])
    assert all(law.degree == 3 for law in jn.load_trajectory(path, as_controller=True).laws.values())
    law = tmp_path / "law.yaml"
    law.write_text("joints: {a: t}\ntime: {stop: 1, step: 0.1}\n")
    with pytest.raises(TrajectoryError, match="as_controller: contains laws"):
        jn.load_trajectory(law, as_controller=True)
    twice = tmp_path / "twice.json"
    twice.write_text(json.dumps(message([POINTS[0], *POINTS])))
    with pytest.warns(jn.errors.RecordingWarning, match="1 repeated stamps are left out"):
        check(jn.load_trajectory(twice), tolerance=1e-4)
    with pytest.raises(TrajectoryError, match="as_controller: the controller refuses such points"):
        jn.load_trajectory(twice, as_controller=True)


@pytest.mark.parametrize("version", [8, 9])
def test_bags_of_ros_2(tmp_path, version):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds = store.types
    state, head = kinds["sensor_msgs/msg/JointState"], kinds["std_msgs/msg/Header"]
    stamp, duration = kinds["builtin_interfaces/msg/Time"], kinds["builtin_interfaces/msg/Duration"]
    row, whole = kinds["trajectory_msgs/msg/JointTrajectoryPoint"], kinds["trajectory_msgs/msg/JointTrajectory"]
    folder = tmp_path / "bag"
    with rosbags.Writer(folder, version=version) as writer:
        for topic, kind in (("/joint_states", state), ("/plan", whole), ("/gripper", state)):
            connection = writer.add_connection(topic, kind.__msgtype__, typestore=store)
            if kind is state:
                for t in TIMES if topic != "/gripper" else []:
                    header = head(stamp(1732686000, round(t * 1e9)) if t < 1 else stamp(1732686001, 0), "")
                    values = [motion(np.array(t), k) for k in (0, 1)]
                    raw = store.serialize_cdr(state(header, list(JOINTS), *values, np.zeros(0)), kind.__msgtype__)
                    writer.write(connection, int((1732686000 + t) * 1e9), raw)
            else:
                points = [
                    row(*(np.array(x[key]) for key in ("positions", "velocities", "accelerations")), np.zeros(0),
                        duration(**x["time_from_start"]))
                    for x in POINTS
                ]  # fmt: skip
                raw = store.serialize_cdr(whole(head(stamp(0, 0), ""), list(JOINTS), points), kind.__msgtype__)
                writer.write(connection, 1732686000 * 10**9, raw)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.RecordingWarning)
        with pytest.raises(TrajectoryError, match=r"topic: .*several topics .* /joint_states, /plan, /gripper"):
            jn.load_trajectory(folder)
        log = jn.load_trajectory(folder, topic="/joint_states")
        check(log)
        assert abs(log.stop - 1.0) < 1e-12
        check(jn.load_trajectory(next(folder.glob("*.db3")), topic="/plan"), tolerance=1e-4)
        with pytest.raises(TrajectoryError, match="at least two samples are needed"):
            jn.load_trajectory(folder, topic="/gripper")
    with pytest.raises(TrajectoryError, match="no topic of joint states or trajectories has this name"):
        jn.load_trajectory(folder, topic="/none")
    next(folder.glob("*.db3")).write_bytes(b"nothing of a bag")
    with pytest.raises(TrajectoryError, match="the bag cannot be read"):
        jn.load_trajectory(folder, topic="/plan")


def bag_of_states(folder, stamps, names):
    """Write a bag of joint states that are received once a second, with these stamps, s."""
    rosbags = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    state, head = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    time = store.types["builtin_interfaces/msg/Time"]
    with rosbags.Writer(folder, version=9) as writer:
        connection = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for k, stamp in enumerate(stamps):
            sent = state(head(time(stamp, 0), ""), names, 0.1 * k * np.ones(2), np.zeros(0), np.zeros(0))
            writer.write(connection, (1732686000 + k) * 10**9, store.serialize_cdr(sent, state.__msgtype__))
    return folder


@pytest.mark.parametrize(
    "stamps, names, says",
    [
        ([0, 1732686000, 1732686001], ["a", "b"], "stamp: 1 of 3 messages have no stamp, the first is message 1"),
        ([1732686000, 0, 0], ["a", "b"], "stamp: 2 of 3 messages have no stamp, the first is message 2"),
        ([0, 1, 2], ["a", "a"], "name: message 1 of /joint_states names a joint twice, got ['a', 'a']"),
    ],
)
def test_messages_without_a_stamp_or_with_a_name_twice_are_refused(tmp_path, stamps, names, says):
    with pytest.raises(TrajectoryError) as caught:
        jn.load_trajectory(bag_of_states(tmp_path / "bag", stamps, names))
    assert says in str(caught.value)


def test_a_simulated_clock_may_begin_at_zero(tmp_path):
    log = jn.load_trajectory(bag_of_states(tmp_path / "bag", range(9), ["a", "b"]))
    assert (log.start, log.stop) == (0.0, 8.0)
    np.testing.assert_allclose(log.derivatives([8.0], 0), [[[0.8, 0.8]]], rtol=1e-12)


def test_a_bag_that_was_cut_short_says_how_it_is_mended(tmp_path):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds = store.types
    state, head = kinds["sensor_msgs/msg/JointState"], kinds["std_msgs/msg/Header"]
    folder = tmp_path / "bag"
    with rosbags.Writer(folder, version=9, storage_plugin=rosbags.StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for t in TIMES:
            header = head(kinds["builtin_interfaces/msg/Time"](int(t), round((t % 1) * 1e9)), "")
            values = [motion(np.array(t), k) for k in (0, 1)]
            raw = store.serialize_cdr(state(header, list(JOINTS), *values, np.zeros(0)), state.__msgtype__)
            writer.write(connection, int(t * 1e9), raw)
    (file,) = folder.glob("*.mcap")
    check(jn.load_trajectory(folder))
    file.write_bytes(file.read_bytes()[:-200])
    alone = tmp_path / "alone.mcap"
    alone.write_bytes(file.read_bytes())
    for path in (folder, file, alone):
        with pytest.raises(TrajectoryError, match=r"the bag cannot be read: .*cut short, .*mend it by `mcap recover`"):
            jn.load_trajectory(path)


@pytest.mark.parametrize("kept", ["feedback", "actual"])
def test_controller_states_in_a_bag_are_what_was_measured(tmp_path, kept):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    name, asked = "control_msgs/msg/JointTrajectoryControllerState", "reference" if kept == "feedback" else "desired"
    point = "trajectory_msgs/JointTrajectoryPoint"
    fields = f"std_msgs/Header header\nstring[] joint_names\n{point} {asked}\n{point} {kept}\n{point} error\n"
    store.register(typesys.get_types_from_msg(fields, name))
    kinds = store.types
    head, stamp = kinds["std_msgs/msg/Header"], kinds["builtin_interfaces/msg/Time"]
    row, duration = kinds["trajectory_msgs/msg/JointTrajectoryPoint"], kinds["builtin_interfaces/msg/Duration"]

    def at(t, scale):
        position, velocity = (scale * motion(np.array(t), k) for k in (0, 1))
        return row(position, velocity, np.zeros(0), np.zeros(0), duration(0, 0))

    folder = tmp_path / "bag"
    with rosbags.Writer(folder, version=9) as writer:
        connection = writer.add_connection("/arm_controller/controller_state", name, typestore=store)
        for t in TIMES:
            header = head(stamp(1732686000 + int(t), round((t % 1) * 1e9)), "")
            states = {asked: at(t, 2.0), kept: at(t, 1.0), "error": at(t, 0.0)}
            raw = store.serialize_cdr(kinds[name](header=header, joint_names=list(JOINTS), **states), name)
            writer.write(connection, int((1732686000 + t) * 1e9), raw)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.RecordingWarning)
        check(jn.load_trajectory(folder))


@pytest.mark.parametrize("begin", [0, 12_345_678_901, 1732686000 * 10**9])
def test_stamps_of_rostopic_are_in_ns_also_by_a_simulated_clock(tmp_path, begin):
    log = tmp_path / "log.csv"
    stamps = [begin + round(t * 1e9) for t in TIMES]
    rows = [f"{s},shoulder,elbow,{a:.17g},{b:.17g}" for s, a, b in zip(stamps, *Q, strict=True)]
    log.write_text("\n".join(["%time,field.name0,field.name1,field.position0,field.position1", *rows]) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.RecordingWarning)
        read = jn.load_trajectory(log)
    assert read.start == pytest.approx(begin * 1e-9 if begin < 1e17 else 0.0, abs=1e-9)
    assert read.stop - read.start == pytest.approx(1.0, abs=1e-9)


def test_spaces_between_entries_are_named(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("timestamp actual_q_0\n" + "".join(f"{t:.3f} {q:.9f}\n" for t, q in zip(TIMES, Q[0], strict=True)))
    with pytest.raises(TrajectoryError, match=r"line 1: entries are separated by commas, here by spaces"):
        jn.load_trajectory(log)


def test_a_long_table_is_read_as_the_same_table_in_parts(tmp_path, monkeypatch):
    """Numbers without a text for each entry, stamps since an epoch exactly; a fault is told by its line."""
    epoch = table(tmp_path, "time,shoulder,elbow", [EPOCH, *Q])
    monkeypatch.setattr("jounce.io.files.long_tables.LONG", 10)
    with pytest.warns(jn.errors.RecordingWarning, match=r"t = 0 is 1732686000\.0"):
        trajectory = jn.load_trajectory(epoch)
    np.testing.assert_allclose(trajectory.times, TIMES, rtol=0, atol=1e-15)
    check(trajectory)
    bad = table(tmp_path, "time,shoulder,elbow", [TIMES, *Q], "bad.csv")
    bad.write_text(bad.read_text().replace("\n0.5,", "\nx,"))
    with pytest.raises(TrajectoryError, match="line 27, time: must be a finite number, got 'x'"):
        jn.load_trajectory(bad)
    monkeypatch.setattr("jounce.io.files.long_tables.MAX_SAMPLES", 10)
    with pytest.raises(TrajectoryError, match="line 27: a file of this length may contain numbers only"):
        jn.load_trajectory(bad)


def test_joints_of_a_robot_for_a_table_that_names_none(tmp_path):
    robot = jn.load_robot("examples/robots/ur5.urdf")
    path = table(tmp_path, "time," + ",".join(f"q_{k}" for k in range(6)), [TIMES, *np.repeat(Q, 3, axis=0)])
    with pytest.warns(jn.errors.RecordingWarning, match="the columns name no joints: taken are shoulder_pan_joint, "):
        assert jn.load_trajectory(path, robot=robot).names == robot.joint_names
    path = table(tmp_path, "time,q_0,q_1", [TIMES, *Q])
    with pytest.raises(TrajectoryError, match="2 joints without names, and the robot 6 that move"):
        jn.load_trajectory(path, robot=robot)


def controller_states(part, count=51, rate=True):
    states = []
    for k in range(count):
        measured = {"positions": Q[:, k].tolist(), "velocities": V[:, k].tolist() if rate else []}
        ordered = {"positions": (Q[:, k] + 0.1).tolist(), "velocities": []}
        stamp = {"sec": 1732686000 + k // 50, "nanosec": k % 50 * 20_000_000}
        names = {"feedback": "reference", "actual": "desired"}
        states.append(
            {"header": {"stamp": stamp}, "joint_names": list(JOINTS), names[part]: ordered, part: measured, "error": {}}
        )
    return states


@pytest.mark.parametrize("part", ["feedback", "actual"])
def test_states_of_a_controller_are_what_was_measured(tmp_path, part):
    path = tmp_path / "state.yaml"
    path.write_text(yaml.safe_dump_all(controller_states(part), explicit_start=True))
    with pytest.warns(jn.errors.RecordingWarning, match=rf"only measured values are read \({part}\)"):
        found = jn.load_trajectory(path)
    check(found)
    short = tmp_path / "short.yaml"
    states = controller_states(part, 3)
    states[1][part]["positions"] = [0.0]
    short.write_text(yaml.safe_dump_all(states, explicit_start=True))
    with pytest.raises(TrajectoryError, match="must be 2 finite numbers, one for each joint: positions"):
        jn.load_trajectory(short)


def test_joints_are_selected_where_a_file_has_more(tmp_path):
    path = table(tmp_path, "time,gripper,shoulder,elbow", [TIMES, TIMES, *Q])
    check(jn.load_trajectory(path, only=JOINTS))
    assert jn.load_trajectory(path, only=["elbow"]).names == ("elbow",)
    with pytest.raises(TrajectoryError, match=r"log\.csv, joints: .*did you mean 'elbow'"):
        jn.load_trajectory(path, only=["elbo"])
    laws = tmp_path / "laws.yaml"
    laws.write_text("joints: {shoulder: sin(t), gripper: t}\ntime: {start: 0, stop: 1, count: 11}\n")
    assert jn.load_trajectory(laws, only=["shoulder"]).names == ("shoulder",)
