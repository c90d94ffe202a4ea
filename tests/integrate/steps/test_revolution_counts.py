"""Turns of angles about axes in space, counted along simulations: closed forms, which know no turns."""

import functools
import importlib

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces
from jounce.integrate.steps.revolution_counts import attitudes_along, attitudes_at

BODIES, Z, ORIGIN = ("ground", "rotor"), [0, 0, 1], [0, 0, 0]
STIFFNESS = INERTIA = 2.0  # a vibration with a period of 2 pi
WOUND = 6 * np.pi
TIME = np.linspace(0.0, 7.0, 8)
ANGLE = jn.outputs.RelativeAngleOutput(BODIES, Z)
VECTORS = jn.outputs.RelativeAngleOutput(BODIES, Z, [1, 0, 0], [1, 0, 0])


def rotor(kind="spring", wound=WOUND):
    """A free body that a torsional spring, or a torque by its law, turns to and fro about an axis of inertia.

    It has both, of which one is zero: so all tests have one mechanism, which is compiled once.
    """
    return jn.Mechanism(
        space="spatial",
        parameters={"wound": wound, "k": STIFFNESS * (kind == "spring"), "c": STIFFNESS * (kind == "torque")},
        bodies={"rotor": jn.Body(ORIGIN, mass=1.0, inertia=np.diag([1.0, 1.5, INERTIA]).tolist())},
        joints={},
        forces={
            "spring": forces.SpatialTorsionalSpring(BODIES, Z, "k"),
            "torque": forces.SpatialTorque(BODIES, Z, "-c*x"),
        },
        initial={"start": drivers.RotationDriver(BODIES, Z, "wound")},
        outputs={"angle": ANGLE},
    )


@functools.cache
def released(kind="spring"):
    return jn.simulate(rotor(kind), TIME, order=2)


def closed_form(time, orders=3, wound=WOUND):
    return wound * np.stack([np.cos(time + k * np.pi / 2) for k in range(orders)], axis=-1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["spring", "torque"])
def test_a_spring_wound_up_by_three_turns_swings_three_turns_to_either_side(kind):
    found = released(kind)
    np.testing.assert_allclose(found.outputs["angle"], closed_form(TIME), rtol=0, atol=1e-12)
    torque = jn.dynamics.applied_force(found, kind).values
    np.testing.assert_allclose(torque, -STIFFNESS * closed_form(TIME, 2), rtol=0, atol=1e-11)
    if kind == "spring":
        assert np.ptp(found.energy) < 1e-13 * found.energy[0]
        assert found.energy[0] == pytest.approx(0.5 * STIFFNESS * WOUND**2, rel=1e-13)
        stored = jn.dynamics.stored_energy(found)
        np.testing.assert_allclose(stored, 0.5 * STIFFNESS * closed_form(TIME)[:, 0] ** 2, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_in_the_plane_where_nothing_but_the_angle_moves():
    """Of what the program of the march is given, much is without effect here, and XLA leaves it out."""
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"rotor": jn.Body([0, 0], mass=1.0, inertia=INERTIA)},
        joints={},
        forces={"twist": forces.TorsionalSpring(BODIES, STIFFNESS)},
        initial={"start": drivers.CoordinateDriver(BODIES, "angle", WOUND)},
        outputs={"angle": jn.outputs.AngleOutput("rotor")},
    )
    found = jn.simulate(mechanism, TIME, order=2)
    np.testing.assert_allclose(found.outputs["angle"], closed_form(TIME), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_its_power_balance_closes():
    balance = jn.energy.power_balance(released())
    assert float((abs(balance["residual"]) / balance["scale"]).max()) < 1e-13


@pytest.mark.slow
def test_any_instants_and_outputs_asked_for_later_have_the_same_turns():
    found = released()
    other = np.array([0.1, 2.9, 3.0, 3.3, 6.7])
    np.testing.assert_allclose(found.at(other).outputs["angle"], closed_form(other), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.at([3.0]).energy, found.energy[:1], rtol=1e-13)
    for output in (ANGLE, VECTORS):
        np.testing.assert_allclose(found.evaluate(output).values, closed_form(TIME), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_and_backward_in_time():
    found = jn.simulate(rotor(), -TIME, order=2)
    np.testing.assert_allclose(found.outputs["angle"], closed_form(-TIME), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_an_event_after_turns_ends_the_motion_with_its_turns():
    passing = jn.Event(ANGLE, value=-4 * np.pi, terminal=True)
    found = jn.simulate(rotor(), TIME, order=2, events=[passing])
    when = np.arccos(-2 / 3)
    assert found.events[0] == [pytest.approx(when, abs=1e-12)]
    last = found.at([when])
    assert jn.dynamics.applied_force(last, "spring").values[0, 0] == pytest.approx(STIFFNESS * 4 * np.pi, abs=1e-10)


@pytest.mark.slow
def test_implicit_formulas_count_turns():
    found = jn.simulate(rotor(), TIME, order=2, method=jn.Obreshkov(6, step=0.01), tolerance=1e-15)
    np.testing.assert_allclose(found.outputs["angle"], closed_form(TIME), rtol=0, atol=1e-9)


@pytest.mark.slow
def test_runs_side_by_side_have_turns_of_their_own():
    wound = np.array([0.5, WOUND, -4 * np.pi, 20.0, 2.0, 3.2])
    found = jn.simulate_batch(rotor(wound=0.3), {"wound": wound}, TIME, 2).outputs["angle"]
    expected = wound[:, None, None] * closed_form(TIME, 3, 1.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_the_solvers_of_diffrax_carry_the_turns_along():
    diffrax = importlib.import_module("diffrax")
    equation = jn.integrate.ode_term(rotor())
    solution = diffrax.diffeqsolve(
        equation.term,
        diffrax.Dopri8(),
        0.0,
        TIME[-1],
        0.01,
        equation.state,
        args=equation.equations,
        saveat=diffrax.SaveAt(ts=jnp.asarray(TIME)),
        stepsize_controller=diffrax.PIDController(rtol=1e-11, atol=1e-11),
    )
    motion = equation.motion(solution.ts, solution.ys, order=2)
    torque = jn.dynamics.applied_force(motion, "spring").values[:, 0]
    np.testing.assert_allclose(torque, -STIFFNESS * closed_form(TIME, 1)[:, 0], rtol=0, atol=1e-7)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_attitudes_along_steps_are_those_at_their_instants(sense):
    random = np.random.default_rng(3)
    series = random.normal(size=(5, 12, 4, 2)) / np.cumprod([1.0, *np.arange(1.0, 12)])[:, None, None]
    series[3, 2:] = 0.0  # an even turn, for as long as nobody asks for another step
    length = sense * np.array([0.3, 0.7, 1.1, 1e40, 0.2])
    found = attitudes_along(series, length, 8)
    step, share = np.repeat(np.arange(5), 8), np.tile(np.arange(8) / 8, 5)
    step, share = np.append(step, 4), np.append(share, 1.0)
    expected = attitudes_at(series[step], share * length[step])
    assert found.shape == (4, 3, 41)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(found[:, 0], np.eye(4)[:, :1] * np.ones(41))
