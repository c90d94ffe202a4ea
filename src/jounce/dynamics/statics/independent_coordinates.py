"""Small motions in independent coordinates: which ones, and how all bodies move as each of them does.

The independent coordinates are named: drivers that are released, outputs, or coordinates of bodies. Together with the
constraints they determine every change of a motion, order after order: the k-th Taylor coefficient of the change
follows from one matrix, the Jacobian of the constraints above the gradients of the coordinates, as in a solve.
"""

import dataclasses
import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from jaxtyping import Float

from jounce.dynamics.forward.accelerations import Equations
from jounce.dynamics.statics.variations import (
    LEVELS,
    law_variations,
    loads_at,
    masses_at,
    output_variations,
    variations,
)
from jounce.errors import MechanismError, check_name
from jounce.linear_algebra.host_jacobian import RANK_TOLERANCE
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.driver_outputs import is_turning
from jounce.mechanism.element_indices import element_indices

COLUMNS = {"planar": ("x", "y", "angle"), "spatial": ("x", "y", "z", "turn_x", "turn_y", "turn_z")}
TIE = 0.99  # of the largest: candidates as good as that are taken in the order of the mechanism
SHIFT = 0.9  # by which shifts count less than turns where coordinates are chosen: angles read better
ROUNDING = 1e-12  # of the sum of the sizes of what enters a sum

Lanes = Float[np.ndarray, "3 column lane"]
"""Taylor coefficients of changes of the scaled coordinates of all moving bodies."""


@dataclasses.dataclass(frozen=True, eq=False)
class Place:
    """A mechanism in a motion at one instant, where small changes of that motion are looked at.

    Parameters
    ----------
    mechanism : Mechanism
        What moves.
    model : Model
        Its numbers, the rows scaled.
    equations : Equations
        Its forces there, with the turns that angles about axes have.
    coordinates : dict of str to array
        Taylor coefficients to order 2 of the coordinates of all bodies, the ground first; a batch of one.
    clock : array of shape (3, 1, 1)
        Those of time; of rate zero where the laws of time are held.
    """

    mechanism: Mechanism
    model: Model
    equations: Equations
    coordinates: dict[str, np.ndarray]
    clock: np.ndarray

    @cached_property
    def _found(self) -> tuple[np.ndarray, np.ndarray]:
        parts, jacobian = loads_at(self.equations, self.coordinates, self.clock)
        return np.asarray(parts), np.asarray(jacobian)

    @property
    def loads(self) -> Float[np.ndarray, "2 column"]:
        """Inertia less weight, and applied forces with the minus sign, in scaled coordinates: N m, or N by size."""
        return self.as_columns(self._found[0][..., None])[..., 0]

    @property
    def jacobian(self) -> Float[np.ndarray, "row column"]:
        """Of all constraints, scaled on both sides."""
        return self._found[1]

    @property
    def scale(self) -> Float[np.ndarray, " column"]:
        """Of the coordinates of the moving bodies, m or rad."""
        return np.tile(np.asarray(self.model.system.column_scale), len(self.model.bodies))

    @cached_property
    def multipliers(self) -> Float[np.ndarray, " row"]:
        """Of the scaled rows: the shortest ones that balance the loads."""
        load = self.loads.sum(axis=0)
        return -np.linalg.lstsq(self.jacobian.T, load, rcond=RANK_TOLERANCE)[0] if len(self.jacobian) else np.zeros(0)

    @cached_property
    def free(self) -> Float[np.ndarray, "column direction"]:
        """Orthonormal directions of the scaled coordinates that all constraints leave free."""
        return null_space(self.jacobian)

    @cached_property
    def masses(self) -> Float[np.ndarray, "coordinate coordinate body"]:
        """Mass matrices of the moving bodies, their rows and columns scaled, kg m^2."""
        scale = np.asarray(self.model.system.column_scale)
        return np.asarray(masses_at(self.equations, self.coordinates)) * (scale[:, None] * scale)[..., None]

    def as_columns(self, by_body: Float[np.ndarray, "... coordinate body lane"]) -> np.ndarray:
        """Return what acts on the coordinates of bodies in the order of the scaled columns."""
        scaled = by_body * np.asarray(self.model.system.column_scale)[:, None, None]
        return np.swapaxes(scaled, -3, -2).reshape(*scaled.shape[:-3], -1, scaled.shape[-1])

    def changes(
        self, columns: Float[np.ndarray, "level column lane"]
    ) -> Float[np.ndarray, "level coordinate all lane"]:
        """Return changes of the scaled coordinates as shifts and turns of all bodies, the ground first, m and rad."""
        count = len(self.model.system.column_scale)
        parts = (columns * self.scale[:, None]).reshape(len(columns), -1, count, columns.shape[-1])
        return np.pad(np.swapaxes(parts, 1, 2), ((0, 0), (0, 0), (1, 0), (0, 0)))

    def varied(self, columns: Lanes) -> tuple[Float[np.ndarray, "3 column lane"], Float[np.ndarray, "3 row lane"]]:
        """Return how loads, with those of the joints, and the rows vary with changes of the scaled coordinates."""
        arguments = self.equations, self.coordinates, self.clock, self.multipliers[:, None], self.changes(columns)
        forces, rows = (np.asarray(x) for x in variations(*arguments))
        return self.as_columns(forces), rows

    def outputs_varied(self, columns: Lanes) -> list[Float[np.ndarray, "level component instance lane"]]:
        """Return how outputs, group by group, vary with changes of the scaled coordinates."""
        groups, pose_type = self.model.system.outputs, self.model.pose_type
        return [np.asarray(x) for x in output_variations(groups, self.coordinates, pose_type, self.changes(columns))]

    @cached_property
    def output_gradients(self) -> dict[str, Float[np.ndarray, " column"]]:
        """Gradients, by the scaled coordinates, of the components of outputs that are places or angles, by name."""
        count = len(self.scale)
        found = self.outputs_varied(np.stack([np.eye(count), *[np.zeros((count, count))] * 2]))
        places = self.components([x.shape[1] for x in found])
        groups = self.model.system.outputs
        return {name: found[g][0, c, k] for name, (g, c, k) in places.items() if not groups[g].element.lost_orders}

    def components(self, counts: Sequence[int]) -> dict[str, tuple[int, int, int]]:
        """Return group, component and instance of each component of an output, by its name in tables."""
        found = {}
        for index, (names, group) in enumerate(zip(self.model.outputs, self.model.system.outputs, strict=True)):
            labels = group.element.labels[: counts[index]] if counts[index] > 1 else ("",)
            for instance, name in enumerate(names):
                for k, label in enumerate(labels):
                    found[f"{name}_{label}" if label else name] = index, k, instance
        return {name: found[name] for name in sorted(found, key=self._order)}

    def _order(self, component: str) -> int:
        """Return the place of the output that a component belongs to in the order of the mechanism."""
        names = list(self.mechanism.outputs)
        return max(k for k, name in enumerate(names) if component == name or component.startswith(f"{name}_"))


