"""Turns of angles about axes in space, counted along simulations as the angles of bodies in the plane have them."""

import functools
import importlib

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces

BODIES, Z, ORIGIN = ("ground", "rotor"), [0, 0, 1], [0, 0, 0]
STIFFNESS = INERTIA = 2.0  # a vibration with a period of 2 pi
WOUND = 6 * np.pi
TIME = np.linspace(0.0, 7.0, 8)
ANGLE = jn.RelativeAngleOutput(BODIES, Z)
VECTORS = jn.RelativeAngleOutput(BODIES, Z, [1, 0, 0], [1, 0, 0])


def rotor(space, kind="spring", wound=WOUND):
    """A free body that a torsional spring, or a torque by its law, turns to and fro about an axis of inertia."""
    spatial = space == "spatial"
    if kind == "spring":
        twist = forces.SpatialTorsionalSpring(BODIES, Z, STIFFNESS) if spatial else forces.TorsionalSpring(BODIES, 2.0)
    else:
        twist = forces.SpatialTorque(BODIES, Z, "-2*x") if spatial else forces.Torque(BODIES, "-2*x")
    if spatial:
        body = jn.Body(ORIGIN, mass=1.0, inertia=np.diag([1.0, 1.5, INERTIA]).tolist())
        start = drivers.RotationDriver(BODIES, Z, "wound")
    else:
        body = jn.Body([0, 0], mass=1.0, inertia=INERTIA)
        start = drivers.CoordinateDriver(BODIES, "angle", "wound")
    return jn.Mechanism(
        space=space,
        parameters={"wound": wound},
        bodies={"rotor": body},
        joints={},
        forces={"twist": twist},
        initial={"start": start},
        outputs={"angle": ANGLE if spatial else jn.AngleOutput("rotor")},
    )


@functools.cache
def released(space, kind="spring", backward=False):
    return jn.simulate(rotor(space, kind), TIME[::-1] - TIME[-1] * backward if backward else TIME, order=4)


def closed_form(time, orders=5, wound=WOUND):
    return wound * np.stack([np.cos(time + k * np.pi / 2) for k in range(orders)], axis=-1)


KINDS = ["spring", pytest.param("torque", marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_spring_wound_up_by_three_turns_swings_three_turns_to_either_side(kind):
    found = released("spatial", kind)
    np.testing.assert_allclose(found.outputs["angle"], closed_form(TIME), rtol=0, atol=1e-12)
    plane = released("planar", kind)
    np.testing.assert_allclose(found.outputs["angle"], plane.outputs["angle"], rtol=0, atol=1e-12)
    torque = jn.applied_force(found, "twist").values
    np.testing.assert_allclose(torque, -STIFFNESS * closed_form(TIME, 4), rtol=0, atol=1e-11)
    if kind == "spring":
        assert np.ptp(found.energy) < 1e-13 * found.energy[0]
        assert found.energy[0] == pytest.approx(0.5 * STIFFNESS * WOUND**2, rel=1e-13)
        stored = jn.dynamics.stored_energy(found)
        np.testing.assert_allclose(stored, 0.5 * STIFFNESS * closed_form(TIME)[:, 0] ** 2, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_its_power_balance_closes():
    balance = jn.power_balance(released("spatial"))
    assert float((abs(balance["residual"]) / balance["scale"]).max()) < 1e-13


@pytest.mark.slow
def test_any_instants_and_outputs_asked_for_later_have_the_same_turns():
    found = released("spatial")
    other = np.array([0.1, 2.9, 3.0, 3.3, 6.7])
    np.testing.assert_allclose(found.at(other).outputs["angle"], closed_form(other), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.at([3.0]).energy, found.energy[:1], rtol=1e-13)
    for output in (ANGLE, VECTORS):
        np.testing.assert_allclose(found.evaluate(output).values, closed_form(TIME), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_and_backward_in_time():
    found = jn.simulate(rotor("spatial"), -TIME, order=4)
    np.testing.assert_allclose(found.outputs["angle"], closed_form(-TIME), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_an_event_after_turns_ends_the_motion_with_its_turns():
    passing = jn.Event(ANGLE, value=-4 * np.pi, terminal=True)
    found = jn.simulate(rotor("spatial"), TIME, order=4, events=[passing])
    when = np.arccos(-2 / 3)
    assert found.events[0] == [pytest.approx(when, abs=1e-12)]
    last = found.at([when])
    assert jn.applied_force(last, "twist").values[0, 0] == pytest.approx(STIFFNESS * 4 * np.pi, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(
    "method, tolerance, error",
    [(jn.Taylor(step=0.2), 1e-15, 1e-12), (jn.Obreshkov(6, step=0.01), 1e-15, 1e-9)],
    ids=["taylor", "obreshkov"],
)
def test_all_methods_count_turns(method, tolerance, error):
    found = jn.simulate(rotor("spatial"), TIME, order=2, method=method, tolerance=tolerance)
    np.testing.assert_allclose(found.outputs["angle"], closed_form(TIME, 3), rtol=0, atol=error)


@pytest.mark.slow
def test_runs_side_by_side_have_turns_of_their_own():
    wound = np.array([0.5, WOUND, -4 * np.pi, 20.0, 2.0, 3.2])
    found = jn.simulate_batch(rotor("spatial", wound=0.3), {"wound": wound}, TIME, 2).outputs["angle"]
    expected = wound[:, None, None] * closed_form(TIME, 3, 1.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    plane = jn.simulate_batch(rotor("planar", wound=0.3), {"wound": wound}, TIME, 2).outputs["angle"]
    np.testing.assert_allclose(found, plane, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_the_solvers_of_diffrax_carry_the_turns_along():
    diffrax = importlib.import_module("diffrax")
    equation = jn.ode_term(rotor("spatial"))
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
    torque = jn.applied_force(motion, "twist").values[:, 0]
    np.testing.assert_allclose(torque, -STIFFNESS * closed_form(TIME, 1)[:, 0], rtol=0, atol=1e-7)
