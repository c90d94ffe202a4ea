"""Spatial poses on jets against the closed forms of S, 59-76, and against identities."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce import jet, rigid
from jounce.jet import Jet
from jounce.rigid import SpatialPose, to_body, to_global
from tests.oracles import sommer_spatial as spatial
from tests.problems.states import jet_of, spatial_pose, spatial_state

SEEDS = pytest.mark.parametrize("seed", range(2))


def column(v):
    return v[:, None, None]


def derivatives(x):
    return np.array(x.derivatives())[..., 0, 0]


class Case:
    """Two random bodies with points and vectors, and their poses."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        first, second = spatial_state(random), spatial_state(random)
        self.i, self.j = first[0], second[0]
        self.pose_i, self.pose_j, self.both = spatial_pose(first), spatial_pose(second), spatial_pose(first, second)
        self.s_i, self.s_j = random.normal(size=(2, 3))


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=3e-14 * (1 + np.abs(expected).max()))


@SEEDS
def test_equations_059_to_066_point(seed):
    case = Case(seed)
    found = derivatives(case.pose_i.point(column(case.s_i)))
    equations = (
        spatial.equation_059,
        spatial.equation_061,
        spatial.equation_062,
        spatial.equation_064,
        spatial.equation_066,
    )
    for value, equation in zip(found, equations, strict=True):
        close(value, equation(case.i, case.s_i))


@SEEDS
def test_equations_060_063_065_products_of_angular_velocity(seed):
    """A^T A^(k): skew(w) and its products, of the matrix that turns with the body."""
    case = Case(seed)
    turned = [case.i.A.T @ d for d in derivatives(case.pose_i.attitude)]
    skew = [spatial.equation_060(w) for w in case.i.w]
    close(turned[1], skew[0])
    close(turned[2], skew[1] + skew[0] @ skew[0])
    close(turned[3], spatial.equation_063(case.i) + skew[2])
    close(turned[4], spatial.equation_065(case.i) + skew[3])
    assert case.pose_i.angular_velocity is not None
    products = np.asarray(rigid.angular_product_matrices(case.pose_i.angular_velocity)).reshape(-1, 3, 3)
    close(products[3], spatial.equation_063(case.i))
    close(products[4], spatial.equation_065(case.i))
    for k in range(2, len(products)):
        close(products[k] + skew[k - 1], turned[k])
    np.testing.assert_array_equal(products[:2], [np.eye(3), np.zeros((3, 3))])


@SEEDS
def test_equations_067_to_070_relative_vector(seed):
    case = Case(seed)
    found = derivatives(case.pose_j.point(column(case.s_j)) - case.pose_i.point(column(case.s_i)))
    for k, equation in enumerate(
        (spatial.equation_067, spatial.equation_068, spatial.equation_069, spatial.equation_070)
    ):
        close(found[k], equation(case.i, case.j, case.s_i, case.s_j))
    printed = spatial.equation_069_printed(case.i, case.j, case.s_i, case.s_j)
    assert np.abs(found[2] - printed).max() > 1e-3  # as printed, body i has a wrong sign


@SEEDS
def test_equations_071_to_072_direction(seed):
    case = Case(seed)
    local = spatial.equation_072(case.s_j, case.s_i)
    direction = case.pose_i.direction(column(local))
    close(derivatives(direction)[0], spatial.equation_071(case.i, local))
    between = case.pose_i.point(column(case.s_j)) - case.pose_i.point(column(case.s_i))
    close(derivatives(between), derivatives(direction))


@SEEDS
def test_equations_073_to_076_angular_velocity_to_global_axes(seed):
    case = Case(seed)
    found, (w, dw, ddw, dddw) = derivatives(case.pose_i.global_angular_velocity()), case.i.w
    close(found[0], spatial.equation_073(case.i.A, w))
    close(found[1], spatial.equation_074(case.i.A, dw))
    close(found[2], spatial.equation_075(case.i.A, w, dw, ddw))
    close(found[3], spatial.equation_076(case.i.A, w, dw, ddw, dddw))
    attitude = case.pose_i.attitude
    close(derivatives(to_global(attitude, case.pose_i.angular_velocity)), found)


@SEEDS
def test_equations_073_to_076_back_to_body_axes(seed):
    case = Case(seed)
    turning = case.pose_i.global_angular_velocity()
    w, dw, ddw, dddw = derivatives(turning)
    A = case.i.A
    close(spatial.equation_073(A.T, w), case.i.w[0])
    close(spatial.equation_074(A.T, dw), case.i.w[1])
    close(spatial.equation_075(A, w, dw, ddw, back=True), case.i.w[2])
    close(spatial.equation_076(A, w, dw, ddw, dddw, back=True), case.i.w[3])
    close(derivatives(to_body(case.pose_i.attitude, turning)), case.i.w)
    close(derivatives(case.pose_i.to_body(turning)), case.i.w)


@SEEDS
def test_attitude_stays_orthonormal_at_all_orders(seed):
    A = Case(seed).pose_i.attitude
    for product in (jet.matmul(A, jet.transpose(A)), jet.matmul(jet.transpose(A), A)):
        found = np.array(product.dense().coefficients)[..., 0, 0]
        np.testing.assert_allclose(found, np.concatenate([np.eye(3)[None], np.zeros((4, 3, 3))]), atol=1e-12)