@dataclasses.dataclass(frozen=True, eq=False)
class Reduction:
    """The equations of small motions in independent coordinates: ``M y'' + C y' + K y = ...``.

    Parameters
    ----------
    place : Place
        About what motion.
    names, units : tuple of str
        Of the coordinates.
    released : tuple of str
        Drivers among them, the first coordinates.
    changes : array of shape (3, columns, lanes)
        Taylor coefficients of the changes of all bodies, scaled, for a unit of each coordinate, of its rate and of its
        second derivative, one after the other, then for those of each driver that holds.
    matrices : array of shape (coordinates, lanes)
        Generalised forces of the coordinates that these changes need.
    sizes : array of shape (coordinates, lanes)
        What they would be if nothing cancelled: by it, what is rounding can be told.
    """

    place: Place
    names: tuple[str, ...]
    units: tuple[str, ...]
    released: tuple[str, ...]
    held: tuple[str, ...]
    changes: Lanes
    matrices: Float[np.ndarray, "coordinate lane"]
    sizes: Float[np.ndarray, "coordinate lane"]

    def part(self, level: int) -> Float[np.ndarray, "coordinate coordinate"]:
        """Return stiffness, damping or mass matrix, by the level of the derivative that it belongs to."""
        return self.matrices[:, self.lanes(level)]

    def noise(self, level: int) -> Float[np.ndarray, "coordinate coordinate"]:
        """Return by how much that matrix may be off by rounding."""
        return ROUNDING * self.sizes[:, self.lanes(level)]

    def lanes(self, level: int, *, drivers: bool = False) -> slice:
        """Return the lanes of one level of the coordinates, or of the drivers that hold."""
        own, other = len(self.names), len(self.held)
        first, count = (LEVELS * own + level * other, other) if drivers else (level * own, own)
        return slice(first, first + count)

    @property
    def basis(self) -> Float[np.ndarray, "column coordinate"]:
        """How the scaled coordinates of all bodies change with each coordinate."""
        return self.changes[0][:, self.lanes(0)]


