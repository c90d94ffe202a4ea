"""Jacobians as jets, and the factors that solve for multipliers, beside differences and plain linear algebra."""

import dataclasses
from functools import partial

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.forward.loads import inertia_forces, mass_matrices
from jounce.dynamics.inverse.constraint_forces import balancing, multipliers
from jounce.dynamics.masses import Masses
from jounce.jet import Jet
from jounce.kinematics.sensitivity.jacobian_series import slopes
from jounce.mechanism import build
from jounce.mechanism.system import law_left_out
from jounce.testing.samples import group_of, pose_of, random_motion
from tests.problems.bank import cases
from tests.problems.massed import arm

STEP = 1e-3


def moved(motion, step):
    """The same motion of polynomials seen from an instant a step later."""
    found = {}
    for name, series in motion.items():
        degree = len(series) - 1
        shifted = [
            sum(np.array(binomial(j, k)) * series[j] * step ** (j - k) for j in range(k, degree + 1))
            for k in range(degree + 1)
        ]
        found[name] = np.stack(shifted)
    return found


def binomial(n, k):
    return float(np.prod([(n - i) / (i + 1) for i in range(k)])) if k else 1.0


@pytest.mark.slow
@pytest.mark.parametrize("case", cases(), ids=str)
def test_slopes_are_the_jacobian_and_its_rates(case):
    random = np.random.default_rng(7)
    group = group_of([case.element(random)], case.space)
    motion = random_motion(random, case.space, 4)
    scale = np.ones(3 if case.space == "planar" else 6)
    order = 2 if case.space == "planar" else 1  # in space second rates take long to compile

    @jax.jit
    def jets(motion):
        pose = pose_of({name: series[: order + 1] for name, series in motion.items()})
        poses = [pose.take(bodies) for bodies in group.bodies]
        return [slopes(group.element, poses, Jet.variable(np.zeros((1, 1)), order), slot) for slot in range(len(poses))]

    @jax.jit
    def plain(motion, now):
        still = pose_of({name: series[:1] for name, series in motion.items()})
        return group.derivative_blocks(still, Jet.constant(now, 1), scale)

    found = jets(motion)
    at = [plain(moved(motion, k * STEP), np.full((1, 1), k * STEP)) for k in (-2, -1, 0, 1, 2)]
    for slot, slope in enumerate(found):
        far, near, here, after, further = (blocks[slot] for blocks in at)
        size = float(np.abs(slope).max())
        np.testing.assert_allclose(slope[0], here, atol=1e-14 * size)
        first = (far - 8 * near + 8 * after - further) / (12 * STEP)
        second = (-far + 16 * near - 30 * here + 16 * after - further) / (12 * STEP**2)
        # differences of fourth order err by h^4 times a fifth derivative, and by rounding over the step
        np.testing.assert_allclose(slope[1], first, atol=1e-9 * size)
        if order > 1:
            np.testing.assert_allclose(2 * slope[2], second, atol=1e-6 * size)


@pytest.mark.slow
@pytest.mark.parametrize("case", [case for case in cases() if case.kind.role == "driver"], ids=str)
def test_slopes_do_not_depend_on_the_laws_that_are_left_out(case):
    random = np.random.default_rng(11)
    group, motion = group_of([case.element(random)], case.space), random_motion(random, case.space, 3)
    bare, pose = law_left_out(group), pose_of(motion)
    assert type(bare.element.motion) is not type(group.element.motion)

    @partial(jax.jit, static_argnums=1)
    def slope(group, slot):
        poses = [pose.take(bodies) for bodies in group.bodies]
        return slopes(group.element, poses, Jet.variable(np.full((1, 1), 0.3), 3), slot)

    for slot in range(len(group.bodies)):
        found, expected = slope(bare, slot), slope(group, slot)
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-14 * np.abs(expected).max())


class Stretched(jn.drivers.CoordinateDriver):
    """A driver of one's own: what its law is decides how its residual changes with the body."""

    def residual(self, body_i, body_j, time):
        law = self.motion(time)
        return (self.evaluate(body_i, body_j) - law) * (2.0 + law * law)


@pytest.mark.slow
def test_a_law_that_slopes_may_depend_on_is_kept():
    """The torque is that of an ordinary driver: Jacobian and conjugate of the law are stretched alike."""
    plain = arm(mass=2.0, inertia=0.3, center_of_mass=[0.5, 0.0])
    driver = plain.drivers["turn"]
    own = dataclasses.replace(plain, drivers={"turn": Stretched(driver.bodies, driver.coordinate, driver.motion)})
    time = np.linspace(0.0, 1.0, 5)
    found, expected = (jn.driver_force(jn.solve(mechanism, time), "turn").values for mechanism in (own, plain))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


class Renamed(jn.drivers.DistanceDriver):
    """A driver of one's own that calls something else its coordinate."""

    def evaluate(self, body_i, body_j):
        return 0.5 * super().evaluate(body_i, body_j)


