"""Files of trajectories: what they hold, and what is said when they are wrong."""

import pickle

import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.io import load_trajectory

JOINTS = [f"panda_joint{k}" for k in range(1, 8)]
ROWS = ["time,a,b", *(f"{0.1 * k:.1f},{0.01 * k * k:.17g},{np.sin(0.1 * k):.17g}" for k in range(12))]


def write(folder, text, name="motion.csv"):
    path = folder / name
    path.write_text(text if isinstance(text, str) else "\n".join(text) + "\n")
    return path


@pytest.mark.parametrize("name, stop", [("panda_good", 4.0), ("panda_too_fast", 0.2)])
def test_examples_of_samples(name, stop):
    """The samples are those of a 4-5-6-7 polynomial."""
    trajectory = load_trajectory(f"examples/trajectories/{name}.csv", degree=7)
    assert trajectory.names == tuple(JOINTS)
    assert (trajectory.start, trajectory.stop) == (0.0, stop)
    found = trajectory.derivatives(trajectory.times, 3)
    start, end = found[0, 0], found[-1, 0]
    u = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
    for k in range(4):  # at the ends, jerk amplifies the rounding of the samples most
        law = (u.deriv(k) if k else u)(trajectory.times / stop) / stop**k
        expected = law[:, None] * (end - start) + (start if k == 0 else 0)
        np.testing.assert_allclose(found[:, k], expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    slow = np.abs(found).max(axis=(0, 2))
    assert (slow[1:] < [2.1, 7.0, 1000.0]).all() == (name == "panda_good")


def test_example_of_a_pick():
    trajectory = load_trajectory("examples/trajectories/panda_pick.yaml")
    assert trajectory.names == tuple(JOINTS)
    found = trajectory.derivatives([0.0, 1.0, 2.0], 2)
    np.testing.assert_allclose(found[:, 0, 0], np.deg2rad([0, 30, 60]), atol=1e-15)
    np.testing.assert_array_equal(found[[0, 2], 1:], 0)
    assert len(trajectory.times) == 201


def test_example_of_laws():
    trajectory = load_trajectory("examples/trajectories/panda_wave.yaml")
    t = trajectory.times
    assert len(t) == 201
    found = trajectory.derivatives(t, 2, ["panda_joint6", "panda_joint4", "panda_joint1"])
    w, amplitude = np.pi, np.deg2rad(30)
    np.testing.assert_allclose(found[:, 1, 2], amplitude * w * np.cos(w * t), atol=1e-13)
    np.testing.assert_allclose(found[:, 2, 0], -amplitude * (2 * w) ** 2 * np.sin(2 * w * t), atol=1e-11)
    np.testing.assert_allclose(found[:, 0, 1], np.deg2rad(-120), rtol=1e-15)


@pytest.mark.parametrize("step, count", [("30 ms", 35), ("0.3 s", 5), ("7 s", 2), ("25 ms", 41), ("333 ms", 5)])
def test_a_law_file_ends_at_its_stop(tmp_path, step, count):
    text = f"joints: {{a: t**2}}\ntime: {{stop: 1 s, step: {step}}}\n"
    trajectory = load_trajectory(write(tmp_path, text, "law.yaml"))
    assert trajectory.stop == trajectory.times[-1] == 1.0
    assert len(trajectory.times) == count
    assert trajectory.derivatives([trajectory.stop], 1)[0, :, 0].tolist() == [1.0, 2.0]


def test_samples_and_columns_of_derivatives(tmp_path):
    rows = [f"{row},{'a_d1,a_d2' if k == 0 else f'{0.2 * (k - 1)},99'}" for k, row in enumerate(ROWS)]
    trajectory = load_trajectory(write(tmp_path, rows))
    assert trajectory.names == ("a", "b")
    np.testing.assert_allclose(trajectory.derivatives([0.55], 1)[0, :, 0], [0.3025, 1.1], rtol=1e-12)


def test_order_of_columns_blank_lines_spaces_and_byte_order_mark(tmp_path):
    text = "\ufeff a , time\r\n\r\n" + "".join(f" {k * k} , {k} \r\n" for k in range(8))
    path = tmp_path / "motion.CSV"
    path.write_text(text, encoding="utf-8")
    trajectory = load_trajectory(path, degree=3)
    np.testing.assert_allclose(trajectory.derivatives([2.5], 2)[0, :, 0], [6.25, 5.0, 2.0], rtol=1e-12)


def changed(line, text):
    return [*ROWS[: line - 1], text, *ROWS[line:]]


@pytest.mark.parametrize(
    "rows, message",
    [
        ("", "motion.csv: the file of samples is empty"),
        ("\n\n", "motion.csv: the file of samples is empty"),
        (ROWS[:1], "motion.csv: at least two samples are needed, got 0"),
        (ROWS[:6], "motion.csv: a spline of degree 5 needs at least 6 samples, got 5; give more, or lower"),
        (
            changed(5, "0.2,9,0"),
            "motion.csv, line 5, a: times must increase, got 0.2; this one repeats .* at 0.04 and 9",
        ),
        (changed(4, "0.2,0,inf"), "motion.csv, line 4, b: must be a finite number, got 'inf'"),
        (changed(4, "0.2,0,x1"), "motion.csv, line 4, b: must be a finite number, got 'x1'"),
        (changed(4, "0.2,0"), "motion.csv, line 4: .* the 3 columns, got 2; this one has another number"),
        (changed(4, "0.2,0,0,0"), "motion.csv, line 4: .* got 4"),
        (changed(1, "time,a,a"), "motion.csv, line 1: two columns have this name, got 'a'"),
        (changed(1, "time,a,time"), "motion.csv, line 1: two columns have this name, got 'time'"),
        (changed(1, "time,a,"), "motion.csv, line 1: column 3 has no name"),
        (changed(1, "tme,a,b"), "motion.csv, line 1: no column has this name, got 'time'; did you mean 'tme'"),
        (ROWS[1:], "motion.csv, line 1: the first row holds the names"),
        (["time", "0", "1"], "there is no column besides 'time'"),
        ('time,a\n0,"1\n', "the samples cannot be read"),
    ],
)
def test_bad_samples(tmp_path, rows, message):
    with pytest.raises(TrajectoryError, match=message):
        load_trajectory(write(tmp_path, rows))


def test_bytes_that_are_no_text(tmp_path):
    path = tmp_path / "motion.csv"
    path.write_bytes(b"time,a\n0,\xff\xfe\n")
    with pytest.raises(TrajectoryError, match="cannot be read"):
        load_trajectory(path)


def test_the_units_of_columns_are_kept(tmp_path):
    rows = ["time,a [deg],b [mm],c,a_d1 [deg/s]", *(f"{k},{k},{k},{k},1" for k in range(8))]
    assert load_trajectory(write(tmp_path, rows)).measures == {"a": "angle", "b": "length"}


@pytest.mark.parametrize(
    "text, measures",
    [
        ("parameters: {A: 2 cm}\njoints: {a: A*sin(t), b: 20*deg*t, c: 1 m, d: t**2}\n", "length, None, length, None"),
        (
            "point_to_point: {duration: 1 s, from: {a: 0, b: 0, c: 0}, to: {a: 9 deg, b: 0, c: 1 mm}}\n",
            "angle, None, length",
        ),
        ("motion: {samples: m.csv, derivative: 2, initial: {b: [0, 2 mm/s]}}\n", "angle, length, None"),
        ("joints: {a: {samples: m.csv, value: a, derivative: 2}, b: {samples: m.csv, value: c}}\n", "angle, None"),
    ],
)
def test_the_units_of_laws_are_kept(tmp_path, text, measures):
    write(tmp_path, ["time,a [deg/s^2],b,c", *(f"0.{k},{k},{k},{k}" for k in range(8))], "m.csv")
    trajectory = load_trajectory(write(tmp_path, text + "time: {stop: 0.5, step: 0.1}\n", "motion.yaml"))
    assert [str(trajectory.measures.get(name)) for name in trajectory.names] == measures.split(", ")
    assert pickle.loads(pickle.dumps(trajectory)).measures == trajectory.measures


def test_a_joint_is_not_both_angle_and_length(tmp_path):
    text = PICK.replace("a: 0,", "a: 1 m,")
    with pytest.raises(TrajectoryError, match=r"line 1, point_to_point\.to\.a: .* 'a' .* length"):
        load_trajectory(write(tmp_path, text, "motion.yaml"))


GRID = "time: {start: 0 s, stop: 1 s, step: 0.1 s}\n"
PICK = "point_to_point: {duration: 2 s, from: {a: 0, b: 1 m}, to: {b: 2 m, a: 90 deg}}\n"


def test_point_to_point_without_a_grid(tmp_path):
    trajectory = load_trajectory(write(tmp_path, PICK, "motion.yaml"))
    assert trajectory.stop == 2.0
    np.testing.assert_allclose(trajectory.derivatives([2.0], 0)[0, 0], [np.pi / 2, 2.0])


def test_point_to_point_within_limits_and_held_on_a_longer_grid(tmp_path):
    text = """point_to_point:
  profile: trapezoidal
  start_time: 500 ms
  from: {a: 0}
  to: {a: 90 deg}
  limits: {velocity: 90 deg/s, acceleration: 360 deg/s^2, jerk: 720 deg/s^3}
time: {stop: 4 s, count: 9}
"""
    trajectory = load_trajectory(write(tmp_path, text, "motion.yaml"))
    found = trajectory.derivatives(np.linspace(0, 4, 401), 3)[:, :, 0]
    limits = np.deg2rad([90, 360, 720])
    assert (np.abs(found[:, 1:]).max(axis=0) <= limits * (1 + 1e-12)).all()
    assert np.abs(found[:, 1]).max() == pytest.approx(limits[0])
    np.testing.assert_array_equal(found[:51, 0], 0)
    np.testing.assert_allclose(found[-1], [np.pi / 2, 0, 0, 0])


def test_json_and_toml(tmp_path):
    text = '{"joints": {"a": "sin(t)"}, "time": {"stop": "1 s", "step": 0.5}}'
    toml = '[joints]\na = "sin(t)"\n[time]\nstop = "1 s"\nstep = 0.5\n'
    for name, content in (("motion.json", text), ("motion.toml", toml)):
        trajectory = load_trajectory(write(tmp_path, content, name))
        np.testing.assert_allclose(trajectory.derivatives(trajectory.times, 1)[:, 1, 0], np.cos([0, 0.5, 1]))


@pytest.mark.parametrize(
    "text, message",
    [
        (GRID, "has either 'joints', 'point_to_point' or 'motion', got"),
        ("jonts: {a: t}\n" + GRID, "motion.yaml, line 1, jonts: unknown key; did you mean 'joints'"),
        ("[1, 2]\n", "must be a mapping with at least one entry"),
        ("joints: {}\n" + GRID, "line 1, joints: must be a mapping"),
        ("joints:\n  a: 2*x\n" + GRID, r"line 2, joints\.a: .*'x'"),
        ("joints:\n  a: 2 kg\n" + GRID, r"line 2, joints\.a: must be an angle or a length, not a mass, got '2 kg'"),
        ("joints:\n  a: [1]\n" + GRID, r"line 2, joints\.a: must be a number"),
        ("joints: {a: t}\n", "time: is missing"),
        ("joints: {a: t}\ntime: {start: 0}\n", r"time\.stop: is missing"),
        ("joints: {a: t}\ntime: {stop: 1 m, step: 1}\n", r"line 2, time\.stop: .*got '1 m'"),
        ("joints: {a: t}\ntime: {stop: 1 s}\n", "line 2, time: a time grid takes either step or count"),
        ("joints: {a: t}\ntime: {stop: 0 s, step: 2 s}\n", "line 2, time: .* at least two instants"),
        (
            "joints: {a: t}\ntime:\n  start: 2 s\n  stop: 1 s\n  step: 0.1 s\n",
            r"line 4, time\.stop: stop must not come",
        ),
        ("parameters: {t: 1}\njoints: {a: t}\n" + GRID, r"parameters\.t: the name 't' is reserved"),
        ("parameters: {if: 1}\njoints: {a: t}\n" + GRID, r"line 1, parameters\.if: the word 'if' cannot be a name"),
        ("parameters: {w: 1/0}\njoints: {a: t}\n" + GRID, r"parameters\.w: .*1 ?/ ?0"),
        ("parameters: {T: 2 s}\njoints: {a: T}\n" + GRID, r"joints\.a: must be an angle or a length, not a time"),
        (PICK.replace("to: {b: 2 m, a", "to: {b: 2 m, c"), "line 1, point_to_point.to: the joint 'a' is missing"),
        (PICK.replace("a: 0, ", ""), "line 1, point_to_point.from: the joint 'a' is missing"),
        (PICK.replace("duration: 2 s, ", ""), "point_to_point.duration: .*duration|limits or a duration"),
        (PICK.replace("2 s", "-2 s"), "greater than zero, got -2.0"),
        (PICK.replace("duration", "profile: s, duration"), r"point_to_point\.profile: no profile has this name"),
        (PICK.replace("duration", "profile: 3, duration"), r"point_to_point\.profile: must be a name"),
        (PICK.replace("duration", "limits: {velocity: 1}, duration"), r"limits\.acceleration: is missing"),
        (
            PICK.replace("duration", "limits: {velocity: 1 m/s^2, acceleration: 1, jerk: 1}, duration"),
            r"limits\.velocity: must be an angle or a length per s, not an acceleration, got '1 m/s\^2'",
        ),
        (PICK.replace("duration", "speed: 1, duration"), r"point_to_point\.speed: unknown key"),
        ("joints: {a: t, a: t}\n", "duplicate name"),
        ("joints: {a: &x t, b: *x}\n", r"alias \*x is not allowed"),
    ],
)
def test_bad_laws(tmp_path, text, message):
    with pytest.raises(TrajectoryError, match=message):
        load_trajectory(write(tmp_path, text, "motion.yaml"))


@pytest.mark.parametrize(
    "name, message",
    [("none.csv", "not found"), ("none.yaml", "file not found"), ("none.txt", "given by its extension")],
)
def test_no_such_file(tmp_path, name, message):
    with pytest.raises(TrajectoryError, match=message):
        load_trajectory(tmp_path / name)


def test_a_folder(tmp_path):
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(TrajectoryError, match="is a directory"):
        load_trajectory(tmp_path / "folder.csv")


def table(folder, *names):
    times = np.linspace(0.0, 1.0, 21)
    path = folder / "log.csv"
    rows = np.stack([times, *(np.sin((k + 1) * times) for k in range(len(names)))], axis=1)
    np.savetxt(path, rows, delimiter=",", header=",".join(("time", *names)), comments="")
    return path


@pytest.mark.parametrize("other", ["tau_elbow", "effort_elbow", "motorTorque", "current 1", "elbow_temperature"])
def test_columns_named_after_torques_and_the_like_are_no_positions(tmp_path, other):
    path = table(tmp_path, "elbow", other)
    with pytest.warns(jn.errors.RecordingWarning, match=f"left out: {other}; to read one as a joint, choose joints by"):
        found = jn.load_trajectory(path)
    assert found.names == ("elbow",)
    np.testing.assert_allclose(found.derivatives([0.5], order=0), [[[np.sin(0.5)]]], atol=1e-6)
    assert jn.load_trajectory(path, only=["elbow", other]).names == ("elbow", other)


def test_a_file_of_torques_alone_is_refused(tmp_path):
    with pytest.raises(jn.errors.TrajectoryError, match=r"tau_a: .*other quantities: tau_a, tau_b; to read one"):
        jn.load_trajectory(table(tmp_path, "tau_a", "tau_b"))


def test_joints_of_a_robot_may_be_named_after_torques(tmp_path):
    links = [jn.Link("base"), jn.Link("a", jn.Inertia(1.0)), jn.Link("b", jn.Inertia(1.0))]
    joints = [jn.Joint("torque_tube", "base", "a"), jn.Joint("elbow", "a", "b")]
    robot = jn.Robot("arm", links, joints)
    assert jn.load_trajectory(table(tmp_path, "torque_tube", "elbow"), robot=robot).names == ("torque_tube", "elbow")
    assert jn.load_trajectory(table(tmp_path, "elbow_joint", "current_position")).names == (
        "elbow_joint",
        "current",
    )
