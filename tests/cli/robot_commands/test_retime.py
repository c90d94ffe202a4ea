"""The command ``retime``: what it writes passes ``check``; what is wrong is told before anything is computed."""

import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from jounce import io
from jounce.reporting.json.result_schema import result_schema

PANDA = "examples/robots/panda.urdf"
TOO_FAST = "examples/trajectories/panda_too_fast.csv"
LIMITS = "examples/limits/franka_panda.yaml"


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--repair",)], ids=["fastest", "repaired"])
def test_a_trajectory_that_breaks_limits_comes_back_as_one_that_passes_check(run, tmp_path, options):
    out, figure = tmp_path / "fast.csv", tmp_path / "fast.png"
    given = ("--limits", LIMITS, "--out", out, "--figure", figure, "--json", *options)
    status, printed, _ = run("retime", PANDA, TOO_FAST, *given)
    assert status == 0
    result = json.loads(printed)
    Draft202012Validator(result_schema()["$defs"]["retime"]).validate(result)
    assert result["kept"]
    assert result["before"] == 0.2
    assert figure.stat().st_size > 10_000
    rows = io.read(out)
    np.testing.assert_allclose(np.diff(rows["time"].values), 1e-3, rtol=1e-9)
    still = 1.42e-7 if options else 1e-9  # rad/s: the spline through the rounded samples ends at 1.41e-7
    np.testing.assert_allclose(rows["panda_joint1"].values[[0, -1], 1], 0, atol=still)
    assert run("check", PANDA, out, "--limits", LIMITS)[0] == 0


@pytest.mark.slow
def test_a_load_is_carried_from_retiming_to_the_file_of_a_controller(run, tmp_path):
    pinocchio = pytest.importorskip("pinocchio")
    fast, exported = tmp_path / "fast.csv", tmp_path / "franka.csv"
    asked = ("--limits", LIMITS, "--out", fast, "--payload", "panda_hand=2 kg@30 %:70 %", "--json")
    status, printed, _ = run("retime", PANDA, TOO_FAST, *asked)
    assert status == 0
    loads = json.loads(printed)["loads"]
    assert [x["masses"] for x in loads] == [{"panda_hand": 2.0}, {"panda_hand": -2.0}]
    carried = ("--payload", f"panda_hand=2 kg@{loads[0]['time']:.12g} s:{loads[1]['time']:.12g} s")
    status, printed, _ = run("check", PANDA, fast, "--limits", LIMITS, *carried, "--json")
    result = json.loads(printed)
    assert status == 0
    assert [x["time"] for x in result["loads"]] == pytest.approx([x["time"] for x in loads], rel=1e-9)
    rounded = ("--payload", f"panda_hand=2 kg@{loads[0]['time']:.6g} s:{loads[1]['time']:.6g} s")  # as it is printed
    printed = run("check", PANDA, fast, "--limits", LIMITS, *rounded)[1]
    assert printed.count("at rest; torques step there") == 2
    assert run("torques", PANDA, fast, *carried, "--out", tmp_path / "torques.csv")[0] == 0
    assert run("export", PANDA, fast, "--format", "franka", "--torques", *carried, "--out", exported)[0] == 0
    rows = np.genfromtxt(exported, delimiter=",", names=True)
    torques = io.read(tmp_path / "torques.csv")
    whole = np.stack([torques[f"panda_joint{k + 1}"].values[:, 0] for k in range(7)])
    model = pinocchio.buildModelFromUrdf(PANDA)
    loaded = pinocchio.buildModelFromUrdf(PANDA)
    hand = model.frames[model.getFrameId("panda_hand")]
    point = pinocchio.Inertia(2.0, np.zeros(3), np.zeros((3, 3)))
    loaded.appendBodyToJoint(hand.parentJoint, point, hand.placement)
    steps = 0
    for row in rows:
        holds = loads[0]["time"] <= row["time"] < loads[1]["time"]
        steps += holds
        own = loaded if holds else model
        state = np.zeros((3, own.nq))
        state[:, :7] = [[row[f"{q}_{k}"] for k in range(7)] for q in ("q_d", "dq_d", "ddq_d")]
        expected = pinocchio.rnea(own, own.createData(), *state)[:7]
        weight = pinocchio.computeGeneralizedGravity(own, own.createData(), state[0])[:7]
        printed = [row[f"tau_J_d_{k}"] for k in range(7)]  # without gravity, for which the controller provides
        np.testing.assert_allclose(printed, expected - weight, atol=1e-6)
        damped = expected + model.damping[:7] * state[1, :7]
        np.testing.assert_allclose(whole[:, round(1000 * row["time"])], damped, atol=1e-6)
    assert steps == pytest.approx(1000 * (loads[1]["time"] - loads[0]["time"]), abs=1)


