"""Angles that are likely in degrees, told by the values of laws; and trajectories of robots in degrees."""

import json
import math
import shutil

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.cli import main
from jounce.trajectory.law_checks.unit_doubts import degrees_meant, looks_like_degrees, values_of

T = np.linspace(0.0, 2.0, 41)
SWING = 30 + 60 * np.sin(np.pi * T)
ROD = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])


def arm(limits=None):
    """A joint that turns and one that slides."""
    given = {} if limits is None else {"limits": limits}
    joints = [
        jn.Joint("pin", "base", "arm", axis=[0, 0, 1], **given),
        jn.Joint("slide", "arm", "rod", "prismatic", axis=[1, 0, 0], limits=jn.Limits(velocity=1e3)),
    ]
    return jn.Robot("ram", [jn.Link("base"), jn.Link("arm", ROD), jn.Link("rod", ROD)], joints)


FREE, LIMITED = arm(), arm(jn.Limits(lower=-2.0, upper=2.0, velocity=1e3, acceleration=1e4))


@pytest.mark.parametrize(
    "law",
    [
        jn.laws.ExpressionMotion("30 + 60*sin(pi*t)"),
        jn.laws.FunctionMotion(lambda t: 30 + 60 * jnp.sin(np.pi * t)),
        jn.laws.SplineMotion(T, SWING),
        jn.laws.MeasuredMotion(T, 60 * np.pi * np.cos(np.pi * T), 1, [30.0]),
        jn.laws.HermiteMotion(T, np.stack([SWING, 60 * np.pi * np.cos(np.pi * T)], axis=1)),
        jn.laws.FollowingMotion(jn.laws.SplineMotion(np.pi * T, SWING), "pi*t"),
        jn.laws.PiecewiseMotion(["30 + 60*sin(pi*t)", "30 + 60*sin(pi*t)"], [1.0]),
    ],
    ids=lambda law: type(law).__name__,
)
def test_values_of_laws_of_every_form(law):
    found = values_of(law, 0.0, 2.0)
    grid = np.linspace(0.0, 2.0, 201)
    np.testing.assert_allclose(found, 30 + 60 * np.sin(np.pi * grid), rtol=0, atol=2e-3)
    assert degrees_meant(found) == "goes from -30 to 90 rad, 19 turns: degrees?"


@pytest.mark.parametrize(
    "law",
    [
        jn.laws.SegmentedMotion([jn.laws.Segment("modified_sine", 1.0, to=90.0), jn.laws.Segment("dwell", 1.0)]),
        jn.laws.SegmentedMotion([jn.laws.Segment("cycloidal", 1.0, to=2.0), jn.laws.Segment("cycloidal", 1.0, to=0.0)]),
        jn.laws.TrapezoidalMotion(0.0, 3.0, duration=2.0),
        jn.laws.SplineMotion(T, SWING, beyond="hold"),
    ],
    ids=lambda law: type(law).__name__,
)
def test_values_by_numpy_are_those_of_the_law(law):
    grid = np.linspace(0.0, 2.0, 201)
    own = np.asarray(law(jn.Jet([grid])).coefficients[0])
    np.testing.assert_allclose(values_of(law, 0.0, 2.0), own, rtol=0, atol=1e-12 * np.abs(own).max())


@pytest.mark.parametrize(
    "law, expected",
    [
        ("8*sin(3.1*t)", "goes from -8 to 8 rad, 2.5 turns: degrees?"),
        ("3 + 9*sin(4*t)", "goes from -6 to 12 rad, 2.9 turns: degrees?"),
        ("-7.5*sin(4*t)", "goes from -7.5 to 7.5 rad, 2.4 turns: degrees?"),
        ("8*(3*t**2/4 - t**3/4)", "goes from 0 to 8 rad, 1.3 turns: degrees?"),
        ("8*t", ""),  # a shaft that goes on
        ("5*sin(5*t)", ""),  # less than a turn to each side
        ("7.3*sin(5*t)", ""),
        ("450*deg*sin(5*t)", ""),
        ("2.5*pi*sin(3*t)", ""),
    ],
)
def test_swings_to_whole_and_half_degrees_of_more_than_a_turn_are_reported(law, expected):
    assert degrees_meant(values_of(jn.laws.ExpressionMotion(law), 0.0, 2.0)) == expected


@pytest.mark.parametrize("law", ["log(t - 1)", "1.7e308*t", "1e300 + t", "1/(t - 1)"])
def test_a_law_that_says_nothing_of_the_run_has_no_values(law):
    assert values_of(jn.laws.ExpressionMotion(law), 0.0, 2.0) is None


