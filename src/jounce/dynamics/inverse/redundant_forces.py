"""Multipliers of redundant constraints: the unique ones, and a choice of the others by norm or by stiffness.

If rows are redundant, the balance ``Phi_q^T lambda = load`` determines multipliers only up to the null space of
``Phi_q^T`` (Wojtyra 2005, Joint reaction forces in multibody systems with redundant constraints). One solution has the
least energy ``lambda^T C lambda / 2``, with the compliance C of elastic joints (Wojtyra and Fraczek 2013), or with mere
weights C for a least norm. It obeys

    C lambda + Phi_q mu = 0,    Phi_q^T lambda = load,

on jets, coefficient after coefficient with one matrix, so that its rates are derivatives of the chosen solution. A
random right-hand side without load gives self-balanced multipliers, to which no unique force contributes.
"""

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.saddle_point import as_column, by_body, saddle_point
from jounce.dynamics.inverse.constraint_forces import Slopes, by_group, jacobian_of, onto_bodies, work_along
from jounce.errors import MechanismError
from jounce.kinematics.assembly.redundancy import repetitions
from jounce.linear_algebra.least_squares import range_basis
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism import Model
from jounce.mechanism.system import System

RowNumbers = Float[np.ndarray, " row"]
OPEN = 1e-7  # fraction of the largest undetermined force: less is rounding


def least_multipliers(
    system: System,
    blocks: Slopes,
    load: Float[Numbers, "levels coordinate body batch"],
    compliance: Float[Numbers, " row"],
    bent: Float[Numbers, " row"],
) -> Float[Numbers, "levels row batch"]:
    """Return the Taylor coefficients of the unscaled multipliers of least energy that balance a load.

    Parameters
    ----------
    system : System
        System with redundant rows.
    blocks, load
        As for `multipliers`.
    compliance : array of shape (rows,)
        Compliance of each row; zero for a rigid row.
    bent : array of shape (rows,)
        Misalignment: the right-hand side of the first equation; zero, or random to find self-balanced multipliers.
    """
    scale, rows = jnp.asarray(system.column_scale), system.shape[0]
    jacobian = jacobian_of(system, blocks)
    soft = compliance[:, None] * system.row_scale**2
    soft = soft / jnp.max(soft)
    basis = range_basis(jnp.swapaxes(jacobian, 0, 1), system.rank or rows)
    reduced = jnp.sum(basis[:, :, None] * jnp.swapaxes(jacobian, 0, 1)[:, None], axis=0)
    factor = DenseFactor.of(saddle_point((jnp.eye(rows) * soft)[..., None], reduced))
    orders: list[Any] = []
    strains: list[Any] = []
    for k in range(len(load)):
        deficit = load[k]
        for group, slopes, forces in by_group(system, blocks, orders):
            for slot, slope in zip(group.moving_slots, slopes, strict=True):
                deficit -= onto_bodies(work_along(slope, forces, k, 1), group.bodies[slot], system.body_count)
        gaps = -_jacobian_times_displacements(system, blocks, strains, k) * system.row_scale
        gaps = gaps + (bent[:, None] if k == 0 else 0.0)
        right = jnp.sum(basis * as_column(deficit, scale)[:, None], axis=0)
        solution = factor.solve(jnp.concatenate([jnp.broadcast_to(gaps, (rows, right.shape[-1])), right]))
        orders.append(solution[:rows] * system.row_scale)
        strains.append(by_body(jnp.sum(basis * solution[rows:][None], axis=1), scale))
    return jnp.stack(orders)


def _jacobian_times_displacements(
    system: System, blocks: Slopes, strains: Sequence[Any], level: int
) -> Float[Numbers, "row batch"]:
    """Return the Taylor coefficient of Jacobian times displacements, without the term of the Jacobian of order zero."""
    products = []
    for group, slopes in zip(system.groups, blocks, strict=True):
        product: Any = 0.0
        for slot, slope in zip(group.moving_slots, slopes, strict=True):
            for j in range(1, level + 1):
                displacements = jnp.pad(strains[level - j], ((0, 0), (1, 0), (0, 0)))[:, np.array(group.bodies[slot])]
                product = product + jnp.sum(slope[j] * displacements[:, None], axis=0)
        _, _, rows, instances, lanes = slopes[0].shape
        products.append(jnp.broadcast_to(product, (rows, instances, lanes)).reshape(-1, lanes))
    return jnp.concatenate(products)


