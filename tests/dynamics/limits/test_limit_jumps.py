"""Quantities that are infinite where laws jump: which, of which joints, where; and what is not."""

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.limits.check_limits import check_limits

ROD = jn.Inertia(1.0, center_of_mass=[0.2, 0, 0], tensor=[0.02, 0.03, 0.04])
EVERY = {"velocity": 1e3, "acceleration": 1e4, "jerk": 1e6, "effort": 1e6, "effort_rate": 1e8}
NOTHING = set()
RATES = {"jerk", "torque rate"}
FORCES = RATES | {"acceleration", "torque"}
HARMONIC, CYCLOIDAL = (
    jn.laws.SegmentedMotion(
        [jn.laws.Segment("dwell", 0.5), jn.laws.Segment(name, 2.0, by=0.5), jn.laws.Segment("dwell", 0.5)]
    )
    for name in ("harmonic", "cycloidal")
)
EVEN = jn.laws.SegmentedMotion([jn.laws.Segment("constant_velocity", 0.5, by=by) for by in (0.5, 1.0)])
PARABOLAS = jn.laws.PiecewiseMotion(["2*t**2", "t - 0.125", "1 - 2*(1.25 - t)**2"], [0.25, 1.0])
KNEE = jn.laws.PiecewiseMotion(["t", "2*t - 0.5"], [0.5])
TIMES = np.linspace(0.0, 1.0, 21)


def arm(kind="revolute", **limits):
    joint = jn.Joint("j", "base", "a", kind, limits=jn.Limits(**(limits or EVERY)))
    return jn.Robot("arm", [jn.Link("base"), jn.Link("a", ROD)], [joint], gravity=[0, 0, 0])


def infinite(robot, laws, start, stop, **options):
    """Return what is infinite, by joint and quantity, and when; all of it is broken, and nothing else."""
    trajectory = jn.JointTrajectory(laws if isinstance(laws, dict) else {"j": laws}, start=start, stop=stop)
    report = check_limits(robot, trajectory, **options)
    rows = [row for row in report.limited if row.infinite]
    assert {row.ratio for row in rows} <= {np.inf}
    assert set(report.broken) == set(rows)
    assert all(np.sign(row.limit) == np.sign(row.value) for row in rows)
    return {(row.joint, row.quantity): row.time for row in rows}


@pytest.mark.filterwarnings("ignore::jounce.errors.SampleWarning")
@pytest.mark.parametrize(
    "law, start, stop, quantities, time",
    [
        (PARABOLAS, 0.0, 1.25, RATES, 0.25),
        (KNEE, 0.0, 1.0, FORCES, 0.5),
        (jn.laws.PiecewiseMotion(["0", "1"], [0.5]), 0.0, 1.0, FORCES | {"velocity"}, 0.5),
        (EVEN, 0.0, 1.0, FORCES, 0.5),
        (HARMONIC, 0.0, 3.0, RATES, 0.5),
        (CYCLOIDAL, 0.0, 3.0, NOTHING, None),
        (jn.laws.RestToRestMotion(0.0, 1.0, 1.0, 0.5, rest=1), 0.0, 2.0, RATES, 0.5),
        (jn.laws.RestToRestMotion(0.0, 1.0, 1.0, 0.5, rest=2), 0.0, 2.0, NOTHING, None),
        (jn.laws.TrapezoidalMotion(0.0, 1.0, 1.0, 2.0, 10.0, start_time=0.2), 0.0, 2.0, NOTHING, None),
        (jn.laws.FollowingMotion(HARMONIC, "2*t"), 0.0, 1.5, RATES, 0.25),
        (jn.laws.FollowingMotion(jn.laws.ExpressionMotion("sin(t)"), KNEE), 0.0, 1.0, FORCES, 0.5),
        (jn.laws.SplineMotion(TIMES, np.sin(3 * TIMES), 1), 0.0, 1.0, FORCES, 0.05),
        (jn.laws.SplineMotion(TIMES, np.sin(3 * TIMES), 2), 0.0, 1.0, RATES, 0.075),  # whose knots are between samples
        (jn.laws.SplineMotion(TIMES, np.sin(3 * TIMES), 3), 0.0, 1.0, NOTHING, None),
        (jn.laws.SplineMotion(TIMES, np.sin(3 * TIMES), 5, beyond="hold"), 0.0, 2.0, FORCES, 1.0),
        ("abs(t - 0.98765)", 0.0, 2.0, FORCES, 0.98765),
        ("(t - 0.98765)*abs(t - 0.98765)", 0.0, 2.0, RATES, 0.98765),
        ("(t - 0.98765)**2*abs(t - 0.98765)", 0.0, 2.0, NOTHING, None),
        ("0.1*exp(-((t - 0.5)/0.001)**2)", 0.0, 1.0, NOTHING, None),  # steep, and smooth
    ],
)
def test_what_is_above_a_derivative_that_jumps_is_infinite(law, start, stop, quantities, time):
    limits = dict.fromkeys(EVERY, 1e12)
    found = infinite(arm(**limits), law, start, stop)
    assert found == {("j", quantity): pytest.approx(time, abs=1e-10) for quantity in quantities}


