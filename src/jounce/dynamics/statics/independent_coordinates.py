"""Small motions in independent coordinates: the choice of coordinates, and the changes of all bodies with them.

The independent coordinates are released drivers, outputs, or coordinates of bodies. With the constraints they determine
every change of a motion, order after order: the k-th Taylor coefficient of the change follows from one matrix, the
constraint Jacobian stacked on the gradients of the coordinates, as in a solve.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.dynamics.statics.operating_point import Lanes, OperatingPoint, changes_of_coordinates, null_space
from jounce.dynamics.statics.variations import LEVELS, law_variations
from jounce.errors import MechanismError, check_name
from jounce.linear_algebra.host_jacobian import RANK_TOLERANCE
from jounce.mechanism import Mechanism
from jounce.mechanism.building.element_indices import element_indices
from jounce.mechanism.laws.driver_outputs import is_turning

COLUMNS = {"planar": ("x", "y", "angle"), "spatial": ("x", "y", "z", "turn_x", "turn_y", "turn_z")}
TIE = 0.99  # fraction of the best candidate: equally good coordinates are taken in the order of the mechanism
SHIFT = 0.9  # weight of shifts relative to rotations in the choice of coordinates: angles read better
NOWHERE = 1e-8  # fraction of the largest force: less is balanced
ROUNDING = 1e-12  # fraction of the sum of the absolute values of all terms


@dataclasses.dataclass(frozen=True, eq=False)
class Reduction:
    """The equations of small motions in independent coordinates: ``M y'' + C y' + K y = ...``.

    Parameters
    ----------
    point : OperatingPoint
        Motion about which the equations are linearized.
    names, units : tuple of str
        Names and units of the coordinates.
    released : tuple of str
        Released drivers, the first coordinates.
    held : tuple of str
        Drivers that are not released.
    changes : array of shape (3, columns, lanes)
        Taylor coefficients of the scaled changes of all bodies. Lanes are a unit of each coordinate, then of each rate,
        then of each second derivative, followed by those of each held driver.
    matrices : array of shape (coordinates, lanes)
        Generalized forces along the coordinates that these changes require.
    sizes : array of shape (coordinates, lanes)
        The generalized forces with absolute values of all terms, as a scale of rounding.
    """

    point: OperatingPoint
    names: tuple[str, ...]
    units: tuple[str, ...]
    released: tuple[str, ...]
    held: tuple[str, ...]
    changes: Lanes
    matrices: Float[np.ndarray, "coordinate lane"]
    sizes: Float[np.ndarray, "coordinate lane"]

    def part(self, level: int) -> Float[np.ndarray, "coordinate coordinate"]:
        """Return the stiffness, damping or mass matrix, for level 0, 1 or 2."""
        return self.matrices[:, self.lanes(level)]

    def noise(self, level: int) -> Float[np.ndarray, "coordinate coordinate"]:
        """Return the rounding error of the matrix of a level."""
        return ROUNDING * self.sizes[:, self.lanes(level)]

    def lanes(self, level: int, *, drivers: bool = False) -> slice:
        """Return the lanes of one level of the coordinates, or of the held drivers."""
        n, m = len(self.names), len(self.held)
        first, count = (LEVELS * n + level * m, m) if drivers else (level * n, n)
        return slice(first, first + count)

    @property
    def basis(self) -> Float[np.ndarray, "column coordinate"]:
        """The derivatives of the scaled coordinates of all bodies with respect to the independent coordinates."""
        return self.changes[0][:, self.lanes(0)]


def reduced(
    point: OperatingPoint,
    names: Sequence[str] | None = None,
    released: Sequence[str] = (),
    *,
    prefer_outputs: bool = False,
    drivers: bool = True,
) -> Reduction:
    """Return the equations of small motions about a motion, in independent coordinates.

    Parameters
    ----------
    point : OperatingPoint
        Motion about which the equations are linearized.
    names : sequence of str, optional
        Names of coordinates other than released drivers; chosen automatically by default.
    released : sequence of str
        Drivers that keep their force instead of their coordinate.
    prefer_outputs : bool, default False
        Choose among outputs instead of the coordinates of bodies.
    drivers : bool, default True
        Include changes of the laws of held drivers.

    Raises
    ------
    MechanismError
        If a name is not that of a coordinate, or the named coordinates are not independent.
    """
    free_directions = point.free
    chosen = _chosen(point, free_directions, prefer_outputs) if names is None else tuple(names)
    gradients = _gradients(point, chosen, free_directions)
    driving = tuple(name for name in point.mechanism.drivers if name not in released) if drivers else ()
    n, m = len(released) + len(chosen), len(driving)
    laws, targets = _directions(len(released), len(chosen), m)
    rows = _laws_varied(point, (*released, *driving), laws)
    matrix = np.concatenate([point.jacobian, gradients])
    inverse = np.linalg.pinv(matrix, rcond=RANK_TOLERANCE)
    changes = np.zeros((LEVELS, len(point.scale), targets.shape[-1]))
    output_names = [name for name in chosen if name in point.output_gradients] if chosen else []
    for level in range(LEVELS):
        gaps = rows[level] + point.varied(changes)[1][level] if level else rows[level]
        target_gaps = targets[level] - gradients @ changes[level]
        if level and output_names:
            target_gaps = targets[level] - _measured(point, chosen, changes, level)
        changes[level] = inverse @ np.concatenate([-gaps, target_gaps])
    forces, _ = point.varied(changes)
    basis = changes[0][:, :n]
    units = [_unit_of_driver(point.mechanism, name) for name in released] + [_unit(point, name) for name in chosen]
    matrices, sizes = basis.T @ forces.sum(axis=0), np.abs(basis).T @ np.abs(forces).sum(axis=0)
    sizes[:, : 2 * n] += np.concatenate(_magnitudes(point, basis), axis=1)
    if rolls(point):
        _check_nowhere(point, (*released, *chosen), (gradients, inverse, basis, sizes.max(axis=1)), len(released))
    return Reduction(point, (*released, *chosen), tuple(units), tuple(released), driving, changes, matrices, sizes)


def rolls(point: OperatingPoint) -> bool:
    """Return whether joints are nonholonomic, so that there are more positions than small motions."""
    return any(joint.nonholonomic for joint in point.mechanism.joints.values())


def _check_nowhere(
    point: OperatingPoint, names: tuple[str, ...], reduction: tuple[Any, Any, Any, Any], released: int
) -> None:
    """Raise MechanismError unless small motions are independent of the positions to which wheels have rolled.

    Positions that the coordinates do not determine, such as the place and heading of a bicycle, are varied one by one,
    with the velocities that the constraints then require: the balance of forces must not change.
    """
    gradients, inverse, basis, sizes = reduction
    count, chosen = len(point.scale), names[released:]
    rows = point.varied(changes_of_coordinates(np.eye(count)))[1][0]
    directions = null_space(rows)
    directions = directions - basis @ (gradients @ directions) if len(gradients) else directions
    changes = changes_of_coordinates(directions)
    for level in (1, 2):
        gaps = point.varied(changes)[1][level]
        output_changes = _measured(point, chosen, changes, level) if chosen else np.zeros((0, gaps.shape[1]))
        changes[level] = inverse @ np.concatenate([-gaps, -output_changes])
    unbalanced = basis.T @ point.varied(changes)[0].sum(axis=0)
    if released or (np.abs(unbalanced) > NOWHERE * sizes[:, None]).any():
        message = (
            "small motions of wheels that roll are known where they do not depend on the places that wheels have "
            "rolled to: name coordinates that determine the motion of bodies for any heading, release no driver, and "
            "look at a steady motion"
        )
        raise MechanismError(message, name="coordinates", value=list(names))


def _magnitudes(point: OperatingPoint, basis: Float[np.ndarray, "column coordinate"]) -> list[np.ndarray]:
    """Return the sizes of the terms of loads in the stiffness and of velocities in the damping, without cancellation.

    Applied forces count one by one, since the geometric stiffness of a spring may cancel that of another, or its own.
    """
    bodies = len(point.model.bodies)
    borne = np.abs(point.jacobian).T @ np.abs(point.multipliers)
    load = np.stack([*np.abs(point.loads), borne]).sum(axis=0).reshape(bodies, -1).max(axis=1) + point.pushed
    rate = [point.coordinates[name][1 if name in ("position", "angle") else 0, ..., 1:, 0]
            for name in ("position", "angle" if point.model.pose_type.turns == 1 else "angular_velocity")]  # fmt: skip
    speed = np.abs(rate[0]).max(axis=0) / point.model.length + np.abs(np.atleast_2d(rate[1])).max(axis=0)
    mass = np.abs(point.masses).max(axis=(0, 1))
    displacements = np.linalg.norm(basis.reshape(bodies, -1, basis.shape[1]), axis=1)
    return [np.einsum("b,bi,bj->ij", weight, displacements, displacements) for weight in (load, mass * speed)]


def with_joints(reduction: Reduction, names: Sequence[str]) -> Reduction:
    """Return the reduction with its coordinates named after joints."""
    return dataclasses.replace(reduction, names=tuple(names), released=tuple(names))


def column_names(point: OperatingPoint) -> list[str]:
    """Return the names of the coordinates of all moving bodies."""
    return [f"{body}.{name}" for body in point.model.bodies for name in COLUMNS[point.mechanism.space]]


def chosen_outputs(point: OperatingPoint) -> tuple[str, ...]:
    """Return outputs that together determine the motion of all bodies."""
    return _chosen(point, point.free, True)


def _chosen(
    point: OperatingPoint, directions: Float[np.ndarray, "column direction"], prefer_outputs: bool
) -> tuple[str, ...]:
    """Return well-conditioned independent coordinates, chosen by pivoting on the largest remaining row."""
    if prefer_outputs:
        names = list(point.output_gradients)
        rows = np.array([point.output_gradients[name] for name in names]).reshape(-1, len(directions)) @ directions
        rows = rows / np.array([1.0 if _unit(point, name) == "rad" else point.model.length for name in names])[:, None]
    else:
        names = column_names(point)
        width = len(COLUMNS[point.mechanism.space])
        turns = np.arange(width) >= point.model.pose_type.shifts
        rows = directions * np.tile(np.where(turns, 1.0, SHIFT), len(point.model.bodies))[:, None]
        if rolls(point):  # the axes of a turning wheel differ at every instant
            spin = np.abs(point.coordinates["angular_velocity"][0, :, 1:, 0]).max(axis=0)
            rows[np.repeat(spin > NOWHERE * spin.max(initial=0.0), width)] *= 1e-3
    columns: list[int] = []
    remaining = rows.copy()
    for _ in range(directions.shape[1]):
        lengths = np.linalg.norm(remaining, axis=1)
        if not lengths.max(initial=0.0) > 1e-6:
            raise MechanismError("do not determine how all bodies move; name coordinates of bodies", name="outputs")
        row = int(np.argmax(lengths >= TIE * lengths.max()))
        direction = remaining[row] / lengths[row]
        remaining = remaining - np.outer(remaining @ direction, direction)
        columns.append(row)
    return tuple(names[k] for k in sorted(columns))


def _gradients(
    point: OperatingPoint, names: Sequence[str], directions: Float[np.ndarray, "column direction"]
) -> Float[np.ndarray, "coordinate column"]:
    """Return the gradients of named coordinates with respect to the scaled coordinates of the bodies.

    Raises
    ------
    MechanismError
        If a name is not that of a coordinate, or the coordinates are not independent.
    """
    columns = column_names(point)
    rows = []
    for name in names:
        if name in columns:
            rows.append(np.eye(len(columns))[columns.index(name)] * point.scale)
            continue
        check_name("coordinate", name, (*columns, *point.output_gradients), MechanismError, name="coordinates")
        rows.append(point.output_gradients[name])
    gradients = np.array(rows).reshape(-1, len(columns))
    count = directions.shape[1]
    if len(names) != count or len(set(names)) != len(names):
        noun = "coordinate is" if count == 1 else "coordinates are"
        message = f"{count} independent {noun} needed besides those of released drivers; one name for each"
        raise MechanismError(message, name="coordinates", value=list(names))
    if count:
        sizes = np.array([1.0 if _unit(point, name) == "rad" else point.model.length for name in names])
        values = np.linalg.svd(gradients @ directions / sizes[:, None], compute_uv=False)
        if not values.min() > 1e-6:
            suggested = ", ".join(_chosen(point, directions, False))
            message = f"are not independent here, and do not determine the motion of all bodies; use {suggested}"
            raise MechanismError(message, name="coordinates", value=list(names))
    return gradients


def _directions(released: int, chosen: int, driving: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Taylor coefficients of laws, (3, drivers, lanes), and of other coordinates, for a unit of each level."""
    n = released + chosen
    lanes = LEVELS * (n + driving)
    laws, targets = np.zeros((LEVELS, released + driving, lanes)), np.zeros((LEVELS, chosen, lanes))
    for level in range(LEVELS):
        unit = 1 / math.factorial(level)
        for k in range(n):
            (laws if k < released else targets)[level, k if k < released else k - released, level * n + k] = unit
        for k in range(driving):
            laws[level, released + k, LEVELS * n + level * driving + k] = unit
    return laws, targets