class OpenMultipliers:
    """The undetermined multipliers of redundant rows at one position, and the choice among them.

    Parameters
    ----------
    model : Model
        Model of a mechanism with redundant rows.
    jacobian : array of shape (rows, columns)
        Jacobian at that position, rows and columns scaled.
    selection : str or mapping
        Choice of reactions, as in `Mechanism.redundant_reactions`.
    """

    def __init__(self, model: Model, jacobian: Float[np.ndarray, "row column"], selection: Any):
        self.model, self.selection = model, selection
        self._row_scale = np.asarray(model.system.row_scale)
        self._jacobian = jacobian

    @cached_property
    def words(self) -> str:
        """A text that names the joints that repeat equations of others."""
        return "; ".join(map(str, repetitions(self.model.rows, self._basis)))

    @cached_property
    def weights(self) -> RowNumbers:
        """The force of a unit multiplier of each row, N, or its couple over the size of the mechanism."""
        forces, couples = self._sizes
        return forces + couples / self.model.length

    @cached_property
    def compliance(self) -> RowNumbers:
        """The compliance of each row: the squares of `weights` for a norm, or that of joints with given stiffnesses.

        Raises
        ------
        MechanismError
            If the stiffnesses leave multipliers undetermined.
        """
        if not isinstance(self.selection, Mapping):
            return self.weights**2
        forces, couples = self._sizes
        compliances = np.zeros(len(forces))
        for name, stiffness in self.selection.items():
            is_own = np.array([row.partition(".")[2] == name for row in self.model.rows])
            for size, key in ((forces, "force"), (couples, "torque")):
                compliances += np.where(is_own, size**2 / stiffness.get(key, math.inf), 0.0)
        open_basis = np.linalg.qr(self._basis * self._row_scale)[0]
        if not np.linalg.eigvalsh(open_basis.T @ (compliances[:, None] * open_basis))[0] > 1e-12 * np.max(
            compliances, initial=0.0
        ):
            affected = np.any(np.abs(self._basis) > OPEN, axis=1)
            names = dict.fromkeys(row.partition(".")[2] for row, x in zip(self.model.rows, affected, strict=True) if x)
            message = f"leaves reactions open; give stiffnesses, force and torque, of more of {', '.join(names)}"
            raise MechanismError(message, name="redundant_reactions", value=dict(self.selection))
        return compliances

    def random_right_side(self) -> RowNumbers:
        """Return a random right-hand side, the same each time, that excites all self-balanced multipliers."""
        normal = np.random.default_rng(0).standard_normal(len(self.model.rows))
        return normal * self.weights * self._row_scale[:, 0]

    @cached_property
    def _basis(self) -> Float[np.ndarray, "row combination"]:
        """An orthonormal basis of the self-balanced multipliers of scaled rows."""
        return np.linalg.svd(self._jacobian)[0][:, self.model.system.rank :]

    @cached_property
    def _sizes(self) -> tuple[RowNumbers, RowNumbers]:
        """Force and couple of a unit multiplier on a body: each row has either a force or a pure couple."""
        scale = np.asarray(self.model.system.column_scale)
        shifts = self.model.pose_type.shifts
        scaled = np.abs((self._jacobian / self._row_scale).reshape(len(self._jacobian), -1, len(scale)) / scale)
        forces, couples = (np.linalg.norm(x, axis=2).max(axis=1) for x in np.split(scaled, [shifts], axis=2))
        pure = forces * self.model.length <= 1e-9 * couples
        return np.where(pure, 0.0, forces), np.where(pure, couples, 0.0)
