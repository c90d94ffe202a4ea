"""Angles of lines in planes, instant centers, roll centers, and derivatives of outputs with respect to others."""

import dataclasses
import math

import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from jounce.kinematics import Status
from tests.oracles import double_wishbone as oracle

ORDER = 4
INSTANTS = np.array([-0.7, 0.2, 0.9])
LAW = "0.15*sin(1.3*t) + 0.02*t"
STEERING = "0.9*sin(0.8*t) - 0.3*t"  # of the pinion of 7.5 mm, which moves the rack to the right


def law(t):
    return mp.mpf("0.15") * mp.sin(mp.mpf("1.3") * t) + t / 50


def rack(t):
    return -mp.mpf("0.0075") * (mp.mpf("0.9") * mp.sin(mp.mpf("0.8") * t) - mp.mpf("0.3") * t)


def derivatives(function, t, order=ORDER):
    with mp.workdps(60):
        return [c * mp.factorial(k) for k, c in enumerate(mp.taylor(function, mp.mpf(float(t)), order))]


def quotient(y, x, times=1):
    """Return plain derivatives of ``d^n y / dx^n`` from those of y and x: division of polynomials."""
    y, x = ([c / mp.factorial(k) for k, c in enumerate(its)] for its in (y, x))
    speed = [c * k for k, c in enumerate(x)][1:]
    for _ in range(times):
        rest, y = [c * k for k, c in enumerate(y)][1:], []
        for k in range(min(len(rest), len(speed))):
            y.append((rest[k] - sum(y[j] * speed[k - j] for j in range(k))) / speed[0])
    return [c * mp.factorial(k) for k, c in enumerate(y)]


def close(found, expected, tolerance=1e-10):
    expected = np.array([[float(x) for x in row] for row in expected])
    scale = np.maximum(1.0, np.abs(expected).max(axis=0))
    np.testing.assert_array_less(np.abs(found - expected) / scale, tolerance)


@pytest.fixture(scope="module")
def wishbone():
    """Return the suspension driven at its lower arm, steered."""
    made = jn.load("examples/double_wishbone.yaml")
    steering = dataclasses.replace(made.drivers["wheel"], motion=STEERING)
    driver = jn.drivers.RotationDriver(("ground", "lower_arm"), [1, 0.04, -0.02], LAW)
    second = {"bump_steer_2": jn.outputs.DerivativeOutput("toe", "wheel_z", 2)}
    made = dataclasses.replace(made, drivers={"arm": driver, "wheel": steering}, outputs={**made.outputs, **second})
    return made, jn.solve(made, INSTANTS, order=ORDER)


def seen(name):
    """Return an angle of the suspension as a function of time, by its definition."""
    its, axle = oracle.Suspension(), oracle.vector([0, 1, 0])

    def angle(t):
        place = its.upright(law(t), rack(t))
        if name in ("toe", "camber"):
            x, y, z = place(axle, free=True)
            return mp.atan2(x, y) if name == "toe" else mp.atan2(-z, y)
        x, y, z = place(its.upper_ball) - place(its.lower_ball)
        return mp.atan2(-x, z) if name == "caster" else mp.atan2(-y, z)

    return angle


def height(t):
    return oracle.Suspension().upright(law(t), rack(t))(oracle.vector([0, "0.78", "0.3"]))[2]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["toe", "camber", "caster", "kingpin_inclination"])
def test_angles_of_a_suspension_are_those_of_its_closed_form(wishbone, name):
    close(wishbone[1].outputs[name], [derivatives(seen(name), t) for t in INSTANTS])


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, of, times", [("bump_steer", "toe", 1), ("camber_gain", "camber", 1), ("bump_steer_2", "toe", 2)]
)
def test_derivatives_by_travel_are_those_of_its_closed_form(wishbone, name, of, times):
    levels = ORDER + times
    series = [(derivatives(seen(of), t, levels), derivatives(height, t, levels)) for t in INSTANTS]
    close(wishbone[1].outputs[name], [quotient(y, x, times) for y, x in series])


