"""The constraints at a position as Taylor series: how far a motion that begins there can be continued.

Where constraints are dependent, equations of higher order may block a velocity that they allow. Let x = K y + z, with K
y the velocities that the constraints allow and z solved for. What remains is a few equations g(y) = 0 without linear
terms (Lyapunov-Schmidt reduction), as many as constraints are dependent. Along any series y(t), the coefficients of g
follow from those of the residual, order after order, with one matrix, as in a solve: no derivative of a constraint is
written. Mueller (2016, Higher-order analysis of kinematic singularities of lower pair linkages and serial manipulators)
uses differentials instead.
"""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.modules import with_fields
from jounce.base.shapes import Numbers
from jounce.execution.chunks import in_chunks
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.kinematics.assembly.initial_revolutions import Coordinates
from jounce.mechanism import Model
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

LANES = 32  # series evaluated side by side
FULFILLED = 1e-7  # relative to the terms of an order: smaller residuals are rounding and error of the position
SINGULAR = 1e-7  # of the largest singular value: smaller ones count as zero at a position known to about 1e-8


@dataclasses.dataclass(frozen=True)
class ReducedConstraints:
    """The equations g(y) = 0 that dependent constraints leave at a position.

    Attributes
    ----------
    model : Model
        The joints alone, with rows scaled to one size.
    coordinates : dict of str to array
        Coordinates of all bodies at the position, the ground first.
    free : array of shape (columns, k)
        Orthonormal velocities that the constraints allow: K.
    dependent : array of shape (rows, s)
        Orthonormal combinations of rows that vanish at the position.
    inverse : array of shape (columns, rows)
        Pseudo-inverse of the Jacobian.
    held : array of bool, shape (rows,)
        Rows that must hold; the others, such as those of drivers, are ignored.
    order : int
        Order of the series.
    """

    model: Model
    coordinates: Coordinates
    free: Float[np.ndarray, "column k"]
    dependent: Float[np.ndarray, "row s"]
    inverse: Float[np.ndarray, "column row"]
    held: Bool[np.ndarray, " row"]
    order: int

    @classmethod
    def at(
        cls,
        model: Model,
        coordinates: Coordinates,
        jacobian: Float[np.ndarray, "row column"],
        order: int,
        held: Bool[np.ndarray, " row"] | None = None,
    ) -> "ReducedConstraints":
        """Reduce the constraints, or those of the held rows, at a position with a given scaled Jacobian."""
        held = np.ones(len(jacobian), bool) if held is None else held
        left, sizes, right = np.linalg.svd(jacobian[held])
        rank = int(np.sum(sizes > SINGULAR * sizes.max(initial=0.0)))
        inverse, dependent = np.zeros(jacobian.shape[::-1]), np.zeros((len(jacobian), left.shape[1] - rank))
        inverse[:, held] = right[:rank].T @ (left[:, :rank] / sizes[:rank]).T
        dependent[held] = left[:, rank:]
        system = with_fields(model.system, outputs=(), forces=(), fronts=None)
        model = dataclasses.replace(model, system=system)
        return cls(model, coordinates, right[rank:].T, dependent, inverse, held, order)

    def along(self, series: Float[np.ndarray, "lane order k"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the series of g along series of y; both without their coefficients of order 0, which are zero.

        Returns
        -------
        equations : array of shape (lanes, order, s)
            Coefficients of g from order 1 on, with scaled rows.
        sizes : array of shape (lanes, order)
            Largest coefficient of any row of the residual from which those of g are combined.
        coordinates : array of shape (lanes, order, columns)
            Coefficients of the scaled coordinates.
        """
        bases, lanes = (self.free, self.dependent, self.inverse, self.held.astype(float)), np.moveaxis(series, 0, -1)
        arguments, kind = (self.model.system, self.coordinates, bases), self.model.pose_type
        parts = in_chunks(lambda k: _along(*arguments, lanes[..., k], pose_type=kind), len(series), (LANES,), threads=1)
        equations, sizes, displacements = (np.moveaxis(x, -1, 0) for x in parts)
        return equations, sizes, displacements

    def gap(self, series: Float[np.ndarray, "lane order k"], order: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficients of g up to an order, (lanes, order * s), and the bound below which each is zero."""
        equations, sizes, _ = self.along(series)
        orders = np.arange(1, order + 1)
        rate = np.max(np.maximum(sizes[:, :order], 1e-300) ** (1.0 / orders), axis=1)
        allowed = FULFILLED * rate[:, None] ** orders
        flat = equations[:, :order].reshape(len(series), -1)
        return flat, np.repeat(allowed, equations.shape[2], axis=1)

    def placed(self, coefficients: Float[np.ndarray, "order column"], step: float) -> Float[np.ndarray, " column"]:
        """Return the scaled increment of the coordinates after a step along a series, to first order in rotations."""
        powers = step ** np.arange(1, len(coefficients) + 1)
        return powers @ coefficients


@compiled("pose_type", brief=True)
def _along(
    system: System,
    coordinates: dict[str, Numbers],
    bases: tuple[Numbers, Numbers, Numbers, Numbers],
    series: Float[Numbers, "order k lane"],
    *,
    pose_type: type[Pose],
) -> tuple[Any, Any, Any]:
    free, dependent, inverse, held = bases
    order, lanes = len(series), series.shape[-1]
    start = {name: jnp.broadcast_to(x, (*x.shape[:-1], lanes)) for name, x in coordinates.items()}
    pose: Any = pose_at(start, pose_type)
    time = Jet.variable(jnp.zeros((1, lanes)), order)
    equations, sizes, displacements = [], [], []
    for k in range(1, order + 1):
        remainder = system.residual(pose.extended(None, None), time.truncate(k)).dense().coefficients[k]
        column = _product(free, series[k - 1]) - _product(inverse, remainder)
        pose = pose.extended(*system.coordinates(column, pose.shifts))
        equations.append(_product(dependent.T, remainder))
        sizes.append(jnp.max(jnp.abs(remainder) * held[:, None], axis=0))
        displacements.append(column)
    return jnp.stack(equations), jnp.stack(sizes), jnp.stack(displacements)


def _product(matrix: Float[Numbers, "row column"], columns: Float[Numbers, "column lane"]) -> Any:
    return jnp.sum(jnp.asarray(matrix)[:, :, None] * columns[None], axis=1)
