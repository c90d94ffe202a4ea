"""What `docs/retiming.md` says to those who come from TOPP-RA, row by row: both sides on one path.

The path of TOPP-RA's ``SplineInterpolator`` is SciPy's ``CubicSpline`` with not-a-knot ends, which stands for it where
TOPP-RA itself is not needed.
"""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.planning.paths.paths import Between, path_of

pytestmark = pytest.mark.long

SPEED, ACCELERATION, TORQUE = 1.2, 4.0, 9.0
GRID = 2001


@pytest.fixture
def toppra():
    return pytest.importorskip("toppra", reason="TOPP-RA, a peer of the extra bench, is not installed")


def arm(**limits):
    """Return two rods in a vertical plane."""
    rod = jn.Inertia(0.6, center_of_mass=[0.2, 0, 0], tensor=[0.001, 0.01, 0.01])
    joints = [
        jn.Joint("a", "base", "upper", axis=[0, -1, 0], limits=jn.Limits(**limits)),
        jn.Joint("b", "upper", "lower", axis=[0, -1, 0], position=[0.4, 0, 0], limits=jn.Limits(**limits)),
    ]
    return jn.Robot("arm", [jn.Link("base"), jn.Link("upper", rod), jn.Link("lower", rod)], joints)


def waypoints(seed, count=5):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.2, 1.0, count)), rng.uniform(-1, 1, (count, 2))


@pytest.mark.parametrize("count", range(2, 9))
def test_the_same_path_is_given_by_its_parameter_and_degree_3(count):
    s, points = waypoints(count, count)
    path = path_of(points, ["a", "b"], 2, Between(parameter=s, degree=3))
    assert (path.start, path.stop) == (s[0], s[-1])
    at = np.linspace(s[0], s[-1], 501)
    theirs = CubicSpline(s, points)
    for level, found in enumerate(np.moveaxis(path.derivatives(at, 2), 1, 0)):
        np.testing.assert_allclose(found, theirs(at, level), atol=1e-12 * np.abs(theirs(at, level)).max() + 1e-13)


def test_without_them_it_is_another_curve_through_the_same_points():
    points = np.array([[0.0, 0.4, 1.0, 1.2], [-1.2, -1.0, -1.1, -1.4], [1.5, 1.2, 1.0, 1.3]]).T
    own = path_of(points, ["a", "b", "c"]).derivatives(np.linspace(0, 1, 2001), 0)[:, 0]
    theirs = CubicSpline(np.linspace(0, 1, 4), points)(np.linspace(0, 1, 20001))
    apart = max(np.linalg.norm(theirs - place, axis=1).min() for place in own[::20])
    assert 0.02 < apart < 0.06  # rad


def test_the_path_is_theirs_to_rounding(toppra):
    s, points = waypoints(3)
    theirs = toppra.SplineInterpolator(s, points)
    at = np.linspace(s[0], s[-1], 101)
    np.testing.assert_allclose(CubicSpline(s, points)(at), theirs(at), atol=1e-14)


def durations(toppra, robot, s, points, constraints, rates=(0.0, 0.0)):
    path = toppra.SplineInterpolator(s, points)
    instance = toppra.algorithm.TOPPRA(constraints, path, gridpoints=np.linspace(s[0], s[-1], GRID))
    theirs = instance.compute_trajectory(*rates).duration
    return jn.retime(robot, points, parameter=s, degree=3, rates=rates), theirs


def kinematic(toppra):
    bounds = (np.array([[-1, 1]] * 2) * x for x in (SPEED, ACCELERATION))
    kinds = (toppra.constraint.JointVelocityConstraint, toppra.constraint.JointAccelerationConstraint)
    return [kind(bound) for kind, bound in zip(kinds, bounds, strict=True)]


@pytest.mark.parametrize(
    "rates", [pytest.param((0.0, 0.0), marks=pytest.mark.slow), (0.1, 0.05)], ids=["rest", "sd_start, sd_end"]
)
def test_velocity_acceleration_and_rates_at_the_ends(toppra, rates):
    s, points = waypoints(1)
    ours, theirs = durations(
        toppra, arm(velocity=SPEED, acceleration=ACCELERATION), s, points, kinematic(toppra), rates
    )
    assert ours.stop == pytest.approx(theirs, rel=3e-3)
    _, first = np.asarray(ours.progress(jn.Jet.variable(0.0, 1)).derivatives())
    assert first == pytest.approx(rates[0], abs=1e-6)
    assert ours.report.kept


@pytest.mark.slow
def test_torque(toppra):
    s, points = waypoints(2)
    robot = arm(velocity=SPEED, effort=TORQUE)

    def inverse_dynamics(q, v, a):
        return np.asarray(jn.inverse_dynamics(robot, np.stack([q, v, a])))[0]

    bound = np.array([[-TORQUE, TORQUE]] * 2)
    torque = toppra.constraint.JointTorqueConstraint(inverse_dynamics, bound, np.zeros(2))
    ours, theirs = durations(toppra, robot, s, points, [kinematic(toppra)[0], torque])
    assert ours.stop == pytest.approx(theirs, rel=5e-3)


@pytest.mark.parametrize(
    "given, message",
    [
        ({"parameter": [0.0, 1.0]}, "5 numbers that increase"),
        ({"parameter": [0.0, 1.0, 1.0, 2.0, 3.0]}, "5 numbers that increase"),
        ({"parameter": [0.0, 1.0, np.nan, 2.0, 3.0]}, "parameter"),
        ({"degree": 12}, "degree"),
        ({"deviation": 0.0}, "greater than zero"),
        ({"deviation": 0.1, "degree": 3}, "degree"),
    ],
)
def test_bad_parameters_are_reported(given, message):
    with pytest.raises(TrajectoryError, match=message):
        jn.retime(arm(velocity=1.0), waypoints(0)[1], **given)
