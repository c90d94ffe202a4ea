"""The command ``check``: what it prints, how it ends, and what it says about bad input."""

import functools
import json
import pathlib
import re
import sys

import numpy as np
import pytest

from jounce.dynamics.limits.check_limits import check_limits
from jounce.io import load_trajectory
from jounce.io.robots.limits import load_limits
from jounce.io.robots.loader import load_robot

EXAMPLES = pathlib.Path(__file__).resolve().parents[3] / "examples"
PANDA = EXAMPLES / "robots" / "panda.urdf"
GOOD, TOO_FAST, WAVE = (
    EXAMPLES / "trajectories" / f"panda_{name}" for name in ("good.csv", "too_fast.csv", "wave.yaml")
)
FRANKA = EXAMPLES / "limits" / "franka_panda.yaml"

PENDULUM = """<robot name="pendulum">
  <link name="base"/>
  <link name="rod">
    <inertial><origin xyz="0.5 0 0"/><mass value="2"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="pin" type="revolute">
    <parent link="base"/><child link="rod"/><axis xyz="0 -1 0"/>
    <limit lower="-1" upper="1" effort="20" velocity="2"/>
  </joint>
  <link name="tip"/>
  <joint name="tip" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="1 0 0"/></joint>
</robot>
"""


@pytest.fixture
def run(run):
    return functools.partial(run, "check")


@pytest.fixture
def files(tmp_path):
    """Write files of the given names and return their paths."""

    def call(**texts):
        paths = []
        for name, text in texts.items():
            stem, _, suffix = name.rpartition("_")
            paths.append(tmp_path / f"{stem}.{suffix}")
            paths[-1].write_text(text, encoding="utf-8")
        return paths

    return call


def samples(law, count=101, names="pin"):
    rows = [f"{t:.17g},{law(t):.17g}" for t in np.linspace(0.0, 1.0, count)]
    return "\n".join([f"time,{names}", *rows])


@pytest.mark.slow
def test_a_good_trajectory_ends_with_0_and_the_table_has_the_worst_values(run):
    status, out, err = run(PANDA, GOOD, "--limits", FRANKA)
    assert (status, err) == (0, "")
    assert out.splitlines()[:5] == [
        "panda: 7 moving joints (panda.urdf, panda_good.csv)",
        "t = 0 s to 4 s, 2001 instants and the peaks between them",
        "not in the trajectory, held still: panda_finger_joint1 at 0 m",
        "torques: armature, damping and friction, as far as the robot file has them",
        "without a limit: force rate",
    ]
    robot = load_robot(PANDA)
    report = check_limits(robot, load_trajectory(GOOD), load_limits(FRANKA, robot))
    lines = [re.split(r"  +", line.strip()) for line in out.splitlines()]
    table = {(cells[0], cells[1]): cells[2:] for cells in lines if len(cells) == 7}
    for row in report.limited:
        unit, value, limit, ratio, time = table[row.joint, row.quantity]
        assert unit == row.unit
        # Printed with six, five and four digits.
        assert float(value) == pytest.approx(row.value, rel=1e-5)
        assert float(limit) == row.limit
        assert float(ratio) == pytest.approx(row.ratio, abs=6e-5)
        assert float(time) == pytest.approx(row.time, rel=1e-4)
    assert out.endswith("All limits kept (43).\nClosest: panda_joint1 position, 0.6213 of its limit at t = 4 s\n")


def test_a_trajectory_that_is_too_fast_ends_with_1_and_its_rows_are_marked(run):
    status, out, err = run(PANDA, TOO_FAST, "--limits", FRANKA)
    assert (status, err) == (1, "")
    robot = load_robot(PANDA)
    report = check_limits(robot, load_trajectory(TOO_FAST), load_limits(FRANKA, robot))
    marked = [line for line in out.splitlines() if re.search(r"\d\*  ", line)]
    assert len(marked) == len(report.broken) > 20
    assert f"{len(report.broken)} of {len(report.limited)} limits broken.\nWorst: panda_joint1 torque rate, " in out
    assert "* broken" in out