def _laws_varied(point: OperatingPoint, names: Sequence[str], laws: np.ndarray) -> Float[np.ndarray, "3 row lane"]:
    if not names:
        return np.zeros((LEVELS, len(point.jacobian), laws.shape[-1]))
    indices = element_indices(point.model)
    order = tuple((indices[name].group, indices[name].instance) for name in names)
    return np.asarray(law_variations(point.equations, point.coordinates, point.clock, order, laws))


def _measured(
    point: OperatingPoint, names: Sequence[str], changes: Lanes, level: int
) -> Float[np.ndarray, "coordinate lane"]:
    """Return the Taylor coefficients of coordinates for changes, which may be incomplete at this level."""
    varied = point.outputs_varied(changes)
    components, columns = point.components([x.shape[1] for x in varied]), column_names(point)
    rows = []
    for name in names:
        if name in columns:
            k = columns.index(name)
            rows.append(point.scale[k] * changes[level][k])
        else:
            group, component, instance = components[name]
            rows.append(varied[group][level, component, instance])
    return np.array(rows)


def _unit(point: OperatingPoint, name: str) -> str:
    columns = column_names(point)
    if name in columns:
        width = len(COLUMNS[point.mechanism.space])
        return "m" if columns.index(name) % width < point.model.pose_type.shifts else "rad"
    output = max((n for n in point.mechanism.outputs if name == n or name.startswith(f"{n}_")), key=len)
    return point.mechanism.outputs[output].unit


def _unit_of_driver(mechanism: Mechanism, name: str) -> str:
    return "rad" if is_turning(mechanism.drivers[name]) else "m"
