"""States of joints that ROS prints: interrupted printouts, dynamic states, joints of several coordinates."""

import json

import numpy as np
import pytest
import yaml

import jounce as jn
from jounce.errors import RecordingWarning, TrajectoryError
from tests.io.trajectories.test_recordings import JOINTS, TIMES, check, controller_states, motion, states

ECHO = "".join(yaml.safe_dump(state, sort_keys=False) + "---\n" for state in states(TIMES))
LAST = ECHO[: -len("---\n")].rindex("---\n") + len("---\n")  # where the last message begins


def read(tmp_path, text, name="echo.yaml"):
    path = tmp_path / name
    path.write_text(text)
    with pytest.warns(RecordingWarning) as caught:
        trajectory = jn.load_trajectory(path)
    return trajectory, [str(x.message) for x in caught]


@pytest.mark.parametrize("end", range(LAST + 1, len(ECHO) - len("---\n"), 7))
def test_an_echo_may_be_interrupted_anywhere(tmp_path, end):
    """Wherever the last message ends, the others are read, and no number that was cut is taken for a whole one."""
    trajectory, words = read(tmp_path, ECHO[:end])
    line = ECHO.count("\n", 0, LAST) + 1
    assert any(f"the last message, from line {line}, was not printed to its end, and is left out" in x for x in words)
    np.testing.assert_allclose(trajectory.times, TIMES[:-1], rtol=0, atol=1e-12)
    expected = np.stack([motion(TIMES[:-1], k) for k in (0, 1)], axis=1)
    laws = jn.JointTrajectory({name: trajectory.laws[name] for name in JOINTS}, 0.0, trajectory.stop)
    np.testing.assert_allclose(laws.derivatives(TIMES[:-1], 1), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("text", [ECHO, ECHO[: -len("---\n")], "---\n" + ECHO[: -len("---\n")]])
def test_whole_echoes_are_read_whole(tmp_path, text):
    trajectory, words = read(tmp_path, text)
    np.testing.assert_allclose(trajectory.times, TIMES, rtol=0, atol=1e-12)
    assert not any("not printed to its end" in x for x in words)


WRAPPED = {
    "rosbridge": ({"op": "subscribe", "topic": "/arm"}, lambda x: {"op": "publish", "topic": "/arm", "msg": x}),
    "mcap": ({"topic": "/imu", "data": {"x": 1}}, lambda x: {"topic": "/arm", "sequence": 3, "data": x}),
    "alone": (None, lambda x: x),
}


@pytest.mark.parametrize("ending", [".jsonl", ".json"])
@pytest.mark.parametrize("kind", WRAPPED)
def test_states_as_json_lines(tmp_path, kind, ending):
    """Of rosbridge, of `mcap cat --json`, and of messages alone; a last line that is not whole is left out."""
    other, wrapped = WRAPPED[kind]
    lines = [json.dumps(x) for x in ([other] if other else []) + [wrapped(state) for state in states(TIMES)]]
    for cut, count in ((0, len(TIMES)), (25, len(TIMES) - 1)):
        text = "\n".join(lines)
        trajectory, words = read(tmp_path, text[: len(text) - cut], f"log{ending}")
        np.testing.assert_allclose(trajectory.times, TIMES[:count], rtol=0, atol=1e-12)
        laws = jn.JointTrajectory({name: trajectory.laws[name] for name in JOINTS}, 0.0, trajectory.stop)
        expected = np.stack([motion(TIMES[:count], k) for k in (0, 1)], axis=1)
        np.testing.assert_allclose(laws.derivatives(TIMES[:count], 1), expected, rtol=0, atol=1e-9)
        assert any(f"from line {len(lines)}, was not printed to its end" in x for x in words) is (cut > 0)


def test_topics_of_json_lines_are_chosen(tmp_path):
    """Errors have the lines of the file."""
    points = [{"positions": [0.5 * k], "time_from_start": {"secs": k, "nsecs": 0}} for k in range(3)]
    goal = {"op": "publish", "topic": "/goal", "msg": {"joint_names": ["a"], "points": points}}
    path = tmp_path / "log.jsonl"
    logged = [{"op": "publish", "topic": "/arm", "msg": state} for state in states(TIMES)]
    path.write_text("\n".join(map(json.dumps, [goal, *logged])))
    assert jn.load_trajectory(path, topic="/goal").stop == 2.0
    with pytest.raises(TrajectoryError, match="several topics of joint states or trajectories; choose one: /goal, /ar"):
        jn.load_trajectory(path)
    with pytest.raises(TrajectoryError, match=r"no topic of joint states or trajectories .* did you mean '/goal'"):
        jn.load_trajectory(path, topic="/gaol")
    logged[4]["msg"]["position"][0] = "far"
    path.write_text("\n".join(map(json.dumps, logged)))
    with pytest.raises(TrajectoryError, match=r"line 5, .*position: must be \d finite numbers"):
        jn.load_trajectory(path)
    path.write_text(json.dumps({"op": "publish", "topic": "/imu", "msg": {"x": 1}}))
    with pytest.raises(TrajectoryError, match=r"no topic of joint states or a trajectory, got \['/imu'\]"):
        jn.load_trajectory(path)


def test_states_of_a_controller_may_be_interrupted(tmp_path):
    text = yaml.safe_dump_all(controller_states("feedback"), sort_keys=False)
    trajectory, words = read(tmp_path, text[: text.rindex("velocities")])
    assert len(trajectory.times) == len(controller_states("feedback")) - 1
    assert any("not printed to its end" in x for x in words)


def test_a_message_that_was_cut_within_the_file_is_named(tmp_path):
    """Two printouts, of which the first was interrupted."""
    first = ECHO[: ECHO.index("velocity:", LAST)]
    path = tmp_path / "echo.yaml"
    path.write_text(first + "---\n" + ECHO)
    with pytest.raises(TrajectoryError, match=r"line 813, time: .* times start again"):
        jn.load_trajectory(path)
    path.write_text(ECHO[: ECHO.index("position:", LAST)] + "---\n" + ECHO)
    number = len(TIMES)
    with pytest.raises(TrajectoryError, match=rf"\[{number - 1}\]: message {number} is not of the kind of the first"):
        jn.load_trajectory(path)


def test_a_trajectory_that_is_interrupted_is_refused(tmp_path):
    path = tmp_path / "plan.yaml"
    points = [{"positions": [0.1 * k, 0.2], "time_from_start": {"sec": k, "nanosec": 0}} for k in range(4)]
    text = yaml.safe_dump({"joint_names": list(JOINTS), "points": points}, sort_keys=False)
    path.write_text(text + "---\n" + text[:-30])
    with pytest.warns(RecordingWarning, match="was not printed to its end, and is left out"):
        assert jn.load_trajectory(path).stop == 3.0


def test_two_documents_of_laws_stay_refused(tmp_path):
    path = tmp_path / "laws.yaml"
    laws = "joints: {a: t}\ntime: {start: 0, stop: 1, step: 0.5}"
    path.write_text(laws + "\n---\n" + laws)
    with pytest.raises(TrajectoryError, match="line 4: a second document starts"):
        jn.load_trajectory(path)


def dynamic_states(velocities=True):
    """Return the states of both joints, in any order, and of a sensor."""
    for k, state in enumerate(states(TIMES)):
        rows = dict(zip(state["name"], zip(state["position"], state["velocity"], strict=True), strict=True))
        keys = ["velocity", "position"] if velocities else ["position", "effort"]
        values = {
            name: {"interface_names": list(keys), "values": [row[1], row[0]] if velocities else [row[0], float("nan")]}
            for name, row in rows.items()
        }
        values["wrist"] = {"interface_names": ["force.x", "torque.z"], "values": [1.0, 0.1 * k]}
        yield {"header": state["header"], "joint_names": list(values), "interface_values": list(values.values())}


@pytest.mark.parametrize("velocities", [True, False])
def test_dynamic_joint_states_as_they_are_echoed(tmp_path, velocities):
    text = "".join(yaml.safe_dump(x, sort_keys=False) + "---\n" for x in dynamic_states(velocities))
    trajectory, words = read(tmp_path, text)
    assert any("without an interface position, and left out: wrist" in x for x in words)
    check(jn.JointTrajectory({k: trajectory.laws[k] for k in JOINTS}, 0.0, trajectory.stop))
    shorter, words = read(tmp_path, text[: text.rindex("values")])
    assert len(shorter.times) == len(TIMES) - 1
    path = tmp_path / "bad.yaml"
    path.write_text(text.replace("position", "voltage"))
    with pytest.raises(TrajectoryError, match=r"interface_values: no joint has an interface named position"):
        jn.load_trajectory(path)


def test_dynamic_joint_states_in_a_bag(tmp_path):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    interface, name = "control_msgs/msg/InterfaceValue", "control_msgs/msg/DynamicJointState"
    store.register(typesys.get_types_from_msg("string[] interface_names\nfloat64[] values\n", interface))
    fields = "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
    store.register(typesys.get_types_from_msg(fields, name))
    kinds = store.types
    head, stamp = kinds["std_msgs/msg/Header"], kinds["builtin_interfaces/msg/Time"]
    with rosbags.Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/dynamic_joint_states", name, typestore=store)
        for t, state in zip(TIMES, dynamic_states(), strict=True):
            header = head(stamp(int(t), round((t % 1) * 1e9)), "")
            values = [kinds[interface](x["interface_names"], np.array(x["values"])) for x in state["interface_values"]]
            raw = store.serialize_cdr(kinds[name](header, state["joint_names"], values), name)
            writer.write(connection, int(t * 1e9), raw)
    with pytest.warns(RecordingWarning, match="without an interface position, and left out: wrist"):
        trajectory = jn.load_trajectory(tmp_path / "bag")
    check(jn.JointTrajectory({k: trajectory.laws[k] for k in JOINTS}, 0.0, trajectory.stop))


def test_poses_of_joints_of_several_coordinates_are_refused_with_what_to_do(tmp_path):
    pose = {"translation": {"x": 0.0, "y": 0.0, "z": 0.0}, "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    state = {"header": {"stamp": {"sec": 1, "nanosec": 0}}, "joint_names": ["base"], "transforms": [pose]}
    for text in (yaml.safe_dump(state), yaml.safe_dump_all([state] * 3)):
        path = tmp_path / "base.yaml"
        path.write_text(text)
        with pytest.raises(TrajectoryError, match="poses of planar and floating joints are not read; write their"):
            jn.load_trajectory(path)
    points = [{"transforms": [{}], "time_from_start": {"sec": k, "nanosec": 0}} for k in range(2)]
    path.write_text(yaml.safe_dump({"joint_names": ["base"], "points": points}))
    with pytest.raises(TrajectoryError, match=r"points\[0\]: poses of planar and floating joints are not read"):
        jn.load_trajectory(path)