@pytest.mark.slow
def test_the_instant_center_and_the_roll_center_of_a_suspension_are_those_of_its_closed_form(wishbone):
    its = oracle.Suspension()

    def contact(k):
        return lambda t: its.upright(law(t), rack(t))(oracle.vector([0, "0.78", 0]))[k]

    roll, center = [], []
    for t in INSTANTS:
        y, z = (derivatives(contact(k), t, ORDER + 1) for k in (1, 2))
        slope = quotient(y, z)  # dy/dz of the point of contact: the line to its center has the slope -dy/dz
        height_of_center = [
            z[k] + sum(math.comb(k, j) * y[j] * slope[k - j] for j in range(k + 1)) for k in range(ORDER + 1)
        ]
        roll.append(height_of_center)
        center.append(_center(its, t))
    close(wishbone[1].outputs["roll_center"][..., 2], roll)
    np.testing.assert_allclose(wishbone[1].outputs["roll_center"][..., 1], 0.0, atol=1e-13)
    np.testing.assert_allclose(wishbone[1].outputs["instant_center"][:, 0, 1:], center, rtol=1e-10)
    np.testing.assert_allclose(wishbone[1].outputs["instant_center"][..., 0], 0.0, atol=1e-12)


@pytest.mark.slow
def test_where_both_lines_of_a_roll_center_are_one_only_that_of_a_symmetric_axle_is_known():
    """Swing axles, which carry their wheels on hinges 0.2 m from the middle, level at t = 0: then each line is both."""
    hinges = {"left": 0.2, "right": -0.2}
    joints = {
        side: jn.spatial.Revolute(("ground", side), [0, y, 0], [0, y, 0], [1, 0, 0], [1, 0, 0])
        for side, y in hinges.items()
    }
    lift = {"left": "sin(t)", "right": "-sin(t)"}
    drivers = {f"{side}_lift": jn.drivers.RotationDriver(("ground", side), [1, 0, 0], lift[side]) for side in hinges}
    one = jn.outputs.SymmetricRollCenterOutput("left", [0, 0.7, 0], [1, 0, 0], [0, 1, 0])
    two = jn.outputs.RollCenterOutput(("ground", "left", "right"), [1, 0, 0], [0, 0.7, 0], [0, -0.7, 0])
    bodies = dict.fromkeys(hinges, jn.Body([0, 0, 0]))
    time = np.array([-0.3, -1e-5, -1e-9, 0.0, 1e-7, 1e-3, 0.4])
    expected = [derivatives(lambda t: -mp.tan(mp.sin(t)) / 5, t) for t in time]
    for output, known, tolerance in ((one, np.ones(7, bool), 1e-12), (two, np.abs(time) > 0.1, 1e-2)):
        made = jn.Mechanism(space="spatial", bodies=bodies, joints=joints, drivers=drivers, outputs={"R": output})
        motion = jn.solve(made, time, order=ORDER, strict=False)
        found, solved = motion.outputs["R"], motion.status == Status.OK
        assert solved[known].all()
        assert solved[3] == known[3]
        close(found[solved][..., 2], np.array(expected)[solved], tolerance)  # 1e-2 is what quotients are given to
        np.testing.assert_array_less(np.abs(found[solved][..., :2]), tolerance)


def _center(its, t):
    """Return where in the plane of the wheel center the upright has no velocity in it, by linear algebra."""
    with mp.workdps(40):
        t, step = mp.mpf(float(t)), mp.mpf(10) ** -12
        now, later, before = (its.upright(law(x), rack(x)) for x in (t, t + step, t - step))

        def velocity(y, z):  # of the place of the upright that is there now
            origin = now(oracle.vector([0, 0, 0]))
            axes = [now(oracle.vector(e), free=True) for e in ([1, 0, 0], [0, 1, 0], [0, 0, 1])]
            d = mp.matrix([0, y, z]) - origin
            local = mp.matrix([oracle.dot(axis, d) for axis in axes])
            return (later(local) - before(local)) / (2 * step)

        v0, v1, v2 = velocity(0, 0), velocity(1, 0), velocity(0, 1)
        found = mp.lu_solve(mp.matrix([[v1[1] - v0[1], v2[1] - v0[1]], [v1[2] - v0[2], v2[2] - v0[2]]]), -v0[1:3])
        return [float(found[0]), float(found[1])]


