"""Loads of joints, drivers and applied forces on the bodies of a mechanism, as forces and torques at points."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jounce.dynamics import applied_force, joint_reaction
from jounce.errors import JounceError
from jounce.kinematics import Motion
from jounce.mechanism import Mechanism
from jounce.plot.drawings.frames import Frame, frames, points_at
from jounce.plot.drawings.geometry import Symbol, skeleton
from jounce.viewer.shapes.recording import Load, Vectors, spatial_vectors


def has_loads(mechanism: Mechanism) -> bool:
    """Return whether a mechanism has masses or applied forces, and thus reactions."""
    return bool(mechanism.forces) or any(body.mass is not None for body in mechanism.bodies.values())


def mechanism_loads(motion: Motion, solved: Bool[np.ndarray, " all"]) -> list[Load]:
    """Return the loads of joints, drivers and applied forces on the last of their bodies, at the solved instants.

    Raises
    ------
    JounceError
        If the order of the motion is too low for forces.
    """
    if not has_loads(motion.mechanism):
        return []
    if motion.order < 2:
        raise JounceError("forces need accelerations; set the order to 2 or more", name="order", value=motion.order)
    skeleton_ = skeleton(motion.mechanism)
    poses = {body: frame[solved] for body, frame in frames(motion).items()}
    loads = [_reaction(motion, solved, poses, symbol, "reaction") for symbol in skeleton_.symbols]
    loads += [_reaction(motion, solved, poses, symbol, "driver") for symbol in skeleton_.drivers]
    for symbol in skeleton_.forces:
        force, size = motion.mechanism.forces[symbol.name], applied_force(motion, symbol.name).values[solved][:, 0]
        points = [points_at(poses[body], point) for body, point in zip(symbol.bodies, symbol.points, strict=True)]
        vector = _applied(force, symbol, size, poses, points)
        if vector is not None:
            pair = {"force" if force.unit == "N" else "torque": vector}
            loads.append(Load(symbol.name, "applied", spatial_vectors(points[-1]), **pair))
    return loads


def _reaction(
    motion: Motion, solved: Bool[np.ndarray, " all"], poses: dict[str, Frame], symbol: Symbol, kind: str
) -> Load:
    """Return the load of a joint or a driver on its second body."""
    slot = min(1, len(symbol.bodies) - 1)
    reaction = joint_reaction(motion, symbol.name, point=symbol.points[slot])
    force, torque = reaction.force.values[solved][:, 0], reaction.torque.values[solved]
    if torque.ndim == 2:  # planar: about z
        torque = _about_z(torque[:, 0])
    else:
        torque = torque[:, 0]
    point = points_at(poses[symbol.bodies[slot]], symbol.points[slot])
    return Load(symbol.name, kind, spatial_vectors(point), spatial_vectors(force), torque)


def _about_z(size: Float[np.ndarray, " time"]) -> Vectors:
    return np.array([0.0, 0.0, 1.0]) * size[:, None]


def _applied(
    force: Any,
    symbol: Symbol,
    size: Float[np.ndarray, "time *component"],
    poses: dict[str, Frame],
    points: list[Float[np.ndarray, "time component"]],
) -> Vectors | None:
    """Return a force or a torque as a global vector; None if its direction is unknown."""
    if size.ndim == 2:  # by components
        if getattr(force, "frame", "global") == "body":
            size = np.einsum("tck,tk->tc", poses[symbol.bodies[-1]][:, :, 1:], size)
        return spatial_vectors(size)
    axis = symbol.axes[0]
    if axis is not None and (force.unit == "N" or len(axis) == 3):
        direction = poses[symbol.bodies[0]][:, :, 1:] @ (axis / np.linalg.norm(axis))
        return spatial_vectors(direction) * size[:, None]
    if force.unit != "N":
        return _about_z(size)
    if len(points) == 2 and hasattr(force, "point_i"):
        line = points[1] - points[0]
        length = np.linalg.norm(line, axis=1, keepdims=True)
        return spatial_vectors(line / np.where(length > 0, length, 1.0)) * size[:, None]
    return None