def reduced(
    place: Place,
    wanted: Sequence[str] | None = None,
    released: Sequence[str] = (),
    *,
    prefer_outputs: bool = False,
    drivers: bool = True,
) -> Reduction:
    """Return the equations of small motions about a motion, in independent coordinates.

    Parameters
    ----------
    place : Place
        The motion.
    wanted : sequence of str, optional
        Names of coordinates, those of released drivers left out; chosen unless given.
    released : sequence of str
        Drivers whose force stays as it is, instead of their coordinate.
    prefer_outputs : bool, default False
        Choose among outputs instead of the coordinates of bodies.
    drivers : bool, default True
        Look at changes of the laws of the drivers that hold too.

    Raises
    ------
    MechanismError
        If a name is not one of a coordinate, or the coordinates named are not independent.
    """
    free = place.free
    chosen = _chosen(place, free, prefer_outputs) if wanted is None else tuple(wanted)
    gradients = _gradients(place, chosen, free)
    held = tuple(name for name in place.mechanism.drivers if name not in released) if drivers else ()
    own, other = len(released) + len(chosen), len(held)
    laws, targets = _directions(len(released), len(chosen), other)
    rows = _laws_varied(place, (*released, *held), laws)
    matrix = np.concatenate([place.jacobian, gradients])
    inverse = np.linalg.pinv(matrix, rcond=RANK_TOLERANCE)
    changes = np.zeros((LEVELS, len(place.scale), targets.shape[-1]))
    named = [name for name in chosen if name in place.output_gradients] if chosen else []
    for level in range(LEVELS):
        gaps = rows[level] + place.varied(changes)[1][level] if level else rows[level]
        away = targets[level] - gradients @ changes[level]
        if level and named:
            away = targets[level] - _measured(place, chosen, changes, level)
        changes[level] = inverse @ np.concatenate([-gaps, away])
    parts, _ = place.varied(changes)
    basis = changes[0][:, :own]
    units = [_unit_of_driver(place.mechanism, name) for name in released] + [_unit(place, name) for name in chosen]
    matrices, sizes = basis.T @ parts.sum(axis=0), np.abs(basis).T @ np.abs(parts).sum(axis=0)
    sizes[:, : 2 * own] += np.concatenate(_magnitudes(place, basis), axis=1)
    return Reduction(place, (*released, *chosen), tuple(units), tuple(released), held, changes, matrices, sizes)


def _magnitudes(place: Place, basis: Float[np.ndarray, "column coordinate"]) -> list[np.ndarray]:
    """Return what stiffness and damping by all loads and velocities would be if they did not cancel within a body."""
    bodies = len(place.model.bodies)
    borne = np.abs(place.jacobian).T @ np.abs(place.multipliers)
    load = np.stack([*np.abs(place.loads), borne]).sum(axis=0).reshape(bodies, -1).max(axis=1)
    rate = [place.coordinates[name][1 if name in ("position", "angle") else 0, ..., 1:, 0]
            for name in ("position", "angle" if place.model.pose_type.turns == 1 else "angular_velocity")]  # fmt: skip
    speed = np.abs(rate[0]).max(axis=0) / place.model.length + np.abs(np.atleast_2d(rate[1])).max(axis=0)
    mass = np.abs(place.masses).max(axis=(0, 1))
    moved = np.linalg.norm(basis.reshape(bodies, -1, basis.shape[1]), axis=1)
    return [np.einsum("b,bi,bj->ij", weight, moved, moved) for weight in (load, mass * speed)]


def with_joints(found: Reduction, names: Sequence[str]) -> Reduction:
    """Return a reduction whose coordinates have the names of joints."""
    return dataclasses.replace(found, names=tuple(names), released=tuple(names))


def null_space(jacobian: Float[np.ndarray, "row column"]) -> Float[np.ndarray, "column direction"]:
    """Return an orthonormal basis of the directions that a scaled Jacobian takes to zero."""
    if not len(jacobian):
        return np.eye(jacobian.shape[1])
    _, sizes, right = np.linalg.svd(jacobian)
    return right[int(np.sum(sizes > RANK_TOLERANCE * sizes.max(initial=0.0))) :].T


def column_names(place: Place) -> list[str]:
    """Return the names of the coordinates of all moving bodies."""
    return [f"{body}.{name}" for body in place.model.bodies for name in COLUMNS[place.mechanism.space]]


def chosen_outputs(place: Place) -> tuple[str, ...]:
    """Return outputs that together tell how all bodies move."""
    return _chosen(place, place.free, True)