def four_bar(**outputs):
    made = jn.load("examples/four_bar.yaml")
    known = {
        "theta": jn.outputs.AngleOutput("crank"),
        "psi": jn.outputs.AngleOutput("rocker"),
        "C": jn.outputs.PointOutput("rocker", ["CD", 0]),
    }
    return dataclasses.replace(made, outputs={**known, **outputs})


def test_a_transmission_ratio_is_that_of_freudenstein_and_an_instant_center_lies_on_both_lines():
    outputs = {
        "ratio": jn.outputs.DerivativeOutput("psi", "theta"),
        "third": jn.outputs.DerivativeOutput("psi", "theta", 3),
        "tangent": jn.outputs.DerivativeOutput("C_y", "C_x"),
        "pole": jn.outputs.InstantCenterOutput(("crank", "rocker")),
        "own": jn.outputs.InstantCenterOutput(("crank", "rocker"), frame="body"),
        "pin": jn.outputs.InstantCenterOutput(("ground", "rocker")),
    }
    motion = jn.solve(four_bar(**outputs), [0.1, 0.2, 0.9], order=ORDER)
    found = motion.outputs
    close(found["ratio"], [ratio(t, ORDER) for t in motion.time])
    close(found["third"], [ratio(t, ORDER, 3) for t in motion.time], 1e-9)
    np.testing.assert_allclose(found["tangent"][:, 0], -1 / np.tan(found["psi"][:, 0]), rtol=1e-11)
    # Kennedy: that of crank and rocker lies on the line of centers and divides it by the ratio of their velocities
    turning = found["ratio"][:, 0]
    np.testing.assert_allclose(found["pole"][:, 0, 0], 0.1321 * turning / (turning - 1), rtol=1e-12)
    np.testing.assert_allclose(found["pole"][..., 1], 0.0, atol=1e-11)
    np.testing.assert_allclose(np.hypot(*found["own"][:, 0].T), np.abs(found["pole"][:, 0, 0]), rtol=1e-12)
    np.testing.assert_allclose(found["pin"][:, 0], [[0.1321, 0.0]] * 3, atol=1e-13)
    np.testing.assert_allclose(found["pin"][:, 1:], 0.0, atol=1e-9)


def test_where_the_reference_stands_still_a_derivative_is_undefined_and_its_neighbors_are_right():
    motion = jn.solve(
        four_bar(ratio=jn.outputs.DerivativeOutput("psi", "theta")), np.arange(0.45, 0.5501, 0.01), strict=False
    )
    assert [Status(s) for s in motion.status] == [Status.OK] * 5 + [Status.UNDEFINED] + [Status.OK] * 5
    assert np.isnan(motion.outputs["ratio"][5]).all()
    np.testing.assert_allclose(motion.outputs["ratio"][:5, 0], motion.outputs["ratio"][:5:-1, 0], rtol=1e-11)
    with pytest.raises(jn.errors.SolveError, match=r"t = 0\.5 s.*ratio"):
        jn.solve(four_bar(ratio=jn.outputs.DerivativeOutput("psi", "theta")), [0.4, 0.5])


def rocker(theta):
    """Return the angle of the rocker of the four-bar: Freudenstein."""
    a, b, c, d = (mp.mpf(x) for x in ("0.04", "0.1423", "0.2031", "0.1321"))
    x, y = a * mp.cos(theta) - d, a * mp.sin(theta)
    return mp.atan2(y, x) - mp.acos((x * x + y * y + c * c - b * b) / (2 * c * mp.hypot(x, y)))


