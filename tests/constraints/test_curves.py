"""Points on curves and surfaces in mechanisms, against closed forms and mpmath."""

import dataclasses

import mpmath as mp
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.dynamics import DriverForceOutput, DriverTorqueOutput, GroundForceOutput, JointForceOutput
from jounce.kinematics import Status

ORIGIN, X, Z = [0.0, 0.0], [1.0, 0.0], [0.0, 0.0, 1.0]
TIME = np.linspace(0.0, 1.5, 7)
MASS, GRAVITY = 1.5, 9.81
HILL = jn.joints.ParametricCurve(["s", "0.1*s**2"], range=[-1, 1])


def bead(curve, place, *, law="", speed="", start=None, **extra):
    """A bead without spin on a curve of the ground, driven along x or set off along it."""
    hold = drivers.CoordinateDriver(("ground", "bead"), "x", law or speed) if law or speed else None
    return jn.Mechanism(
        space="planar",
        gravity=[0.0, -GRAVITY],
        bodies={"bead": jn.Body(place, mass=MASS, inertia=0.01)},
        joints={
            "track": planar.PlanarCurve(("ground", "bead"), curve, ORIGIN, start=start),
            "upright": planar.Coordinate(("ground", "bead"), "angle", ratio=0.0),
        },
        drivers={"x": hold} if law else {},
        initial={"x": hold} if speed else {},
        outputs={"place": jn.outputs.PointOutput("bead", ORIGIN), "s": jn.outputs.ParameterOutput("track"), **extra},
    )


def derivatives(function, instants, order):
    """Derivatives of a function of mpmath at instants, shape (time, order + 1)."""
    with mp.workdps(40):
        found = [[mp.diff(function, mp.mpf(float(t)), k) for k in range(order + 1)] for t in instants]
        return np.array([[float(x) for x in row] for row in found])


def agree(found, expected, tolerance=1e-10):
    scale = np.abs(expected).max(axis=0)
    assert np.abs((found - expected) / np.where(scale > 0, scale, 1.0)).max() < tolerance


@pytest.mark.slow
def test_a_bead_driven_along_an_ellipse_has_the_closed_form_of_place_parameter_and_forces():
    """Laps of the curve are counted; the reaction is along the normal, and balances weight and inertia."""
    made = bead(
        ["2*cos(s)", "sin(s)"], [2 * np.cos(0.6), np.sin(0.6)], start=0.6,
        force=JointForceOutput("track"), ground=GroundForceOutput(),
    )  # fmt: skip
    bodies = {**made.bodies, "ray": jn.Body(ORIGIN, angle=0.4)}
    joints = {
        **made.joints,
        "center": planar.Revolute(("ground", "ray"), ORIGIN, ORIGIN),
        "slot": planar.Parallel2(("ray", "bead"), ORIGIN, ORIGIN, X),
    }
    motor = {"turn": drivers.CoordinateDriver(("ground", "ray"), "angle", "0.4 + 2*pi*t + 0.3*sin(t)")}
    made = dataclasses.replace(
        made, bodies=bodies, joints=joints, drivers=motor, outputs={**made.outputs, "slot": JointForceOutput("slot")}
    )
    found = jn.solve(made, np.linspace(0.0, 3.0, 7), order=6).outputs

    def parameter(t):
        turn = mp.mpf("0.4") + 2 * mp.pi * t + mp.mpf("0.3") * mp.sin(t)
        laps = mp.floor((turn + mp.pi) / (2 * mp.pi))
        return mp.atan2(2 * mp.sin(turn), mp.cos(turn)) + 2 * mp.pi * laps

    instants = np.linspace(0.0, 3.0, 7)
    s = derivatives(parameter, instants, 6)
    agree(found["s"], s)
    x = derivatives(lambda t: 2 * mp.cos(parameter(t)), instants, 6)
    y = derivatives(lambda t: mp.sin(parameter(t)), instants, 6)
    agree(found["place"], np.stack([x, y], axis=2))

    # m a = force of the curve, along its normal, + force of the slot, across the ray, + weight
    def normal(t):
        p = parameter(t)
        turn = mp.mpf("0.4") + 2 * mp.pi * t + mp.mpf("0.3") * mp.sin(t)
        n, c = (mp.cos(p), 2 * mp.sin(p)), (-mp.sin(turn), mp.cos(turn))
        a = [mp.diff(lambda u, f=f: f(parameter(u)), t, 2) for f in (lambda p: 2 * mp.cos(p), mp.sin)]
        expected = mp.matrix([MASS * a[0], MASS * (a[1] + mp.mpf("9.81"))])
        share = mp.lu_solve(mp.matrix([[n[0], c[0]], [n[1], c[1]]]), expected)
        return share[0] * n[0]

    with mp.workdps(30):
        value = [float(normal(mp.mpf(float(t)))) for t in instants[:3]]
        rate = float((normal(mp.mpf("0.5") + mp.mpf("1e-9")) - normal(mp.mpf("0.5") - mp.mpf("1e-9"))) / mp.mpf("2e-9"))
    assert np.abs(found["force"][:3, 0, 0] - value).max() < 1e-10 * np.abs(value).max()
    assert found["force"][1, 1, 0] == pytest.approx(rate, rel=1e-8)


