"""Laws of outputs in place of laws of drivers: the motion of the drivers follows by inversion."""

import dataclasses
import math

import jax
import mpmath as mp
import numpy as np
import pytest

import jounce as jn

GRID = np.linspace(0.0, 1.0, 9)
ORDER = 4


def slider_crank(law, output="stroke_x"):
    crank = jn.load("examples/slider_crank.yaml")
    theta = dataclasses.replace(crank.drivers["theta"], motion=jn.laws.OutputMotion(output, law))
    bodies = {name: dataclasses.replace(body, mass=1.0, inertia=0.01) for name, body in crank.bodies.items()}
    outputs = crank.outputs | {
        "theta": jn.outputs.DriverAngleOutput("theta"),
        "torque": jn.outputs.DriverTorqueOutput("theta"),
    }
    more = {"bodies": bodies, "outputs": outputs, "gravity": [0.0, -9.81]}
    return dataclasses.replace(crank, drivers={"theta": theta}, **more)


@pytest.fixture(scope="module")
def motion():
    return jn.solve(slider_crank("0.17 + 0.015*cos(3*t)"), GRID, order=ORDER)


def crank_angle(t):
    """The triangle of crank and rod: r = 50, l = 150, offset e = 10 mm."""
    r, rod, e = mp.mpf("0.05"), mp.mpf("0.15"), mp.mpf("0.01")
    x = mp.mpf("0.17") + mp.mpf("0.015") * mp.cos(3 * t)
    d = mp.sqrt(x * x + e * e)
    return mp.atan2(e, x) + mp.acos((r * r + d * d - rod * rod) / (2 * r * d))


@pytest.mark.slow
def test_the_driver_follows_with_all_derivatives(motion):
    with mp.workdps(50):
        exact = np.array([[float(mp.diff(crank_angle, mp.mpf(t), k)) for k in range(ORDER + 1)] for t in GRID])
    scale = np.abs(exact).max(axis=0)
    for found in (motion.outputs["theta"], motion.driver("theta").values, motion.outputs["crank_angle"]):
        assert np.abs((found - exact) / scale).max() < 1e-13
    expected = [[0.015 * 3**k * math.cos(3 * t + k * math.pi / 2) for k in range(1, ORDER + 1)] for t in GRID]
    np.testing.assert_allclose(motion.outputs["stroke"][:, 1:, 0], expected, atol=1e-12)


@pytest.mark.slow
def test_forces_are_those_of_the_driver_not_of_the_output(motion):
    balance = jn.energy.power_balance(motion)
    assert float(np.abs(balance["residual"] / balance["scale"]).max()) < 1e-13
    torque, rate = motion.outputs["torque"][:, 0], motion.outputs["theta"][:, 1]
    np.testing.assert_allclose(torque * rate, balance["drivers"].sel(derivative=0), atol=1e-14)
    again = jn.solve(motion.actuated, GRID, order=1)  # the driver by its own law
    for name, whole in motion.outputs.items():
        values = whole[:, :2]
        scale = np.abs(values).max(axis=0)
        np.testing.assert_allclose(again.outputs[name], values, atol=1e-10 * scale.max(), rtol=1e-9)
    law = motion.driver_law("theta")
    between = law(jn.Jet.variable(np.array([0.3]), 1)).derivatives()
    with mp.workdps(50):
        assert float(between[0][0]) == pytest.approx(float(crank_angle(mp.mpf("0.3"))), abs=1e-9)


@pytest.mark.parametrize(
    "output, words",
    [
        ("stroke", "a component of a point"),
        ("stroke_z", "did you mean 'stroke_"),
        ("torque", "cannot be held to a law"),
        ("theta", "cannot be held to a law"),
    ],
)
def test_what_cannot_be_held_is_named(output, words):
    with pytest.raises(jn.errors.MechanismError, match=words) as caught:
        jn.solve(slider_crank("0.17", output), GRID)
    assert caught.value.name == "drivers.theta.motion.output"


@pytest.mark.slow
def test_where_the_output_does_not_determine_the_driver_it_is_refused():
    with pytest.raises(jn.errors.SolveError, match=r"stroke_x .*no further than 0\.199.*theta") as caught:
        jn.solve(slider_crank("0.19 + 0.02*t"), GRID, order=0)
    assert caught.value.motion.status[0] == jn.Status.OK
    top = math.sqrt(0.2**2 - 0.01**2)
    with pytest.raises(jn.JounceError, match="driver theta follows from the output stroke_x"):
        jn.solve(slider_crank(f"{top!r} - 0.01*t"), GRID, order=0)


@pytest.mark.slow
def test_what_needs_the_law_beforehand_says_so(motion):
    mechanism = slider_crank("0.17 + 0.015*cos(3*t)")
    for ask in (jn.simulate, jn.linearize, jn.trace):
        with pytest.raises(jn.JounceError, match=r"output 'stroke_x'.*motion\.actuated"):
            ask(mechanism)
    with pytest.raises(jn.errors.UnsupportedError, match="go through numbers"):
        jax.grad(lambda r: jn.solve(mechanism.with_parameters(r=r), GRID).actuated)(0.05)
    with pytest.raises(jn.errors.MechanismError, match="the coordinate of this driver is an angle"):
        dataclasses.replace(motion.mechanism, outputs={"x": jn.outputs.DriverDisplacementOutput("theta")})


