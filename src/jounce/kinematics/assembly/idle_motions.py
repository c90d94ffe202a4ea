"""Idle motions: bodies that may spin about an axis of their own without moving others.

A strut between a ball joint and a cylinder, or a rod between two balls, has such a degree of freedom. It is found from
the null space of the Jacobian: vectors of a basis whose bodies no other vector moves, and which turn these as one about
one line. That the motion is finite, and moves nothing else, is seen from the residual after large turns.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.kinematics.assembly.initial_revolutions import Coordinates, Displace
from jounce.kinematics.assembly.redundancy import Redundancy
from jounce.linear_algebra.clusters import clusters
from jounce.mechanism import Model
from jounce.mechanism.transmissions.axis_angles import quaternion_product, turned

TURNS = (0.9, -2.3)  # rad, by which bodies are spun
RELATED = 1e-6  # part of a velocity: less is rounding
_POSE = ("position", "quaternion")
HELD = 1e-8  # rad or sizes of the mechanism, by which constraints may be open after a spin

IdleMotions = dict[str, tuple[tuple[str, ...], tuple[float, float, float]]]
"""By the body that is held: all bodies that spin as one with it, and the axis on that body."""


def idle_motions(model: Model, redundant: Redundancy, coordinates: Coordinates, displace: Displace) -> IdleMotions:
    """Return the idle motions of a driven mechanism in space, if all degrees of freedom left are such; else none.

    Parameters
    ----------
    model : Model
        One that was assembled.
    redundant : Redundancy
        Of its equations.
    coordinates : dict of str to array
        Where they are fulfilled.
    displace : callable
        Takes coordinates and an increment to coordinates, residual and Jacobian.
    """
    driven = any(name.startswith("drivers.") for name in model.rows)
    if redundant.is_singular or not driven or "quaternion" not in coordinates:
        return {}
    directions = redundant.here.free_directions
    parts = directions.reshape(len(directions), len(model.bodies), -1)
    idle: IdleMotions = {}
    for members in _moved_together(parts):
        _, sizes, modes = np.linalg.svd(parts[:, members].reshape(len(parts), -1), full_matrices=False)
        if np.count_nonzero(sizes > 0.5) != 1:  # a projection of orthonormal vectors: each is one or zero
            return {}
        mode = modes[0].reshape(len(members), -1)
        spin = _spin(model, members, mode, coordinates)
        if spin is None or not _is_finite(members, spin, coordinates, displace):
            return {}
        first = members[0]
        axis = mode[0, 3:] / np.linalg.norm(mode[0, 3:])
        axis = axis if axis[np.argmax(np.abs(axis))] > 0 else -axis
        idle[model.bodies[first]] = tuple(model.bodies[k] for k in members), tuple(axis.tolist())
    return idle


def _moved_together(parts: Float[np.ndarray, "direction body coordinate"]) -> list[list[int]]:
    """Return clusters of bodies that directions of the null space move together."""
    projector = np.einsum("dbc,def->bcef", parts, parts)
    joined = np.sqrt((projector**2).sum(axis=(1, 3))) > RELATED
    return [cluster for cluster in clusters(joined) if joined[cluster[0], cluster[0]]]


def _spin(
    model: Model, members: list[int], mode: Float[np.ndarray, "member coordinate"], coordinates: Coordinates
) -> tuple[Any, Any] | None:
    """Return a unit vector and a point of the line about which bodies turn as one; None where they do not.

    Parameters
    ----------
    model : Model
        The mechanism.
    members : list of int
        Bodies, without the ground.
    mode : array of shape (members, 6)
        How each moves, scaled: the velocity of its origin, and its angular velocity in its own axes.
    coordinates : dict of str to array
        Of all bodies.
    """
    velocity = mode * np.asarray(model.system.column_scale)
    positions, attitudes = (np.asarray(coordinates[name])[:, [k + 1 for k in members], 0] for name in _POSE)
    turning = turned(attitudes, velocity[:, 3:].T)
    at_origin = velocity[:, :3].T - np.cross(turning.T, positions.T).T  # of the point in the global origin
    size = np.linalg.norm(turning[:, 0])
    scale = RELATED * np.array([size, size * model.length])
    alike = [np.abs(part - part[:, :1]).max(initial=0.0) for part in (turning, at_origin)]
    if size < RELATED or (np.array(alike) > scale).any():
        return None
    axis = turning[:, 0] / size
    if abs(axis @ at_origin[:, 0]) > scale[1]:  # a screw, which moves the bodies along the axis
        return None
    return axis, np.cross(axis, at_origin[:, 0]) / size


def _is_finite(members: list[int], spin: tuple[Any, Any], coordinates: Coordinates, displace: Displace) -> bool:
    """Tell whether all constraints hold after large turns of bodies about a line, while the others stay in place."""
    axis, point = spin
    bodies, still = [k + 1 for k in members], np.zeros(6 * (np.shape(coordinates["position"])[1] - 1))
    for angle in TURNS:
        turn = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])[:, None]
        position, attitude = (np.array(coordinates[name]) for name in _POSE)
        position[:, bodies, 0] = point[:, None] + turned(turn, position[:, bodies, 0] - point[:, None])
        attitude[:, bodies, 0] = quaternion_product(turn, attitude[:, bodies, 0])
        residual = displace({**coordinates, "position": position, "quaternion": attitude}, still).residual
        if not np.abs(residual).max(initial=0.0) < HELD:
            return False
    return True
