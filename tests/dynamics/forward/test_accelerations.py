"""Forward dynamics: accelerations, multipliers and all their rates at a state, against judges of other formulations."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pinocchio as pin
import pytest
from mpmath import mp
from scipy.special import factorial

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.dynamics.forward.accelerations import State, expand
from jounce.dynamics.forward.initial_state import consistent_start
from jounce.execution.compilation import compiled
from tests.oracles import mp_benchmarks
from tests.oracles.mp_dynamics import Problem
from tests.problems import dynamics, massed

expanded = compiled("order")(expand)
RANDOM = np.random.default_rng(5)


def expansion(mechanism, order, instant=0.0):
    """Return the consistent start of a mechanism and the Taylor coefficients there, as NumPy arrays."""
    ready = consistent_start(mechanism, instant)
    found = expanded(ready.equations, ready.state, np.array([[instant]]), order=order)
    return ready, jax.tree.map(np.asarray, found)


def true_multipliers(ready, found):
    """Return the derivatives of the multipliers of the residuals as they are written, (order, rows), in N or N m."""
    equations = ready.equations
    scale = np.asarray(equations.scale * equations.system.row_scale)[None]
    return (found.multipliers * scale)[..., 0] * factorial(np.arange(len(found.multipliers)))[:, None]


def derivatives(coefficients):
    """Return plain derivatives of Taylor coefficients, order first."""
    orders = np.arange(len(coefficients)).reshape(-1, *[1] * (coefficients.ndim - 1))
    return coefficients * factorial(orders)


def close(found, expected, tolerance):
    """Assert that derivatives agree, order first, by the size of each order, or of its neighbors where it vanishes."""
    found, expected = (np.asarray(x, float).reshape(len(x), -1) for x in (found, expected))
    size = np.max(np.abs(expected), axis=1)
    growth = np.maximum.accumulate(size)  # derivatives grow from order to order
    errors = np.max(np.abs(found - expected), axis=1) / growth
    assert np.max(errors) < tolerance, errors


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_double_pendulum_at_random_states(seed):
    a, b, u, v = np.random.default_rng(seed).uniform(-3, 3, 4)
    _, found = expansion(dynamics.double_pendulum(a, b, u, v), 8)
    with mp.workdps(40):
        quarter = mp.pi / 2
        problem = mp_benchmarks.double_pendulum().start(0, (a + quarter, b + quarter), (u, v)).solve(8)
        expected = np.array(problem.derivatives(*problem.q), float).T
    expected[0] -= np.pi / 2
    close(derivatives(found.state.attitude[:, 0, :, 0]), expected, 2e-14)
    close(derivatives(found.state.spin[:-1, 0, :, 0]), expected[1:], 2e-14)


def swinging_plates(values):
    """Two bodies in the plane, with their centers of mass off the line of their pins, driven by a spring and weight."""
    return jn.Mechanism(
        space="planar",
        gravity=[0.4, -9.81],
        parameters=values,
        bodies={
            "first": jn.Body([0.1, 0.2], "a", mass=1.7, inertia=0.3, center_of_mass=[0.3, -0.2]),
            "second": jn.Body([0.5, 0.5], "b", mass=0.9, inertia=0.05, center_of_mass=[0.1, 0.25]),
        },
        joints={
            "A": planar.Revolute(("ground", "first"), [0.1, 0.2], [0, 0]),
            "B": planar.Revolute(("first", "second"), [0.7, 0.1], [-0.2, 0.1]),
        },
        initial={
            "one": drivers.CoordinateDriver(("ground", "first"), "angle", "a + u*t"),
            "two": drivers.CoordinateDriver(("ground", "second"), "angle", "b + v*t"),
        },
    )


@pytest.mark.slow
def test_multipliers_and_rates_in_the_plane():
    a, b, u, v = 0.7, -1.1, 2.3, -3.1
    ready, found = expansion(swinging_plates({"a": a, "b": b, "u": u, "v": v}), 6)
    state = [np.asarray(part)[..., 0] for part in ready.state]
    with mp.workdps(40):
        problem = Problem()
        first = mp_benchmarks.Planar(problem, "1.7", "0.3", ("0.3", "-0.2"))
        second = mp_benchmarks.Planar(problem, "0.9", "0.05", ("0.1", "0.25"))
        for body, mass in ((first, "1.7"), (second, "0.9")):
            problem.force(mp.mpf(mass) * mp.mpf("0.4"), body.x)
            problem.force(mp.mpf(mass) * mp.mpf("-9.81"), body.y)
        mp_benchmarks.join(problem, [mp.mpf("0.1"), mp.mpf("0.2")], first.point("0", "0"))
        mp_benchmarks.join(problem, first.point("0.7", "0.1"), second.point("-0.2", "0.1"))
        problem.close()
        guess = [*first.at(*state[0][:, 0], a), *second.at(*state[0][:, 1], b)]
        position, velocity = problem.consistent(guess, [0, 0, u, 0, 0, v], fixed=(2, 5))
        problem.start(0, position, velocity).solve(7)
        expected = np.array(problem.derivatives(*problem.multipliers), float).T
        angles = np.array(problem.derivatives(first.angle, second.angle), float).T
    # rows stand group by group: x of both pins, then y of both
    close(true_multipliers(ready, found)[:, [0, 2, 1, 3]], expected[:6], 2e-13)
    close(derivatives(found.state.attitude[:, 0, :, 0]), angles[:7], 2e-13)


@pytest.mark.slow
def test_multipliers_and_rates_in_space():
    spin = np.array([1.3, -2.1, 3.4])
    top = jn.Mechanism(
        space="spatial",
        gravity=[0.3, -0.2, -9.81],
        bodies={
            "top": jn.Body([0.1, 0.2, 0.3], None, [0.6, -0.4, 0.5, 0.48], 1.3, [0.02, 0.03, 0.04], [0.1, 0.2, -0.3])
        },
        joints={"tip": spatial.Spherical(("ground", "top"), [0.1, 0.2, 0.3], [0.0, 0.0, 0.0])},
        outputs={"center": jn.outputs.PointOutput("top", [0.1, 0.2, -0.3])},
    )
    ready = consistent_start(top, 0.0)
    state = ready.state._replace(spin=spin[:, None, None])  # a ball lets the body turn as it will
    found = jax.tree.map(np.asarray, expanded(ready.equations, state, np.zeros((1, 1)), order=6))
    with mp.workdps(40):
        e = [mp.mpf(x) / mp.norm(mp.matrix([0.6, -0.4, 0.5, 0.48])) for x in (0.6, -0.4, 0.5, 0.48)]
        w = [mp.mpf(x) for x in spin]
        rate = [
            (-e[1] * w[0] - e[2] * w[1] - e[3] * w[2]) / 2,
            (e[0] * w[0] - e[3] * w[1] + e[2] * w[2]) / 2,
            (e[3] * w[0] + e[0] * w[1] - e[1] * w[2]) / 2,
            (-e[2] * w[0] + e[1] * w[1] + e[0] * w[2]) / 2,
        ]
        problem = Problem()
        body = mp_benchmarks.Spatial(problem, "1.3", ("0.02", "0.03", "0.04"), ("0.1", "0.2", "-0.3"))
        for weight, x in zip(("0.3", "-0.2", "-9.81"), body.position, strict=True):
            problem.force(mp.mpf("1.3") * mp.mpf(weight), x)
        mp_benchmarks.join(problem, [mp.mpf(x) for x in ("0.1", "0.2", "0.3")], body.point("0", "0", "0"))
        problem.close()
        arm = mp.matrix(["0.1", "0.2", "-0.3"])
        place, velocity = (rotated(e, x) for x in (arm, crossed(w, arm)))
        position = [mp.mpf(x) + r for x, r in zip(("0.1", "0.2", "0.3"), place, strict=True)]
        problem.start(0, [*position, *e], [*velocity, *rate]).solve(7)
        expected = np.array(problem.derivatives(*problem.multipliers[1:]), float).T
        quaternion = np.array(problem.derivatives(*body.coordinates[3:]), float).T
    close(true_multipliers(ready, found), expected[:6], 5e-13)  # 1.3e-13 measured, from small moments of inertia
    close(derivatives(found.state.attitude[..., 0, 0]), quaternion[:7], 1e-13)


def crossed(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def rotated(e, x):
    """Return a vector turned by Euler parameters."""
    once = [p + q for p, q in zip(crossed(e[1:], x), (e[0] * y for y in x), strict=True)]
    return [y + 2 * z for y, z in zip(x, crossed(e[1:], once), strict=True)]


@pytest.mark.slow
def test_spatial_double_pendulum_at_a_random_state():
    angles, rates = (1.05, 0.62), (-1.7, 2.6)
    mechanism = dynamics.spatial_double_pendulum()
    laws = dict(zip(mechanism.initial, zip(angles, rates, strict=True), strict=True))
    initial = {
        name: dataclasses.replace(driver, motion=f"{laws[name][0]} + {laws[name][1]}*t")
        for name, driver in mechanism.initial.items()
    }
    motion = jn.simulate(mechanism, [0.0], order=4, initial=initial)
    with mp.workdps(40):
        problem, tip = mp_benchmarks.spatial_double_pendulum()
        problem.start(0, [mp.mpf(str(x)) for x in angles], [mp.mpf(str(x)) for x in rates]).solve(4)
        expected = np.array(problem.derivatives(*problem.q), float)
        place = np.array(problem.derivatives(*tip), float).T
    for name, values in zip(("first", "second"), expected, strict=True):
        close(motion.outputs[name][0], values, 1e-13)
    close(motion.outputs["tip"][0], place, 1e-13)
    acceleration, jerk = pinocchio_rates(angles, rates)
    found = np.array([motion.outputs[name][0, 2:4] for name in ("first", "second")])
    assert np.allclose(found[:, 0], acceleration, rtol=1e-12)
    assert np.allclose(found[:, 1], jerk, rtol=1e-11)


def pinocchio_rates(angles, rates):
    """Return accelerations and jerk of the same pendulum by Pinocchio's articulated bodies and their derivatives."""
    model = pin.Model()
    model.gravity.linear = np.array([0, 0, -dynamics.GRAVITY])
    parent = 0
    for name, joint, offset, mass, moments in (
        ("first", pin.JointModelRY(), [0, 0, 0], 2.0, [0.03, 0.04, 0.02]),
        ("second", pin.JointModelRX(), [0, 0, -0.5], 1.5, [0.05, 0.02, 0.06]),
    ):
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array(offset, float)), name)
        inertia = pin.Inertia(mass, np.array([0, 0, -0.3]), np.diag(moments))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    data, q, v = model.createData(), np.array(angles), np.array(rates)
    acceleration = pin.aba(model, data, q, v, np.zeros(2)).copy()
    by_q, by_v, _ = pin.computeABADerivatives(model, data, q, v, np.zeros(2))
    return acceleration, by_q @ v + by_v @ acceleration