LATE = "joints: {pin: 1.05*t**40}\ntime: {stop: 1 s, step: 30 ms}\n"  # over the range of +-1 rad in the last hundredth


def test_the_last_instant_counts_though_the_step_does_not_divide_the_time(run, files):
    robot, law = files(pendulum_urdf=PENDULUM, late_yaml=LATE)
    status, out, _ = run(robot, law)
    assert status == 1
    assert "t = 0 s to 1 s" in out
    assert "the step of 0.03 s does not divide the time: the last one is 0.01 s" in out
    status, out, _ = run(robot, law, "--json")
    record = json.loads(out)
    assert record["time"]["stop"] == 1.0
    (position,) = (row for row in record["limits"] if row["quantity"] == "position")
    assert (position["worst"], position["at"], position["broken"]) == (1.05, 1.0, True)


def test_what_is_infinite_by_a_jump_is_reported_printed_drawn_and_null_in_json(run, files, tmp_path):
    law = "joints: {pin: 0.1*abs(t - 0.98765)}\ntime: {stop: 2, step: 0.1}"
    limits = "joints: {pin: {acceleration: 5 rad/s^2, velocity: 1 rad/s}}"
    robot, trajectory, bounds = files(pendulum_urdf=PENDULUM, corner_yaml=law, limits_yaml=limits)
    figure = tmp_path / "corner.png"
    status, out, err = run(robot, trajectory, "--limits", bounds, "--out", figure)
    assert (status, err, figure.stat().st_size > 10_000) == (1, "", True)
    assert "pin acceleration rad/s^2 infinite 5 inf* 0.98765" in [" ".join(line.split()) for line in out.splitlines()]
    assert "2 of 4 limits broken.\nWorst: pin acceleration, infinite by a jump at t = 0.98765 s\n" in out
    status, out, _ = run(robot, trajectory, "--limits", bounds, "--json")
    row = next(x for x in json.loads(out)["limits"] if x["quantity"] == "acceleration")
    assert (status, row["worst"], row["ratio"], row["broken"], row["limit"]) == (1, None, None, True, 5.0)
    assert row["at"] == pytest.approx(0.98765, abs=1e-9)


@pytest.mark.slow
def test_the_text_is_plain_and_fits_80_columns(run):
    for trajectory in (GOOD, TOO_FAST, WAVE):
        _, out, _ = run(PANDA, trajectory)
        assert max(map(len, out.splitlines())) <= 80
        assert out.isascii()
        assert "\x1b" not in out


def test_what_has_no_limit_and_what_stands_still_is_reported(run):
    status, out, _ = run(PANDA, WAVE)
    assert status == 1
    assert "without a limit: acceleration, jerk, torque rate, force rate" in out
    assert "held still: panda_joint3 at 0 rad, panda_joint5 at 0 rad,\n  panda_joint7 at 0 rad" in out


def test_a_payload_raises_the_torques(run, files):
    robot, trajectory = files(pendulum_urdf=PENDULUM, hold_yaml="joints: {pin: 0}\ntime: {stop: 1, step: 0.1}")
    status, out, _ = run(robot, trajectory)
    assert status == 0
    assert re.search(r"torque +N m +9\.81 +20 +0\.4905", out)
    status, out, _ = run(robot, trajectory, "--payload", "tip=500 g", "--payload", "base=7")
    assert status == 0
    assert re.search(r"torque +N m +14\.715 +20 +0\.7358", out)


def test_mjcf_robots_are_checked_too(run, files):
    path = EXAMPLES / "robots" / "planar_arm.xml"
    joint = load_robot(path).joint_names[0]
    trajectory, limits = files(
        wave_yaml=f"joints: {{{joint}: sin(t)}}\ntime: {{stop: 1, step: 0.1}}",
        limits_yaml=f"joints: {{{joint}: {{acceleration: 0.5}}}}",
    )
    status, out, _ = run(path, trajectory, "--limits", limits)
    assert status == 1
    assert re.search(r"acceleration +rad/s\^2 +-0\.841471 +-0\.5 +1\.6829\*", out)