@pytest.mark.slow
def test_the_normal_force_of_a_curve_has_the_closed_form_with_its_rates_and_the_ground_has_its_counterpart():
    made = bead(HILL, [0.2, 0.004], law="0.2 + 0.5*sin(t)", start=0.2,
                force=JointForceOutput("track"), on_ground=JointForceOutput("track", "ground"),
                drive=DriverForceOutput("x"))  # fmt: skip
    found = jn.solve(made, TIME, order=6).outputs

    def x(t):
        return mp.mpf("0.2") + mp.sin(t) / 2

    def lift(t):  # of the bead, with its weight
        return MASS * (mp.diff(lambda u: x(u) ** 2 / 10, t, 2) + mp.mpf("9.81"))

    force = [lambda t: -lift(t) * x(t) / 5, lift]
    expected = np.stack([derivatives(f, TIME, 4) for f in force], axis=2)
    agree(found["force"][:, :5], expected)
    agree(found["on_ground"][:, :5], -expected)
    agree(found["drive"][:, :5], derivatives(lambda t: MASS * mp.diff(x, t, 2) + lift(t) * x(t) / 5, TIME, 4))
    agree(found["s"], derivatives(x, TIME, 6))


@pytest.mark.slow
def test_a_bead_falls_along_a_cycloid_in_the_time_of_huygens():
    """On a cycloid the period does not depend on the height, and the length along it swings as a cosine."""
    radius = 0.3
    cycloid = jn.joints.ParametricCurve([f"{radius}*(s + sin(s))", f"-{radius}*(1 + cos(s))"], range=[-3, 3])
    for start in (0.5, 2.5):
        place = [radius * (start + np.sin(start)), -radius * (1 + np.cos(start))]
        made = bead(cycloid, place, speed=f"{float(place[0])!r}", start=start)
        period = 2 * np.pi * np.sqrt(4 * radius / GRAVITY)
        instants = np.linspace(0.0, 1.2 * period, 8)
        found = jn.simulate(made, instants, order=2)
        length = 4 * radius * np.sin(start / 2) * np.cos(2 * np.pi * instants / period)
        s = found.outputs["s"][:, 0]
        assert np.abs(4 * radius * np.sin(s / 2) - length).max() < 1e-10
        assert np.ptp(found.energy) < 1e-11


@pytest.mark.slow
def test_a_barrel_cam_by_the_flank_of_its_groove_has_the_torque_of_its_lift():
    """Axial force times dz/dtheta is the torque; the surface has one equation, and no row of it is redundant."""
    radius, stroke, speed, mass, rate = 0.04, 0.012, 3.0, 0.8, 2000.0
    flank = jn.joints.ParametricCurve(["v*cos(u)", "v*sin(u)", f"{stroke}*sin(2*u)"], range=[[-9, 9], [0.03, 0.05]])
    made = jn.Mechanism(
        space="spatial",
        bodies={
            "drum": jn.Body([0, 0, 0], mass=2.0, inertia=[0.002] * 3),
            "slide": jn.Body([radius, 0, 0], mass=mass, inertia=[0.001] * 3),
        },
        joints={
            "axle": spatial.Revolute(("ground", "drum"), [0, 0, 0], [0, 0, 0], Z, Z),
            "guide": spatial.Prismatic(("ground", "slide"), [radius, 0, 0], [0, 0, 0], Z, Z, [1, 0, 0], [1, 0, 0]),
            "groove": spatial.Surface(("drum", "slide"), flank, [0, 0, 0], start_u=0.0, start_v=radius),
        },
        drivers={"motor": drivers.RotationDriver(("ground", "drum"), Z, f"{speed}*t")},
        forces={"spring": forces.Spring(("ground", "slide"), [radius, 0, 0.1], [0, 0, 0], rate, 0.12)},
        outputs={
            "pin": jn.outputs.PointOutput("slide", [0, 0, 0]),
            "around": jn.outputs.ParametersOutput("groove"),
            "torque": DriverTorqueOutput("motor"),
            "flank": JointForceOutput("groove"),
        },
    )
    found = jn.solve(made, TIME, order=6).outputs

    def lift(t):
        return -stroke * mp.sin(2 * speed * t)

    def axial(t):  # what the flank exerts on the slide along z: the compressed spring pushes it down
        return mass * mp.diff(lift, t, 2) + rate * (mp.mpf("0.12") - (mp.mpf("0.1") - lift(t)))

    agree(found["pin"][:, :, 2], derivatives(lift, TIME, 6))
    agree(found["around"][:, :, 0], derivatives(lambda t: -speed * t, TIME, 6))
    agree(found["flank"][:, :5, 2], derivatives(axial, TIME, 4))
    agree(found["torque"][:, :5], derivatives(lambda t: axial(t) * mp.diff(lift, t) / speed, TIME, 4))


