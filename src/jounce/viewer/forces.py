"""Applied forces as vectors at points: along lines, along directions, about axes, and by components."""

from __future__ import annotations

from typing import Any

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve_element
from jounce.viewer.take import Exertion, poses, rotated, spatial_vectors

__all__ = ["applied"]


def applied(motion: Any, good: np.ndarray) -> list[Exertion]:
    """Return what the applied forces of a motion do to their last body, at the instants that were solved."""
    from jounce.dynamics import applied_force

    mechanism = motion.mechanism
    position, quaternion = (array[good] for array in poses(motion))
    names = (GROUND, *mechanism.bodies)
    found = []
    for name, force in mechanism.forces.items():
        components = 2 if mechanism.space == "planar" else 3
        values = resolve_element(force, mechanism.parameter_values, components, f"forces.{name}")
        size = np.asarray(applied_force(motion, name).values)[good][:, 0]
        attitude = {body: quaternion[:, names.index(body)] for body in force.bodies}
        places = _places(force, values, position, quaternion, names)
        vector = _vector(force, values, size, attitude, places)
        if vector is not None:
            turning = force.unit != "N"
            pair = (None, vector) if turning else (vector, None)
            found.append(Exertion(name, "applied", places[-1], *pair))
    return found


def _places(force: Any, values: Any, position: np.ndarray, quaternion: np.ndarray, names: Any) -> list[np.ndarray]:
    """Return the points of a force on its bodies, (time, 3) each; the origin of a body where it has none."""
    places = []
    for slot, body in enumerate(force.bodies):
        keys = ("point",) if len(force.bodies) == 1 else (f"point_{'ijmn'[slot : slot + 1]}",)
        local = next((values[key] for key in keys if values.get(key) is not None), np.zeros(3))
        index = names.index(body)
        places.append(position[:, index] + rotated(quaternion[:, index], spatial_vectors(np.asarray(local, float))))
    return places


def _vector(force: Any, values: Any, size: np.ndarray, attitude: Any, places: list[np.ndarray]) -> Any:
    """Return a force or a torque as a global vector, (time, 3); None for a law of no direction that is known here."""
    first, last = force.bodies[0], force.bodies[-1]
    if size.ndim == 2:  # by components
        whole = spatial_vectors(size)
        return rotated(attitude[last], whole) if getattr(force, "frame", "global") == "body" else whole
    for key in ("vector_i", "axis_i"):
        if values.get(key) is not None and (key == "axis_i" or force.unit == "N"):
            along = spatial_vectors(np.asarray(values[key], float))
            return rotated(attitude[first], along / np.linalg.norm(along)) * size[:, None]
    if force.unit != "N":
        return np.array([0.0, 0.0, 1.0]) * size[:, None]
    if len(places) == 2 and "point_i" in values:
        line = places[1] - places[0]
        length = np.linalg.norm(line, axis=1, keepdims=True)
        return line / np.where(length > 0, length, 1.0) * size[:, None]
    return None
