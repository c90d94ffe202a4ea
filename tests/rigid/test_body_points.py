"""Points of a moving body and its center of mass: Negrean 2025, equations 23-29 and 35-49, right and as printed."""

import functools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from jounce import jet, rigid
from jounce.jet import Jet
from tests.oracles import negrean_rotations as negrean

ORDER = 6
INSTANT = 0.3
SEQUENCE = "ZXZ"
SEEDS = pytest.mark.parametrize("seed", range(3))


class Body:
    """A body that moves by three coordinates and three Euler angles, as mpmath's series and on jets."""

    def __init__(self, seed):
        self.law = negrean.Law(seed, 6)
        t = Jet.variable(INSTANT, ORDER)
        a, b, c, d, e = jnp.asarray(self.law.table)
        self.coordinates = a + t * b + c * jet.sin(t * d + e)
        self.origin, self.angles = self.coordinates[:3], self.coordinates[3:]
        self.R = rigid.rotation_matrix(SEQUENCE, self.angles)
        self.w = rigid.angular_velocity(self.R)
        first = Rotation.from_matrix(self.R.coefficients[0]).as_quat(scalar_first=True)
        self.pose = rigid.SpatialPose.from_coordinates(
            {
                "position": self.origin,
                "quaternion": Jet([jnp.asarray(first)]),
                "angular_velocity": rigid.angular_velocity(self.R, "body"),
            }
        )
        random = np.random.default_rng(100 + seed)
        self.local = random.normal(size=3)
        self.points, self.masses = random.normal(size=(5, 3)), random.uniform(0.1, 2, size=5)

    def point(self, local):
        """Derivatives of the position of a point, in forty digits."""

        def place(t):
            q = self.law(t)
            turned = negrean.equation_020(SEQUENCE, q[3:]) * negrean.mp.matrix(list(local))
            return [x + y for x, y in zip(q[:3], turned, strict=True)]

        return negrean.derivatives(negrean.taylor(place, INSTANT, ORDER))


body = functools.cache(Body)


def close(found, expected, tolerance=1e-13):
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    scale = np.abs(expected).max(axis=tuple(range(1, expected.ndim)), keepdims=True)
    np.testing.assert_array_less(np.abs(found - expected) / scale, tolerance)


def off(found, right):
    """Largest difference over the largest entry of the reference."""
    return np.abs(np.asarray(found) - right).max() / np.abs(np.asarray(right)).max()


def skew(v):
    return np.cross(np.eye(3), -np.asarray(v)).T


@pytest.mark.slow
@SEEDS
def test_equations_023_to_028_position_of_a_point(seed):
    case = body(seed)
    expected = case.point(case.local)
    close((case.origin + jet.matvec(case.R, case.local)).derivatives(), expected)
    close(case.pose.point(case.local).derivatives(), expected)
    u, v, w = "zxz"  # equation 26
    turned = case.local
    for axis, angle in ((w, case.angles[2]), (v, case.angles[1]), (u, case.angles[0])):
        turned = jet.matvec(rigid.rotation_about(np.eye(3)["xyz".index(axis)], angle), turned)
    close((case.origin + turned).derivatives(), expected)


@SEEDS
def test_equations_035_to_037_velocity_and_acceleration_of_a_point(seed):
    case = body(seed)
    expected = case.point(case.local)
    _, v_0, a_0 = case.origin.derivatives()[:3]
    R, dR = case.R.derivatives()[:2]
    w, e = case.w.derivatives()[:2]
    rho = R @ case.local
    np.testing.assert_allclose(v_0 + dR @ R.T @ rho, expected[1], rtol=1e-13)
    np.testing.assert_allclose(dR @ R.T, skew(w), atol=1e-15)
    np.testing.assert_allclose(v_0 + np.cross(w, rho), expected[1], rtol=1e-13)
    np.testing.assert_allclose(a_0 + np.cross(e, rho) + np.cross(w, np.cross(w, rho)), expected[2], rtol=1e-13)
    close(case.pose.point(case.local).derivatives()[:3], expected[:3])


