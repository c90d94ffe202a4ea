"""Inertia against clouds of point masses, the parallel-axis theorem and closed forms of simple bodies."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn


def cloud(seed, count=6):
    """Return masses and positions of point masses."""
    generator = np.random.default_rng(seed)
    return generator.uniform(0.1, 2.0, count), generator.normal(size=(count, 3))


def of_cloud(masses, points):
    """Return the mass, center and inertia about the center, as sums over the points."""
    mass = masses.sum()
    center = masses @ points / mass
    tensor = np.zeros((3, 3))
    for m, p in zip(masses, points - center, strict=True):
        tensor += m * (p @ p * np.eye(3) - np.outer(p, p))
    return mass, center, tensor


def same(found, expected, tolerance=1e-14):
    for name in ("mass", "center_of_mass", "tensor"):
        a, b = np.asarray(getattr(found, name)), np.asarray(getattr(expected, name))
        assert np.abs(a - b).max() <= tolerance * max(1.0, np.abs(b).max()), name


@pytest.mark.parametrize("seed", range(3))
def test_moments_are_those_of_a_cloud_of_points(seed):
    masses, points = cloud(seed)
    body = jn.Inertia(*of_cloud(masses, points))
    about_origin = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
    np.testing.assert_allclose(body.about_origin, about_origin, rtol=0, atol=1e-13)
    centered = points - body.center_of_mass
    np.testing.assert_allclose(body.second_moments, (centered.T * masses) @ centered, rtol=0, atol=1e-13)
    homogeneous = np.column_stack([points, np.ones(len(points))])
    np.testing.assert_allclose(body.pseudo_inertia, (homogeneous.T * masses) @ homogeneous, rtol=0, atol=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_pseudo_inertia_tells_the_body(seed):
    masses, points = cloud(seed)
    homogeneous = np.column_stack([points, np.ones(len(points))])
    same(jn.Inertia.from_pseudo((homogeneous.T * masses) @ homogeneous), jn.Inertia(*of_cloud(masses, points)), 1e-13)


def test_a_solid_is_centered_in_its_frame_by_default():
    assert jn.Inertia.solid("sphere", radius=0.1, mass=2.0).center_of_mass.tolist() == [0, 0, 0]


@pytest.mark.parametrize("seed", range(3))
def test_a_moved_body_is_the_moved_cloud(seed):
    masses, points = cloud(seed)
    position = np.array([0.3, -1.0, 2.0])
    rotation = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    moved = jn.Inertia(*of_cloud(masses, points)).moved(position, rotation)
    same(moved, jn.Inertia(*of_cloud(masses, position + points @ rotation.T)))
    same(moved.moved(-rotation.T @ position, rotation.T), jn.Inertia(*of_cloud(masses, points)))


def test_bodies_fixed_together_are_one_cloud():
    clouds = [cloud(seed, 4) for seed in range(3)]
    whole = jn.Inertia.total(jn.Inertia(*of_cloud(*one)) for one in clouds)
    masses, points = (np.concatenate(parts) for parts in zip(*clouds, strict=True))
    same(whole, jn.Inertia(*of_cloud(masses, points)))


def test_point_masses_make_a_dumbbell():
    ends = [jn.Inertia(2.0, [0, 0, 1]), jn.Inertia(2.0, [0, 0, -1])]
    dumbbell = jn.Inertia.total(ends)
    assert dumbbell.mass == 4.0
    assert dumbbell.center_of_mass.tolist() == [0, 0, 0]
    assert dumbbell.tensor.tolist() == np.diag([4.0, 4.0, 0.0]).tolist()


def test_parallel_axes():
    rod = jn.Inertia(3.0, [0.5, 0, 0], [0, 0.25, 0.25])  # of length 1, about its end: m l^2 / 3
    np.testing.assert_allclose(rod.about_origin, np.diag([0, 1.0, 1.0]), rtol=0, atol=1e-15)


def test_three_numbers_are_a_diagonal():
    assert jn.Inertia(1.0, tensor=[1, 2, 3]).tensor.tolist() == np.diag([1.0, 2.0, 3.0]).tolist()


def test_a_plate_just_meets_the_triangle_inequality():
    plate = jn.Inertia(1.0, tensor=[1.0, 2.0, 3.0])
    assert np.linalg.eigvalsh(plate.second_moments).min() == pytest.approx(0, abs=1e-15)
    jn.Inertia(1.0, tensor=[1.0, 2.0, 3.00002])  # as files of six digits have it
    with pytest.raises(jn.errors.RobotError, match="triangle"):
        jn.Inertia(1.0, tensor=[1.0, 2.0, 3.0001])


def test_what_was_given_can_change_without_the_body():
    center, tensor = np.zeros(3), np.eye(3)
    body = jn.Inertia(1.0, center, tensor)
    center[0], tensor[0, 0] = 5.0, 5.0
    assert body.center_of_mass[0] == 0.0
    assert body.tensor[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        body.tensor[0, 0] = 2.0


PRODUCTS = [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: jn.Inertia(0.0), "mass: must be greater than zero, got 0.0"),
        (lambda: jn.Inertia(-1.0), "mass: must be greater than zero, got -1.0"),
        (lambda: jn.Inertia(np.nan), "mass: must be finite, got nan"),
        (
            lambda: jn.Inertia(1.0, tensor=np.full(3, 1j)),
            "tensor: must be real numbers, got array([0.+1.j, 0.+1.j, 0.+1.j])",
        ),
        (lambda: jn.Inertia(1.0, [0, 0]), "center_of_mass: must have the shape (3,), not (2,)"),
        (lambda: jn.Inertia(1.0, [0, 0, np.inf]), "center_of_mass: must be finite, got [0.0, 0.0, inf]"),
        (lambda: jn.Inertia(1.0, tensor=1.0), "tensor: must have the shape (3, 3) or (3,), not ()"),
        (
            lambda: jn.Inertia(1.0, tensor=[[1.0], [2.0, 3.0]]),
            "tensor: must be real numbers, got [[1.0], [2.0, 3.0]]",
        ),
        (
            lambda: jn.Inertia(1.0, tensor=PRODUCTS),
            "inertia: must be symmetric, got [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
        ),
        (
            lambda: jn.Inertia(1.0, tensor=[-1, 1, 1]),
            "inertia: has a negative principal moment, got -1.0; check the units, the signs of the products of inertia "
            "and the axes, or compute with the numbers as they are, by strict=False",
        ),
        (
            lambda: jn.Inertia(1.0, tensor=[1, 1, 4]),
            "inertia: breaks the triangle inequality: the largest principal moment exceeds the sum of the others, got "
            "[1.0, 1.0, 4.0]; check the units, the signs of the products of inertia and the axes, or compute with the "
            "numbers as they are, by strict=False",
        ),
        (lambda: jn.Inertia.total([]), "parts: the sum of inertias needs at least one, got an empty list"),
    ],
)
def test_no_body_has_such_an_inertia(make, message):
    with pytest.raises(jn.errors.RobotError) as caught:
        make()
    assert str(caught.value) == message


@pytest.mark.parametrize("seed", range(10))
def test_rods_and_plates_of_six_digits_are_bodies(seed):
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    for moments in ([0.0, 1.0, 1.0], [1.0, 2.0, 3.0]):
        exact = turn @ np.diag(moments) @ turn.T
        rounded = np.array([[float(f"{x:.6g}") for x in row] for row in exact])
        assert jn.Inertia(1.0, tensor=rounded).fault is None


def test_the_numbers_of_no_real_body_are_kept_as_they_are():
    moments, place = [-0.5, 1.0, 3.0], np.array([0.1, 0.2, 0.3])
    turn = Rotation.random(rng=np.random.default_rng(1)).as_matrix()
    inertia = jn.Inertia(2.0, tensor=moments, strict=False)
    assert inertia.fault.value == -0.5
    moved = inertia.moved(place, turn)
    np.testing.assert_allclose(moved.tensor, turn @ np.diag(moments) @ turn.T, rtol=0, atol=1e-15)
    whole = jn.Inertia.total([moved, jn.Inertia(1.0, place)])
    np.testing.assert_allclose(whole.tensor, moved.tensor, rtol=0, atol=1e-15)
    assert jn.Inertia(1.0, tensor=[1.0, 1.0, 3.0], strict=False).fault.value == [1.0, 1.0, 3.0]


def test_moments_without_mass_add_to_those_of_what_they_are_fixed_to():
    rotor = jn.Inertia(0.0, [0.1, 0.2, 0.3], [0.3, 0.2, 0.1], strict=False)
    assert rotor.fault.words == "has moments of inertia but no mass"
    body = jn.Inertia(2.0, [0.5, 0.0, 0.0], [0.1, 0.2, 0.2])
    same(jn.Inertia.total([body, rotor]), jn.Inertia(2.0, [0.5, 0.0, 0.0], [0.4, 0.4, 0.3]))
    np.testing.assert_allclose(jn.Inertia.total([rotor, rotor]).tensor.diagonal(), [0.6, 0.4, 0.2], rtol=1e-15)
    with pytest.raises(jn.errors.RobotError, match=r"mass: must be greater than zero, got -1\.0"):
        jn.Inertia(-1.0, strict=False)
