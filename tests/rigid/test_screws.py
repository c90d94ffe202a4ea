"""Transforms by screw parameters and products of their exponentials: Negrean 2025, equations 31-34."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

from jounce import jet, rigid
from jounce.errors import JounceError
from jounce.jet import Jet
from tests.oracles import negrean_rotations as negrean

ORDER = 6
INSTANT = 0.6


def matrix_of(axis, point, kind="revolute", pitch=0.0):
    """The 4 by 4 matrix of a screw, whose exponential is the transform."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    turning = kind == "revolute"
    S = np.zeros((4, 4))
    S[:3, :3] = np.cross(np.eye(3), -axis).T * turning
    S[:3, 3] = np.cross(point, axis) + pitch * axis if turning else axis
    return S


def chain(seed, joints=5):
    """Random axes, one of them prismatic, as the library and the oracle want them."""
    random = np.random.default_rng(seed)
    axes, points = random.normal(size=(2, joints, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    kinds = ["prismatic" if j == 2 else "revolute" for j in range(joints)]
    screws = [rigid.ScrewAxis(*parts) for parts in zip(axes, points, kinds, strict=True)]
    plain = [(a.tolist(), p.tolist(), kind == "revolute") for a, p, kind in zip(axes, points, kinds, strict=True)]
    return screws, plain


def law(seed, size):
    t = Jet.variable(INSTANT, ORDER)
    a, b, c, d, e = jnp.asarray(negrean.Law(seed, size).table)
    return a + t * b + c * jet.sin(t * d + e)


@pytest.mark.slow
@pytest.mark.parametrize("kind, pitch", [("revolute", 0.0), ("revolute", 0.3), ("prismatic", 0.0)])
def test_equations_031_and_034_against_the_exponential_of_a_matrix(kind, pitch):
    random = np.random.default_rng(1)
    for _ in range(4):
        axis, point = random.normal(size=(2, 3))
        coordinates = random.uniform(-3, 3, size=4)
        found = np.asarray(rigid.screw_transform(axis, point, coordinates, kind, pitch))
        for k, coordinate in enumerate(coordinates):
            expected = expm(matrix_of(axis, point, kind, pitch) * coordinate)
            np.testing.assert_allclose(found[..., k], expected, atol=3e-14)  # SciPy's exponential squares repeatedly
            one = rigid.ScrewAxis(axis, point, kind, pitch).transform(float(coordinate))
            np.testing.assert_allclose(one, found[..., k], atol=1e-15)


@pytest.mark.parametrize("seed", range(2))
def test_equations_031_to_034_products_to_order_6(seed):
    screws, plain = chain(seed)
    motion = negrean.Law(seed, 5)
    start = [0.2, -0.4, 0.9]
    home = np.eye(4)
    home[:3, 3] = start

    def along(t):
        rotation, position = negrean.equation_032(plain, motion(t), start)
        return [[*rotation[i, :], position[i]] for i in range(3)]

    expected = negrean.derivatives(negrean.taylor(along, INSTANT, ORDER))
    found = np.asarray(rigid.product_of_exponentials(screws, law(seed, 5), home).derivatives())
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    np.testing.assert_array_less(np.abs(found[:, :3] - expected) / scale, 1e-13)
    lower = np.zeros((ORDER + 1, 4))
    lower[0, 3] = 1
    np.testing.assert_array_equal(found[:, 3], lower)


def test_equation_033_position_of_the_frame_and_of_a_point():
    """Delta_p: the same product moves the origin of the frame, or any point of the body."""
    screws, _ = chain(3)
    q = np.random.default_rng(4).uniform(-2, 2, size=(5, 6))
    home = np.eye(4)
    home[:3, 3] = [1.0, 2.0, 3.0]
    frame = np.asarray(rigid.product_of_exponentials(screws, q, home))
    whole = np.asarray(rigid.product_of_exponentials(screws, q))
    moved = np.einsum("ijn,j->in", whole, [1.0, 2.0, 3.0, 1.0])
    np.testing.assert_allclose(frame[:, 3], moved, atol=1e-14)
    one = np.asarray(rigid.product_of_exponentials(screws, [float(x) for x in q[:, 0]], home))
    np.testing.assert_allclose(one, frame[..., 0], atol=1e-14)


def test_velocity_of_a_chain_is_that_of_its_screws():
    """T' T^-1 is the sum of the screws, each moved by the axes before it, times the rates."""
    screws, plain = chain(5)
    q = np.random.default_rng(6).normal(size=(2, 5))
    T, rate = (np.asarray(x) for x in rigid.product_of_exponentials(screws, Jet.from_derivatives(q)).derivatives())
    moved, total = np.eye(4), np.zeros((4, 4))
    for (axis, point, turning), angle, speed in zip(plain, *q, strict=True):
        S = matrix_of(axis, point, "revolute" if turning else "prismatic")
        total += moved @ S @ np.linalg.inv(moved) * speed
        moved = moved @ expm(S * angle)
    np.testing.assert_allclose(rate @ np.linalg.inv(T), total, atol=1e-12)  # the oracle inverts and exponentiates


def test_transforms_are_traced_and_differentiated():
    def place(axis, point, angle):
        return rigid.screw_transform(axis, point, angle)[:3, 3]

    arguments = jnp.asarray([0.0, 0.6, 0.8]), jnp.asarray([1.0, 2.0, -1.0]), jnp.asarray(0.7)
    np.testing.assert_allclose(jax.jit(place)(*arguments), place(*arguments), atol=1e-15)
    slope = jax.jacfwd(place, argnums=2)(*arguments)
    np.testing.assert_allclose(slope, np.cross(arguments[0], place(*arguments) - arguments[1]), atol=1e-15)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: rigid.ScrewAxis([0, 0, 0]), "axis: .* not of zero length"),
        (lambda: rigid.ScrewAxis([0, 0, 1], [0, 1]), "point: a point needs three finite coordinates"),
        (lambda: rigid.ScrewAxis([0, 0, 1], [0, 1, np.inf]), "point: a point needs three finite coordinates"),
        (lambda: rigid.ScrewAxis([0, 0, 1], kind="prismatik"), "kind: .*did you mean 'prismatic'"),
        (lambda: rigid.ScrewAxis([0, 0, 1], pitch=np.nan), "pitch: must be a finite number"),
        (lambda: rigid.ScrewAxis([0, 0, 1], kind="prismatic", pitch=0.1), "pitch: a prismatic axis has no pitch"),
        (lambda: rigid.screw_transform([0, 0, 0], [0, 0, 0], 0.1), "not of zero length"),
        (lambda: rigid.product_of_exponentials([], []), "one coordinate along the first axis"),
        (lambda: rigid.product_of_exponentials([rigid.ScrewAxis([0, 0, 1])], [0.1, 0.2]), "for each of 1 screw axes"),
        (lambda: rigid.product_of_exponentials([rigid.ScrewAxis([0, 0, 1])], [0.1], np.eye(3)), "home: .*4 rows"),
    ],
)
def test_errors(call, message):
    with pytest.raises(JounceError, match=message):
        call()