def test_bad_input_is_reported(run, tmp_path):
    for given, message in (
        ((PANDA,), "a robot needs a path"),
        (("examples/press.yaml",), "--limits"),
        (("examples/press.yaml", TOO_FAST), "that of its drivers"),
        ((PANDA, TOO_FAST, "--rate", "3 m"), "frequency"),
        ((PANDA, tmp_path / "none.csv"), "none.csv"),
    ):
        status, _, error = run("retime", *given)
        assert status == 2
        assert message in error
    points = tmp_path / "points.csv"
    points.write_text("panda_joint1,panda_joint9\n0,0\n1,1\n")
    status, _, error = run("retime", PANDA, points)
    assert status == 2
    assert "panda_joint9" in error


def test_paths_without_times_are_read(tmp_path):
    points, laws = tmp_path / "points.csv", tmp_path / "path.yaml"
    points.write_text("a [deg],b\n0,0\n90,1\n180,0\n")
    laws.write_text("path:\n  a: 0.8*sin(pi*s)\n  b: 2 - s\n")
    found = io.load_path(points)
    np.testing.assert_allclose(
        found.derivatives(np.array([0.0, 0.5, 1.0]), 0)[:, 0], [[0, 0], [np.pi / 2, 1], [np.pi, 0]]
    )
    values = io.load_path(laws).derivatives(np.array([0.5]), 1)[0]
    np.testing.assert_allclose(values, [[0.8, 1.5], [0.0, -1.0]], atol=1e-14)


CART = """<robot name="cart"><link name="base"/><link name="cart"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="slide" type="prismatic">
<parent link="base"/><child link="cart"/><axis xyz="1 0 0"/><limit lower="-9" upper="9" velocity="1" effort="99"/>
</joint></robot>"""


@pytest.fixture
def cart(tmp_path):
    (tmp_path / "cart.urdf").write_text(CART)
    (tmp_path / "line.csv").write_text("slide\n0\n2\n")
    (tmp_path / "limits.yaml").write_text("joints: {slide: {velocity: [-0.5 m/s, 1 m/s], acceleration: 2 m/s^2}}\n")
    return tmp_path / "cart.urdf", tmp_path / "line.csv", "--limits", tmp_path / "limits.yaml"


@pytest.mark.slow
def test_a_duration_is_written_in_whole_periods(run, cart, tmp_path):
    out, figure = tmp_path / "slow.csv", tmp_path / "slow.png"
    status, printed, _ = run("retime", *cart, "--duration", "4s", "--out", out, "--figure", figure, "--json")
    assert (status, json.loads(printed)["duration"]) == (0, pytest.approx(4.0, rel=1e-12))
    rows = io.read(out)
    assert len(rows["time"]) == 4001
    assert abs(float(rows["slide"].values[-1, 0]) - 2) < 1e-9
    assert figure.read_bytes()[:4] == b"\x89PNG"
    status, printed, _ = run("retime", *cart, "--duration", "4s")
    assert status == 0
    assert "no limit binds" in printed
    assert "limit that binds" not in printed
    status, _, error = run("retime", *cart, "--duration", "2.4s")
    assert status == 2
    assert "the least time of this path within these limits is 2.50" in error
    status, _, error = run("retime", *cart, "--duration", "4.0005s", "--out", tmp_path / "odd.csv")
    assert status == 2
    assert "not a number of whole periods" in error
    assert not (tmp_path / "odd.csv").exists()


@pytest.mark.slow
def test_from_a_running_trajectory(run, cart, tmp_path):
    running = tmp_path / "running.yaml"
    running.write_text("joints: {slide: 0.4*t}\ntime: {start: 0, stop: 2, count: 21}\n")
    back = tmp_path / "back.csv"
    back.write_text("slide\n0.4\n-1\n")
    out = tmp_path / "new.csv"
    robot, _, *limits = cart
    asked = (robot, back, *limits, "--running", running, "--at", "1s")
    status, printed, _ = run("retime", *asked, "--duration", "5s", "--out", out, "--json")
    result = json.loads(printed)
    assert (status, result["kept"]) == (0, True)
    assert "from the running state onto the path" in result["path"]
    rows = io.read(out)["slide"].values
    np.testing.assert_allclose(rows[0, :2], [0.4, 0.4], atol=1e-9)
    assert rows[:, 1].min() >= -0.5 * (1 + 1e-6)  # backward it is slower
    assert abs(rows[-1, 0] + 1) < 1e-8
    for more, message in (
        (("--running", running), "--running: has no effect without --at"),
        (("--running", running, "--at", "9s"), "goes from 0 s to 2 s"),
        (("--running", running, "--at", "1s", "--out", tmp_path / "none.csv"), "--duration: the rows of a motion"),
    ):
        status, _, error = run("retime", *cart, *more)
        assert status == 2
        assert message in error


@pytest.mark.parametrize(
    "text, message",
    [
        ("velocity: [1, 2]", "must be the lowest value, below zero, and the highest"),
        ("velocity: [-1, 2, 3]", "one value, or the lowest and the highest"),
        ("velocity: [-1 N, 2]", "the unit is that of a force"),
    ],
)
def test_bad_limits_by_direction_are_reported_by_line(run, cart, tmp_path, text, message):
    (tmp_path / "limits.yaml").write_text(f"joints:\n  slide:\n    {text}\n")
    status, _, error = run("retime", *cart)
    assert status == 2
    assert message in error
    assert "line 3" in error or "limits.yaml:3" in error