def test_a_pole_is_no_motion_in_degrees():
    assert degrees_meant(values_of(jn.laws.ExpressionMotion("tan(2*t)"), 0.0, 0.9)) == ""
    there = np.repeat([-90.0, 90.0], 100)  # at once: they stand still on both sides
    assert degrees_meant(there) == "goes from -90 to 90 rad, 29 turns: degrees?"


def test_the_largest_numbers_look_like_degrees():
    assert looks_like_degrees(1.7976931348623157e308)


IN_DEGREES = {
    "samples": jn.JointTrajectory.from_samples(T, np.stack([SWING, 0 * T], axis=1), ["pin", "slide"]),
    "laws": jn.JointTrajectory({"pin": "30 + 60*sin(pi*t)"}, 0.0, 2.0),
    "point to point": jn.JointTrajectory.point_to_point(["pin"], [0.0], [90.0], duration=2.0),
}


@pytest.mark.parametrize("robot", [FREE, LIMITED], ids=["free", "limited"])
@pytest.mark.parametrize("given", IN_DEGREES)
def test_a_trajectory_in_degrees_is_reported(robot, given):
    with pytest.warns(jn.errors.UnitWarning, match=r"pin goes from .* to 90 rad, .* turns: degrees\?"):
        jn.dynamics.trajectory_torques(robot, IN_DEGREES[given])


@pytest.mark.parametrize(
    "robot, law",
    [
        (FREE, "200*t"),
        (FREE, "100*(1 - exp(-t))"),
        (FREE, "3*sin(t)"),
        (LIMITED, "1.9*sin(pi*t)"),
        (LIMITED, "3.5*sin(pi*t)"),  # breaks its limits, as a motion in rad
        (arm(jn.Limits(lower=-100.0, upper=100.0)), "90*sin(pi*t)"),  # a joint of many turns
    ],
)
def test_a_trajectory_in_rad_is_not_doubted(robot, law):
    assert jn.dynamics.trajectory_torques(robot, jn.JointTrajectory({"pin": law, "slide": "50*sin(t)"}, 0.0, 2.0))


def test_waypoints_in_degrees_are_reported():
    with pytest.warns(jn.errors.UnitWarning, match="pin goes from 0 to 91.87 rad"), pytest.raises(jn.JounceError):
        jn.retime(LIMITED, [[0.0, 0.0], [90.0, 0.1], [45.0, 0.0]])


def _panda(folder, header, factor):
    rows = [f"{t:.3f},{factor * (30 + 40 * math.sin(2 * t)):.6f},{factor * -20:.6f}" for t in np.linspace(0, 2, 101)]
    path = folder / "move.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize("command", ["torques", "check"])
def test_commands_tell_degrees_on_standard_error_and_in_json(tmp_path, capsys, command):
    path = _panda(tmp_path, "time,panda_joint1,panda_joint4", 1.0)
    shown = main([command, "examples/robots/panda.urdf", str(path), "--json"])
    record = [json.loads(line)["warning"] for line in capsys.readouterr().err.splitlines()]
    words = [line["message"] for line in record if line["kind"] == "UnitWarning"]
    assert len(words) == 1
    assert "panda_joint1 goes from -0.2721 to 70 rad, 11 turns: degrees? (and 1 joint like it)" in words[0]
    assert shown == (0 if command == "torques" else 1)


@pytest.mark.parametrize("header, factor", [("time,panda_joint1 [deg],panda_joint4 [deg]", 1.0),
                                            ("time,panda_joint1,panda_joint4", math.pi / 180)])  # fmt: skip
def test_commands_say_nothing_of_a_trajectory_with_units_or_in_rad(tmp_path, capsys, header, factor):
    main(["torques", "examples/robots/panda.urdf", str(_panda(tmp_path, header, factor))])
    assert "degrees?" not in capsys.readouterr().err


def test_a_mechanism_in_degrees_runs_with_status_0_and_is_reported_in_json(tmp_path, capsys):
    path = tmp_path / "four_bar.yaml"
    shutil.copy("examples/four_bar.yaml", path)
    path.write_text(path.read_text().replace("motion: 30*deg", "motion: 30 + 0*deg").replace("60*deg*sin", "60*sin"))
    main(["inspect", str(path), "--json"])
    assert "degrees?" not in capsys.readouterr().err  # deg is named in it
    path.write_text(path.read_text().replace(" + 0*deg", ""))
    assert main(["inspect", str(path), "--json"]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "drivers.theta.motion: goes from -30 to 90 rad, 19 turns: degrees?" in json.loads(line)["warning"]["message"]
