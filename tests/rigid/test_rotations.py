"""Rotations of every sequence against SciPy at order 0 and mpmath above; Negrean 2025, 1-22, 29-30, 36."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from jounce import jet, rigid
from jounce.errors import JounceError, SingularityError
from jounce.jet import Jet
from tests.oracles import negrean_rotations as negrean

ORDER = 6
INSTANT = 0.4
ALL = pytest.mark.parametrize("sequence", rigid.SEQUENCES)
FEW = pytest.mark.parametrize("sequence", ["ZYX", "xyx"])
ANGLES = st.lists(st.floats(-3.0, 3.0, allow_subnormal=False), min_size=3, max_size=3)
RATES = st.lists(st.floats(-2.0, 2.0, allow_subnormal=False), min_size=6, max_size=6)


def law(seed, order=ORDER, size=3):
    """The motion of the oracle, on jets."""
    t = Jet.variable(INSTANT, order)
    a, b, c, d, e = jnp.asarray(negrean.Law(seed, size).table)
    return a + t * b + c * jet.sin(t * d + e)


def close(found, expected, tolerance=1e-13):
    """Every derivative agrees, relative to the largest entry of its order."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    axes = tuple(range(1, expected.ndim))
    scale = np.abs(expected).max(axis=axes, keepdims=True)
    np.testing.assert_array_less(np.abs(found - expected) / np.where(scale > 0, scale, 1), tolerance)


@pytest.mark.parametrize("axis", "xyz")
def test_equations_011_to_018_simple_rotation(axis):
    angles = np.array([-2.9, -0.3, 0.0, 0.8, 4.0])
    found = np.asarray(rigid.simple_rotation(axis, angles))
    for k, angle in enumerate(angles):
        for equation in (negrean.equation_011, negrean.equation_012, negrean.equation_015):
            np.testing.assert_allclose(found[..., k], negrean.array(equation(axis, angle)), atol=1e-15)
    np.testing.assert_array_equal(rigid.simple_rotation(axis.upper(), angles), found)
    expected = negrean.taylor(lambda t: negrean.equation_011(axis, negrean.Law(1, 1)(t)[0]).tolist(), INSTANT, ORDER)
    close(rigid.simple_rotation(axis, law(1, size=1)[0]).derivatives(), negrean.derivatives(expected))


def test_equation_019_rotation_about_any_axis_at_order_zero():
    random = np.random.default_rng(2)
    for axis in (*np.eye(3), *random.normal(size=(4, 3))):
        angle = random.uniform(-4, 4)
        unit = axis / np.linalg.norm(axis)
        found = np.asarray(rigid.rotation_about(axis, angle))
        np.testing.assert_allclose(found, Rotation.from_rotvec(unit * angle).as_matrix(), atol=2e-15)
        skew = np.cross(np.eye(3), -unit).T
        np.testing.assert_allclose(found, expm(skew * angle), atol=2e-14)  # SciPy's exponential squares repeatedly
        np.testing.assert_allclose(found, negrean.array(negrean.equation_019(unit, angle)), atol=2e-15)


def test_equation_019_small_angles_keep_their_digits():
    found = np.asarray(rigid.rotation_about([0, 3, 4], 1e-9))
    np.testing.assert_allclose(found[2, 1], 0.6 * 0.8 * 0.5e-18, rtol=1e-14)


def test_equation_019_derivatives_with_axis_at_rest_and_in_motion():
    axis = np.array([0.48, 0.6, 0.64])
    angle = law(3, size=1)[0]
    expected = negrean.taylor(
        lambda t: negrean.equation_019(axis.tolist(), negrean.Law(3, 1)(t)[0]).tolist(), INSTANT, ORDER
    )
    close(rigid.rotation_about(axis, angle).derivatives(), negrean.derivatives(expected))

    def turning(t):
        x, y, z = negrean.Law(4)(t)
        length = negrean.mp.sqrt(x * x + y * y + z * z)
        return negrean.equation_019([x / length, y / length, z / length], negrean.Law(3, 1)(t)[0]).tolist()

    expected = negrean.taylor(turning, INSTANT, ORDER)
    close(rigid.rotation_about(law(4), angle).derivatives(), negrean.derivatives(expected))