@SEEDS
def test_equations_043_to_049_center_of_mass(seed):
    case = body(seed)
    local = case.masses @ case.points / case.masses.sum()
    expected = case.point(local)
    rho = jet.matvec(case.R, local)
    mean = sum(m * jet.matvec(case.R, p) for m, p in zip(case.masses, case.points, strict=True)) / case.masses.sum()
    close(mean.derivatives(), rho.derivatives())
    close((case.origin + rho).derivatives(), expected)
    close(case.pose.point(local).derivatives(), expected)
    close((case.origin.differentiate() + jet.cross(case.w, rho)).derivatives(), expected[1:])  # 45 and 47, k = 0..5
    a_0, (w, e), place = case.origin.derivatives()[2], case.w.derivatives()[:2], rho.coefficients[0]
    np.testing.assert_allclose(a_0 + np.cross(e, place) + np.cross(w, np.cross(w, place)), expected[2], rtol=1e-13)
    point = jet.matvec(case.R, case.points[0])
    apart = jet.matvec(case.R, case.points[0] - local)
    close((jet.cross(case.w, rho) + jet.cross(case.w, apart)).derivatives(), point.differentiate().derivatives())


@SEEDS
def test_equation_029_has_no_orientation_vector(seed):
    """The rate of J_psi psi is not the angular velocity, which is J_psi psi': no such vector exists in space."""
    case = body(seed)
    transfer = rigid.transfer_matrix(SEQUENCE, case.angles)
    w = np.asarray(case.w.derivatives()[0])
    rate = jet.matvec(transfer, case.angles).derivatives()[1]
    assert off(rate, w) > 0.1
    np.testing.assert_allclose(transfer.coefficients[0] @ case.angles.derivatives()[1], w, rtol=1e-14)


@SEEDS
def test_equations_038_and_048_exponential_of_a_sum_is_not_the_rotation(seed):
    case = body(seed)
    axes = [np.eye(3)["xyz".index(letter)] for letter in SEQUENCE.lower()]
    angle = np.asarray(case.angles.coefficients[0])
    R = np.asarray(case.R.coefficients[0])
    product = functools.reduce(np.matmul, [expm(skew(u) * a) for u, a in zip(axes, angle, strict=True)])
    np.testing.assert_allclose(product, R, atol=1e-14)
    printed = expm(sum(skew(u) * a for u, a in zip(axes, angle, strict=True)))
    assert off(printed @ case.local, R @ case.local) > 0.05
    # and so do all derivatives: equation 48 at k = 1, with the printed rotation vector on jets
    vector = sum(u * a for u, a in zip(axes, case.angles, strict=True))
    length = jet.sqrt(jet.dot(vector, vector))
    turned = case.origin + jet.matvec(rigid.rotation_about(vector, length), case.local)
    right = case.point(case.local)
    assert off(turned.derivatives()[2], right[2]) > 0.05


@SEEDS
def test_equations_044_and_045_exponential_of_the_product_is_not_the_rotation(seed):
    """An outer exponential around the product, as the first forms read, does not even keep lengths."""
    case = body(seed)
    R, origin = np.asarray(case.R.coefficients[0]), case.origin.coefficients[0]
    placed = case.pose.point(case.local).coefficients[0]
    np.testing.assert_allclose(placed, origin + R @ case.local, rtol=1e-13)
    assert off(expm(R) @ case.local, placed - origin) > 0.5


@SEEDS
def test_equation_042_with_turned_axes_inside_the_exponentials_is_wrong(seed):
    """The exponents have the axes of the initial state; with rotated axes the exponentials are in another order."""
    case = body(seed)
    (a, b, _), (da, db, dc) = (np.asarray(x) for x in case.angles.derivatives()[:2])
    z, x, _ = axes = [np.eye(3)[2], np.eye(3)[0], np.eye(3)[2]]
    w = np.asarray(case.w.derivatives()[0])
    first, second = expm(skew(z) * a), expm(skew(x) * b)
    np.testing.assert_allclose(da * z + db * first @ x + dc * first @ second @ axes[2], w, rtol=1e-13)
    turned = expm(skew(first @ x) * b)
    assert off(da * z + db * first @ x + dc * first @ turned @ axes[2], w) > 0.05
