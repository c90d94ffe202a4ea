"""A mechanism at one instant of a motion, as the operating point of small motions."""

import dataclasses
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from jaxtyping import Float

from jounce.dynamics.forward.accelerations import Equations
from jounce.dynamics.forward.initial_state import TOLERANCE
from jounce.dynamics.friction.coupling import pressing_teeth
from jounce.dynamics.statics.variations import (
    LEVELS,
    constraint_forces_at,
    displaced,
    loads_at,
    masses_at,
    output_variations,
    sizes_of_forces,
    variations,
)
from jounce.kinematics.assembly.gauss_newton import assemble_from_guess
from jounce.linear_algebra.host_jacobian import RANK_TOLERANCE
from jounce.mechanism import Mechanism, Model

Lanes = Float[np.ndarray, "3 column lane"]
"""Taylor coefficients of changes of the scaled coordinates of all moving bodies."""


@dataclasses.dataclass(frozen=True, eq=False)
class OperatingPoint:
    """A mechanism at one instant of a motion, as the operating point of small motions.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    model : Model
        The numeric model, with scaled rows.
    equations : Equations
        Equations of motion at the instant, with the revolutions of angles about axes.
    coordinates : dict of str to array
        Taylor coefficients to order 2 of the coordinates of all bodies, the ground first; a batch of one.
    clock : array of shape (3, 1, 1)
        Taylor coefficients of time; the rate is zero if the laws are frozen.
    """

    mechanism: Mechanism
    model: Model
    equations: Equations
    coordinates: dict[str, np.ndarray]
    clock: np.ndarray

    @property
    def instant(self) -> float:
        """The instant, s."""
        return float(self.clock[0, 0, 0])

    @property
    def place(self) -> dict[str, np.ndarray]:
        """Coordinates of all bodies, of order zero."""
        return {name: x[0] for name, x in self.coordinates.items() if name != "angular_velocity"}

    def displaced(self, change: Float[np.ndarray, "coordinate all 1"]) -> dict[str, np.ndarray]:
        """Return the coordinates of all bodies after shifts and rotations from `changes`."""
        return {name: np.asarray(x) for name, x in displaced(self.place, change, self.model.pose_type).items()}

    def closed(self, coordinates: dict[str, np.ndarray]) -> dict[str, np.ndarray] | None:
        """Return nearby coordinates that satisfy all constraints; None if none are found."""
        if not self.model.rows:
            return coordinates
        trial = assemble_from_guess(self.model, self.instant, TOLERANCE, coordinates)
        return trial.coordinates if trial.closed else None

    @cached_property
    def _loads_and_jacobian(self) -> tuple[np.ndarray, np.ndarray]:
        loads, jacobian = loads_at(self.equations, self.coordinates, self.clock)
        return np.asarray(loads), np.asarray(jacobian)

    @property
    def loads(self) -> Float[np.ndarray, "2 column"]:
        """Inertia less weight, and applied forces with the minus sign, in scaled coordinates, N m."""
        return self.as_columns(self._loads_and_jacobian[0][..., None])[..., 0]

    @property
    def jacobian(self) -> Float[np.ndarray, "row column"]:
        """Jacobian of all constraints, with rows and columns scaled."""
        return self._loads_and_jacobian[1]

    @property
    def scale(self) -> Float[np.ndarray, " column"]:
        """Scales of the coordinates of the moving bodies, m or rad."""
        return np.tile(np.asarray(self.model.system.column_scale), len(self.model.bodies))

    @cached_property
    def multipliers(self) -> Float[np.ndarray, " row"]:
        """Multipliers of the scaled rows, of least norm, that balance the loads."""
        load = self.loads.sum(axis=0)
        if not len(self.jacobian):
            return np.zeros(0)
        first = self._balancing(load)
        if not pressing_teeth(self.equations.system):
            return first
        borne = np.asarray(constraint_forces_at(self.equations, self.coordinates, self.clock, first[:, None]))
        return first + self._balancing(load + self.as_columns(borne[..., None])[:, 0])  # multipliers of teeth stay

    @cached_property
    def pushed(self) -> Float[np.ndarray, " body"]:
        """Sum of the absolute applied forces on each moving body, N m."""
        sums = np.zeros(1 + len(self.model.bodies))
        groups = self.equations.system.forces
        if groups:
            unchanged = self.changes(changes_of_coordinates(np.zeros((len(self.scale), 1))))
            sizes = sizes_of_forces(self.equations, self.coordinates, self.clock, unchanged)
            for group, size in zip(groups, sizes, strict=True):
                lever = self.model.length if group.element.unit == "N" else 1.0
                body_force = np.abs(np.asarray(size)).max(axis=(0, 2)) * lever
                for bodies in group.bodies:
                    np.add.at(sums, list(bodies), body_force)
        return sums[1:]

    def _balancing(self, load: Float[np.ndarray, " column"]) -> Float[np.ndarray, " row"]:
        return -np.linalg.lstsq(self.jacobian.T, load, rcond=RANK_TOLERANCE)[0]

    @cached_property
    def free(self) -> Float[np.ndarray, "column direction"]:
        """Orthonormal directions of the scaled coordinates that all constraints leave free."""
        return null_space(self.jacobian)

    @cached_property
    def masses(self) -> Float[np.ndarray, "coordinate coordinate body"]:
        """Mass matrices of the moving bodies, with rows and columns scaled, kg m^2."""
        scale = np.asarray(self.model.system.column_scale)
        return np.asarray(masses_at(self.equations, self.coordinates)) * (scale[:, None] * scale)[..., None]

    def as_columns(self, by_body: Float[np.ndarray, "... coordinate body lane"]) -> np.ndarray:
        """Return generalized forces by body in the order of the scaled columns."""
        scaled = by_body * np.asarray(self.model.system.column_scale)[:, None, None]
        return np.swapaxes(scaled, -3, -2).reshape(*scaled.shape[:-3], -1, scaled.shape[-1])

    def changes(
        self, columns: Float[np.ndarray, "level column lane"]
    ) -> Float[np.ndarray, "level coordinate all lane"]:
        """Return scaled changes as shifts, m, and rotations, rad, of all bodies, the ground first."""
        count = len(self.model.system.column_scale)
        by_body = (columns * self.scale[:, None]).reshape(len(columns), -1, count, columns.shape[-1])
        return np.pad(np.swapaxes(by_body, 1, 2), ((0, 0), (0, 0), (1, 0), (0, 0)))

    def varied(self, columns: Lanes) -> tuple[Float[np.ndarray, "3 column lane"], Float[np.ndarray, "3 row lane"]]:
        """Return the variations of loads, constraint forces and rows with changes of the scaled coordinates."""
        arguments = self.equations, self.coordinates, self.clock, self.multipliers[:, None], self.changes(columns)
        forces, rows = (np.asarray(x) for x in variations(*arguments))
        return self.as_columns(forces), rows

    def outputs_varied(self, columns: Lanes) -> list[Float[np.ndarray, "_ _ _ lane"]]:
        """Return the variations of outputs, group by group, with changes of the scaled coordinates."""
        groups, pose_type = self.model.system.outputs, self.model.pose_type
        return [np.asarray(x) for x in output_variations(groups, self.coordinates, pose_type, self.changes(columns))]

    @cached_property
    def output_gradients(self) -> dict[str, Float[np.ndarray, " column"]]:
        """Gradients by the scaled coordinates of output components that are functions of the poses, by name."""
        count = len(self.scale)
        varied = self.outputs_varied(changes_of_coordinates(np.eye(count)))
        components = self.components([x.shape[1] for x in varied])
        groups = self.model.system.outputs
        return {name: varied[g][0, c, k] for name, (g, c, k) in components.items() if not groups[g].element.lost_orders}

    def components(self, counts: Sequence[int]) -> dict[str, tuple[int, int, int]]:
        """Return group, component and instance of each component of an output, by its name in tables."""
        components = {}
        for index, (names, group) in enumerate(zip(self.model.outputs, self.model.system.outputs, strict=True)):
            labels = group.element.labels[: counts[index]] if counts[index] > 1 else ("",)
            for instance, name in enumerate(names):
                for k, label in enumerate(labels):
                    components[f"{name}_{label}" if label else name] = index, k, instance
        return {name: components[name] for name in sorted(components, key=self._order)}

    def _order(self, component: str) -> int:
        """Return the index of the output of a component, in the order of the mechanism."""
        names = list(self.mechanism.outputs)
        return max(k for k, name in enumerate(names) if component == name or component.startswith(f"{name}_"))


def changes_of_coordinates(columns: Float[np.ndarray, "column lane"]) -> Lanes:
    """Return changes of the scaled coordinates without changes of their rates."""
    return np.stack([columns, *[np.zeros_like(columns)] * (LEVELS - 1)])


def null_space(jacobian: Float[np.ndarray, "row column"]) -> Float[np.ndarray, "column direction"]:
    """Return an orthonormal basis of the null space of a scaled Jacobian."""
    if not len(jacobian):
        return np.eye(jacobian.shape[1])
    _, sizes, right = np.linalg.svd(jacobian)
    return right[int(np.sum(sizes > RANK_TOLERANCE * sizes.max(initial=0.0))) :].T
