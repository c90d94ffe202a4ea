"""Homogeneous solids: volume, and moments of inertia per mass, from their sizes.

The formulas are plain arithmetic, so that sizes may be numbers or anything else that can be added and multiplied.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple


class HomogeneousSolid(NamedTuple):
    """A kind of solid: its sizes, its default axis, and its volume and moments.

    Attributes
    ----------
    sizes : tuple of str
        Names of its sizes, m.
    axis : str
        ``"x"``, ``"y"`` or ``"z"``; empty if no axis is special.
    measure : callable
        Maps the sizes to the volume, m^3 (None where a size is taken for zero), and to the moments of inertia over
        Maps the sizes to the volume, m^3 (None for thin solids), and to the moments of inertia per mass, m^2, about the
        axis and perpendicular to it; or about x, y and z.
    """

    sizes: tuple[str, ...]
    axis: str
    measure: Callable[..., tuple[Any, tuple[Any, ...]]]


def _box(size: Any) -> tuple[Any, tuple[Any, ...]]:
    x, y, z = size
    return x * y * z, ((y * y + z * z) / 12.0, (z * z + x * x) / 12.0, (x * x + y * y) / 12.0)


def _sphere(radius: Any) -> tuple[Any, tuple[Any, ...]]:
    moment = radius * radius * 0.4
    return radius * radius * radius * (4 * math.pi / 3), (moment, moment, moment)


def _tube(radius: Any, inner_radius: Any, length: Any) -> tuple[Any, tuple[Any, ...]]:
    outer, inner = radius * radius, inner_radius * inner_radius
    axial = (outer + inner) / 2.0
    return (outer - inner) * length * math.pi, (axial, axial / 2.0 + length * length / 12.0)


def _cylinder(radius: Any, length: Any) -> tuple[Any, tuple[Any, ...]]:
    return _tube(radius, 0.0, length)


def _capsule(radius: Any, length: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return volume and moments of a cylinder of a given length between two half spheres."""
    balls = radius * (4.0 / 3.0)  # length of a cylinder with the volume of the half spheres
    squared, full_length = radius * radius, length + balls
    axial = (length * squared / 2.0 + balls * squared * 0.4) / full_length
    lever = squared * 0.4 + length * length / 4.0 + length * radius * 0.375
    transverse = (length * (length * length / 12.0 + squared / 4.0) + balls * lever) / full_length
    return squared * full_length * math.pi, (axial, transverse)


def _cone(radius: Any, length: Any) -> tuple[Any, tuple[Any, ...]]:
    squared = radius * radius
    return squared * length * (math.pi / 3), (squared * 0.3, squared * 0.15 + length * length * 0.0375)


def _ellipsoid(size: Any) -> tuple[Any, tuple[Any, ...]]:
    x, y, z = size
    return x * y * z * (math.pi / 6), ((y * y + z * z) / 20.0, (z * z + x * x) / 20.0, (x * x + y * y) / 20.0)


def _rod(length: Any) -> tuple[Any, tuple[Any, ...]]:
    return None, (0.0, length * length / 12.0)


def _disc(radius: Any) -> tuple[Any, tuple[Any, ...]]:
    return None, (radius * radius / 2.0, radius * radius / 4.0)


SOLIDS = {
    "box": HomogeneousSolid(("size",), "", _box),
    "sphere": HomogeneousSolid(("radius",), "", _sphere),
    "cylinder": HomogeneousSolid(("radius", "length"), "z", _cylinder),
    "tube": HomogeneousSolid(("radius", "inner_radius", "length"), "z", _tube),
    "capsule": HomogeneousSolid(("radius", "length"), "z", _capsule),
    "cone": HomogeneousSolid(("radius", "length"), "z", _cone),
    "ellipsoid": HomogeneousSolid(("size",), "", _ellipsoid),
    "rod": HomogeneousSolid(("length",), "x", _rod),
    "disc": HomogeneousSolid(("radius",), "z", _disc),
}


def solid_moments(kind: str, axis: str, sizes: dict[str, Any]) -> tuple[Any, tuple[Any, Any, Any]]:
    """Return the volume of a solid, None for a thin one, and its moments per mass about x, y and z.

    Examples
    --------
    >>> solid_moments("rod", "x", {"length": 6.0})
    (None, (0.0, 3.0, 3.0))
    """
    volume, moments = SOLIDS[kind].measure(**sizes)
    if len(moments) == 3:
        return volume, (moments[0], moments[1], moments[2])
    axial, transverse = moments
    x, y, z = (axial if letter == axis else transverse for letter in "xyz")
    return volume, (x, y, z)


def pseudo_parts(pseudo: Any) -> tuple[Any, list[Any], list[list[Any]]]:
    """Return the mass, the center of mass and the second moments about it from a matrix of pseudo-inertia.

    Parameters
    ----------
    pseudo : sequence of sequences
        ``[[S, m c], [m c^T, m]]`` with S the integral of rho rho^T dm about the origin; (4, 4), or (3, 3) in the plane.
    """
    size = range(len(pseudo) - 1)
    mass, first = pseudo[-1][-1], [row[-1] for row in pseudo[:-1]]
    second = [[pseudo[i][k] - first[i] * first[k] / mass for k in size] for i in size]
    return mass, [moment / mass for moment in first], second