@pytest.mark.slow
def test_inverse_after_forward_returns_the_applied_torque_and_its_rates():
    """Move a mechanism by a torque, drive it along the same motion instead, and compare what the driver does."""
    order, bodies = 4, ("ground", "crank")
    free = dataclasses.replace(
        dynamics.free_four_bar(),
        forces={"motor": forces.Torque(bodies, "2.5*sin(7*t + 0.4)")},
        initial={"start": drivers.CoordinateDriver(bodies, "angle", "1 + 3*t")},
    )
    expected = [2.5 * 7**k * np.sin(0.4 + k * np.pi / 2) for k in range(order - 1)]
    moved = jn.simulate(free, [0.0], order=order).outputs["crank"][0]
    names = [f"c{k}" for k in range(order + 1)]
    series = " + ".join(f"{name}*t**{k}" for k, name in enumerate(names))
    law = jn.laws.ExpressionMotion(series, dict(zip(names, moved / factorial(np.arange(order + 1)), strict=True)))
    driver = drivers.CoordinateDriver(bodies, "angle", law)
    driven = dataclasses.replace(free, forces={}, initial={}, drivers={"motor": driver})
    found = np.asarray(jn.driver_force(jn.solve(driven, [0.0], order=order), "motor"))[0]
    for k, (value, exact) in enumerate(zip(found, expected, strict=True)):
        assert abs(value - exact) < 1e-11 * max(abs(exact), abs(expected[max(k - 1, 0)])), k


