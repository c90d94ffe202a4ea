"""Idle motions: bodies that may spin about their own axis without moving others.

A strut between a ball joint and a cylinder, or a rod between two balls, has such a degree of freedom. It appears in the
null space of the Jacobian as a basis vector that turns its bodies as one about one line, while no other vector moves
them. The residual after large turns shows whether the motion is finite and moves nothing else.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.kinematics.assembly.initial_revolutions import Coordinates, Displace
from jounce.kinematics.assembly.redundancy import Redundancy
from jounce.linear_algebra.clusters import clusters
from jounce.mechanism import Model
from jounce.mechanism.transmissions.axis_angles import quaternion_product, turned

TURNS = (0.9, -2.3)  # rad, of the test spins
RELATED = 1e-6  # relative to a velocity: smaller parts are rounding
_POSE = ("position", "quaternion")
HELD = 1e-8  # rad or sizes of the mechanism: largest residual after a spin

IdleMotions = dict[str, tuple[tuple[str, ...], tuple[float, float, float]]]
"""For each held body, all bodies that spin as one with it, and the axis in its frame."""


def idle_motions(model: Model, redundant: Redundancy, coordinates: Coordinates, displace: Displace) -> IdleMotions:
    """Return the idle motions of a driven spatial mechanism; none unless they are all its degrees of freedom.

    Parameters
    ----------
    model : Model
        The assembled model.
    redundant : Redundancy
        Redundancy of its equations.
    coordinates : dict of str to array
        The assembled coordinates.
    displace : callable
        Maps coordinates and an increment to coordinates, residual and Jacobian.
    """
    driven = any(name.startswith("drivers.") for name in model.rows)
    if redundant.is_singular or not driven or "quaternion" not in coordinates:
        return {}
    directions = redundant.at_assembly.free_directions
    parts = directions.reshape(len(directions), len(model.bodies), -1)
    idle: IdleMotions = {}
    for members in _moved_together(parts):
        _, sizes, modes = np.linalg.svd(parts[:, members].reshape(len(parts), -1), full_matrices=False)
        if np.count_nonzero(sizes > 0.5) != 1:  # projections of orthonormal vectors: singular values are one or zero
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
    """Return clusters of bodies that null-space directions move together."""
    projector = np.einsum("dbc,def->bcef", parts, parts)
    related = np.sqrt((projector**2).sum(axis=(1, 3))) > RELATED
    return [cluster for cluster in clusters(related) if related[cluster[0], cluster[0]]]


def _spin(
    model: Model, members: list[int], mode: Float[np.ndarray, "member coordinate"], coordinates: Coordinates
) -> tuple[Any, Any] | None:
    """Return the axis about which bodies turn as one, as unit vector and point; None if there is none.

    Parameters
    ----------
    model : Model
        The mechanism.
    members : list of int
        Bodies, numbered without the ground.
    mode : array of shape (members, 6)
        Scaled velocity of each body: that of its origin, and its angular velocity in its own axes.
    coordinates : dict of str to array
        Coordinates of all bodies.
    """
    velocity = mode * np.asarray(model.system.column_scale)
    positions, attitudes = (np.asarray(coordinates[name])[:, [k + 1 for k in members], 0] for name in _POSE)
    omega = turned(attitudes, velocity[:, 3:].T)
    at_origin = velocity[:, :3].T - np.cross(omega.T, positions.T).T  # velocity of the point at the global origin
    size = np.linalg.norm(omega[:, 0])
    scale = RELATED * np.array([size, size * model.length])
    spreads = [np.abs(part - part[:, :1]).max(initial=0.0) for part in (omega, at_origin)]
    if size < RELATED or (np.array(spreads) > scale).any():
        return None
    axis = omega[:, 0] / size
    if abs(axis @ at_origin[:, 0]) > scale[1]:  # a screw motion, with translation along the axis
        return None
    return axis, np.cross(axis, at_origin[:, 0]) / size


def _is_finite(members: list[int], spin: tuple[Any, Any], coordinates: Coordinates, displace: Displace) -> bool:
    """Return whether all constraints hold after large turns of bodies about a line, the other bodies at rest."""
    axis, point = spin
    bodies, no_increment = [k + 1 for k in members], np.zeros(6 * (np.shape(coordinates["position"])[1] - 1))
    for angle in TURNS:
        turn = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])[:, None]
        position, attitude = (np.array(coordinates[name]) for name in _POSE)
        position[:, bodies, 0] = point[:, None] + turned(turn, position[:, bodies, 0] - point[:, None])
        attitude[:, bodies, 0] = quaternion_product(turn, attitude[:, bodies, 0])
        residual = displace({**coordinates, "position": position, "quaternion": attitude}, no_increment).residual
        if not np.abs(residual).max(initial=0.0) < HELD:
            return False
    return True