@pytest.mark.slow
@pytest.mark.parametrize("forces", [True, False], ids=["one by one", "side by side"])
def test_families_are_designs_solved_alone(forces):
    mechanism = slider_crank("0.17 + 0.015*cos(3*t)")
    if not forces:
        kept = {name: output for name, output in mechanism.outputs.items() if name != "torque"}
        mechanism = dataclasses.replace(mechanism, outputs=kept)
    lengths = [0.05, 0.052, 0.01]  # of the crank; the last one does not reach the stroke
    family = jn.solve_batch(mechanism, {"r": lengths}, GRID[:4], order=3)
    assert (family["status"].values != 0).tolist() == [[False] * 4, [False] * 4, [True] * 4]
    for k in range(2):
        single = jn.solve(mechanism.with_parameters(r=lengths[k]), GRID[:4], order=3).outputs
        for name, values in single.items():
            np.testing.assert_allclose(family[name].values[k], values, rtol=1e-11, atol=1e-12 * np.abs(values).max())


@pytest.mark.slow
def test_gradients_of_the_driver_and_of_its_torque():
    """The torque of `test_in_space_the_torque_is_that_of_the_motor`, for a length of the rod and a swing of its tip."""
    mechanism = rod_in_the_plane({"length": 0.2, "swing": 0.1})
    values = np.array([0.2, 0.1])

    def outputs(values):
        design = mechanism.with_parameters(length=values[0], swing=values[1])
        return jn.solve(design, GRID, order=1).outputs

    def angle(t, length, swing):
        return mp.asin((swing * mp.sin(2 * t) + mp.mpf("0.05")) / length)

    found = jax.tree.map(np.asarray, jax.jit(jax.jacfwd(outputs))(values))
    with mp.workdps(40):
        at = [(mp.mpf(t), mp.mpf("0.2"), mp.mpf("0.1")) for t in GRID]
        exact = [[[float(mp.diff(angle, x, (k, *by))) for by in ((1, 0), (0, 1))] for k in range(4)] for x in at]
    exact = np.array(exact)
    scale = np.abs(exact).max(axis=0)
    assert np.abs((found["angle"] - exact[:, :2]) / scale[:2]).max() < 1e-11
    assert np.abs((found["torque"] - 0.01 * exact[:, 2:]) / (0.01 * scale[2:])).max() < 1e-10


@pytest.mark.slow
def test_the_least_torque_of_a_driver_that_follows():
    """The longer the rod, the less its hinge turns for the same tip, and the less torque that takes."""
    mechanism = rod_in_the_plane({"length": 0.2, "swing": 0.1})
    found = jn.optimize(mechanism, "peak(torque)", {"length": (0.18, 0.25)}, starts=1, time=GRID[:5])
    assert found.status == "optimal"
    assert found.parameters["length"] == 0.25


def rod_in_the_plane(parameters):
    """The rod of `rod_in_space` in the plane."""
    law = jn.laws.OutputMotion("tip_y", "swing*sin(2*t) + 0.05")
    return jn.Mechanism(
        space="planar",
        parameters=parameters,
        bodies={"rod": jn.Body([0, 0], angle=0.2, mass=2.0, inertia=0.01)},
        joints={"hinge": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
        drivers={"motor": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", law)},
        outputs={
            "tip": jn.outputs.PointOutput("rod", ["length", 0]),
            "angle": jn.outputs.DriverAngleOutput("motor"),
            "torque": jn.outputs.DriverTorqueOutput("motor"),
        },
    )


def rod_in_space(parameters):
    """A rod that turns about z with its tip held to a law of y; its motor drives an inertia of 0.01 kg m^2 only."""
    rod = jn.Body([0, 0, 0], orientation=[math.cos(0.1), 0, 0, math.sin(0.1)], mass=2.0, inertia=[0.0, 0.01, 0.01])
    hinge = jn.spatial.Revolute(("ground", "rod"), [0, 0, 0], [0, 0, 0], axis_i=[0, 0, 1], axis_j=[0, 0, 1])
    motor = jn.drivers.RotationDriver(
        ("ground", "rod"), [0, 0, 1], jn.laws.OutputMotion("tip_y", "swing*sin(2*t) + 0.05")
    )
    return jn.Mechanism(
        space="spatial",
        parameters=parameters,
        bodies={"rod": rod},
        joints={"hinge": hinge},
        drivers={"motor": motor},
        outputs={
            "tip": jn.outputs.PointOutput("rod", ["length", 0, 0]),
            "angle": jn.outputs.DriverAngleOutput("motor"),
            "torque": jn.outputs.DriverTorqueOutput("motor"),
        },
    )


@pytest.mark.slow
def test_in_space_the_torque_is_that_of_the_motor():
    """A rod of 0.2 m turns about z, and its tip is held to y = 0.2 sin(theta): theta = arcsin(5 y)."""
    motion = jn.solve(rod_in_space({"length": 0.2, "swing": 0.1}), GRID, order=1)

    def angle(t):
        return mp.asin(5 * (mp.sin(2 * t) / 10 + mp.mpf("0.05")))

    with mp.workdps(40):
        exact = np.array([[float(mp.diff(angle, mp.mpf(t), k)) for k in range(4)] for t in GRID])
    np.testing.assert_allclose(motion.outputs["angle"], exact[:, :2], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(motion.outputs["torque"], 0.01 * exact[:, 2:], rtol=1e-10, atol=1e-11)
