"""Friction that follows reactions, in simulations: closed forms, and balances by hand at what was simulated."""

import math

import numpy as np
import pytest

import jounce as jn
from tests.dynamics.inverse.test_friction import slider_crank, vars_of, wedge
from tests.oracles import mp_friction as by_hand

TIME = np.linspace(0.0, 1.0, 6)


def sled(mu=0.3, speed=0.05):
    return jn.Mechanism(
        space="planar",
        gravity=[0, -10.0],
        parameters={"mu": mu},
        bodies={"sled": jn.Body([0, 0], mass=2.0, inertia=1.0)},
        joints={
            "guide": jn.planar.Prismatic(
                ("ground", "sled"), [0, 0], [0, 0], [1, 0], [1, 0], friction=jn.joints.Friction("mu", speed)
            )
        },
        initial={"v": jn.drivers.CoordinateDriver(("ground", "sled"), "x", "2*t")},
        outputs={"place": jn.outputs.PointOutput("sled", [0, 0])},
    )


def velocity(mu=0.3, speed=0.05):
    """Of ``v' = -mu g tanh(v / speed)``, from 2 m/s."""
    return speed * np.arcsinh(np.sinh(2 / speed) * np.exp(-mu * 10 * TIME / speed))


@pytest.mark.slow
def test_a_sled_comes_to_rest_as_the_closed_form():
    simulated = jn.simulate(sled(), TIME)
    np.testing.assert_allclose(simulated.outputs["place"][:, 1, 0], velocity(), rtol=0, atol=1e-11)
    assert len(simulated.dense_output.start) < 40  # not held up by the speed, far above it


@pytest.mark.slow
def test_a_batch_and_a_gradient_by_the_coefficient():
    import jax

    found = jn.simulate_batch(sled(), {"mu": [0.1, 0.3]}, TIME)
    for k, mu in enumerate((0.1, 0.3)):
        np.testing.assert_allclose(found.outputs["place"][k, :, 1, 0], velocity(mu), rtol=0, atol=1e-11)

    def last(mu):
        return jn.simulate(sled().with_parameters(mu=mu), TIME[:3]).outputs["place"][-1, 1, 0]

    assert float(jax.grad(last)(0.3)) == pytest.approx(-10 * TIME[2], rel=1e-6)


@pytest.mark.slow
def test_a_free_slider_crank_fulfills_balances_by_hand_with_rates():
    driven = slider_crank(0.1)
    outputs = {"angle": jn.outputs.AngleOutput("crank")}
    free = jn.Mechanism(
        **{**vars_of(driven), "drivers": {}, "outputs": outputs},
        joints=driven.joints,
        parameters=driven.parameters,
        forces={"push": jn.forces.Torque(("ground", "crank"), "3.0")},
        initial={"turn": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "0.5 + 30*t")},
    )
    simulated = jn.simulate(free, [0.0, 0.02, 0.033], order=6)
    factorials = np.cumprod([1.0, *range(1, 7)])
    torque = by_hand.torque_of_series(simulated.outputs["angle"][-1] / factorials, 4)
    gap = np.abs(np.array(torque) - [3.0, 0, 0, 0, 0])
    np.testing.assert_array_less(gap / (10 * 30.0 ** np.arange(5)), 1e-9)
    balance = jn.energy.power_balance(simulated)
    assert (abs(balance["residual"]) <= 1e-11 * balance["scale"]).all()
    assert (balance["friction"].sel(derivative=0) < 0).all()


@pytest.mark.slow
def test_a_wedge_that_jams_stops_though_it_is_pushed_and_creeps_as_the_law_says():
    free = wedge(2.5)
    start = {"go": jn.drivers.CoordinateDriver(("ground", "wedge"), "x", "-0.3*t")}
    push = {"push": jn.forces.PointForce("wedge", [0, 0], ["-200", "0"])}
    parts = vars_of(free) | {"drivers": {}, "outputs": {"lift": jn.outputs.PointOutput("lift", [0, 0])}}
    found = jn.simulate(jn.Mechanism(**parts, joints=free.joints, initial=start, forces=push), [0.0, 0.005])
    # 400 N across the slope, per unit of x, lift 30 N and overcome the guide, which bears the half of them
    creep = 1e-3 * np.arctanh((400 - 30) / (2.5 * 200))
    assert found.outputs["lift"][-1, 1, 1] == pytest.approx(creep, rel=1e-8)