def test_the_figure_is_written(run, files, tmp_path):
    robot, trajectory = files(pendulum_urdf=PENDULUM, wave_yaml="joints: {pin: sin(t)/2}\ntime: {stop: 1, step: 0.1}")
    status, out, _ = run(robot, trajectory, "--hand-over", "--out", tmp_path / "limits.svg")
    assert status == 0
    assert out.endswith(f"Written to {tmp_path / 'limits.svg'}\n")
    text = (tmp_path / "limits.svg").read_text(encoding="utf-8")
    assert text.count("<svg ") == 1
    assert "pendulum: wave.yaml" in text


def test_samples_that_do_not_support_the_jerk_are_a_warning_in_one_line(run, files):
    noise = np.random.default_rng(0).normal(scale=1e-5, size=101)
    robot, trajectory = files(pendulum_urdf=PENDULUM, noisy_csv=samples(lambda t: 0.1 * t + noise[round(100 * t)]))
    status, out, err = run(robot, trajectory, "--hand-over")
    assert status == 0
    assert err.startswith("warning: samples of 'pin' do not support its derivative of order ")
    assert err.count("\n") == 1
    assert "All limits kept" in out


def test_the_degree_of_the_splines_is_an_option(run, files):
    robot, trajectory = files(pendulum_urdf=PENDULUM, motion_csv=samples(lambda t: t / 2, count=5))
    status, _, err = run(robot, trajectory)
    assert status == 2
    assert "a spline of degree 5 needs at least 6 samples, got 5; give more, or lower the degree" in err
    assert run(robot, trajectory, "--degree", "3", "--hand-over")[0] == 0


def test_a_terminal_gets_a_colored_table(run, monkeypatch, files):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "100")
    robot, trajectory = files(pendulum_urdf=PENDULUM, fast_yaml="joints: {pin: 4*t}\ntime: {stop: 0.1, step: 0.1}")
    status, out, _ = run(robot, trajectory)
    assert status == 1
    assert "\x1b[1;31m2.0000\x1b[0m" in out


HOLD = "joints: {pin: 0.5}\ntime: {stop: 1, step: 0.1}"
LINE = "0.1,1\n0.2,2\n0.3,3\n0.4,4\n0.5,5\n0.6,6\n"
BAD_TRAJECTORIES = {
    "unknown joint": ("csv", samples(lambda t: t, names="pim"), "no moving joint of pendulum has this name, got 'pim'"),
    "unknown joint in a law": ("yaml", HOLD.replace("pin", "pim"), "did you mean 'pin'?"),
    "unsorted times": ("csv", f"time,pin\n0.3,1\n{LINE}", "motion.csv, line 5, pin: times must increase"),
    "repeated times": (
        "csv",
        f"time,pin\n0.1,9\n{LINE}",
        "line 3, pin: times must increase, got 0.1; this one repeats the one before",
    ),
    "infinite": ("csv", f"time,pin\n0,inf\n{LINE}", "motion.csv, line 2, pin: must be a finite number, got 'inf'"),
    "too few samples": ("csv", "time,pin\n0,0\n1,1\n", "a spline of degree 5 needs at least 6 samples, got 2"),
    "empty": ("csv", "", "motion.csv: the file of samples is empty"),
    "a law without a value": ("yaml", HOLD.replace("0.5", "1/t"), "the law is not defined or not smooth at 0 s"),
    "unknown key": ("yaml", f"speed: 3\n{HOLD}", "motion.yaml, line 1, speed: unknown key"),
    "unknown ending": ("txt", HOLD, "the kind of a trajectory file is given by its extension"),
}