@ALL
def test_equations_020_to_022_every_sequence_at_order_zero(sequence):
    angles = np.random.default_rng(5).uniform(-3, 3, size=(3, 8))
    expected = Rotation.from_euler(sequence, angles.T).as_matrix()
    found = np.asarray(rigid.rotation_matrix(sequence, angles))
    np.testing.assert_allclose(np.moveaxis(found, -1, 0), expected, atol=2e-15)
    one = np.asarray(rigid.rotation_matrix(sequence, [float(angle) for angle in angles[:, 0]]))
    np.testing.assert_array_equal(one, found[..., 0])


def test_equations_020_to_022_product_of_exponentials_of_the_axes():
    a, b, c = law(6, order=3)
    u, v, w = np.eye(3)
    found = rigid.rotation_matrix("ZYX", [a, b, c]).derivatives()
    turns = [rigid.rotation_about(axis, angle) for axis, angle in ((w, a), (v, b), (u, c))]
    close(jet.matmul(jet.matmul(*turns[:2]), turns[2]).derivatives(), found, 1e-14)


@ALL
def test_equations_021_to_022_derivatives_and_equations_030_036_041_042_angular_velocity(sequence):
    """Rotation, transfer matrix and angular velocity of one motion, each to order 6 against forty digits."""
    motion, angles = negrean.Law(7), law(7, ORDER + 1)
    series = negrean.taylor(lambda t: negrean.equation_020(sequence, motion(t)).tolist(), INSTANT, ORDER + 1)
    rotation = rigid.rotation_matrix(sequence, angles)
    close(rotation.derivatives(), negrean.derivatives(series))
    velocity = negrean.equation_036(series)
    expected = negrean.derivatives(velocity)
    close(rigid.angular_velocity(rotation).derivatives(), expected)
    close(rigid.angular_velocity_from_angles(sequence, angles).derivatives(), expected)
    reversed_series = np.swapaxes(series, 1, 2)  # R^T turns with the opposite of the velocity in body axes
    expected = -negrean.derivatives(negrean.equation_036(reversed_series))
    close(rigid.angular_velocity(rotation, "body").derivatives(), expected)
    close(rigid.angular_velocity_from_angles(sequence, angles, "body").derivatives(), expected)


@pytest.mark.parametrize("sequence", ["ZYX", "ZXZ", "XZY", "YXY"])
def test_equation_030_transfer_matrix(sequence):
    motion = negrean.Law(8)
    expected = negrean.taylor(lambda t: negrean.equation_030(sequence, motion(t)).tolist(), INSTANT, ORDER)
    found = rigid.transfer_matrix(sequence, law(8))
    close(found.derivatives(), negrean.derivatives(expected))
    fixed = rigid.transfer_matrix(sequence[::-1].lower(), law(8)[::-1])  # the same turns, named from the other end
    close(fixed[:, ::-1].derivatives(), negrean.derivatives(expected))


def test_equations_003_to_010_axes_and_direction_cosines():
    """Columns of R are the axes of the body, of unit length; three angles fix the nine direction cosines."""
    angles = np.array([0.4, -1.1, 2.3])
    R = np.asarray(rigid.rotation_matrix("XYZ", angles))
    for k, axis in enumerate(np.eye(3)):
        alpha, beta, gamma = np.arccos(R[:, k])
        assert np.cos(alpha) ** 2 + np.cos(beta) ** 2 + np.cos(gamma) ** 2 == pytest.approx(1, abs=1e-15)
        np.testing.assert_allclose(R @ axis, [np.cos(alpha), np.cos(beta), np.cos(gamma)], atol=1e-15)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-15)  # six relations among nine cosines
    np.testing.assert_allclose(rigid.euler_angles("XYZ", R), angles, rtol=1e-14)