@pytest.mark.slow
def test_a_driven_mechanism_moves_as_kinematics_says():
    mechanism = massed.massed_example("slider_crank")
    instant = 0.13
    ready, found = expansion(mechanism, 6, instant)
    driven = jn.solve(mechanism, [instant], order=6)
    _, coordinates = driven.poses
    close(derivatives(found.state.position[..., 0]), derivatives(coordinates["position"][:, :, 1:, 0]), 1e-12)
    close(derivatives(found.state.attitude[:, 0, :, 0]), derivatives(coordinates["angle"][:, 1:, 0]), 1e-12)
    assert ready.mobility.startswith("no degree of freedom")


@pytest.mark.slow
def test_multiplier_rates_are_those_of_differenced_multipliers():
    ready, found = expansion(dynamics.double_pendulum(0.3, 1.2, 2.0, -1.0), 20)
    width = 0.01
    steps = np.array([-2, -1, 1, 2, -4, 4]) * width
    powers = steps ** np.arange(21.0)[:, None]
    states = State(*(np.sum(part * powers[:, None, None], axis=0) for part in found.state))
    beside = expanded(ready.equations, states, jnp.asarray(steps)[None], order=8)
    values = np.concatenate([beside.acceleration[0].reshape(6, -1), beside.multipliers[0]])
    rate = np.concatenate([found.acceleration[1].reshape(6), found.multipliers[1, :, 0]])

    def errors(near, far):
        """Return the errors of differences of order 2 and 4, from neighbors at one and two widths."""
        first = (values[:, near[1]] - values[:, near[0]]) / (steps[near[1]] - steps[near[0]])
        second = (values[:, far[1]] - values[:, far[0]]) / (steps[far[1]] - steps[far[0]])
        return np.linalg.norm(first - rate), np.linalg.norm((4 * first - second) / 3 - rate)

    narrow, wide = errors((1, 2), (0, 3)), errors((0, 3), (4, 5))
    orders = np.log2(np.array(wide) / np.array(narrow))
    assert np.allclose(orders, [2, 4], atol=0.05), orders


@pytest.mark.slow
def test_lanes_of_a_batch_are_runs_of_their_own():
    single = [expansion(dynamics.double_pendulum(a, -a, 1.0, a), 6) for a in (0.2, 0.9, 2.0)]
    states = State(*(np.concatenate(parts, axis=-1) for parts in zip(*(r.state for r, _ in single), strict=True)))
    together = expanded(single[0][0].equations, states, np.zeros((1, 3)), order=6)
    for lane, (_, one) in enumerate(single):
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(together), strict=True):
            assert np.allclose(a[..., 0], b[..., lane], rtol=1e-13, atol=1e-13 * np.abs(a).max())


@pytest.mark.slow
def test_free_fall_has_no_higher_coefficients():
    _, found = expansion(dynamics.thrown_stone(), 8)
    place = np.zeros((9, 2))
    place[:3] = [[1, 2], [2, 5], [0, -9.81 / 2]]
    assert np.allclose(found.state.position[..., 0, 0], place, rtol=1e-15, atol=1e-15)
    assert np.allclose(found.state.attitude[:2, 0, 0, 0], [0.5, -3], rtol=1e-15)
    assert not np.any(found.state.attitude[2:])