@pytest.mark.parametrize("suffix, text, message", BAD_TRAJECTORIES.values(), ids=BAD_TRAJECTORIES)
def test_bad_trajectories_end_with_2_and_one_line(suffix, text, message, run, files):
    robot, trajectory = files(**{"pendulum_urdf": PENDULUM, f"motion_{suffix}": text})
    status, out, err = run(robot, trajectory)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: {trajectory}")
    assert err.count("\n") == 1
    assert message in err


BAD_ROBOTS = {
    "malformed": (PENDULUM.replace("</robot>", ""), "pendulum.urdf, line "),
    "negative mass": (PENDULUM.replace('value="2"', 'value="-2"'), "must be greater than zero"),
    "no robot": ("<world/>", "is not a robot file"),
}


@pytest.mark.parametrize("text, message", BAD_ROBOTS.values(), ids=BAD_ROBOTS)
def test_bad_robots_end_with_2_and_one_line(text, message, run, files):
    robot, trajectory = files(pendulum_urdf=text, motion_yaml=HOLD)
    status, out, err = run(robot, trajectory)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: {robot}")
    assert err.count("\n") == 1
    assert message in err


def test_a_robot_as_no_real_one_is_warned_of_in_one_line_and_refused_if_strict(run, files):
    robot, trajectory = files(pendulum_urdf=PENDULUM.replace('ixx="0.01"', 'ixx="1"'), motion_yaml=HOLD)
    status, out, err = run(robot, trajectory)
    assert status in (0, 1)
    assert out
    assert err.startswith(f"warning: {robot}: ")
    assert err.count("\n") == 1
    assert "exceeds the sum of the others: " in err
    status, out, err = run(robot, trajectory, "--strict")
    assert (status, out) == (2, "")
    assert "breaks the triangle inequality" in err
    status, out, err = run(robot, trajectory, "--json")
    assert json.loads(err)["warning"]["kind"] == "RobotWarning"
    assert json.loads(out)["command"] == "check"


BAD_OPTIONS = {
    "no such joint in limits": (["--limits", "FILE"], "joints.pim: no moving joint of pendulum has this name"),
    "no file of limits": (["--limits", "none.yaml"], "none.yaml: file not found"),
    "figure of another kind": (["--out", "limits.gif"], "limits.gif: the kind of a figure is given by its extension"),
    "no such link": (["--payload", "hand=3 kg"], "--payload: no link has this name, got 'hand'"),
    "no such place": (["--payload", "tip=3 kg@2 m:"], "--payload: "),
    "an end that is not in the motion": (["--payload", "tip=3 kg@0.1 s:90 s"], "outside of the motion"),
    "a waypoint of a trajectory": (["--payload", "tip=3 kg@waypoint 2:"], "instants, not by waypoint"),
    "two kinds of places": (["--payload", "tip=3 kg@10 %:2 s"], "both ends are of one kind"),
    "even degree": (["--degree", "4"], "degree: the degree of the splines is odd"),
}


@pytest.mark.parametrize("options, message", BAD_OPTIONS.values(), ids=BAD_OPTIONS)
def test_bad_options_end_with_2_and_one_line(options, message, run, files):
    robot, trajectory, limits = files(
        pendulum_urdf=PENDULUM, motion_csv=samples(lambda t: t / 2), limits_yaml="joints: {pim: {jerk: 3}}"
    )
    status, out, err = run(robot, trajectory, *(limits if option == "FILE" else option for option in options))
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_nothing_to_compare_with_is_bad_input(run, files):
    free = re.sub(r"<limit [^>]*>", "", PENDULUM).replace("revolute", "continuous")
    robot, trajectory = files(pendulum_urdf=free, motion_yaml=HOLD)
    status, out, err = run(robot, trajectory)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: {robot}: ")
    assert all(word in err for word in ("no limits", "--limits"))
    assert err.count("\n") == 1


def test_files_that_do_not_exist(run):
    for arguments in [("none.urdf", GOOD), (PANDA, "none.csv"), (PANDA, "none.yaml")]:
        status, out, err = run(*arguments)
        assert (status, out) == (2, "")
        assert "not found" in err
