"""Inertia of solids against sums over many small cubes, and pseudo-inertia converted both ways."""

import numpy as np
import pytest

import jounce as jn

CELLS = 60


def cubes(extent, inside):
    """Return volume, center and moments about x, y and z over the volume, from small cubes that lie inside."""
    edges = [(np.arange(CELLS) + 0.5) / CELLS * 2 * e - e for e in extent]
    x, y, z = np.meshgrid(*edges, indexing="ij")
    within = inside(x, y, z)
    cell = np.prod([2 * e / CELLS for e in extent])
    volume = within.sum() * cell
    squares = [(q[within] ** 2).mean() + (2 * e / CELLS) ** 2 / 12 for q, e in zip((x, y, z), extent, strict=True)]
    return volume, [squares[1] + squares[2], squares[2] + squares[0], squares[0] + squares[1]]


@pytest.mark.parametrize(
    "kind, sizes, extent, inside, tolerance",
    [
        ("box", {"size": [0.2, 0.6, 1.0]}, (0.1, 0.3, 0.5), lambda x, y, z: x < 1, 1e-12),
        ("sphere", {"radius": 0.5}, (0.5,) * 3, lambda x, y, z: x**2 + y**2 + z**2 < 0.25, 2e-3),
        ("cylinder", {"radius": 0.5, "length": 2.0}, (0.5, 0.5, 1.0), lambda x, y, z: x**2 + y**2 < 0.25, 2e-3),
        (
            "cylinder",
            {"radius": 0.5, "length": 2.0, "axis": "x"},
            (1.0, 0.5, 0.5),
            lambda x, y, z: y**2 + z**2 < 0.25,
            2e-3,
        ),
        (
            "tube",
            {"radius": 0.5, "inner_radius": 0.3, "length": 2.0, "axis": "y"},
            (0.5, 1.0, 0.5),
            lambda x, y, z: (x**2 + z**2 < 0.25) & (x**2 + z**2 > 0.09),
            5e-3,
        ),
        (
            "capsule",
            {"radius": 0.3, "length": 0.8},
            (0.3, 0.3, 0.7),
            lambda x, y, z: x**2 + y**2 + np.maximum(abs(z) - 0.4, 0) ** 2 < 0.09,
            5e-3,
        ),
        (
            "ellipsoid",
            {"size": [0.4, 0.8, 1.2]},
            (0.2, 0.4, 0.6),
            lambda x, y, z: (x / 0.2) ** 2 + (y / 0.4) ** 2 + (z / 0.6) ** 2 < 1,
            5e-3,
        ),
    ],
)
def test_volume_and_moments_are_those_of_many_cubes(kind, sizes, extent, inside, tolerance):
    """A staircase of 60 cubes misses a round edge by about a thousandth."""
    volume, moments = cubes(extent, inside)
    found = jn.Inertia.solid(kind, density=3.0, **sizes)
    assert found.mass == pytest.approx(3.0 * volume, rel=tolerance)
    np.testing.assert_allclose(found.tensor / found.mass, np.diag(moments), rtol=tolerance, atol=1e-15)
    given = jn.Inertia.solid(kind, mass=found.mass, center_of_mass=[1, 2, 3], **sizes)
    np.testing.assert_allclose(given.tensor, found.tensor, rtol=1e-15)
    assert given.center_of_mass.tolist() == [1, 2, 3]


@pytest.mark.parametrize("axis, index", [("x", 0), ("y", 1), ("z", 2)])
def test_thin_solids_are_limits_of_thick_ones(axis, index):
    rod = jn.Inertia.solid("rod", mass=2.0, length=3.0, axis=axis).tensor.diagonal()
    thin = jn.Inertia.solid("cylinder", mass=2.0, length=3.0, radius=1e-9, axis=axis).tensor.diagonal()
    np.testing.assert_allclose(rod, thin, atol=1e-15)
    assert rod[index] == 0
    disc = jn.Inertia.solid("disc", mass=2.0, radius=3.0, axis=axis).tensor.diagonal()
    flat = jn.Inertia.solid("cylinder", mass=2.0, radius=3.0, length=1e-9, axis=axis).tensor.diagonal()
    np.testing.assert_allclose(disc, flat, rtol=1e-15)
    assert disc[index] == 9.0