@SEEDS
def test_quaternion_stays_of_unit_length_and_agrees_with_the_attitude(seed):
    pose = Case(seed).pose_i
    e0, e1, e2, e3 = pose.quaternion
    length = e0**2 + e1**2 + e2**2 + e3**2
    np.testing.assert_allclose(np.array(length.dense().coefficients)[:, 0, 0], [1, 0, 0, 0, 0], atol=1e-12)
    rows = [
        [e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3, 2.0 * (e1 * e2 - e0 * e3), 2.0 * (e1 * e3 + e0 * e2)],
        [2.0 * (e1 * e2 + e0 * e3), e0 * e0 - e1 * e1 + e2 * e2 - e3 * e3, 2.0 * (e2 * e3 - e0 * e1)],
        [2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3],
    ]
    A = np.array(pose.attitude.dense().coefficients)
    for r, row in enumerate(rows):
        for c, entry in enumerate(row):
            np.testing.assert_allclose(np.array(entry.dense().coefficients), A[:, r, c], atol=1e-12)


@SEEDS
def test_coordinates_and_back(seed):
    pose = Case(seed).both
    again = SpatialPose.from_coordinates(pose.coordinates())
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-14), again, pose)


@SEEDS
def test_prediction_is_the_taylor_series_of_the_coordinates(seed):
    pose, step = Case(seed).both, jnp.asarray([0.01])
    predicted = SpatialPose.predicted_from(pose.coordinates(), step)
    np.testing.assert_allclose(predicted.position.coefficients[0], pose.position.evaluate(step))
    np.testing.assert_allclose(predicted.attitude.coefficients[0], pose.attitude.evaluate(step), atol=1e-6)
    length = np.linalg.norm(predicted.quaternion.coefficients[0], axis=0)
    np.testing.assert_allclose(length, 1.0, rtol=1e-15)


@SEEDS
def test_small_displacements_add_to_the_position_and_turn_about_body_axes(seed):
    case = Case(seed)
    start = SpatialPose.at(case.pose_i.position.coefficients[0], case.pose_i.quaternion.coefficients[0])
    shift, turn = np.array([0.1, -0.2, 0.3]), np.array([1e-5, 2e-5, -1e-5])
    moved = start.displaced(column(shift), column(turn))
    A = np.array(moved.attitude.coefficients[0])[..., 0, 0]
    np.testing.assert_allclose(case.i.A.T @ A, np.eye(3) + spatial.equation_060(turn), atol=1e-9)
    found = moved.separation(start)
    np.testing.assert_allclose(found[0][:, 0, 0], shift, atol=1e-15)
    np.testing.assert_allclose(found[1][:, 0, 0], turn, atol=1e-12)


def test_separation_is_the_same_for_both_signs_of_a_quaternion_up_to_its_own():
    """p and -p are one attitude: no jump must be seen between them."""
    pose = Case(0).both
    start = SpatialPose.at(pose.position.coefficients[0], pose.quaternion.coefficients[0])
    other = SpatialPose.at(pose.position.coefficients[0], -pose.quaternion.coefficients[0])
    np.testing.assert_allclose(other.separation(start)[1], 0, atol=1e-15)


def test_pose_of_order_zero_has_no_angular_velocity():
    pose = SpatialPose.at(jnp.zeros((3, 1, 1)), column(jnp.asarray([2.0, 0, 0, 0])))
    with pytest.raises(ValueError, match="order 1 or more"):
        pose.global_angular_velocity()


def test_quaternions_are_normalized():
    pose = SpatialPose.at(jnp.zeros((3, 1, 1)), column(jnp.asarray([1.0, 2.0, -2.0, 4.0])))
    np.testing.assert_allclose(pose.quaternion.coefficients[0][:, 0, 0], np.array([1, 2, -2, 4]) / 5)


@pytest.mark.parametrize("bodies", [(0,), (2,), (1, 2), (0, 2), (2, 0), (1, 1), (2, 0, 1), (1, 1, 2)])
def test_take_selects_bodies_by_index(bodies):
    random = np.random.default_rng(5)
    ground = spatial_state(random, p=np.array([1.0, 0, 0, 0]), w=np.zeros((4, 3)))
    ground = (ground[0]._replace(r=np.zeros((5, 3))), ground[1])
    whole = spatial_pose(ground, spatial_state(random), spatial_state(random))
    taken = whole.take(bodies)
    for name in ("position", "quaternion"):
        found, expected = (np.array(getattr(p, name).dense().coefficients) for p in (taken, whole))
        np.testing.assert_array_equal(
            np.broadcast_to(found, (*found.shape[:2], len(bodies), 1)), expected[:, :, list(bodies)]
        )
    s = random.normal(size=3)
    found, expected = (np.array(p.point(column(s)).dense().coefficients) for p in (taken, whole))
    np.testing.assert_allclose(np.broadcast_to(found, (5, 3, len(bodies), 1)), expected[:, :, list(bodies)], atol=1e-14)


def test_steady_spin_is_the_rotation_matrix_of_its_angle():
    rate = 1.7
    p = jnp.asarray([1.0, 0.0, 0.0, 0.0])
    w = np.zeros((8, 3, 1, 1))
    w[0, 2] = rate
    pose = SpatialPose.from_coordinates(
        {"position": jet_of(np.zeros((9, 3, 1, 1))), "quaternion": Jet([column(p)]), "angular_velocity": jet_of(w)}
    )
    x = pose.direction(column(np.array([1.0, 0.0, 0.0])))
    t = Jet.variable(jnp.zeros((1, 1)), 8)
    expected = jet.stack([jet.cos(rate * t), jet.sin(rate * t), 0.0 * t])
    np.testing.assert_allclose(x.dense().coefficients, expected.dense().coefficients, atol=1e-15)
