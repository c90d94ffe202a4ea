"""Which way parts lie in joints that would hold them turned over as well.

The rows of a hinge or a guide hold a body in two ways: as drawn, and with its axis the other way round. The second is
no assembly that anybody means, and no motion leads from one to the other.
"""

import numpy as np
from jaxtyping import Bool, Float

from jounce.mechanism.system import Group, System

PAIRS = (("axis_i", "axis_j"), ("normal_i", "normal_j"), ("vector_i", "vector_j"))
PARALLEL_VECTORS = ("parallel1", "prismatic")  # of the plane: joints of space have axes
Coordinates = dict[str, np.ndarray]


def senses(system: System, coordinates: Coordinates) -> Bool[np.ndarray, " pair"]:
    """Tell of each pair of directions that joints hold parallel whether they point the same way.

    Coordinates have the shape (..., bodies), the ground first.
    """
    found = [_products(group, names, coordinates) for group in system.groups for names in _parallel(group)]
    return np.concatenate([*found, np.zeros(0)]) >= 0


def _parallel(group: Group) -> list[tuple[str, str]]:
    element = group.element
    if group.is_driver:
        return []
    held = [names for names in PAIRS[:2] if all(hasattr(element, name) for name in names)]
    if type(element).space == "planar" and element.type_name in PARALLEL_VECTORS:
        held.append(PAIRS[2])
    return held


def _products(group: Group, names: tuple[str, str], coordinates: Coordinates) -> Float[np.ndarray, " instance"]:
    bodies = [np.array(slot) for slot in group.bodies[:2]]
    first, second = (
        _turned(np.asarray(getattr(group.element, name))[..., 0], coordinates, slot)
        for name, slot in zip(names, bodies, strict=True)
    )
    return np.sum(first * second, axis=0)


def _turned(
    vectors: Float[np.ndarray, "component instance"], coordinates: Coordinates, bodies: np.ndarray
) -> Float[np.ndarray, "component instance"]:
    """Return vectors given in the axes of bodies in global ones."""
    vectors = np.broadcast_to(vectors, (len(vectors), len(bodies)))
    if "angle" in coordinates:
        c, s = np.cos(coordinates["angle"][bodies]), np.sin(coordinates["angle"][bodies])
        return np.stack([c * vectors[0] - s * vectors[1], s * vectors[0] + c * vectors[1]])
    e0, e = coordinates["quaternion"][0, bodies], coordinates["quaternion"][1:, bodies]
    across = np.cross(e, vectors, axis=0)
    return vectors + 2.0 * (e0 * across + np.cross(e, across, axis=0))