@functools.cache
def everything(sequence):
    """Quantities for the identities, compiled once for all random motions."""

    def computed(motion):
        R = rigid.rotation_matrix(sequence, motion)
        velocities = {frame: rigid.angular_velocity(R, frame) for frame in ("global", "body")}
        return {
            "RRt": jet.matmul(R, jet.transpose(R)).derivatives(),
            "RtR": jet.matmul(jet.transpose(R), R).derivatives(),
            "turned": jet.matvec(R, velocities["body"]).derivatives(),
            "velocities": {frame: w.derivatives() for frame, w in velocities.items()},
            "from angles": {
                frame: rigid.angular_velocity_from_angles(sequence, motion, frame).derivatives() for frame in velocities
            },
            "angles": rigid.euler_angles(sequence, R).derivatives(),
            "rates": [rigid.angle_rates(sequence, motion, w, frame).derivatives() for frame, w in velocities.items()],
            "solved": rigid.angle_rates(sequence, motion.coefficients[0], velocities["body"], "body").derivatives(),
        }

    return jax.jit(computed)


@pytest.mark.slow
@FEW
@given(angles=ANGLES, rates=RATES)
def test_identities_of_any_motion(sequence, angles, rates):
    """R is orthonormal at all orders; angular velocity from angles and from the matrix is one, in both frames."""
    found = everything(sequence)(Jet.from_derivatives(jnp.asarray([angles, *np.reshape(rates, (2, 3))])))
    unit = np.concatenate([np.eye(3)[None], np.zeros((2, 3, 3))])
    for product in ("RRt", "RtR"):
        np.testing.assert_allclose(found[product], unit, atol=1e-12)  # second derivatives of R reach 50
    for frame, velocity in found["velocities"].items():
        np.testing.assert_allclose(found["from angles"][frame], velocity, atol=1e-12)
    np.testing.assert_allclose(found["turned"], found["velocities"]["global"], atol=1e-12)


@pytest.mark.slow
@FEW
@given(angles=ANGLES, rates=RATES)
def test_round_trips(sequence, angles, rates):
    """Angles from the matrix, and their rates from the angular velocity, away from singular orientations."""
    angles[1] = 0.7 + 0.2 * angles[1]  # in (0.1, 1.3): regular for every sequence
    expected = np.asarray([angles, *np.reshape(rates, (2, 3))])
    found = everything(sequence)(Jet.from_derivatives(jnp.asarray(expected)))
    # 0.1 from singular, rates are ten times larger than velocities, and their derivatives a hundred times
    np.testing.assert_allclose(found["angles"], expected, atol=1e-11)
    for rate in (*found["rates"], found["solved"]):
        np.testing.assert_allclose(rate, expected[1:], atol=1e-11)


@ALL
def test_euler_angles_against_scipy(sequence):
    turns = Rotation.random(20, rng=9)
    found = rigid.euler_angles(sequence, np.moveaxis(turns.as_matrix(), 0, -1))
    np.testing.assert_allclose(np.asarray(found).T, turns.as_euler(sequence), atol=3e-14)


@FEW
def test_angle_rates_of_a_batch_of_values(sequence):
    random = np.random.default_rng(10)
    angles, rates = random.uniform(0.2, 1.2, size=(2, 3, 5))
    matrix = np.asarray(rigid.transfer_matrix(sequence, angles))
    velocity = np.einsum("ijn,jn->in", matrix, rates)
    np.testing.assert_allclose(rigid.angle_rates(sequence, angles, velocity), rates, rtol=1e-13)
    motion = Jet([jnp.asarray(angles), jnp.ones((3, 5))])
    for one, many in ((velocity[:, 0], motion), (velocity[:, 0], angles), (velocity, angles[:, 0])):
        # one state for all of a batch of the other
        first = rigid.angle_rates(sequence, many, one)
        np.testing.assert_allclose(
            np.asarray(getattr(first, "coefficients", [first])[0])[:, 0], rates[:, 0], rtol=1e-13
        )
    volume = np.abs(np.linalg.det(np.moveaxis(matrix, -1, 0)))
    np.testing.assert_allclose(rigid.singularity_distance(sequence, angles), volume, rtol=1e-13)


