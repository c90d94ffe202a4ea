"""Batches: shapes and sizes of all kinds, one compilation for each width, kinds of arrays, values at the margins."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.execution.background import ByKey
from jounce.execution.llvm import modules
from jounce.execution.llvm.programs import Program
from jounce.jet.derivatives import plain_derivatives, taylor_coefficients
from jounce.robot.algorithms import forward_dynamics as forward_dynamics_
from jounce.robot.algorithms.inverse_dynamics import generalized_forces
from jounce.robot.recursions.batches import WIDTHS
from tests.problems.robots import random_robot

ROBOT = random_robot(5, 4, tree=False)
LAST = ROBOT.moving_links[-1]
CHUNK = WIDTHS[1]
Q = np.random.default_rng(1).uniform(-1, 1, (2 * WIDTHS[-1] + 1, 4, 4))


@pytest.fixture(scope="module")
def torque():
    """Return torques of all samples, computed in large blocks."""
    return jn.inverse_dynamics(ROBOT, Q)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, CHUNK, CHUNK + 1, 1024, 1025, 2048, 2049])
def test_results_are_the_same_in_all_sizes(torque, count):
    found = jn.inverse_dynamics(ROBOT, Q[:count])
    assert found.shape == (count, 2, 4)
    # blocks of other widths may round otherwise: by sums in another order, never more
    np.testing.assert_allclose(found, torque[:count], rtol=0, atol=1e-14 * np.abs(torque).max())


@pytest.mark.slow
@pytest.mark.parametrize("lead", [(), (3,), (2, 3), (0,), (2, 0), (1, 1, 2)])
def test_shapes_of_batches_are_kept(torque, lead):
    count = int(np.prod(lead))
    q = Q[:count].reshape(*lead, 4, 4)
    found = jn.inverse_dynamics(ROBOT, q)
    assert found.shape == (*lead, 2, 4)
    np.testing.assert_allclose(found.reshape(-1, 2, 4), torque[:count], rtol=0, atol=1e-14 * np.abs(torque).max())
    motion = jn.forward_kinematics(ROBOT, q, LAST)
    assert motion.position.shape == (*lead, 4, 3)
    assert motion.rotation.shape == (*lead, 4, 3, 3)
    assert motion.angular_velocity.shape == (*lead, 3, 3)
    assert jn.jacobian(ROBOT, q, LAST).shape == (*lead, 4, 6, 4)
    assert jn.robot.operational_accelerations(ROBOT, q, LAST).shape == (*lead, 3, 6)
    assert jn.robot.center_of_mass(ROBOT, q).shape == (*lead, 4, 3)
    assert jn.robot.joint_wrenches(ROBOT, q).shape == (*lead, 2, 4, 6)


@pytest.mark.slow
def test_programs_that_are_too_long_with_single_values_have_arrays_in_memory(monkeypatch):
    state, forces = Q[:40, :2], 30.0 * Q[40:80, 1:]
    expected = jn.forward_dynamics(ROBOT, state, forces)
    moved = forward_dynamics_._forward_dynamics.mapped
    monkeypatch.setattr(modules, "MOST_LINES_WITHOUT_LOOPS", 3000)
    monkeypatch.setattr(moved.machine_code, "_programs", ByKey())
    found = jn.forward_dynamics(ROBOT, state, forces)
    (program,) = moved.machine_code._programs.values()
    assert isinstance(program, Program)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())


def compilations():
    return generalized_forces.jitted._cache_size() + len(generalized_forces.mapped.machine_code)


def test_values_and_robots_of_one_kind_compile_nothing_again(torque):
    jn.inverse_dynamics(ROBOT, Q[:3])
    jn.inverse_dynamics(ROBOT, Q[:100])
    before = compilations()
    for count in (1, 2, 8, 9, 64, CHUNK, 2 * CHUNK, 1000, 1025, 2048, 3000):
        jn.inverse_dynamics(ROBOT, 2 * Q[:count])
    jn.inverse_dynamics(ROBOT.with_gravity([1, 2, 3]).with_payload(LAST, jn.Inertia(2.0)), Q[:5])
    other = random_robot(5, 4, tree=False, fixed=0.0)  # other links, as many joints
    jn.inverse_dynamics(other, Q[:5])
    assert compilations() == before
    jn.inverse_dynamics(ROBOT, Q[:5, :3])  # another order
    assert compilations() == before + 1


def test_wrenches_of_other_values_compile_nothing_again():
    def call(force, point, link):
        wrench = jn.robot.Wrench(link, force, point=point)
        return jn.inverse_dynamics(ROBOT, Q[:3], wrenches=[wrench])

    call([1.0, 2, 3], [0, 0, 1], LAST)
    before = compilations()
    call([3.0, 2, 1], [0, 1, 0], ROBOT.moving_links[0])
    call(np.ones((3, 2, 3)), [0, 1, 0], LAST)
    assert compilations() == before


@pytest.mark.parametrize(
    "kind",
    [
        lambda q: q.tolist(),
        lambda q: jnp.asarray(q),
        np.asfortranarray,
        lambda q: np.repeat(q, 2, axis=0)[::2],
        lambda q: q.astype(object),
    ],
)
def test_kinds_of_arrays(torque, kind):
    found = jn.inverse_dynamics(ROBOT, kind(Q[:3]))
    assert isinstance(found, np.ndarray)
    np.testing.assert_allclose(found, torque[:3], rtol=0, atol=1e-14 * np.abs(torque).max())


@pytest.mark.parametrize("kind", [np.float32, np.int64, np.int8])
@pytest.mark.parametrize("library", [np, jnp])
def test_numbers_of_other_precision_are_computed_in_double(kind, library):
    q = np.round(Q[:3]).astype(kind)
    found = jn.inverse_dynamics(ROBOT, library.asarray(q))
    assert found.dtype == np.float64
    assert np.array_equal(found, jn.inverse_dynamics(ROBOT, q.astype(float)))


def test_results_belong_to_the_caller():
    for count in (1, 5, 300):
        q = Q[:count].copy()
        found = jn.inverse_dynamics(ROBOT, q)
        found[:] = 0.0
        assert np.array_equal(q, Q[:count])
        assert jn.inverse_dynamics(ROBOT, q).any()


def test_nan_stays_in_its_sample(torque):
    q = Q[:20].copy()
    q[7, 2, 1] = np.nan
    found = jn.inverse_dynamics(ROBOT, q)
    rest = np.delete(np.arange(20), 7)
    assert np.isnan(found[7]).any()
    np.testing.assert_allclose(found[rest], torque[rest], rtol=0, atol=1e-14 * np.abs(torque).max())


@pytest.mark.slow
def test_functions_of_jax_run_through(torque):
    expected = torque[:6].reshape(2, 3, 2, 4)
    q = Q[:6].reshape(2, 3, 4, 4)
    for call in (jax.jit, jax.vmap, lambda f: jax.jit(jax.vmap(jax.vmap(f)))):
        found = call(lambda q: jn.inverse_dynamics(ROBOT, q))(q)
        assert isinstance(found, jax.Array)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(torque).max())
    single = jax.jit(lambda q: jn.inverse_dynamics(ROBOT, q))(q.astype(np.float32))
    np.testing.assert_allclose(single, expected, rtol=0, atol=1e-5 * np.abs(torque).max())
    motion = jax.jit(lambda q: jn.forward_kinematics(ROBOT, q, LAST))(q)
    assert isinstance(motion, jn.robot.FrameMotion)
    np.testing.assert_allclose(motion.position, jn.forward_kinematics(ROBOT, q, LAST).position, rtol=0, atol=1e-14)


def test_coefficients_are_derivatives_by_factorials():
    values = np.arange(1.0, 13.0).reshape(4, 3)
    found = taylor_coefficients(values)
    np.testing.assert_allclose(found, values / np.array([[1.0], [1.0], [2.0], [6.0]]), rtol=1e-15)
    np.testing.assert_allclose(plain_derivatives(found), values, rtol=1e-15)
