"""Derivatives of simulations by masses, lengths and initial conditions, against variational equations."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jounce as jn

NAMES = ("lift", "m", "c")
VALUES = np.array([0.4, 2.0, 1.0])
INERTIA, GRAVITY = 0.5, 9.81
TIME = [0.0, 1.0, 10.0]

PENDULUM = jn.Mechanism(
    space="planar",
    gravity=[0, -GRAVITY],
    parameters=dict(zip(NAMES, VALUES.tolist(), strict=True)),
    bodies={"rod": jn.Body([0, 0], mass="m", inertia=INERTIA, center_of_mass=["c", 0])},
    joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
    initial={"rise": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion="lift")},
    outputs={"angle": jn.outputs.AngleOutput("rod"), "tip": jn.outputs.PointOutput("rod", ["c", 0])},
)


def angles(values):
    return jn.simulate(PENDULUM.with_parameters(**dict(zip(NAMES, values, strict=True))), TIME, order=1).outputs[
        "angle"
    ]


def variational():
    """Return angle and angular velocity, and how they change with the values, by an integrator of SciPy's."""

    def rate(_, state):
        angle, speed = state[:2]
        m, c = VALUES[1:]
        whole = INERTIA + m * c * c
        pull = m * GRAVITY * c
        by_value = [
            0.0,
            (-GRAVITY * c * whole + pull * c * c) / whole**2,
            (-m * GRAVITY * whole + pull * 2 * m * c) / whole**2,
        ]
        found = [speed, -pull / whole * np.cos(angle)]
        for k in range(3):
            d, v = state[2 + 2 * k : 4 + 2 * k]
            found += [v, pull / whole * np.sin(angle) * d + by_value[k] * np.cos(angle)]
        return found

    start = [VALUES[0], 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    return solve_ivp(rate, (0.0, 10.0), start, "DOP853", TIME, rtol=3e-14, atol=1e-15).y


@functools.cache
def slopes():
    """Return the slopes of a pendulum that swings, and of one that hangs still, by a program that is compiled once."""
    program = jax.jit(jax.jacfwd(angles))
    return [np.asarray(program(jnp.array(values))) for values in (VALUES, [-np.pi / 2, *VALUES[1:]])]


@pytest.mark.slow
def test_ten_seconds_of_a_pendulum():
    known = variational()
    slope = slopes()[0]
    for level in (0, 1):
        expected = known[2 + level :: 2].T
        size = np.abs(expected).max(axis=0)
        assert (np.abs(slope[:, level] - expected) / size).max() < 1e-10

    def last(values):
        found = angles(values)
        return found[-1, 0], found

    reverse, motion = jax.jit(jax.grad(last, has_aux=True))(jnp.array(VALUES))
    np.testing.assert_allclose(reverse, slope[-1, 0], rtol=1e-11)
    np.testing.assert_allclose(motion, angles(VALUES.tolist()), rtol=1e-14)  # that of the simulation


@pytest.mark.slow
def test_forces_that_are_zero_and_a_body_in_even_motion():
    """Forces push the body by x'' = (F sin(30 t) - c x') / 2: the series of the motion itself ends with its speed."""
    mechanism = jn.Mechanism(
        space="planar",
        parameters={"F": 0.0, "v": 1.0, "c": 0.0},
        bodies={"body": jn.Body([0, 0], mass=2.0, inertia=0.5)},
        joints={},
        forces={"push": jn.forces.PointForce("body", [0, 0], ["F*sin(30*t) - c*vx", "0"])},
        initial={
            name: jn.drivers.CoordinateDriver(("ground", "body"), name, motion=motion)
            for name, motion in {"x": "v*t", "y": "0", "angle": "0"}.items()
        },
        outputs={"place": jn.outputs.PointOutput("body", [0, 0])},
    )

    def place(values):
        by_name = dict(zip("Fvc", values, strict=True))
        return jn.simulate(mechanism.with_parameters(**by_name), [0.0, 3.0], order=1).outputs["place"][-1, 0, 0]

    expected = [(3.0 / 30 - np.sin(90.0) / 900) / 2, 3.0, -(3.0**2) / 4]
    np.testing.assert_allclose(jax.jit(jax.jacfwd(place))(jnp.array([0.0, 1.0, 0.0])), expected, rtol=1e-11)


@pytest.mark.slow
def test_a_pendulum_that_hangs_still():
    mass, arm = VALUES[1:]
    frequency = np.sqrt(mass * GRAVITY * arm / (INERTIA + mass * arm**2))
    slope = slopes()[1][..., 0]
    phase = frequency * np.array(TIME)
    expected = np.stack([np.cos(phase), -frequency * np.sin(phase)], axis=-1)
    np.testing.assert_allclose(slope, expected, rtol=1e-10, atol=1e-14)


@pytest.mark.slow
def test_second_derivatives_by_a_mass():
    def angle(mass):
        mechanism = PENDULUM.with_parameters(m=mass)
        return jn.simulate(mechanism, [0.0, 0.2], order=1, method=jn.Taylor(4, step=0.1)).outputs["angle"][-1, 0]

    @jax.jit
    def slope(mass):
        return jax.jvp(angle, (mass,), (1.0,))[1]

    step = 1e-3
    expected = (slope(2.0 + step) - slope(2.0 - step)) / (2 * step)
    found = float(jax.jit(jax.grad(slope))(2.0))
    assert found == pytest.approx(float(expected), rel=1e-5)
    # JAX computes again in reverse what it did not keep, and forgets rules of derivatives there
    assert float(jax.jit(jax.jacfwd(jax.grad(angle)))(2.0)) == pytest.approx(found, rel=1e-12)


@pytest.mark.slow
def test_simulations_are_compiled_and_mapped():
    def last(lift, m=2.0):
        mechanism = PENDULUM.with_parameters(lift=lift, m=m)
        return jn.simulate(mechanism, [0.0, 0.2], order=1, method=jn.Taylor(4, step=0.1)).outputs["angle"][-1]

    compiled = jax.jit(last)  # also under the other transformations, which trace operation by operation otherwise
    value, slope = last(0.4), jax.jacfwd(last)(0.4)
    np.testing.assert_allclose(compiled(0.4), value, rtol=1e-14)
    np.testing.assert_allclose(jax.jacrev(compiled)(0.4), slope, rtol=1e-13)
    lifts = jnp.array([0.4, 0.9])
    np.testing.assert_allclose(jax.vmap(compiled)(lifts), [value, last(0.9)], rtol=1e-14)
    np.testing.assert_allclose(jax.jit(jax.vmap(jax.jacfwd(last)))(lifts)[0], slope, rtol=1e-13)
    with pytest.raises(jax.errors.JaxRuntimeError, match="must not be negative"):
        jax.block_until_ready(jax.jit(last)(0.4, -5.0))


@pytest.mark.slow
def test_what_is_not_reached_is_nan_within_compiled_programs():
    motor = jn.forces.Torque(("ground", "rod"), "k/(0.1 - t)")
    driven = dataclasses.replace(PENDULUM, forces={"motor": motor}, parameters={**PENDULUM.parameters, "k": 0.5})

    def motion(k):
        return jn.simulate(driven.with_parameters(k=k), [0.0, 0.05, 0.2], order=1)

    found = jax.jit(lambda k: (motion(k).outputs["angle"], motion(k).status))(0.5)
    np.testing.assert_array_equal(found[1] == 0, [True, True, False])
    np.testing.assert_array_equal(np.isfinite(found[0]).all(axis=1), [True, True, False])


def test_what_cannot_be_traced_is_reported():
    def by_formulas(m):
        return jn.simulate(PENDULUM.with_parameters(m=m), TIME, method=jn.Obreshkov()).outputs["angle"][-1, 0]

    with pytest.raises(jn.errors.UnsupportedError, match=r"jn\.Taylor\(\)"):
        jax.grad(by_formulas)(2.0)


@pytest.mark.slow
def test_redundant_constraints_are_refused():
    hinge = {"axis_i": [0, 0, 1], "axis_j": [0, 0, 1]}
    door = jn.Mechanism(
        space="spatial",
        parameters={"m": 3.0, "c": 0.5},
        bodies={"door": jn.Body([0, 0, 0], mass="m", inertia=[0.1, 0.2, 0.3], center_of_mass=["c", 0, 0.4])},
        joints={
            "lower": jn.spatial.Revolute(("ground", "door"), [0, 0, 0], [0, 0, 0], **hinge),
            "upper": jn.spatial.Revolute(("ground", "door"), [0, 0, 0.8], [0, 0, 0.8], **hinge),
        },
        outputs={"corner": jn.outputs.PointOutput("door", [1, 0, 0])},
    )

    def last(mass):
        return jn.simulate(door.with_parameters(m=mass), [0.0, 0.1], order=1).outputs["corner"][-1, 0, 0]

    with pytest.raises(jn.errors.MechanismError, match="gradients of mechanisms with redundant constraints"):
        jax.grad(last)(3.0)