@pytest.mark.parametrize("sequence, middle", [("ZYX", np.pi / 2), ("zyx", -np.pi / 2), ("ZXZ", 0.0), ("yxy", np.pi)])
def test_singular_orientations_are_reported(sequence, middle):
    angles = np.array([0.3, middle, -0.5])
    assert bool(rigid.is_singular_orientation(sequence, angles))
    with pytest.raises(SingularityError, match=rf"{sequence}: .*parallel.* [\d.e-]+ away.*\[0\.3") as caught:
        rigid.angle_rates(sequence, angles, [1.0, 2.0, 3.0])
    assert caught.value.value == pytest.approx(angles.tolist())
    with pytest.raises(SingularityError, match="parallel"):
        rigid.euler_angles(sequence, rigid.rotation_matrix(sequence, angles))
    batch = np.stack([angles, angles + 0.4], axis=-1)
    assert rigid.is_singular_orientation(sequence, batch).tolist() == [True, False]
    motion = Jet([jnp.asarray(batch), jnp.ones_like(batch)])
    for found in (
        rigid.angle_rates(sequence, motion, np.ones((3, 2))).coefficients[0],
        rigid.angle_rates(sequence, batch, np.ones((3, 2))),
        *rigid.euler_angles(sequence, rigid.rotation_matrix(sequence, motion)).coefficients,
    ):
        assert np.isnan(found[:, 0]).all()
        assert np.isfinite(found[:, 1]).all()


def test_functions_are_traced_and_differentiated():
    angles = jnp.asarray([0.3, 0.4, 0.5])
    for function in (
        lambda a: rigid.rotation_matrix("ZYX", a),
        lambda a: rigid.euler_angles("XYZ", rigid.rotation_matrix("ZYX", a)),
        lambda a: rigid.angle_rates("ZYX", a, a),
        lambda a: rigid.rotation_about(a, a[0]),
    ):
        np.testing.assert_allclose(jax.jit(function)(angles), function(angles), atol=1e-15)
    slopes = jax.jacfwd(lambda a: rigid.rotation_matrix("ZYX", a))(angles)
    columns = rigid.transfer_matrix("ZYX", angles)
    R = np.asarray(rigid.rotation_matrix("ZYX", angles))
    for k in range(3):  # dR/dq = [J_k]x R
        np.testing.assert_allclose(slopes[..., k], np.cross(columns[:, k], R, axis=0), atol=1e-15)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: rigid.rotation_matrix("ZZX", [0, 0, 0]), "sequence: not an Euler sequence, got 'ZZX'; write three"),
        (lambda: rigid.rotation_matrix("ZyX", [0, 0, 0]), "not an Euler sequence"),
        (lambda: rigid.rotation_matrix("ZYX", [0, 0]), r"angles: needs three angles .* got 'shape \(2,\)'"),
        (lambda: rigid.simple_rotation("w", 0.1), "axis: unknown axis"),
        (lambda: rigid.simple_rotation("xy", 0.1), "axis: unknown axis"),
        (lambda: rigid.rotation_about([0, 0, 0], 0.1), "not of zero length, got"),
        (lambda: rigid.rotation_about([0, np.nan, 0], 0.1), "must be finite"),
        (lambda: rigid.rotation_about([1, 0], 0.1), "needs three components"),
        (lambda: rigid.transfer_matrix("ZYX", [0, 0, 0], "local"), "frame: unknown frame"),
        (lambda: rigid.angular_velocity(np.eye(3)), "attitude: carries no derivative"),
        (lambda: rigid.angular_velocity_from_angles("ZYX", [0, 0, 0]), "angles: carries no derivative"),
        (lambda: rigid.euler_angles("ZYX", np.eye(2)), "3 rows and 3 columns"),
        (lambda: rigid.euler_angles("ZYX", 1.1 * np.eye(3)), "not orthonormal: an entry of R.T R is 0.21 off"),
        (lambda: rigid.euler_angles("ZYX", -np.eye(3)), "reflection"),
        (lambda: rigid.euler_angles("ZYX", np.full((3, 3), np.nan)), "not finite"),
        (lambda: rigid.euler_angles("ZYX", np.stack([np.eye(3), 2 * np.eye(3)], -1)), "number 1 of the batch"),
    ],
)
def test_errors(call, message):
    with pytest.raises(JounceError, match=message):
        call()