@pytest.mark.slow
def test_a_bead_on_a_helix_of_a_turning_body_goes_by_matrices():
    """A rotating curve in space: the position is that on the rotated helix, with its rates."""
    helix = ["0.3*cos(s)", "0.3*sin(s)", "0.1*s"]
    x, y, z = np.eye(3).tolist()
    made = jn.Mechanism(
        space="spatial",
        bodies={"rotor": jn.Body([0, 0, 0]), "bead": jn.Body([0.3, 0.0, 0.0])},
        joints={
            "axle": spatial.Revolute(("ground", "rotor"), [0, 0, 0], [0, 0, 0], x, x),
            "helix": spatial.SpatialCurve(("rotor", "bead"), helix, [0, 0, 0], start=0.0),
            **{f"held_{k}": spatial.Dot1(("rotor", "bead"), a, b) for k, (a, b) in enumerate(((x, y), (y, z), (z, x)))},
        },
        drivers={
            "turn": drivers.RotationDriver(("ground", "rotor"), x, "0.4*t**2"),
            "up": drivers.SpatialSlideDriver(("rotor", "bead"), [0, 0, 0], [0, 0, 0], z, "0.2*t + 0.05*sin(3*t)"),
        },
        outputs={"place": jn.outputs.PointOutput("bead", [0, 0, 0]), "s": jn.outputs.ParameterOutput("helix")},
    )
    found = jn.solve(made, TIME, order=4).outputs

    def parameter(t):
        return 2 * t + mp.sin(3 * t) / 2

    def place(t):
        s, turn = parameter(t), mp.mpf("0.4") * t**2
        a, b, c = mp.mpf("0.3") * mp.cos(s), mp.mpf("0.3") * mp.sin(s), s / 10
        return [a, b * mp.cos(turn) - c * mp.sin(turn), b * mp.sin(turn) + c * mp.cos(turn)]

    agree(found["s"], derivatives(parameter, TIME, 4))
    for k in range(3):
        agree(found["place"][:, :, k], derivatives(lambda t, k=k: place(t)[k], TIME, 4))