def test_a_cone_is_that_of_many_discs():
    """Discs of a thickness of length / n have the moments of their cylinders about the centroid, moved by Steiner."""
    n, radius, length = 20_000, 0.3, 0.9
    z = (np.arange(n) + 0.5) / n * length
    r = radius * (1 - z / length)
    weight = r**2 / np.sum(r**2)
    center = weight @ z
    np.testing.assert_allclose(center, length / 4, rtol=1e-8)
    found = jn.Inertia.solid("cone", density=3.0, radius=radius, length=length)
    moments = [weight @ (r**2 / 4 + (z - center) ** 2)] * 2 + [weight @ (r**2 / 2)]
    np.testing.assert_allclose(found.tensor.diagonal() / found.mass, moments, rtol=1e-7)
    assert found.mass == pytest.approx(np.pi * radius**2 * length)


def test_pseudo_inertia_there_and_back():
    body = jn.Inertia(2.0, [0.1, -0.2, 0.3], [[0.5, 0.02, 0.01], [0.02, 0.6, -0.03], [0.01, -0.03, 0.7]])
    back = jn.Inertia.from_pseudo(body.pseudo_inertia)
    assert back.mass == body.mass
    np.testing.assert_allclose(back.center_of_mass, body.center_of_mass, rtol=1e-15)
    np.testing.assert_allclose(back.tensor, body.tensor, rtol=1e-14)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: jn.Inertia.solid("bx", mass=1), "solid: unknown solid, got 'bx'; did you mean 'box'?"),
        (lambda: jn.Inertia.solid("rod", mass=1), "length: is missing"),
        (lambda: jn.Inertia.solid("rod", mass=1, radius=2), "radius: a rod has no such size; valid: density, length"),
        (lambda: jn.Inertia.solid("rod", length=1), "mass: a rod needs a mass"),
        (lambda: jn.Inertia.solid("rod", length=1, density=1), "density: a rod is thin and has no volume, got 1"),
        (
            lambda: jn.Inertia.solid("sphere", radius=1, mass=1, density=1),
            "density: a sphere takes a mass or a density, not both, got 1",
        ),
        (lambda: jn.Inertia.solid("sphere", radius=1), "mass: a sphere needs a mass or a density"),
        (lambda: jn.Inertia.solid("sphere", radius=-1, mass=1), "radius: must be greater than zero, got -1"),
        (lambda: jn.Inertia.solid("sphere", radius=np.nan, mass=1), "radius: must be finite"),
        (lambda: jn.Inertia.solid("sphere", radius=1, mass=0), "mass: must be greater than zero"),
        (lambda: jn.Inertia.solid("sphere", radius=1, mass=1, axis="x"), "axis: a sphere has no axis, got 'x'"),
        (lambda: jn.Inertia.solid("disc", radius=1, mass=1, axis="w"), "axis: the axis is x, y or z, got 'w'"),
        (lambda: jn.Inertia.solid("box", size=[1, 2], mass=1), "size: must have the shape (3,), not (2,)"),
        (
            lambda: jn.Inertia.solid("tube", radius=1, inner_radius=1, length=1, mass=1),
            "inner_radius: the inner radius of a tube is at least zero and less than its radius, got 1",
        ),
        (lambda: jn.Inertia.from_pseudo(np.eye(3)), "pseudo: must have the shape (4, 4), not (3, 3)"),
        (lambda: jn.Inertia.from_pseudo(np.diag([1.0, 1, 1, 0])), "mass: must be greater than zero, got 0.0"),
        (lambda: jn.Inertia.from_pseudo(np.eye(4) + np.eye(4, k=1)), "pseudo: must be symmetric"),
        (lambda: jn.Inertia.from_pseudo(np.diag([-1.0, 0, 0, 1])), "inertia: has a negative principal moment"),
    ],
)
def test_what_no_solid_is(make, message):
    with pytest.raises(jn.errors.RobotError) as caught:
        make()
    assert message in str(caught.value)
