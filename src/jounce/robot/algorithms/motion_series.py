"""Taylor series of the motion of a tree under forces, order by order, with one factorization of its inertias."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jounce.execution.compilation import LARGE
from jounce.jet.programs.series import Recursion
from jounce.jet.programs.still_entries import ConstantEntries, still_entries
from jounce.robot.recursions.tree_equations import TreeEquations, TreeFactor, TreeState, Unknowns, Wrenches

Series = Any
"""A pytree of arrays of Taylor coefficients, order first."""


class MotionSeries(NamedTuple):
    """Taylor coefficients of a motion, order first.

    Attributes
    ----------
    coordinates, rates : array of shape (order + 2, coordinates, batch)
    accelerations : Unknowns
        Coefficients to the given order, from which all others follow.
    factor : TreeFactor
        Factorized inertias at order zero.
    position, quaternion, twist : array of shape (order + 2, 3 or 4 or 6, batch), or None
        Motion of a free base.
    """

    coordinates: Any
    rates: Any
    accelerations: Unknowns
    factor: TreeFactor
    position: Any = None
    quaternion: Any = None
    twist: Any = None


def motion_series(
    equations: TreeEquations,
    motion: TreeState,
    applied: Callable[[TreeState, Any], tuple[Unknowns, Wrenches]],
    signals: Series,
    driven: Series,
    order: int,
    *,
    reversible: bool = False,
    unrolled: bool = False,
    still: ConstantEntries | None = None,
) -> MotionSeries:
    """Return the series of the motion through a state.

    Parameters
    ----------
    equations : TreeEquations
        Equations of motion of the robot.
    motion : TreeState
        State at the expansion point.
    applied : callable
        Maps a motion and `signals` to the forces of the coordinates, those on a free base, and wrenches on bodies.
    signals : pytree of array of shape (order + 1, ..., batch)
        Series of the inputs of forces other than the motion.
    driven : array of shape (order + 1, coordinates, batch)
        Accelerations of driven coordinates, zero for free ones.
    order : int
        Order of the accelerations.
    reversible : bool, default False
        Whether JAX may differentiate the program in reverse mode.
    unrolled : bool, default False
        Whether each order has code of its own.
    still : ConstantEntries, optional
        Constant entries of the equations, from `constant_motion`.
    """
    factor = equations.factored(motion)
    start = jax.tree.map(lambda x: x[0], signals)
    lanes = motion.axes.shape[-1]
    base = None if motion.base is None else jnp.zeros((6, lanes))
    trial = Unknowns(jnp.broadcast_to(driven[0], motion.rates.shape), base)

    change = factor.solve(_missing(equations, applied, motion, trial, start))
    solved = jax.tree.map(jnp.add, trial, change)
    rates = equations.motion_rates(motion, solved)
    if order == 0:
        accelerations, poses = jax.tree.map(lambda x: x[None], (solved, _poses(rates)))
        return _integrated(motion, accelerations, poses, factor)
    program = partial(_program, equations, applied, jax.tree.structure((motion, solved, start)))
    before, after = ([None] * len(jax.tree.leaves(part)) for part in (motion, start))  # of the unknowns
    inputs = jax.tree.leaves((motion, solved, start))
    recursion = Recursion(program, inputs, order, reversible=reversible, unrolled=unrolled, still=still)

    def room(first: Any) -> Any:
        min_length = 0 if unrolled else LARGE // max(first.size, 1) + 1  # in memory, to write at a place that varies
        return jnp.zeros((max(order + 1, min_length), *first.shape)).at[0].set(first)

    def updated(series: Any, newest: Any, k: Any) -> Any:
        return jax.tree.map(lambda s, c: jax.lax.dynamic_update_index_in_dim(s, c, k, 0), series, newest)

    def level(k: Any, carry: Any) -> Any:
        history, coefficients, accelerations, poses = carry
        trial = Unknowns(jnp.broadcast_to(driven[k], motion.rates.shape), base)
        inputs = jax.tree.leaves((coefficients, trial, jax.tree.map(lambda x: x[k], signals)))
        (gap, rates), newest = recursion.advanced(history, k, inputs)
        change = factor.solve(gap)
        history = recursion.noted(history, k, recursion.corrected(newest, (*before, *jax.tree.leaves(change), *after)))
        newest = jax.tree.map(jnp.add, trial, change)
        rates = _with_accelerations(rates, newest)
        coefficients = jax.tree.map(lambda x: x / (k + 1), rates)
        return history, coefficients, updated(accelerations, newest, k), updated(poses, _poses(rates), k)

    carry = recursion.history, rates, jax.tree.map(room, solved), jax.tree.map(room, _poses(rates))
    if unrolled:
        for k in range(1, order + 1):
            carry = level(k, carry)
    else:
        carry = jax.lax.fori_loop(1, order + 1, level, carry)
    accelerations, poses = jax.tree.map(lambda x: x[: order + 1], carry[2:])
    return _integrated(motion, accelerations, poses, factor)


def _integrated(motion: TreeState, accelerations: Unknowns, pose_rates: Any, factor: TreeFactor) -> MotionSeries:
    """Return the series of a motion from those of its accelerations and of the pose rates of a free base."""
    levels = jnp.arange(1.0, len(accelerations.joints) + 1)[:, None, None]

    def integrated(start: Any, rates: Any) -> Any:
        return jnp.concatenate([start[None], rates / levels])

    rates = integrated(motion.rates, accelerations.joints)
    series = MotionSeries(integrated(motion.coordinates, rates[:-1]), rates, accelerations, factor)
    if motion.base is None:
        return series
    position, quaternion = map(integrated, _poses(motion), pose_rates)
    twist = integrated(motion.base.twist, accelerations.base)
    return series._replace(position=position, quaternion=quaternion, twist=twist)


def _poses(motion: TreeState) -> Any:
    """Return the pose of a free base, or its rates."""
    return None if motion.base is None else (motion.base.position, motion.base.quaternion)


def constant_motion(
    reader: Callable[[Any], tuple[TreeEquations, Any]],
    parameters: Any,
    motion: TreeState,
    accelerations: Unknowns,
    signals: Series,
) -> ConstantEntries:
    """Return the entries that stay constant in the equations of motion of a tree.

    Parameters
    ----------
    reader : callable
        Maps parameters to the equations and the forces that `motion_series` takes.
    parameters : pytree of array
        Parameters, NaN where unknown beforehand.
    motion, accelerations, signals : pytree of array
        A state and the other inputs of forces, NaN where unknown.
    """
    structure = jax.tree.structure((motion, accelerations, signals))

    def program(parameters: Any, *leaves: Any) -> Any:
        return _program(*reader(parameters), structure, *leaves)

    form, first = jax.tree.structure(motion), len(jax.tree.leaves(accelerations))  # rates follow what is missing
    numbers = jax.tree.unflatten(form, range(first, first + form.num_leaves))
    rates = jax.tree.leaves(_with_accelerations(numbers, jax.tree.map(lambda _: -1, accelerations)))
    values = jax.tree.leaves((motion, accelerations, signals))
    return still_entries(program, parameters, values, [*rates, *[-1] * (len(values) - len(rates))])


def _missing(
    equations: TreeEquations, applied: Any, motion: TreeState, accelerations: Unknowns, signals: Any
) -> Unknowns:
    forces, wrenches = applied(motion, signals)
    return jax.tree.map(jnp.subtract, forces, equations.needed(motion, accelerations, wrenches))


def _program(equations: TreeEquations, applied: Any, structure: Any, *leaves: Any) -> Any:
    """Return the force residual and the rates of the motion."""
    motion, accelerations, signals = jax.tree.unflatten(structure, leaves)
    return _missing(equations, applied, motion, accelerations, signals), equations.motion_rates(motion, accelerations)


def _with_accelerations(rates: TreeState, accelerations: Unknowns) -> TreeState:
    """Return the rates of a motion with the given accelerations in place of the trial values."""
    base = None if rates.base is None else rates.base._replace(twist=accelerations.base)
    return rates._replace(rates=accelerations.joints, base=base)