@pytest.mark.slow
class TestEnds:
    """A motion stops at the end of its curve; nothing is computed beyond."""

    def test_a_driven_motion_ends_there_and_at_the_end_itself_it_is_solved(self):
        made = bead(HILL, [0.5, 0.02], law="0.5 + 0.5*t", start=0.5)
        with pytest.raises(jn.errors.SolveError, match=r"joints\.track at its end s = 1: end of curve") as caught:
            jn.solve(made, TIME, order=2)
        assert caught.value.status == Status.END_OF_CURVE
        found = jn.solve(made, TIME, order=2, strict=False)
        assert found.status.tolist() == [0] * 5 + [int(Status.END_OF_CURVE), int(Status.NOT_REACHED)]
        assert found.outputs["s"][4, 0] == pytest.approx(1.0, abs=1e-14)
        assert np.isnan(found.outputs["place"][5:]).all()

    def test_a_motion_that_goes_beyond_and_comes_back_between_two_instants_does_not_come_back(self):
        made = bead(HILL, [0.5, 0.02], law="0.5 + 0.55*sin(t)", start=0.5)
        found = jn.solve(made, [0.0, 1.0, 2.1, 3.1], order=2, strict=False)
        assert found.status.tolist() == [0, 0, int(Status.END_OF_CURVE), int(Status.NOT_REACHED)]

    @pytest.mark.parametrize("excess", [1e-5, 1e-7])
    def test_a_short_excursion_beyond_an_end_between_the_samples_of_a_step_is_found(self, excess):
        """The turning point of -a cos(pi t + 0.1) is beyond s = 1 for a few milliseconds or less."""
        made = bead(HILL, [-0.9, 0.081], law=f"-(1 + {excess})*cos(pi*t + 0.1)", start=-0.9)
        found = jn.solve(made, [0.2, 0.6, 1.0, 1.4], order=2, strict=False)
        assert found.status.tolist() == [0, 0, int(Status.END_OF_CURVE), int(Status.NOT_REACHED)]
        assert found.faults[2] == "joints.track at its end s = 1"
        inside = bead(HILL, [-0.9, 0.081], law="-cos(pi*t + 0.1)", start=-0.9)
        assert not jn.solve(inside, [0.2, 0.6, 1.0, 1.4], order=2).status.any()

    def test_a_start_beyond_an_end_is_reported_before_anything_is_computed(self):
        with pytest.raises(jn.errors.MechanismError, match="between the ends of the curve, -1 and 1") as caught:
            jn.solve(bead(HILL, [0.5, 0.02], law="0.5", start=3.0), [0.0, 1.0])
        assert caught.value.name == "joints.track.start"
        with pytest.raises(jn.errors.SolveError, match="at its end s = 1"):
            jn.solve(bead(HILL, [0.9, 0.08], law="1.1 + 0*t", start=0.9), [0.0, 1.0])

    def test_a_simulation_ends_there(self):
        made = bead(HILL, [0.5, 0.025], speed="0.5 + 3*t", start=0.5)
        found = jn.simulate(made, TIME, order=1, strict=False)
        assert int(Status.END_OF_CURVE) in found.status[1:].tolist()
        assert "joints.track at its end s = 1 at t = " in found.faults[int(np.argmax(found.status))]
        with pytest.raises(jn.errors.SolveError, match="end of curve"):
            jn.simulate(made, TIME, order=1)