@pytest.mark.parametrize("kind", [jn.drivers.DistanceDriver, Renamed])
def test_what_a_driver_exerts_by_a_square_of_its_law(kind):
    """A block on rails, x = 2 + t^2 / 2, pushed from a point beside them: F = m x'' d / x."""
    block = jn.Mechanism(
        space="planar",
        bodies={"block": jn.Body([2, 0], mass=3.0, inertia=1.0)},
        joints={"rails": jn.planar.Prismatic(("ground", "block"), [0, 0], [0, 0], [1, 0], [1, 0])},
        drivers={"push": kind(("ground", "block"), [0, 1], [0, 0], "sqrt(1 + (2 + t**2 / 2)**2)")},
    )
    time = np.linspace(0.0, 2.0, 5)
    x, rate = 2 + time**2 / 2, time
    d = np.sqrt(1 + x**2)
    force, yank = 3 * d / x, 3 * (rate / d - d * rate / x**2)
    found = jn.driver_force(jn.solve(block, time, order=3), "push").values
    np.testing.assert_allclose(found[:, 0], force, rtol=1e-13)
    np.testing.assert_allclose(found[:, 1], yank, rtol=1e-12, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_mass_matrices_give_the_kinetic_energy(space):
    random = np.random.default_rng(3)
    motion = random_motion(random, space, 2)
    pose = pose_of(motion)
    size, count = (2, 3) if space == "planar" else (3, 6)
    bodies = pose.position.shape[1]
    mass, center = random.uniform(1, 2, (bodies, 1)), random.normal(size=(size, bodies, 1))
    root = random.normal(size=(size, size, bodies))
    moments = np.einsum("ikb,jkb->ijb", root, root)[..., None]
    matrices = np.asarray(mass_matrices(pose.truncate(0), Masses(mass, center, moments)))
    spin = pose.angle.differentiate()[None] if space == "planar" else pose.angular_velocity
    velocity = np.concatenate([pose.position.coefficients[1], spin.coefficients[0]])
    energy = 0.5 * np.einsum("ibt,ijbt,jbt->bt", velocity, matrices, velocity)
    translation, rotation = jn.dynamics.body_energy(pose, mass, center, moments, 0)
    np.testing.assert_allclose(energy, translation.coefficients[0] + rotation.coefficients[0], rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(matrices, np.swapaxes(matrices, 0, 1), atol=1e-14 * np.abs(matrices).max())
    assert matrices.shape == (count, count, bodies, 1)


def test_bodies_at_rest_have_their_weight_for_a_load():
    still = pose_of(
        {
            name: np.concatenate([s[:1], 0 * s[:1], 0 * s[:1]])
            for name, s in random_motion(np.random.default_rng(1), "spatial", 1).items()
        }
    )
    bodies = still.position.shape[1]
    gravity = np.array([0.0, 0.0, -9.81])[:, None, None]
    mass, center = np.full((bodies, 1), 2.0), np.zeros((3, bodies, 1))
    force, moment = inertia_forces(still, Masses(mass, center, np.zeros((3, 3, bodies, 1))), gravity)
    np.testing.assert_allclose(force.coefficients[0][2], 2.0 * 9.81, rtol=1e-15)
    assert np.abs(moment.coefficients[0]).max() <= 1e-15


def test_multipliers_solve_the_equations_of_motion():
    random = np.random.default_rng(5)
    root, jacobian, load = random.normal(size=(7, 7, 3)), random.normal(size=(4, 7, 3)), random.normal(size=(7, 3))
    mass = np.einsum("ikb,jkb->ijb", root, root)
    found = np.asarray(balancing(mass, jacobian)(load))
    for k in range(3):
        m, j = np.linalg.inv(mass[..., k]), jacobian[..., k]
        expected = np.linalg.solve(j @ m @ j.T, j @ m @ load[:, k])
        np.testing.assert_allclose(found[:, k], expected, rtol=1e-9)


@pytest.mark.slow
def test_multipliers_balance_loads_to_every_order_by_the_coefficients_that_it_needs():
    bar = jn.Mechanism(
        space="planar",
        bodies={"bar": jn.Body([0, 0])},
        joints={"O": jn.planar.Revolute(("ground", "bar"), [0, 0], [0, 0])},
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "bar"), "angle", "t")},
    )
    random, levels, lanes = np.random.default_rng(7), 5, 3
    blocks = [[random.normal(size=(levels, 3, rows, 1, lanes))] for rows in (2, 1)]
    load = random.normal(size=(levels, 3, 1, lanes))
    transposed = np.concatenate([slope[:, :, :, 0] for (slope,) in blocks], axis=2)
    expected = []
    for k in range(levels):
        missing = load[k, :, 0] - sum(np.einsum("crb,rb->cb", transposed[j], expected[k - j]) for j in range(1, k + 1))
        solved = [np.linalg.solve(transposed[0, ..., b], missing[:, b]) for b in range(lanes)]
        expected.append(np.stack(solved, axis=-1))
    system = build(bar).system
    found = np.asarray(multipliers(system, blocks, load))
    np.testing.assert_allclose(found, np.stack(expected), rtol=1e-9)
    blocks[1][0][3] = np.nan  # as of a law that has no finite third derivative
    found = np.asarray(multipliers(system, blocks, load))
    np.testing.assert_allclose(found[:3], np.stack(expected[:3]), rtol=1e-9)
    assert np.isnan(found[3:]).any(axis=1).all()
    one = np.asarray(multipliers(system, blocks, load[:1]))
    np.testing.assert_allclose(one, np.stack(expected[:1]), rtol=1e-9)
