"""Continuation along a path from its start, node by node, with a check of each interval."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.padding import padded
from jounce.execution.compilation import compiled
from jounce.planning.tool_paths.path_equations import PathEquations

ORDER = 6  # order of the series from node to node
POINTS_IN_STEP = 8  # checked points of an interval
FIRST = 32  # first intervals
BLOCK = 64  # nodes of the compiled program
CHANGE = 0.5  # largest relative change of the Jacobian over an interval, within which it cannot become singular
NEAR = 0.05  # rad, or sizes of the robot: largest distance of the solution from a series
TAME = 0.1  # largest relative change of the Jacobian over a correction
GOOD = 1e-9  # largest last correction
SHORTEST = 2.0**-16  # fraction of the path: continuation fails at an interval that would have to be shorter


class Nodes(NamedTuple):
    """Instants along a path with series of the unknowns.

    Attributes
    ----------
    time : array of shape (nodes,)
        Instants, s.
    series : array of shape (nodes, order + 1, unknowns)
        Taylor coefficients.
    failed : int or None
        Number of the interval that could not be passed; None if the path was followed to its end.
    """

    time: Float[np.ndarray, " nodes"]
    series: Float[np.ndarray, "nodes order unknown"]
    failed: int | None


@compiled()
def march(equations: PathEquations, start: Any, steps: Any, targets: Any, inner: Any) -> Any:
    """Follow a path from node to node.

    Parameters
    ----------
    equations : PathEquations
        Equations of the coordinates.
    start : array of shape (unknowns, 1)
        Guess of the unknowns at the first node.
    steps : array of shape (nodes,)
        Time from each node to the next, s.
    targets, inner : dict of array
        Series at the nodes, (nodes, order + 1, ..., 1), and values within the intervals, (nodes, 1, ..., points).

    Returns
    -------
    guess : array of shape (unknowns, 1)
        Unknowns predicted by the series of the last node.
    series : array of shape (nodes, order + 1, unknowns)
    first, last : array of shape (nodes,)
        Sizes of the first and last correction at each node.
    change, gap, tame : array of shape (nodes,)
        For the interval after each node: relative change of the Jacobian, distance of the solution from the series, and
        change of the Jacobian over that distance.
    """
    shares = jnp.arange(1.0, POINTS_IN_STEP + 1) / POINTS_IN_STEP

    def node(guess: Any, entry: Any) -> Any:
        step, target, values = entry
        corrected = equations.corrected(guess, target)
        factor = corrected.factor
        series = equations.series(corrected.u, factor, target, ORDER)
        powers = (shares * step)[None] ** jnp.arange(ORDER + 1.0)[:, None]
        positions = jnp.sum(series * powers[:, None], axis=0)
        difference = equations.matrix(positions, values) - factor.matrix
        change = jnp.sum(factor.inverse[:, :, None] * difference[None], axis=1)
        change = jnp.max(jnp.sum(jnp.abs(change), axis=1))
        gap = jnp.sum(factor.inverse * equations.residual(positions[None], values)[0][None], axis=1)
        gap = jnp.max(jnp.abs(gap))
        distance = jnp.max(jnp.abs(positions - corrected.u))
        tame = change * gap / jnp.where(distance == 0, 1.0, distance)
        result = series[..., 0], corrected.first[0], corrected.last[0], change, gap, tame
        return positions[:, -1:], result

    return jax.lax.scan(node, start, (steps, targets, inner))


def followed(
    equations: PathEquations,
    start: Float[np.ndarray, " unknown"],
    target: Callable[[Float[np.ndarray, " time"], int], dict[str, Any]],
    start_time: float,
    end: float,
    order: int,
) -> Nodes:
    """Follow a path from its start to its end, halving intervals until each passes its checks.

    Over an interval, the Jacobian changes by less than half, relative to its value at the start, and the solution is so
    near the series that Newton corrections contract (Deuflhard 2011, Newton Methods for Nonlinear Problems,
    theorem 2.3): the solution at the end is on the branch of that at the start.
    """
    time = np.linspace(start_time, end, FIRST + 1)
    while True:
        steps = np.diff(time)
        result = _marched(equations, start, time, target, order)
        series, first, last, change, gap, tame = result
        with np.errstate(invalid="ignore"):
            at_node = (last <= GOOD) & (first <= 2 * NEAR)
            at_node[0] = last[0] <= GOOD
            has_passed = (change[:-1] <= CHANGE) & (gap[:-1] <= NEAR) & (tame[:-1] <= TAME) & at_node[1:]
        if not at_node[0]:
            return Nodes(time[:1], series[:1], 0)
        if has_passed.all():
            return Nodes(time, series, None)
        is_lost = ~at_node[1:]
        stop = int(np.argmax(is_lost)) + 1 if is_lost.any() else len(has_passed)  # later nodes start from a wrong guess
        failures = np.flatnonzero(~has_passed[:stop])
        too_short = failures[steps[failures] <= SHORTEST * (end - start_time)]
        if too_short.size:
            k = int(too_short[0])
            if k == failures[0]:
                return Nodes(time[: k + 1], series[: k + 1], k)
            failures = failures[failures < k]
        time = np.sort(np.concatenate([time, time[failures] + 0.5 * steps[failures]]))


def _marched(equations: PathEquations, start: Any, time: Any, target: Any, order: int) -> list[np.ndarray]:
    """Return the results of `march` for nodes, padded to a multiple of the compiled length."""
    count = BLOCK * -(-len(time) // BLOCK)
    nodes = padded(time, count)
    steps = np.append(np.diff(nodes), 0.0)
    series = {kind: _filled(array, ORDER) for kind, array in target(nodes, min(order, ORDER)).items()}
    targets = {kind: np.moveaxis(array, -1, 0)[..., None] for kind, array in series.items()}
    shares = np.arange(1, POINTS_IN_STEP + 1) / POINTS_IN_STEP
    instants = np.minimum((nodes[:, None] + shares * steps[:, None]).ravel(), time[-1])
    inner = {
        kind: np.moveaxis(array.reshape(*array.shape[:-1], count, POINTS_IN_STEP), -2, 0)
        for kind, array in target(instants, 0).items()
    }
    guess, results = np.asarray(start)[:, None], []
    for first in range(0, count, BLOCK):
        block = slice(first, first + BLOCK)
        guess, result = march(equations, guess, steps[block], *jax.tree.map(lambda x, b=block: x[b], (targets, inner)))
        results.append(result)
    return [np.concatenate(x)[: len(time)] for x in zip(*results, strict=True)]


def _filled(array: np.ndarray, order: int) -> np.ndarray:
    """Return series padded with zeros to an order."""
    count = order + 1 - len(array)
    return np.concatenate([array, np.zeros((count, *array.shape[1:]))]) if count > 0 else array


def predicted(nodes: Nodes, time: Float[np.ndarray, " time"]) -> Float[np.ndarray, "time unknown"]:
    """Return the unknowns at instants, by the series of the nodes before them."""
    chosen = np.clip(np.searchsorted(nodes.time, time, side="right") - 1, 0, len(nodes.time) - 1)
    elapsed = time - nodes.time[chosen]
    powers = elapsed[:, None] ** np.arange(nodes.series.shape[1])
    return np.einsum("tk,tku->tu", powers, nodes.series[chosen])
