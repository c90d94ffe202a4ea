"""Planar poses on jets against the closed forms of S, 9-20, and against identities."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce import jet
from jounce.jet import Jet
from jounce.rigid import PlanarPose, perpendicular
from tests.oracles import sommer_planar as planar
from tests.problems.states import planar_pose, planar_state

SEEDS = pytest.mark.parametrize("seed", range(2))


def bodies(seed, count=2):
    random = np.random.default_rng(seed)
    return [planar_state(random) for _ in range(count)], random.normal(size=(2, 2))


def derivatives(x):
    return np.array(x.derivatives())


@SEEDS
def test_equation_009_attitude(seed):
    (i, _), (s, _) = bodies(seed)
    pose = planar_pose(i)
    A, R, B = planar.equation_009(i.phi[0])
    sine, cosine = (np.array(x.coefficients[0]).item() for x in (pose.sine, pose.cosine))
    np.testing.assert_allclose([[cosine, -sine], [sine, cosine]], A, atol=1e-15)
    np.testing.assert_allclose(perpendicular(A @ s), B @ s, atol=1e-15)
    np.testing.assert_array_equal(perpendicular(s), R @ s)


@SEEDS
def test_equations_010_to_014_point(seed):
    (i, _), (s, _) = bodies(seed)
    found = derivatives(planar_pose(i).point(s[:, None, None]))[..., 0, 0]
    equations = (
        planar.equation_010,
        planar.equation_011,
        planar.equation_012,
        planar.equation_013,
        planar.equation_014,
    )
    for value, equation in zip(found, equations, strict=True):
        expected = equation(i, s)
        np.testing.assert_allclose(value, expected, rtol=0, atol=1e-14 * (1 + np.abs(expected).max()) * 10)


@SEEDS
def test_to_body_undoes_direction(seed):
    (i, _), (s, _) = bodies(seed)
    pose = planar_pose(i)
    turned = pose.direction(s[:, None, None])
    size = np.abs(derivatives(turned)).max(axis=1, keepdims=True)
    expected = np.zeros_like(derivatives(turned))
    expected[0, :, 0, 0] = s
    assert np.all(np.abs(derivatives(pose.to_body(turned)) - expected) <= 1e-13 * size)


@SEEDS
def test_what_varies_with_time_varies_as_the_derivatives_say(seed):
    (i, _), _ = bodies(seed)
    pose = planar_pose(i)
    rates = pose.truncate(pose.order - 1).varied(pose.position.differentiate(), pose.angle.differentiate()[None])
    for name in ("position", "angle", "sine", "cosine"):
        expected = derivatives(getattr(pose, name).differentiate())
        np.testing.assert_allclose(derivatives(getattr(rates, name)), expected, atol=1e-13 * np.abs(expected).max())


@SEEDS
def test_equations_015_to_018_relative_vector(seed):
    (i, j), (s_i, s_j) = bodies(seed)
    d = planar_pose(j).point(s_j[:, None, None]) - planar_pose(i).point(s_i[:, None, None])
    for k, equation in enumerate((planar.equation_015, planar.equation_016, planar.equation_017, planar.equation_018)):
        expected = equation(i, j, s_i, s_j)
        np.testing.assert_allclose(derivatives(d)[k, :, 0, 0], expected, atol=1e-13 * (1 + np.abs(expected).max()))


@SEEDS
def test_equations_019_to_020_direction(seed):
    (i, _), (s_p, s_q) = bodies(seed)
    pose, local = planar_pose(i), planar.equation_020(s_q, s_p)
    direction = pose.direction(local[:, None, None])
    np.testing.assert_allclose(direction.coefficients[0][:, 0, 0], planar.equation_019(i, local), atol=1e-14)
    between = pose.point(s_q[:, None, None]) - pose.point(s_p[:, None, None])
    np.testing.assert_allclose(derivatives(between), derivatives(direction), atol=1e-12)


@SEEDS
def test_attitude_stays_orthonormal_at_all_orders(seed):
    (i, _), _ = bodies(seed)
    pose = planar_pose(i)
    one = derivatives(pose.sine**2 + pose.cosine**2)[:, 0, 0]
    np.testing.assert_allclose(one, [1, 0, 0, 0, 0], atol=1e-11)


@SEEDS
def test_coordinates_and_back(seed):
    states, _ = bodies(seed)
    pose = planar_pose(*states)
    again = PlanarPose.from_coordinates(pose.coordinates())
    jax.tree.map(np.testing.assert_array_equal, again, pose)


@SEEDS
def test_extension_order_by_order_is_the_whole(seed):
    states, s = bodies(seed)
    whole = planar_pose(*states)
    pose = PlanarPose.from_jets(whole.position.truncate(0), whole.angle.truncate(0))
    for k in range(1, whole.order + 1):
        pose = pose.extended(whole.position.coefficients[k], whole.angle.coefficients[k][None])
    np.testing.assert_allclose(
        derivatives(pose.point(s[0][:, None, None])), derivatives(whole.point(s[0][:, None, None]))
    )


@SEEDS
def test_prediction_is_the_taylor_series_of_the_coordinates(seed):
    states, _ = bodies(seed)
    pose, step = planar_pose(*states), jnp.asarray([0.1])
    predicted = PlanarPose.predicted_from(pose.coordinates(), step)
    np.testing.assert_allclose(predicted.position.coefficients[0], pose.position.evaluate(step))
    np.testing.assert_allclose(predicted.sine.coefficients[0], np.sin(pose.angle.evaluate(step)), atol=1e-15)


def test_separation_leads_from_the_other_pose():
    at = Jet([jnp.zeros((2, 1, 1))]), Jet([jnp.zeros((1, 1))])
    there = Jet([jnp.asarray([[[1.0]], [[2.0]]])]), Jet([jnp.full((1, 1), 0.3)])
    shift, turn = PlanarPose.from_jets(*there).separation(PlanarPose.from_jets(*at))
    np.testing.assert_allclose(shift[:, 0, 0], [1.0, 2.0])
    np.testing.assert_allclose(turn, [[[0.3]]])


def test_displacement_then_separation():
    pose = planar_pose(*bodies(1)[0])
    start = PlanarPose.from_jets(pose.position.truncate(0), pose.angle.truncate(0))
    shift, turn = jnp.asarray(np.full((2, 2, 1), 0.1)), jnp.asarray(np.full((1, 2, 1), -0.2))
    found = start.displaced(shift, turn).separation(start)
    np.testing.assert_allclose(found[0], shift, atol=1e-15)
    np.testing.assert_allclose(found[1], turn, atol=1e-15)


def test_jets_of_a_point_on_a_turning_wheel():
    t = Jet.variable(jnp.full((1, 1), 0.4), 6)
    pose = PlanarPose.from_jets(jet.stack([0.5 * t, 0.0 * t]), -1.0 * t)
    x, y = pose.point(np.array([0.0, -0.5])[:, None, None])
    np.testing.assert_allclose(derivatives(x), derivatives(0.5 * t - 0.5 * jet.sin(t)), atol=1e-14)
    np.testing.assert_allclose(derivatives(y), derivatives(-0.5 * jet.cos(t)), atol=1e-14)
