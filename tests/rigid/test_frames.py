"""Frames as jets against matrices that SciPy makes, and against the rates of a rotation about a fixed axis."""

import numpy as np
from scipy.spatial.transform import Rotation

from jounce.jet import Jet
from jounce.rigid.frames import Frames

AXIS = np.array([2.0, -1.0, 2.0]) / 3
RATE = 0.7
COUNT = 2  # frames, and a batch of three instants
INSTANTS = np.array([0.0, 0.4, 1.3])


def attitudes(times, frame):
    """Return rotation matrices, (3, 3, batch): turns about AXIS, each frame from its own start."""
    start = Rotation.from_rotvec([0.3 * frame, 0.2, -0.1])
    return np.moveaxis((Rotation.from_rotvec(np.outer(times * RATE, AXIS)) * start).as_matrix(), 0, -1)


def frames(order=3):
    """Return two frames that turn about AXIS while their origins move on parabolas; jets of shape (3, 2, 3)."""
    skew = np.cross(np.eye(3), AXIS)  # skew @ v == cross(AXIS, v)
    matrix = np.stack([attitudes(INSTANTS, k) for k in range(COUNT)], axis=2)
    levels, factor = [], 1.0
    for k in range(order + 1):
        levels.append(factor * np.einsum("ij,jabt->iabt", np.linalg.matrix_power(RATE * skew, k), matrix))
        factor /= k + 1
    origin = np.stack([INSTANTS, INSTANTS**2, 1 + 0 * INSTANTS])[:, None].repeat(COUNT, axis=1)
    rate = np.stack([1 + 0 * INSTANTS, 2 * INSTANTS, 0 * INSTANTS])[:, None].repeat(COUNT, axis=1)
    half = np.stack([0 * INSTANTS, 1 + 0 * INSTANTS, 0 * INSTANTS])[:, None].repeat(COUNT, axis=1)
    position = Jet((origin, rate, half, *[None] * (order - 2)))
    axes = tuple(Jet([level[:, i] for level in levels]) for i in range(3))
    spin = Jet.constant(np.broadcast_to((RATE * AXIS)[:, None, None], (3, COUNT, len(INSTANTS))), order - 1)
    return Frames(position, axes, spin)


def at(jet, step):
    """Return the value of a jet a step later."""
    return sum(np.asarray(c) * step**k for k, c in enumerate(jet.coefficients) if c is not None)


LOCAL = np.array([0.4, -0.2, 0.9])
STEP = 1e-4  # the fourth-order term that is left out is below 1e-16


def test_points_and_directions():
    moving = frames()
    later = INSTANTS + STEP
    origin = np.stack([later, later**2, 1 + 0 * later])
    for k in range(COUNT):
        direction = np.einsum("ijt,j->it", attitudes(later, k), LOCAL)
        np.testing.assert_allclose(at(moving.direction(LOCAL), STEP)[:, k], direction, rtol=0, atol=2e-15)
        np.testing.assert_allclose(at(moving.point(LOCAL), STEP)[:, k], origin + direction, rtol=0, atol=2e-15)


def test_components_in_the_frame_come_back():
    moving = frames()
    back = moving.to_body(moving.direction(LOCAL))
    for k, coefficient in enumerate(back.dense().coefficients):
        expected = LOCAL[:, None, None] * (k == 0)
        np.testing.assert_allclose(coefficient, np.broadcast_to(expected, (3, COUNT, 3)), rtol=0, atol=1e-15)


def test_a_vector_at_rest_turns_backwards_in_the_frame():
    seen = frames().to_body(np.broadcast_to(LOCAL[:, None, None], (3, COUNT, 3)))
    for k in range(COUNT):
        expected = np.einsum("jit,j->it", attitudes(INSTANTS + STEP, k), LOCAL)
        np.testing.assert_allclose(at(seen, STEP)[:, k], expected, rtol=0, atol=2e-15)


def test_the_attitude_has_the_axes_for_columns():
    moving = frames()
    assert moving.attitude.shape == (3, 3, COUNT, 3)
    for k in range(COUNT):
        expected = attitudes(INSTANTS, k)
        np.testing.assert_allclose(moving.attitude.coefficients[0][:, :, k], expected, rtol=0, atol=1e-15)


def test_one_of_several_and_all_but_the_base():
    moving = frames()
    one, rest = moving.take(1), moving.without_base()
    assert one.position.shape == (3, 3)
    assert rest.position.shape == (3, 1, 3)
    for jet, taken, left in zip(moving.axes, one.axes, rest.axes, strict=True):
        for whole, second, first in zip(jet.coefficients, taken.coefficients, left.coefficients, strict=True):
            assert np.array_equal(second, whole[:, 1])
            assert np.array_equal(first, whole[:, :1])
