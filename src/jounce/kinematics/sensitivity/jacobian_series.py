"""The Jacobian along a motion as a Taylor series, and linear equations with it, solved with one factorization.

The derivatives of residuals with respect to virtual displacements of the bodies are jets, too: none is written by hand.
"""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.jax_internals import by_certain_entries
from jounce.base.shapes import Numbers
from jounce.constraints import AbstractConstraint
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.linear_algebra.frontal import FrontalFactor
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism.system import Group, System, movable, with_rows
from jounce.rigid.pose import Pose

Slope = Float[Numbers, "order coordinate row instance batch"]
"""Taylor coefficients of the derivatives of residuals with respect to the coordinates of the bodies in a slot."""

Series = Float[Numbers, "order column batch"]
"""Taylor coefficients of a quantity with one entry per row, or per column, of the Jacobian."""


def slopes(element: AbstractConstraint, poses: Sequence[Pose], time: Jet, slot: int) -> Slope:
    """Return the Jacobian block of a joint or driver for the body in a slot, as jets.

    Parameters
    ----------
    element : AbstractConstraint
        Joint or driver whose values have the shape (..., instances, 1).
    poses : sequence of SpatialPose or PlanarPose
        Poses of the bodies in each slot, shape (..., instances, batch), of the order of the time.
    time : Jet
        Time, shape (1, batch).
    slot : int
        Slot of the displaced body, which may be the ground.

    Returns
    -------
    array of shape (order + 1, coordinates, rows, instances, batch)
        Taylor coefficients of the derivatives by a shift in global axes, m, and by a rotation in body axes, rad.
    """
    body = movable(poses[slot].truncate(time.order))
    bodies = (*poses[:slot], body, *poses[slot + 1 :])

    def changed(change: Any) -> Any:
        changes = (*[None] * slot, change, *[None] * (len(bodies) - slot - 1))
        return stacked(with_rows(element.variation(bodies, changes, time)))

    return along_displacements(body, changed)


def slopes_of_groups(groups: Sequence[Group], pose: Pose, time: Jet) -> list[list[Slope]]:
    """Return the `slopes` of each moving slot for each group of joints and drivers, along a motion of all bodies.

    `pose`, (..., bodies, batch), with the ground first, has the order of the time.
    """
    posed_groups = [(group, [pose.take(indices) for indices in group.bodies]) for group in groups]
    return [[slopes(group.element, poses, time, slot) for slot in group.moving_slots] for group, poses in posed_groups]


def along_displacements(body: Any, changed: Callable[[Any], Any]) -> Slope:
    """Return the derivatives of jets, (order + 1, rows, instances, batch), for each displacement of a body.

    Parameters
    ----------
    body : SpatialPose or PlanarPose
        Displaced body, as returned by `movable`, shape (..., instances, batch).
    changed : callable
        Maps a variation of the pose to the variation of the jets.
    """
    shape, size, order = body.position.shape[1:], body.shifts + body.turns, body.order

    def along(direction: Any) -> Any:
        unit = jnp.broadcast_to(direction[:, None, None], (size, *shape))
        shift, turn = (Jet.constant(part, order) for part in (unit[: body.shifts], unit[body.shifts :]))
        with by_certain_entries():  # most components do not change
            return changed(jax.lax.optimization_barrier(movable(body.varied(shift, turn).truncate(order))))

    return jnp.moveaxis(jax.vmap(along)(jnp.eye(size)), 0, 1)


def jacobian_series(system: System, pose: Pose, time: Jet) -> Float[Numbers, "order entry batch"]:
    """Return the Taylor coefficients of the entries of the Jacobian along a motion, rows unscaled.

    Parameters
    ----------
    system : System
        The mechanism.
    pose : SpatialPose or PlanarPose
        Poses of all bodies, the ground first, of the order of the time.
    time : Jet
        Time, shape (1, batch).
    """
    scale = jnp.asarray(system.column_scale)[None, :, None, None, None]
    blocks = chain.from_iterable(slopes_of_groups(system.groups, pose, time))
    return jnp.concatenate([(slope * scale).reshape(len(slope), -1, slope.shape[-1]) for slope in blocks], axis=1)


