"""Angular velocity of any order from samples of the attitude, against the motion that was sampled."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jounce import jet, rigid
from jounce.errors import JounceError, TrajectoryError
from jounce.jet import Jet

INSIDE = np.linspace(0.31, 1.69, 7)


def angles(t):
    """A motion of three Euler angles that turns more than once: the quaternion changes sign on the way."""
    if isinstance(t, Jet):
        return jet.stack([4.0 * t, 0.8 * jet.sin(1.5 * t), 0.3 * t * t - 2.0 * t])
    return np.stack([4 * t, 0.8 * np.sin(1.5 * t), 0.3 * t * t - 2 * t], axis=-1)


def exact(order, frame="global"):
    """Angular velocity and its derivatives from the closed form of the motion."""
    t = Jet.variable(jnp.asarray(INSIDE), order + 1)
    return np.asarray(rigid.angular_velocity_from_angles("ZYX", angles(t), frame).derivatives())


def errors(samples, order, frame="global"):
    """Largest relative error of each derivative of the angular velocity."""
    found = samples.angular_velocity(Jet.variable(jnp.asarray(INSIDE), order + 1), frame).derivatives()
    expected = exact(order, frame)
    return np.abs(found - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))


@functools.cache
def samples(count, degree=5):
    t = np.linspace(0, 2, count)
    return rigid.AttitudeSamples.from_euler_angles(t, angles(t), "ZYX", degree)


@pytest.mark.slow
def test_samples_of_every_kind_give_one_motion():
    t = np.linspace(0, 2, 81)
    turns = Rotation.from_euler("ZYX", angles(t))
    quaternions = turns.as_quat(scalar_first=True)
    quaternions[np.random.default_rng(1).integers(0, 2, 81) == 1] *= -1  # either sign is the same attitude
    time = Jet.variable(jnp.asarray(INSIDE), 3)
    expected = samples(81).attitude(time).derivatives()
    for other in (
        rigid.AttitudeSamples(t, quaternions),
        rigid.AttitudeSamples.from_rotation_matrices(t, turns.as_matrix()),
    ):
        np.testing.assert_allclose(other.attitude(time).derivatives(), expected, atol=1e-9)  # 1e-16 / spacing^3


@pytest.mark.slow
def test_attitude_at_the_samples_is_the_sampled_one():
    t = np.linspace(0, 2, 41)
    found = samples(41).attitude(Jet.variable(jnp.asarray(t), 1)).coefficients[0]
    np.testing.assert_allclose(np.moveaxis(found, -1, 0), Rotation.from_euler("ZYX", angles(t)).as_matrix(), atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["global", "body"])
def test_angular_velocity_and_derivatives_approach_the_truth(frame):
    bounds = [2e-9, 4e-7, 3e-5, 3e-3]  # measured 4e-10, 9e-8, 7e-6, 6e-4
    np.testing.assert_array_less(errors(samples(81), 3, frame), bounds)


@pytest.mark.slow
def test_error_falls_with_the_spacing_as_stated():
    """Derivative n of the attitude, n - 1 of the angular velocity, as spacing^(degree + 1 - n)."""
    coarse, fine = errors(samples(41), 3), errors(samples(81), 3)
    rates = np.log2(coarse / fine)
    assert (rates > np.array([5, 4, 3, 2]) - 0.6).all(), rates


def test_derivatives_are_those_of_the_interpolated_motion():
    """Central differences of the angular velocity agree with its derivative."""
    step = 1e-4
    near = [samples(41).angular_velocity(Jet.variable(jnp.asarray(INSIDE + h), 2)) for h in (-step, 0.0, step)]
    slope = (near[2].coefficients[0] - near[0].coefficients[0]) / (2 * step)
    np.testing.assert_allclose(slope, near[1].coefficients[1], atol=1e-5)


@pytest.mark.slow
def test_a_steady_turn_and_a_compiled_call():
    t = np.linspace(0, 3, 61)
    turning = rigid.AttitudeSamples(t, np.stack([np.cos(t), 0 * t, 0 * t, np.sin(t)], axis=1), degree=7)
    found = jax.jit(lambda t: turning.angular_velocity(Jet.variable(t, 3)).derivatives())(jnp.asarray(1.234))
    np.testing.assert_allclose(found[0], [0, 0, 2], atol=1e-10)
    np.testing.assert_allclose(found[1:], np.zeros((2, 3)), atol=1e-6)


T = np.linspace(0.0, 1.0, 8)
STILL = np.tile([1.0, 0.0, 0.0, 0.0], (8, 1))


def changed(array, index, value):
    array = np.array(array)
    array[index] = value
    return array


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: rigid.AttitudeSamples(T[::-1], STILL), "times: .*sample 1 does not come after sample 0"),
        (lambda: rigid.AttitudeSamples(changed(T, 3, T[2]), STILL), "sample 3 does not come after sample 2"),
        (lambda: rigid.AttitudeSamples(changed(T, 3, np.nan), STILL), "times: .*sample 3 is not"),
        (lambda: rigid.AttitudeSamples(T, changed(STILL, (5, 1), np.nan)), "quaternions: .*sample 5 is not"),
        (lambda: rigid.AttitudeSamples(T, changed(STILL, 4, [0.9, 0, 0, 0])), "that of sample 4 is of length 0.9"),
        (lambda: rigid.AttitudeSamples(T, changed(STILL, 4, [0, 1, 0, 0])), "between samples 3 and 4 .*half a turn"),
        (lambda: rigid.AttitudeSamples(T[:5], STILL[:5]), "degree 5 needs at least 6 samples, got 5"),
        (lambda: rigid.AttitudeSamples(T, STILL[:7]), r"shapes \(8,\) and \(7, 4\)"),
        (lambda: rigid.AttitudeSamples(T, STILL, degree=1), "degree: .*from 2 to 11, got 1"),
        (lambda: rigid.AttitudeSamples(T, STILL, degree=12), "degree: .*from 2 to 11, got 12"),
        (
            lambda: rigid.AttitudeSamples.from_rotation_matrices(T, 1.01 * np.tile(np.eye(3), (8, 1, 1))),
            "number 0 of the batch. is not orthonormal",
        ),
        (
            lambda: rigid.AttitudeSamples(T, STILL).attitude(Jet.variable(1.5, 1)),
            "time: .*from 0 to 1 s, got 1.5; there is no",
        ),
        (lambda: rigid.AttitudeSamples(T, STILL).attitude(Jet.variable(0.5, 5)), "order: .*degree=6 or more"),
    ],
)
def test_errors(call, message):
    with pytest.raises(TrajectoryError, match=message):
        call()


def test_unknown_sequence():
    with pytest.raises(JounceError, match="not an Euler sequence"):
        rigid.AttitudeSamples.from_euler_angles(T, STILL[:, :3], "ZZX")