def test_a_jump_at_an_end_or_at_no_instant_that_is_looked_at_is_none():
    for start, stop in ((0.5, 1.0), (0.0, 0.5)):
        assert infinite(arm(), KNEE, start, stop) == {}
    assert infinite(arm(), KNEE, 0.0, 1.0, times=[0.0, 0.4]) == {}
    assert infinite(arm(), KNEE, 0.0, 1.0, times=[0.2]) == {}
    assert set(infinite(arm(), KNEE, 0.0, 1.0, times=[0.2, 0.7])) == {("j", quantity) for quantity in FORCES}


def test_a_jump_of_rounding_is_none():
    # the second law meets the first to rounding: sin(1)^2 and half of 1 - cos(2)
    law = jn.laws.PiecewiseMotion(["sin(t)**2", "0.5 - 0.5*cos(2*t)"], [1.0])
    assert infinite(arm(), law, 0.0, 2.0) == {}
    assert infinite(arm(), jn.laws.PiecewiseMotion(["0.1*t*3", "0.3*t"], [1.0]), 0.0, 2.0) == {}


def test_only_what_is_limited_and_infinite_is_broken():
    assert infinite(arm(lower=-1.0, upper=2.0, velocity=3.0), KNEE, 0.0, 1.0) == {}
    assert infinite(arm(lower=-1.0, upper=2.0, acceleration=9.0), PARABOLAS, 0.0, 1.25) == {}
    assert set(infinite(arm("prismatic"), KNEE, 0.0, 1.0)) == {
        ("j", quantity.replace("torque", "force")) for quantity in FORCES
    }
    row = next(x for x in check_limits(arm(velocity=3.0), jn.JointTrajectory({"j": KNEE}, 0.0, 1.0)).rows if x.infinite)
    assert (row.quantity, row.value, row.time, row.limit, row.ratio) == ("acceleration", np.inf, 0.5, None, None)


@pytest.mark.parametrize(
    "laws, broken",
    [(["t", "2*t - 0.5"], False), (["-t", "0.5 - 2*t"], False), (["2*t", "t + 0.5"], True), (["t", "1 - t"], True)],
)
def test_a_limit_of_deceleration_alone_is_for_what_slows_down(laws, broken):
    found = infinite(arm(deceleration=5.0), jn.laws.PiecewiseMotion(laws, [0.5]), 0.0, 1.0)
    assert set(found) == ({("j", "acceleration")} if broken else set())


def crossed():
    """Return two slides, at right angles, one on the other, and a wheel in balance on the second."""
    links = [jn.Link("base"), *(jn.Link(name, jn.Inertia(2.0, tensor=[0.1, 0.1, 0.1])) for name in "abc")]
    joints = [
        jn.Joint("x", "base", "a", "prismatic", axis=[1, 0, 0]),
        jn.Joint("y", "a", "b", "prismatic", axis=[0, 1, 0]),
        jn.Joint("turn", "b", "c"),
    ]
    return jn.Robot("crossed", links, joints), dict.fromkeys(("x", "y", "turn"), jn.Limits(**EVERY))


@pytest.mark.parametrize("mover", ["x", "y"])
def test_only_what_a_jump_moves_needs_an_infinite_force(mover):
    robot, limits = crossed()
    others = {"x": "y", "y": "x"}
    laws = {mover: KNEE, others[mover]: "sin(t)", "turn": "sin(3*t)"}
    found = infinite(robot, laws, 0.0, 1.0, limits=limits)
    assert set(found) == {(mover, quantity) for quantity in ("acceleration", "jerk", "force", "force rate")}


def test_damping_makes_a_jump_of_velocity_one_of_torque():
    rail = jn.Joint("j", "base", "a", "prismatic", axis=[1, 0, 0], damping=2.0, limits=jn.Limits(**EVERY))
    light = jn.Robot("rail", [jn.Link("base"), jn.Link("a")], [rail], strict=False)
    assert {quantity for _, quantity in infinite(light, KNEE, 0.0, 1.0)} == {"acceleration", "jerk", "force rate"}
    assert {quantity for _, quantity in infinite(light, KNEE, 0.0, 1.0, drives=False)} == {"acceleration", "jerk"}


def test_two_joints_may_jump_at_instants_of_their_own():
    robot, limits = crossed()
    laws = {"x": PARABOLAS, "y": jn.laws.PiecewiseMotion(["t", "2*t - 0.4"], [0.4]), "turn": "1"}
    found = infinite(robot, laws, 0.0, 1.25, limits=limits)
    assert {key: found[key] for key in found if key[0] == "x"} == {("x", "jerk"): 0.25, ("x", "force rate"): 0.25}
    assert {time for (name, _), time in found.items() if name == "y"} == {0.4}
    assert len(found) == 6


def test_a_joint_that_follows_jumps_with_its_leader():
    follow = jn.Joint("f", "base", "b", mimic=jn.robot.Mimic("j", -2.0), limits=jn.Limits(jerk=1e3))
    joints = [jn.Joint("j", "base", "a"), follow]
    robot = jn.Robot("pair", [jn.Link("base"), jn.Link("a", ROD), jn.Link("b", ROD)], joints)
    assert infinite(robot, PARABOLAS, 0.0, 1.25) == {("j", "jerk"): 0.25}