def _chosen(place: Place, free: Float[np.ndarray, "column direction"], prefer_outputs: bool) -> tuple[str, ...]:
    """Choose coordinates that are well independent: the largest part left in turn, as in a pivoted elimination."""
    if prefer_outputs:
        names = list(place.output_gradients)
        rows = np.array([place.output_gradients[name] for name in names]).reshape(-1, len(free)) @ free
        rows = rows / np.array([1.0 if _unit(place, name) == "rad" else place.model.length for name in names])[:, None]
    else:
        names = column_names(place)
        width = len(COLUMNS[place.mechanism.space])
        turns = np.arange(width) >= place.model.pose_type.shifts
        rows = free * np.tile(np.where(turns, 1.0, SHIFT), len(place.model.bodies))[:, None]
    found: list[int] = []
    left = rows.copy()
    for _ in range(free.shape[1]):
        lengths = np.linalg.norm(left, axis=1)
        if not lengths.max(initial=0.0) > 1e-6:
            raise MechanismError("do not determine how all bodies move; name coordinates of bodies", name="outputs")
        place_of = int(np.argmax(lengths >= TIE * lengths.max()))
        direction = left[place_of] / lengths[place_of]
        left = left - np.outer(left @ direction, direction)
        found.append(place_of)
    return tuple(names[k] for k in sorted(found))


def _gradients(
    place: Place, names: Sequence[str], free: Float[np.ndarray, "column direction"]
) -> Float[np.ndarray, "coordinate column"]:
    """Return the gradients of coordinates by the scaled ones of the bodies, or raise where they do not fit."""
    columns = column_names(place)
    rows = []
    for name in names:
        if name in columns:
            rows.append(np.eye(len(columns))[columns.index(name)] * place.scale)
            continue
        check_name("coordinate", name, (*columns, *place.output_gradients), MechanismError, name="coordinates")
        rows.append(place.output_gradients[name])
    found = np.array(rows).reshape(-1, len(columns))
    count = free.shape[1]
    if len(names) != count or len(set(names)) != len(names):
        noun = "coordinate is" if count == 1 else "coordinates are"
        message = f"{count} independent {noun} needed besides those of released drivers; one name for each"
        raise MechanismError(message, name="coordinates", value=list(names))
    if count:
        sizes = np.array([1.0 if _unit(place, name) == "rad" else place.model.length for name in names])
        values = np.linalg.svd(found @ free / sizes[:, None], compute_uv=False)
        if not values.min() > 1e-6:
            suggested = ", ".join(_chosen(place, free, False))
            message = f"are not independent here, and do not tell how all bodies move; {suggested} would do"
            raise MechanismError(message, name="coordinates", value=list(names))
    return found


def _directions(released: int, chosen: int, held: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Taylor coefficients of laws, (3, drivers, lanes), and of other coordinates, for a unit of each level."""
    own = released + chosen
    lanes = LEVELS * (own + held)
    laws, targets = np.zeros((LEVELS, released + held, lanes)), np.zeros((LEVELS, chosen, lanes))
    for level in range(LEVELS):
        unit = 1 / math.factorial(level)
        for k in range(own):
            (laws if k < released else targets)[level, k if k < released else k - released, level * own + k] = unit
        for k in range(held):
            laws[level, released + k, LEVELS * own + level * held + k] = unit
    return laws, targets


def _laws_varied(place: Place, names: Sequence[str], laws: np.ndarray) -> Float[np.ndarray, "3 row lane"]:
    if not names:
        return np.zeros((LEVELS, len(place.jacobian), laws.shape[-1]))
    found = element_indices(place.model)
    order = tuple((found[name].group, found[name].instance) for name in names)
    return np.asarray(law_variations(place.equations, place.coordinates, place.clock, order, laws))


def _measured(place: Place, names: Sequence[str], changes: Lanes, level: int) -> Float[np.ndarray, "coordinate lane"]:
    """Return the Taylor coefficients that coordinates have by changes, of which this level may be incomplete."""
    found = place.outputs_varied(changes)
    places, columns = place.components([x.shape[1] for x in found]), column_names(place)
    rows = []
    for name in names:
        if name in columns:
            k = columns.index(name)
            rows.append(place.scale[k] * changes[level][k])
        else:
            group, component, instance = places[name]
            rows.append(found[group][level, component, instance])
    return np.array(rows)


def _unit(place: Place, name: str) -> str:
    columns = column_names(place)
    if name in columns:
        width = len(COLUMNS[place.mechanism.space])
        return "m" if columns.index(name) % width < place.model.pose_type.shifts else "rad"
    output = max((n for n in place.mechanism.outputs if name == n or name.startswith(f"{n}_")), key=len)
    return place.mechanism.outputs[output].unit


def _unit_of_driver(mechanism: Mechanism, name: str) -> str:
    return "rad" if is_turning(mechanism.drivers[name]) else "m"
