"""Derivatives of simulations of robots by inertias: closed forms of springs, differences of an arm that is pushed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.errors import UnsupportedError

TIME = np.array([0.0, 0.5, 3.0, 10.0])
MASS, STIFFNESS, GRAVITY = 2.0, 4.0, 9.81


def cart(axis):
    rail = jn.Joint("x", "base", "a", "prismatic", axis=axis, stiffness=STIFFNESS)
    return jn.Robot("cart", [jn.Link("base"), jn.Link("a", jn.Inertia(MASS))], [rail])


@pytest.mark.slow
def test_a_mass_on_a_spring_in_both_modes():
    """Positions cos(w t) + sin(w t) / (2 w), w the root of k / m."""

    def positions(mass):
        return jn.simulate(cart([1, 0, 0]).with_inertia("a", mass=mass), TIME, 3, state=[[1.0], [0.5]]).q[:, :2, 0]

    w = np.sqrt(STIFFNESS / MASS)
    c, s = np.cos(w * TIME), np.sin(w * TIME)
    by_frequency = [
        -s * TIME + 0.5 * c * TIME / w - 0.5 * s / w**2,
        -s - w * c * TIME - 0.5 * s * TIME,
    ]
    expected = np.stack(by_frequency, axis=1) * (-w / (2 * MASS))
    with jax.enable_x64(True):
        np.testing.assert_allclose(jax.jacfwd(positions)(MASS), expected, rtol=0, atol=1e-13)
        last = jax.grad(lambda mass: positions(mass)[-1, 0])(MASS)
    assert float(last) == pytest.approx(expected[-1, 0], abs=1e-13)


@pytest.mark.slow
def test_a_mass_on_a_spring_by_its_state_at_the_start_in_both_modes():
    """Positions x cos(w t) + v sin(w t) / w, of which the derivatives by x and v are those of the closed form."""
    track = cart([1, 0, 0])

    def positions(state):
        return jn.simulate(track, TIME, 3, state=state).q[:, :2, 0]

    w = np.sqrt(STIFFNESS / MASS)
    c, s = np.cos(w * TIME), np.sin(w * TIME)
    expected = np.stack([np.stack([c, s / w], axis=1), np.stack([-w * s, c], axis=1)], axis=1)  # of time, level, state
    with jax.enable_x64(True):
        np.testing.assert_allclose(
            jax.jacfwd(positions)(jnp.array([[1.0], [0.5]]))[..., 0], expected, rtol=0, atol=1e-13
        )
        by_state = jax.grad(lambda state: positions(state)[-1, 0])(jnp.array([[1.0], [0.5]]))
        by_name = jax.grad(lambda x: positions({"x": x})[-1, 1])(1.0)
    np.testing.assert_allclose(by_state[:, 0], expected[-1, 0], rtol=0, atol=1e-13)
    assert float(by_name) == pytest.approx(expected[-1, 1, 0], abs=1e-13)


@pytest.mark.slow
def test_runs_of_a_batch_by_what_they_differ_in_in_both_modes():
    """By each position at the start and each mass; a run does not change with those of another."""
    track, mass = cart([1, 0, 0]), np.array([2.0, 3.0])
    start, rate = np.array([1.0, 0.4]), np.array([0.5, -0.3])

    def positions(x, v, m):
        parameters = {"x": x, "x.rate": v, "a.mass": m}
        return jn.simulate_batch(track, parameters, TIME, 2).outputs["x"][..., 0]

    w = np.sqrt(STIFFNESS / mass)[:, None]
    c, s = np.cos(w * TIME), np.sin(w * TIME)
    x, v = start[:, None], rate[:, None]
    by_mass = (-x * TIME * s + v * (TIME * c / w - s / w**2)) * (-w / (2 * mass[:, None]))
    given = (jnp.asarray(start), jnp.asarray(rate), jnp.asarray(mass))
    with jax.enable_x64(True):
        given = tuple(map(jnp.asarray, (start, rate, mass)))
        found = jax.jacfwd(positions, argnums=(0, 1, 2))(*given)
        total = jax.grad(lambda *runs: positions(*runs)[:, -1].sum(), argnums=(0, 1, 2))(*given)
    for slope, by_all, expected in zip(found, total, (c, s / w, by_mass), strict=True):
        whole = np.zeros((2, len(TIME), 2))
        whole[[0, 1], :, [0, 1]] = expected
        np.testing.assert_allclose(slope, whole, rtol=0, atol=1e-13)
        np.testing.assert_allclose(by_all, expected[:, -1], rtol=0, atol=1e-13)


@pytest.mark.slow
def test_beside_an_equilibrium_the_change_moves_though_the_motion_does_not():
    hanging = cart([0, 0, 1])

    def positions(mass):
        state = [[-MASS * GRAVITY / STIFFNESS], [0.0]]
        return jn.simulate(hanging.with_inertia("a", mass=mass), TIME, 2, state=state).q[:, 0, 0]

    w = np.sqrt(STIFFNESS / MASS)
    with jax.enable_x64(True):
        _, change = jax.jvp(positions, (MASS,), (1.0,))
    np.testing.assert_allclose(change, -GRAVITY / STIFFNESS * (1 - np.cos(w * TIME)), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_an_arm_with_a_wrench_a_law_and_damping_against_differences():
    body = jn.Inertia(2.0, [0.3, 0.1, 0], [0.02, 0.03, 0.04])
    joints = [
        jn.Joint("j", "base", "a", axis=[0, 1, 0], stiffness=3.0),
        jn.Joint("k", "a", "b", position=[0.5, 0, 0], axis=[0, 1, 1]),
    ]
    arm = jn.Robot("arm", [jn.Link("base"), jn.Link("a", body), jn.Link("b", body)], joints)
    pushes = [jn.robot.Wrench("b", force=lambda t: jnp.stack([jnp.sin(t), 0 * t, 1 + 0 * t]))]
    time = [0.0, 0.7, 1.5]

    def motion(values):
        own = arm.with_inertia("b", mass=values[0], center_of_mass=values[1:4], tensor=jnp.diag(values[4:]))
        options = {"state": [[0.3, 0.1], [0.0, 1.0]], "torque": {"k": "0.2*sin(t) - 0.1*k_d1"}, "wrenches": pushes}
        return jn.simulate(own, time, 3, **options).q

    values = np.array([2.0, 0.3, 0.1, 0.0, 0.02, 0.03, 0.04])
    with jax.enable_x64(True):
        slopes = np.moveaxis(np.asarray(jax.jacfwd(motion)(jnp.asarray(values))), -1, 0)
    for k, slope in enumerate(slopes):
        step = np.eye(7)[k] * 1e-3
        near, far = (
            (np.asarray(motion(values + n * step)) - np.asarray(motion(values - n * step))) / (2 * n * 1e-3)
            for n in (1, 2)
        )
        np.testing.assert_allclose(slope, (4 * near - far) / 3, rtol=1e-6, atol=1e-7 * np.abs(slopes).max())


@pytest.mark.slow
def test_what_is_not_differentiated_is_reported():
    def stopped(mass):
        return jn.simulate(cart([1, 0, 0]).with_inertia("a", mass=mass), TIME, 2, state=[[1.0], [0.0]]).q[-1, 0, 0]

    def rough(mass):
        options = {"state": [[1.0], [0.0]], "torque": {"x": "-0.5*sign(x_d1)"}}
        return jn.simulate(cart([1, 0, 0]).with_inertia("a", mass=mass), TIME[:3], 2, **options).q[-1, 0, 0]

    with jax.enable_x64(True):
        with pytest.raises(UnsupportedError, match="differentiate it outside"):
            jax.jit(stopped)(MASS)
        with pytest.raises(UnsupportedError, match="a force jumps at t = "):
            jax.grad(rough)(MASS)
