"""The series of the motion of a tree under forces: order by order, by one factorization of its articulated inertias."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jounce.jet.programs.series import Recursion
from jounce.robot.recursions.tree_equations import TreeEquations, TreeFactor, TreeState, Unknowns, Wrenches

Series = Any
"""A pytree of arrays of Taylor coefficients, order first."""


class MotionSeries(NamedTuple):
    """Taylor coefficients of a motion, order first.

    Attributes
    ----------
    motion : TreeState
        To one order more than the accelerations.
    accelerations : Unknowns
    factor : TreeFactor
        Of the inertias at order zero.
    """

    motion: TreeState
    accelerations: Unknowns
    factor: TreeFactor


def motion_series(
    equations: TreeEquations,
    motion: TreeState,
    applied: Callable[[TreeState, Any], tuple[Unknowns, Wrenches]],
    given: Series,
    driven: Series,
    order: int,
    *,
    reversible: bool = False,
    unrolled: bool = False,
) -> MotionSeries:
    """Return the series of the motion through a state.

    Parameters
    ----------
    equations : TreeEquations
        Of the robot.
    motion : TreeState
        The state.
    applied : callable
        Maps a motion and what is given to the forces of the coordinates, those on a free base, and wrenches on bodies.
    given : pytree of array of shape (order + 1, ..., batch)
        Series of what forces depend on besides the motion.
    driven : array of shape (order + 1, coordinates, batch)
        Accelerations of driven coordinates, and zero for those that are free.
    order : int
        Of the accelerations.
    reversible : bool, default False
        Whether JAX may differentiate it in reverse mode.
    unrolled : bool, default False
        Whether each order has code of its own.
    """
    factor = equations.factored(motion)
    start = jax.tree.map(lambda x: x[0], given)
    lanes = motion.axes.shape[-1]
    base = None if motion.base is None else jnp.zeros((6, lanes))
    trial = Unknowns(jnp.broadcast_to(driven[0], motion.rates.shape), base)

    def missing(motion: TreeState, accelerations: Unknowns, given: Any) -> Unknowns:
        forces, wrenches = applied(motion, given)
        return jax.tree.map(jnp.subtract, forces, equations.needed(motion, accelerations, wrenches))

    change = factor.solve(missing(motion, trial, start))
    solved = jax.tree.map(jnp.add, trial, change)
    rates = equations.motion_rates(motion, solved)
    if order == 0:
        series = jax.tree.map(lambda a, b: jnp.stack([a, b]), motion, rates)
        return MotionSeries(series, jax.tree.map(lambda x: x[None], solved), factor)
    structure = jax.tree.structure((motion, solved, start))

    def program(*leaves: Any) -> Any:
        motion, accelerations, given = jax.tree.unflatten(structure, leaves)
        return missing(motion, accelerations, given), equations.motion_rates(motion, accelerations)

    before, after = ([None] * len(jax.tree.leaves(part)) for part in (motion, start))  # of the unknowns
    recursion = Recursion(
        program, jax.tree.leaves((motion, solved, start)), order, reversible=reversible, unrolled=unrolled
    )
    put = jax.lax.dynamic_update_index_in_dim

    def level(k: Any, carry: Any) -> Any:
        history, now, series, accelerations = carry
        known = Unknowns(jnp.broadcast_to(driven[k], motion.rates.shape), base)
        inputs = jax.tree.leaves((now, known, jax.tree.map(lambda x: x[k], given)))
        (gap, rates), history = recursion.advanced(history, k, inputs)
        change = factor.solve(gap)
        history = recursion.corrected(history, (*before, *jax.tree.leaves(change), *after))
        newest = jax.tree.map(jnp.add, known, change)
        rates = _with_accelerations(rates, newest)
        now = jax.tree.map(lambda x: x / (k + 1), rates)
        series = jax.tree.map(lambda s, c: put(s, c, k + 1, 0), series, now)
        return history, now, series, jax.tree.map(lambda s, c: put(s, c, k, 0), accelerations, newest)

    def room(levels: int, *first: Any) -> Any:
        def begun(*parts: Any) -> Any:
            whole = jnp.stack(parts)
            return jnp.pad(whole, ((0, levels - len(parts)), *((0, 0),) * (whole.ndim - 1)))

        return jax.tree.map(begun, *first)

    carry = recursion.history, rates, room(order + 2, motion, rates), room(order + 1, solved)
    if unrolled:
        for k in range(1, order + 1):
            carry = level(k, carry)
    else:
        carry = jax.lax.fori_loop(1, order + 1, level, carry)
    _, _, series, accelerations = carry
    return MotionSeries(series, accelerations, factor)


def _with_accelerations(rates: TreeState, accelerations: Unknowns) -> TreeState:
    """Return rates in which the accelerations are those found, in the place of those tried."""
    base = None if rates.base is None else rates.base._replace(twist=accelerations.base)
    return rates._replace(rates=accelerations.joints, base=base)