@pytest.mark.slow
def pushed_wedge(mu):
    """Return a wedge that a force pushes, whose friction locks from mu = 3.5 on."""
    # the lift, of 3 kg, has the acceleration (...) / (3 + (1 - mu / 2) 1 kg / 0.5^2): none as mu comes to 3.5
    free = wedge(mu)
    parts = vars_of(free) | {"drivers": {}, "outputs": {"lift": jn.outputs.PointOutput("lift", [0, 0])}}
    start = {"go": jn.drivers.CoordinateDriver(("ground", "wedge"), "x", "-0.3*t")}
    push = {"push": jn.forces.PointForce("wedge", [0, 0], ["-200", "0"])}
    return jn.Mechanism(**parts, joints=free.joints, initial=start, forces=push)


@pytest.mark.slow
def test_a_simulation_near_locking_friction_goes_on():
    assert (jn.simulate(pushed_wedge(3.4), [0.0, 0.01]).status == 0).all()


@pytest.mark.slow
def test_a_simulation_that_friction_locks_says_so():
    mechanism = pushed_wedge(3.6)
    words = r"friction locks at t = 0 s: joints\.guide: locked: no force or acceleration"
    with pytest.raises(jn.errors.SolveError, match=words) as caught:
        jn.simulate(mechanism, [0.0, 0.01])
    assert caught.value.status == jn.Status.LOCKED
    assert (jn.simulate(mechanism, [0.0, 0.01], strict=False).status != 0).all()


@pytest.mark.slow
def test_the_solvers_of_diffrax_have_friction():
    import diffrax
    import jax
    import jax.numpy as jnp

    equation = jn.integrate.ode_term(sled())
    with jax.enable_x64(True):
        solution = diffrax.diffeqsolve(
            equation.term, diffrax.Dopri8(), 0.0, 1.0, 0.01, equation.state, args=equation.equations,
            saveat=diffrax.SaveAt(ts=jnp.asarray(TIME)),
            stepsize_controller=diffrax.PIDController(rtol=1e-11, atol=1e-11),
        )  # fmt: skip
    found = equation.motion(solution.ts, solution.ys, order=3).outputs["place"]
    np.testing.assert_allclose(found[:, 1, 0], velocity(), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found[:, 2, 0], -3 * np.tanh(velocity() / 0.05), rtol=0, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("load", [10.0, -30.0])
def test_teeth_press_the_bearings_of_gears(load):
    """Both bearings bear the tooth force F / cos(alpha), whichever flank it is on; in closed form."""
    pin = jn.joints.Friction(coefficient=0.2, radius=0.05, speed=1e-3)
    gears = jn.Mechanism(
        space="planar",
        gravity=[0, 0],
        bodies={"a": jn.Body([0, 0], mass=1.0, inertia=0.01), "b": jn.Body([0.3, 0], mass=2.0, inertia=0.04)},
        joints={
            "A": jn.planar.Revolute(("ground", "a"), [0, 0], [0, 0], friction=pin),
            "B": jn.planar.Revolute(("ground", "b"), [0.3, 0], [0, 0], friction=pin),
            "mesh": jn.planar.Gear(
                ("a", "b"), None, None, [0, 0], [0, 0], radius_i=0.1, radius_j=0.2, pressure_angle=0.6
            ),
        },
        forces={"motor": jn.forces.Torque(("ground", "a"), 6.0), "load": jn.forces.Torque(("ground", "b"), load)},
        initial={"start": jn.drivers.CoordinateDriver(("ground", "a"), "angle", "10*t")},
    )
    run = jn.simulate(gears, [0.0, 0.01], order=3)
    # 0.01 a = 6 - 0.1 F - m |F|, and of b, which turns the other way, 0.04 a / 2 = 0.2 F - load - m |F|
    sign, moment = np.sign(load), 0.2 * 0.05 / math.cos(0.6)
    force, acceleration = np.linalg.solve([[0.1 + sign * moment, 0.01], [-(0.2 - sign * moment), 0.02]], [6.0, -load])
    assert np.sign(force) == sign
    np.testing.assert_allclose(run.angle("a").values[:, 2], acceleration, rtol=1e-11)
    bearing = jn.joint_reaction(run, "B", "b").force.values[:, 0]
    np.testing.assert_allclose(np.hypot(*bearing.T), abs(force) / math.cos(0.6), rtol=1e-11)