def crank(t):
    return mp.radians(30 + 60 * mp.sin(mp.pi * t))


def ratio(t, order, times=1):
    """Return the derivative of the angle of the rocker by that of the crank, with its derivatives in time."""
    levels = order + times
    return quotient(derivatives(lambda t: rocker(crank(t)), t, levels), derivatives(crank, t, levels), times)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 4, 6])
def test_nothing_false_is_reported_near_where_the_reference_stands_still(order):
    """What is given as solved is right, however near; what rounding decides is not given."""
    off = np.array([0.0, 1e-16, 2e-16, 1e-14, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2])
    time = np.unique(np.concatenate([[0.4], 0.5 - off, 0.5 + off]))
    motion = jn.solve(four_bar(ratio=jn.outputs.DerivativeOutput("psi", "theta")), time, order=order, strict=False)
    natural = np.abs([float(x) for x in ratio(0.4, order)]) + 1.0
    solved = motion.status == 0
    for k in np.flatnonzero(solved):
        wrong = np.abs(motion.outputs["ratio"][k] - [float(x) for x in ratio(time[k], order)])
        assert (wrong < 0.1 * natural).all(), (time[k], wrong)
    assert set(motion.status[~solved]) == {int(Status.UNDEFINED)}
    assert not solved[np.abs(time - 0.5) < 1e-15].any()
    assert solved[np.abs(time - 0.5) >= (9e-3 if order > 4 else 9e-4)].all()


def crossing(**given):
    """Return a pin that turns a line through the normal of a plane."""
    pin = jn.spatial.Revolute(("ground", "rod"), [0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 1, 0])
    driver = jn.drivers.RotationDriver(("ground", "rod"), [0, 1, 0], "t")
    lines = {
        "line": jn.outputs.ProjectedAngleOutput(
            ("ground", "ground", "rod"), [0, 0, 1], [1, 0, 0], [0, 0, 0], [0, 0, 0.3]
        ),
        "axis": jn.outputs.RelativeAngleOutput(("ground", "rod"), [0, 0, 1], [1, 0, 0], [0, 0, 1]),
    }
    return jn.Mechanism(
        space="spatial", bodies={"rod": jn.Body([0, 0, 0])}, joints={"pin": pin}, drivers={"turn": driver},
        outputs={name: lines[name] for name in given or lines},
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ["line", "axis"])
def test_where_a_line_is_perpendicular_to_the_plane_there_is_no_angle(name):
    motion = jn.solve(crossing(**{name: True}), [-0.2, -0.01, 0.0, 0.01, 0.2], order=2, strict=False)
    assert [Status(s) for s in motion.status] == [Status.OK] * 2 + [Status.UNDEFINED] + [Status.OK] * 2
    angle = motion.outputs[name]
    np.testing.assert_allclose(np.cos(angle[[0, 1, 3, 4], 0]), [-1, -1, 1, 1], atol=1e-12)
    np.testing.assert_allclose(angle[[0, 1, 3, 4], 1:], 0.0, atol=1e-9)


@pytest.mark.slow
def test_projected_angles_count_turns_and_do_not_depend_on_frames():
    pin = jn.spatial.Revolute(("ground", "rod"), [0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 1])
    driver = jn.drivers.RotationDriver(("ground", "rod"), [0, 0, 1], "7*t + 0.4*t**2")
    line = jn.outputs.ProjectedAngleOutput(
        ("ground", "ground", "rod"), [0, 0, 2], [1, 0, 5], [0.1, 0, 0.1], [0.3, 0, 0.2]
    )
    made = jn.Mechanism(
        space="spatial", bodies={"rod": jn.Body([0, 0, 0])}, joints={"pin": pin}, drivers={"turn": driver},
        outputs={"line": line},
    )  # fmt: skip
    motion = jn.solve(made, [0.0, 0.3, 1.1, 2.5], order=ORDER)

    def angle(t):
        turn = 7 * t + mp.mpf("0.4") * t**2
        x, y = mp.mpf("0.3") * mp.cos(turn) - mp.mpf("0.1"), mp.mpf("0.3") * mp.sin(turn)
        return mp.atan2(y, x) + 2 * mp.pi * mp.nint((turn - mp.atan2(y, x)) / (2 * mp.pi))

    close(motion.outputs["line"], [derivatives(angle, t) for t in motion.time])