def solved_series(system: System, entries: Float[Numbers, "order entry batch"], rhs: Series) -> Series:
    """Return the series x with ``J x = right``, order after order, with the factors of the first coefficient of J.

    Derivatives and transposes are those of the linear equations; the factorization itself is not differentiated.

    Parameters
    ----------
    system : System
        The mechanism, with as many rows as columns.
    entries : array of shape (order + 1, entries, batch)
        Series of the entries, as returned by `jacobian_series`.
    rhs : array of shape (order + 1, rows, batch)
        Right-hand side, rows unscaled.

    Returns
    -------
    array of shape (order + 1, columns, batch)
    """
    scale = _row_scale(system, entries)
    values = jax.lax.stop_gradient(entries[0])
    if system.fronts is None:
        factor: Any = DenseFactor.of(system.pattern.dense(values) * scale[:, :, None])
    else:
        factor = FrontalFactor.of(system.fronts, values, scale)
    matrices, product, transposed = _products(system, entries, scale)

    def multiplied(x: Any) -> Any:
        spread = jax.vmap(product.spread)(x)
        return jnp.stack([product.sum(matrices[: k + 1], spread[k::-1]) for k in range(len(x))])

    def solve(_: Any, b: Any) -> Any:
        return _in_order(product, jax.lax.stop_gradient(matrices), factor.solve, b)

    def solve_transposed(_: Any, b: Any) -> Any:  # the transpose of a convolution runs backwards in the orders
        return _in_order(transposed, jax.lax.stop_gradient(matrices), factor.solve_transposed, b[::-1])[::-1]

    return jax.lax.custom_linear_solve(multiplied, rhs * scale[None], solve, solve_transposed)


def solver(
    product: Callable[[Any], Any], solve: Callable[[Any], Any], solve_transposed: Callable[[Any], Any]
) -> Callable[[Any], Any]:
    """Return a solver of linear equations whose matrix is given by its products, with implicit derivatives."""
    return lambda rhs: jax.lax.custom_linear_solve(
        product, rhs, lambda _, b: solve(b), lambda _, b: solve_transposed(b)
    )


def _row_scale(system: System, entries: Float[Numbers, "order entry batch"]) -> Float[Numbers, "row 1"]:
    """Return factors that scale the largest entry of each row along the motion to one."""
    return system.pattern.row_scale(jnp.max(jnp.abs(jax.lax.stop_gradient(entries[0])), axis=-1, keepdims=True))


class _Product(NamedTuple):
    """Product of matrices with columns: spread the columns along the entries, multiply, and sum."""

    spread: Callable[[Any], Any]
    added: Callable[[Any], Any]
    collected: Callable[[Any], Any] = lambda sums: sums

    def sum(self, matrices: Any, spread: Any) -> Any:
        """Return the sum of the products of matrices with spread columns."""
        return self.collected(jnp.sum(self.added(matrices * spread), axis=0))


def _products(system: System, entries: Any, scale: Any) -> tuple[Any, _Product, _Product]:
    """Return the matrices of a series, and the products of these, and of their transposes, with columns."""
    pattern = system.pattern
    if system.fronts is None:
        matrices = jax.vmap(pattern.dense)(entries) * scale[None, :, :, None]
        forward = _Product(lambda x: x[None], lambda terms: jnp.sum(terms, axis=-2))
        return matrices, forward, _Product(lambda y: y[:, None], lambda terms: jnp.sum(terms, axis=-3))
    matrices = jnp.stack([pattern.by_row(level) * scale[:, None, None] for level in entries])
    forward = _Product(pattern.touched, lambda terms: jnp.sum(terms, axis=(-3, -2)))
    return matrices, forward, _Product(lambda y: y[:, None, None], lambda terms: terms, pattern.summed)


def _in_order(product: _Product, matrices: Any, solve: Callable[[Any], Any], rhs: Series) -> Series:
    """Return the series x of a product of series, given the other factor and the product, in one loop over orders."""

    def step(spread: Any, k: Any) -> tuple[Any, Any]:
        def added(j: Any, sums: Any) -> Any:
            return sums + product.added(matrices[j] * spread[k - j])

        known_sum = jax.lax.fori_loop(1, k + 1, added, jnp.zeros_like(product.added(matrices[0] * spread[0])))
        solved = solve(rhs[k] - product.collected(known_sum))
        return spread.at[k].set(product.spread(solved)), solved

    blank = jnp.zeros((len(rhs), *jax.eval_shape(product.spread, rhs[0]).shape))
    return jax.lax.scan(step, blank, np.arange(len(rhs)))[1]
