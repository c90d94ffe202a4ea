"""Constraint forces and their rates: Lagrange multipliers by the transposed factor of the Jacobian, to any order.

The equations of motion ``M q'' + Phi_q^T lambda = Q`` are a balance of jets. For a known motion, each coefficient of
the multipliers follows from the transposed factor of the Jacobian; if the motion has free directions, from the
saddle-point matrix of masses and Jacobian. The jets of the Jacobian are derivatives of the residuals with respect to
virtual displacements of the bodies. No Jacobian is written by hand, so user-defined joints have reactions, too.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.base.shapes import Numbers
from jounce.dynamics.forward.saddle_point import (
    BodyMatrices,
    Column,
    Jacobian,
    MassMatrix,
    as_column,
    block_diagonal,
    saddle_point,
)
from jounce.jet import Jet
from jounce.jet.algebra import stacked, total
from jounce.kinematics.sensitivity.jacobian_series import Slope, solver
from jounce.linear_algebra.frontal import FrontalFactor
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism.system import OmittedLaw, System, with_rows
from jounce.rigid.pose import Pose
from jounce.trajectory import AbstractMotion

Slopes = Sequence[Sequence[Float[Numbers, "order coordinate _ _ batch"]]]
"""For each group, the slopes of each of its moving slots."""

Multipliers = Float[Numbers, "order row instance batch"]
"""Taylor coefficients of the multipliers of a group."""


def work_along(
    slope: Slope,
    forces: Sequence[Float[Numbers, "row instance batch"]] | Multipliers,
    level: int,
    lowest_level: int = 0,
) -> Float[Numbers, "coordinate instance batch"]:
    """Return the Taylor coefficient of the generalized forces of multipliers: the product of slope and multipliers.

    Parameters
    ----------
    slope : array of shape (levels, coordinates, rows, instances, batch)
        Slope, as `slopes` returns it.
    forces : array of shape (levels, rows, instances, batch)
        Coefficients of the multipliers.
    level : int
        Index of the coefficient of the product.
    lowest_level : int
        Index of the first coefficient of the slope that is included.
    """
    return total(jnp.sum(slope[j] * forces[level - j][None], axis=1) for j in range(lowest_level, level + 1))


def balancing(mass: MassMatrix | None, jacobian: Jacobian) -> Callable[[Column], Float[Numbers, "row batch"]]:
    """Return the solver for the multipliers that balance loads.

    Without a mass matrix, the Jacobian must be square, and the multipliers balance the whole load. With one, the part
    of the load that accelerates the bodies freely is left out.
    """
    if mass is None:
        factor = DenseFactor.of(jax.lax.stop_gradient(jacobian))
        return solver(lambda x: jnp.sum(jacobian * x[:, None], axis=0), factor.solve_transposed, factor.solve)
    matrix, rows = saddle_point(mass, jacobian), len(jacobian)
    factor = DenseFactor.of(jax.lax.stop_gradient(matrix))
    solve = solver(lambda x: jnp.sum(matrix * x[None], axis=1), factor.solve, factor.solve_transposed)
    return lambda load: solve(jnp.concatenate([load, jnp.zeros((rows, load.shape[-1]))]))[-rows:]


def multipliers(
    system: System,
    blocks: Slopes,
    load: Float[Numbers, "levels coordinate body batch"],
    mass: BodyMatrices | None = None,
) -> Float[Numbers, "levels row batch"]:
    """Return the Taylor coefficients of the multipliers of all rows, unscaled.

    Parameters
    ----------
    system : System
        System of the mechanism.
    blocks : sequence of sequence of array
        For each group, `slopes` for each of its moving slots.
    load : array of shape (levels, coordinates of a body, bodies, batch)
        Load on the constraints, without the ground.
    mass : array of shape (coordinates, coordinates, bodies, batch), optional
        Mass matrices, as `mass_matrices` returns them, without the ground; for mechanisms with free directions.
    """
    if not blocks:
        return jnp.zeros((load.shape[0], 0, load.shape[-1]))
    solve, count = load_solver(system, blocks, mass), len(load)

    def level(latest: Any, level_and_load: Any) -> tuple[Any, Any]:
        """Return the coefficients with the next one: the latest first, zeros before the lowest."""
        k, deficit = level_and_load
        for group, slopes, forces in by_group(system, blocks, latest):
            for slot, slope in zip(group.moving_slots, slopes, strict=True):
                # coefficients that order k does not need may not be finite
                lower = [jnp.where(j <= k, slope[j], 0.0) for j in range(1, count)]
                work = total(jnp.sum(c * f[None], axis=1) for c, f in zip(lower, forces, strict=True))
                deficit -= onto_bodies(work, group.bodies[slot], system.body_count)
        newest = solve(deficit)
        return [newest, *latest[:-1]][: len(latest)], newest

    start = [jnp.zeros((system.shape[0], load.shape[-1]))] * (count - 1)
    return jax.lax.scan(level, start, (np.arange(count), load))[1]  # compiled once for all orders


def load_solver(
    system: System, blocks: Slopes, mass: BodyMatrices | None
) -> Callable[[Float[Numbers, "coordinate body batch"]], Float[Numbers, "row batch"]]:
    """Return the solver for unscaled multipliers that balance a load, both of one order and as in `multipliers`."""
    solve, scale = _solver(system, blocks, mass), jnp.asarray(system.column_scale)
    return lambda load: solve(as_column(load, scale)) * system.row_scale


def _solver(system: System, blocks: Slopes, mass: BodyMatrices | None) -> Callable[[Any], Any]:
    """Return the solver for the multipliers of scaled rows; without masses it uses only the Jacobian."""
    if mass is None and system.fronts is not None:
        entries = _entries(system, blocks)
        factor = FrontalFactor.of(system.fronts, jax.lax.stop_gradient(entries), system.row_scale)
        return solver(partial(_transposed, system, entries), factor.solve_transposed, factor.solve)
    jacobian = jacobian_of(system, blocks)
    if mass is None:
        return balancing(None, jacobian)
    mass_matrix = block_diagonal(mass, jnp.asarray(system.column_scale))
    return balancing(mass_matrix / jnp.max(jnp.abs(mass_matrix)), jacobian)  # multipliers do not depend on its scale


def _transposed(system: System, entries: Float[Numbers, "entry batch"], rows: Any) -> Any:
    """Return the products of the transposed, row-scaled matrices, given by their entries, with a vector of rows."""

    def product(columns: Any) -> Any:
        return system.pattern.product(entries, columns) * system.row_scale

    columns = jax.ShapeDtypeStruct((system.shape[1], rows.shape[-1]), rows.dtype)
    return jax.linear_transpose(product, columns)(rows)[0]


def jacobian_of(system: System, blocks: Slopes) -> Jacobian:
    """Return the scaled Jacobian from the slopes of all groups."""
    return system.pattern.dense(_entries(system, blocks)) * system.row_scale[:, :, None]


def _entries(system: System, blocks: Slopes) -> Float[Numbers, "entry batch"]:
    scale = jnp.asarray(system.column_scale)[:, None, None, None]
    return jnp.concatenate([(slope[0] * scale).reshape(-1, slope.shape[-1]) for slopes in blocks for slope in slopes])


def by_group(system: System, blocks: Slopes, latest: list[Float[Numbers, "row batch"]]) -> list[Any]:
    """Return the groups with their blocks and their latest multipliers, each (rows, instances, batch)."""
    if not latest:
        return []
    results, first = [], 0
    for group, slopes in zip(system.groups, blocks, strict=True):
        _, _, rows, instances, lanes = slopes[0].shape
        stop = first + rows * instances
        results.append((group, slopes, [level[first:stop].reshape(rows, instances, lanes) for level in latest]))
        first = stop
    return results


def onto_bodies(
    work: Float[Numbers, "coordinate instance batch"], bodies: tuple[int, ...], count: int
) -> Float[Numbers, "coordinate {count} batch"]:
    """Return the generalized forces on each moving body, summed over the instances of a group."""
    return jnp.zeros((work.shape[0], count + 1, work.shape[-1])).at[:, np.array(bodies)].add(work)[:, 1:]


class _Shifted(AbstractMotion):
    """A law with a constant added, whose derivative of the residual gives the driver force."""

    law: Callable[[Jet], Jet]
    shift: Any

    def __call__(self, time: Jet) -> Jet:
        return self.law(time) + self.shift


def _as_measured(value: Jet, _: Jet) -> Jet:
    return value


def exerted(
    driver: Any, poses: Sequence[Pose], time: Jet, forces: Multipliers
) -> Float[Numbers, "order instance batch"]:
    """Return the forces of drivers along their prescribed coordinates, with rates.

    The force conjugate to the law f is ``lambda^T dPhi/df``; its product with f' is the power put into the mechanism.

    Parameters
    ----------
    driver : AbstractConstraint
        Drivers, with values of shape (..., instances, 1). If their law is omitted, the poses give its value.
    poses, time
        As for `slopes`.
    forces : array of shape (levels, rows, instances, batch)
        Coefficients of the multipliers; the order of the poses is one less than the levels.
    """
    law = driver.motion
    if isinstance(law, OmittedLaw):
        law = partial(_as_measured, driver.evaluate(*poses))

    def residual(shift: Any) -> Any:
        element = with_fields(driver, motion=_Shifted(law, shift))
        return stacked(with_rows(element.residual(*poses, time)))

    shift = jnp.zeros(forces.shape[2:])
    _, slope = jax.jvp(residual, (shift,), (jnp.ones_like(shift),))
    return jnp.stack([work_along(slope[:, None], forces, k)[0] for k in range(len(forces))])


def wrench(slope: Slope, forces: Multipliers) -> Float[Numbers, "order coordinate instance batch"]:
    """Return the wrenches of joints on the bodies in a slot: global force, and moment about the origin in body axes."""
    return jnp.stack([-work_along(slope, forces, k) for k in range(len(forces))])