@pytest.mark.slow
def test_a_force_has_derivatives_by_an_angle_and_what_has_none_is_reported():
    weight = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"arm": jn.Body([0, 0], mass=2.0, inertia=0.1, center_of_mass=[0.3, 0])},
        joints={"O": jn.planar.Revolute(("ground", "arm"), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "arm"), "angle", "sin(2*t)")},
        outputs={
            "angle": jn.outputs.AngleOutput("arm"),
            "law": jn.outputs.DriverAngleOutput("turn"),
            "torque": jn.outputs.DriverTorqueOutput("turn"),
            "stiffness": jn.outputs.DerivativeOutput("torque", "angle"),
            "same": jn.outputs.DerivativeOutput("angle", "law"),
        },
    )
    motion = jn.solve(weight, [0.1, math.pi / 4, 1.0], order=ORDER)

    def angle(t):
        return mp.sin(2 * t)

    def torque(t):
        inertia = mp.mpf("0.1") + 2 * mp.mpf("0.3") ** 2
        return -4 * inertia * mp.sin(2 * t) + 2 * mp.mpf("9.81") * mp.mpf("0.3") * mp.cos(angle(t))

    found = motion.outputs["stiffness"]
    series = [(derivatives(torque, t, ORDER + 1), derivatives(angle, t, ORDER + 1)) for t in (0.1, 1.0)]
    close(found[[0, 2]], [quotient(*pair) for pair in series])
    assert np.isnan(found[1]).all()
    assert "t = 0.785398 s" in motion.dataset["stiffness"].attrs["comment"]
    assert motion.dataset["stiffness"].attrs["units"] == "N*m/rad"
    np.testing.assert_allclose(motion.outputs["same"][[0, 2]], [[1, 0, 0, 0, 0]] * 2, atol=1e-10)


@pytest.mark.parametrize(
    "given, words",
    [
        (jn.outputs.DerivativeOutput("psy", "theta"), "psy.*psi"),
        (jn.outputs.DerivativeOutput("C", "theta"), "components.*name one, such as C_x"),
        (jn.outputs.DerivativeOutput("self", "theta"), "one of itself"),
        (jn.outputs.DerivativeOutput("psi", "C_z"), "C_z"),
    ],
)
def test_bad_derivatives_are_reported(given, words):
    with pytest.raises(jn.errors.MechanismError, match=words) as caught:
        four_bar(self=given)
    assert caught.value.name.startswith("outputs.self.")


@pytest.mark.slow
def test_derivatives_of_derivatives_and_of_motions_that_are_solved():
    second = {
        "ratio": jn.outputs.DerivativeOutput("psi", "theta"),
        "again": jn.outputs.DerivativeOutput("ratio", "theta"),
    }
    made = four_bar(**second, direct=jn.outputs.DerivativeOutput("psi", "theta", 2))
    motion = jn.solve(made, [0.1, 0.3], order=3)
    np.testing.assert_allclose(motion.outputs["again"], motion.outputs["direct"], rtol=1e-10)
    found = jn.solve(four_bar(), [0.1, 0.3], order=3).evaluate(jn.outputs.DerivativeOutput("psi", "theta"))
    np.testing.assert_allclose(found.values[:, :3], motion.outputs["ratio"][:, :3], rtol=1e-11)
    with pytest.raises(jn.errors.MechanismError, match="solve it to a higher order"):
        jn.solve(four_bar(), [0.1, 0.3], order=3).evaluate(jn.outputs.DerivativeOutput("psi", "theta", 9))