@pytest.mark.parametrize(
    "curve, words",
    [
        (jn.joints.ParametricCurve(["s", "abs(s)"], range=[-1, 1]), "a corner at s = 0"),
        (jn.joints.ParametricCurve(["s", "abs(s)*s"], range=[-1, 1]), "a jump of its curvature at s = 0"),
        (["s", "abs(s)"], "abs may have kinks or ends; give the range of s"),
        (["s", "s**0.5"], "a power may have kinks or ends; give the range of s"),
        (["s**2", "s**3"], "a cusp at s = 0"),
        (["cos(s)**3", "sin(s)**3"], "a cusp at s = "),
        (jn.joints.ParametricCurve(["s", "1/(s - 0.3)"], range=[-1, 1]), "a gap at s = 0.3"),
        (
            jn.joints.ParametricCurve(["cos(s)", "sin(s)"], range=[0, 6], closed=True),
            "does not close: there is a gap of 0.28",
        ),
        (jn.joints.ParametricCurve(["s", "sqrt(1 - s**2)"], range=[-1, 1]), "not finite at s = -1"),
        (jn.joints.ParametricCurve(["1", "2"], range=[0, 1]), "a single point"),
        (["s"], "must be 2 expressions"),
        (["s", "w"], "unknown name 'w'"),
        (jn.joints.ParametricCurve(["s", "s**2"], range=[1, 0]), "the first value must be below the last"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_a_curve_that_is_not_smooth_is_named_before_anything_is_computed(curve, words):
    with pytest.raises(jn.JounceError, match=words) as caught:
        jn.solve(bead(curve, [0.5, 0.5], law="0.5 + 0.1*t", start=0.5), [0.0, 0.1])
    assert caught.value.name.startswith("joints.track.curve")


def ring(count=60, turns=1.0):
    angle = 2 * np.pi * turns * np.arange(count) / count
    return np.stack([np.cos(angle), 0.6 * np.sin(angle)], axis=1)


@pytest.mark.parametrize(
    "points, closed, words",
    [
        (np.delete(ring(), slice(20, 30), axis=0), True, "a gap of .* give points between"),
        (np.array([[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [3, 2], [3, 3]]), False, "a corner of 90 deg"),
        (np.array([[0, 0], [1, 0], [2, 0], [3, 0], [4, 0.3], [5, 0.6], [6, 0.9]]), False, r"points\[3\].* of 17 deg"),
        (ring(60, 0.5), True, "a gap of"),
        (np.repeat(ring(), 2, axis=0), True, "repeats the one before"),
        (ring()[:5], False, "at least 7 points"),
        (np.full((9, 2), np.nan), False, "must be finite"),
        (np.ones((9, 4)), False, "rows of two or three"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_points_that_make_no_smooth_curve_are_named(points, closed, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.joints.SampledCurve(points, closed)


def test_a_start_that_is_near_two_branches_asks_for_one():
    eight = ["sin(s)", "sin(s)*cos(s)"]
    with pytest.raises(
        jn.errors.MechanismError, match=r"two parts of the curve are about as near .* give start"
    ) as caught:
        jn.solve(bead(eight, [0.0, 0.0], law="0.1*t"), [0.0, 0.1])
    assert caught.value.name == "joints.track.start"


@pytest.mark.slow
def test_a_curve_that_crosses_itself_is_followed_through_the_crossing():
    """The eight of Gerono, on which a bead runs lap after lap without loss, through the crossing each time."""
    made = bead(["sin(s)", "sin(s)*cos(s)"], [0.3, 0.29], speed="0.3 + 6*t", start=0.3)
    made = dataclasses.replace(made, gravity=[0.0, 0.0])
    found = jn.simulate(made, np.linspace(0.0, 4.0, 9), order=1)
    s, place = found.outputs["s"][:, 0], found.outputs["place"]
    assert s[-1] > 6 * np.pi
    curve = np.stack([np.sin(s), np.sin(s) * np.cos(s)], axis=1)
    assert np.abs(place[:, 0] - curve).max() < 1e-12
    speed = np.linalg.norm(place[:, 1], axis=1)
    assert np.ptp(speed) < 1e-10 * speed[0]  # nothing acts along the curve


@pytest.mark.slow
def test_many_laps_of_a_curve_through_points():
    """A weightless bead on a ring given by samples keeps its speed over the knots; laps are counted."""
    ellipse = jn.joints.SampledCurve(ring(80), closed=True)
    made = dataclasses.replace(bead(ellipse, [1.0, 0.0], speed="1 + 0*t"), gravity=[0.0, 0.0])
    made = dataclasses.replace(made, initial={"y": drivers.CoordinateDriver(("ground", "bead"), "y", "4*t")})
    found = jn.simulate(made, np.linspace(0.0, 5.0, 6), order=1)
    speed = np.linalg.norm(found.outputs["place"][:, 1], axis=1)
    assert np.ptp(speed) < 1e-9 * speed[0]
    assert found.outputs["s"][-1, 0] > 3 * ellipse.length
    x, y = found.outputs["place"][:, 0].T
    assert np.abs(x**2 + (y / 0.6) ** 2 - 1).max() < 1e-6  # between its points, the spline is near the ellipse


@pytest.mark.slow
def test_gradients_and_families_of_a_curve_follow_its_parameters():
    import jax

    made = dataclasses.replace(
        bead(["a*cos(s)", "b*sin(s)"], [1.65, 0.56], law="a*cos(0.6 + 0.3*t)", start=0.6),
        parameters={"a": 2.0, "b": 1.0},
    )

    def height(b):
        return jn.solve(made.with_parameters(b=b), [0.0, 1.0], order=2).outputs["place"][-1, 2, 1]

    assert float(jax.grad(height)(1.0)) == pytest.approx(-0.09 * np.sin(0.9), rel=1e-11)
    found = jn.solve_batch(made, {"b": [0.8, 1.2]}, [0.0, 1.0], order=2)
    assert int(found["status"].max()) == 0
    expected = np.array([0.8, 1.2]) * np.sin(0.9)
    np.testing.assert_allclose(found["place"].values[:, -1, 0, 1], expected, rtol=1e-12)


@pytest.mark.slow
def test_a_bead_rests_at_the_foot_of_its_curve_and_swings_with_its_curvature():
    made = bead(["2*cos(s)", "sin(s)"], [0.1, -1.0], start=-1.5)
    rest = jn.equilibrium(made)
    assert list(rest.poses) == ["bead"]
    np.testing.assert_allclose(rest.poses["bead"]["position"], [0.0, -1.0], atol=1e-12)
    modes = jn.linearize(made).modes
    assert float(np.abs(modes.eigenvalues[0])) == pytest.approx(np.sqrt(GRAVITY / 4), rel=1e-10)  # radius of 4 m
