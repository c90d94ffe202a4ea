"""Steps of a simulation, divided where derivatives of the motion vary faster than the motion itself.

A body at rest or in uniform motion is simulated in one step, since its series ends. The series of its derivative with
respect to a mass or a force does not end, and converges only within some radius. Each step is therefore divided until
the series of its derivatives, with respect to the initial state and each traced value, converge within the parts.
"""

from collections.abc import Collection, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Float, Int

from jounce.base.padding import power_of_two
from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Instants, State, expand
from jounce.dynamics.forward.saddle_point import DenseInverse
from jounce.errors import UnsupportedError
from jounce.execution.compilation import compiled
from jounce.integrate.marching.marching import DenseOutput
from jounce.integrate.marching.smoothness_breaks import Break
from jounce.integrate.steps.methods import LOWEST_ORDER, evaluated
from jounce.kinematics.sensitivity.jacobian_series import solver

MOST_STEPS = 2**17
MOST_DIRECTIONS = 16
HALVINGS = 17
FINER = 100.0  # truncation errors of parts are this much smaller than those of steps, which are fewer

ROUNDS = 3  # of refinement of a state behind a kink; each gains a factor of the time to the kink


class Kinks(NamedTuple):
    """The pieces that lead over kinks.

    Attributes
    ----------
    begins : array of shape (steps,)
        First instant of each piece, s; instants behind a kink belong to the piece after it.
    back : array of bool, shape (steps,)
        Whether a piece begins behind a kink and goes back to it.
    velocity, spin : array of shape (steps, components, bodies)
        Weights of `Break`.
    """

    begins: Float[np.ndarray, " step"]
    back: Bool[np.ndarray, " step"]
    velocity: Float[np.ndarray, "step component body"]
    spin: Float[np.ndarray, "step component body"]


class Pieces(NamedTuple):
    """Consecutive steps, or parts of steps.

    Attributes
    ----------
    start, length : array of shape (steps,)
        s; lengths are negative backward in time.
    state : State
        States at the starts, (steps, components, bodies).
    used : array of bool, shape (steps, order + 1)
        Whether each coefficient of the series is used.
    kinks : Kinks, optional
        Kinks, if there are any.
    """

    start: Float[np.ndarray, " step"]
    length: Float[np.ndarray, " step"]
    state: State
    used: Bool[np.ndarray, "step order"]
    kinks: Kinks | None = None

    def at(self, instants: Float[np.ndarray, " time"]) -> Int[np.ndarray, " time"]:
        """Return the indices of the pieces that contain instants."""
        sign = -1.0 if self.length[0] < 0 else 1.0
        begins = self.start if self.kinks is None else self.kinks.begins
        index = np.searchsorted(sign * begins, sign * instants, "right") - 1
        return np.clip(index, 0, len(self.start) - 1)

    def padded(self) -> "Pieces":
        """Return the pieces padded to a power of two by pieces of no length, so that few sizes are compiled."""
        count = len(self.start)
        fill = np.minimum(np.arange(power_of_two(count)), count - 1)
        return self.chosen(fill)._replace(length=np.where(np.arange(len(fill)) < count, self.length[fill], 0.0))

    def chosen(self, indices: Int[np.ndarray, " chosen"]) -> "Pieces":
        """Return the pieces with given indices."""
        return jax.tree.map(lambda part: part[indices], self)

    def over(self, kinks: dict[int, Break]) -> "Pieces":
        """Return the pieces with those of given indices ending at kinks.

        The next pieces still begin behind the kinks, so that none begins at a kink, where rounding would decide its
        side. Between them, additional pieces go back to the kink, where the two sides meet.
        """
        if not kinks:
            return self
        indices = np.array(sorted(kinks))
        before, after = np.isin(np.arange(len(self.start)), indices), np.isin(np.arange(len(self.start)), indices + 1)
        repeated = np.repeat(np.arange(len(self.start)), np.where(after, 1 + ROUNDS, 1))
        goes_back = np.append(repeated[1:] == repeated[:-1], False)
        length, starts = self.length.copy(), self.start.copy()
        remaining, weights = np.zeros(len(length)), [np.zeros(part.shape) for part in self.state[2:]]
        for index, kink in kinks.items():
            remaining[index + 1], length[index] = length[index] - kink.since, kink.since
            starts[index + 1] = self.start[index] + kink.since
            weights[0][index + 1], weights[1][index + 1] = kink.velocity, kink.spin
        pieces = self._replace(length=length, used=self.used | (before | after)[:, None]).chosen(repeated)
        kink_data = Kinks(starts[repeated], goes_back, *(part[repeated] for part in weights))
        return pieces._replace(length=np.where(goes_back, -remaining[repeated], pieces.length), kinks=kink_data)


def divided_steps(
    dense: DenseOutput, equations: Equations, numeric: Equations, allowed: float | None, kinks: Collection[Break]
) -> Pieces:
    """Return the steps of a simulation, divided so that the series of all changes converge within each.

    Parameters
    ----------
    dense : DenseOutput
        The steps.
    equations, plain : Equations
        Equations with some leaves traced by JAX, and the same with plain numbers in their places.
    allowed : float or None
        Relative error of a derivative in a step; None leaves the steps undivided.
    kinks : collection of Break
        Kinks of forces within steps; these steps are not divided.

    Raises
    ------
    UnsupportedError
        If too many steps would be needed.
    """
    leaves, structure = jax.tree.flatten(equations)
    numbers, plain_structure = jax.tree.flatten(numeric)
    assert structure == plain_structure
    moving = tuple(k for k, leaf in enumerate(leaves) if isinstance(leaf, Tracer))
    directions, turns = _directions([numbers[k] for k in moving])
    used, duration = _used_coefficients(dense), abs(dense.end - float(dense.start[0]))
    count = np.ones(len(dense.start), int)
    while True:
        pieces, step_of_piece = _parts(dense, used, count)
        kink_of_piece = {int(np.searchsorted(step_of_piece, kink.step)): kink for kink in kinks}
        if allowed is None:
            return pieces
        sizes = np.stack(_sizes(numeric, pieces.padded(), directions, turns, moving=moving))[..., : len(pieces.start)]
        unresolved = step_of_piece[_needed(sizes, pieces, duration, allowed) > 1]
        unresolved = unresolved[~np.isin(unresolved, [kink.step for kink in kinks])]
        if not unresolved.size:
            return pieces.over(kink_of_piece)
        if not used[unresolved].all():  # a body that hardly moves took a long step of low order: try all orders first
            used[unresolved] = True
            continue
        parts = count.copy()
        factors = np.where(np.isin(step_of_piece, unresolved), _needed(sizes, pieces, duration, allowed / FINER), 1)
        np.maximum.at(parts, step_of_piece, count[step_of_piece] * factors)
        if parts.sum() > MOST_STEPS:
            message = (
                f"this motion changes so fast that more than {MOST_STEPS} steps are needed; simulate a shorter time"
            )
            raise UnsupportedError(message, name="time")
        count = parts


def _used_coefficients(dense: DenseOutput) -> Bool[np.ndarray, "step order"]:
    """Return the coefficients with which steps were taken: all of a series that ended before it could be cut."""
    used = np.any([np.any(np.asarray(part) != 0, axis=tuple(range(2, part.ndim))) for part in dense.polynomial], axis=0)
    orders = np.arange(used.shape[1])
    last = np.max(np.where(used, orders, 0), axis=1, keepdims=True)
    return (orders <= last) | (last < LOWEST_ORDER)


def _parts(
    dense: DenseOutput, used: Bool[np.ndarray, "step order"], count: Int[np.ndarray, " step"]
) -> tuple[Pieces, Int[np.ndarray, " part"]]:
    """Return the parts of steps, and the index of the step of each part."""
    steps = np.repeat(np.arange(len(count)), count)
    part = np.concatenate([np.arange(number) for number in count])
    length = np.asarray(dense.length)[steps] / count[steps]
    polynomial = dense.polynomial.map(lambda c: np.moveaxis(np.asarray(c)[steps], (0, 1), (-1, 0)))
    state = evaluated(polynomial, part * length).map(lambda x: np.moveaxis(np.asarray(x), -1, 0))
    return Pieces(np.asarray(dense.start)[steps] + part * length, length, state, used[steps]), steps


def _needed(
    sizes: Float[np.ndarray, "part order direction step"], pieces: Pieces, duration: float, allowed: float
) -> Int[np.ndarray, " step"]:
    """Return the numbers of parts, powers of two, into which steps are to be divided.

    The truncation error is that of the known terms that are left out or, if all are kept, is extrapolated: its ratio to
    the last two terms is the ratio of those to the two before. It is relative to the largest change, with velocities
    multiplied by the whole duration.
    """
    positions, velocities = sizes
    orders = np.arange(len(positions))[:, None, None]
    unused, complete = ~pieces.used.T[:, None], pieces.used.all(axis=1)
    counts = np.full(len(pieces.length), 2**HALVINGS)
    for parts in 2 ** np.arange(HALVINGS)[::-1]:
        powers = (np.abs(pieces.length) / parts) ** orders
        terms = positions * powers
        largest = np.maximum(terms, duration * velocities * powers).max(axis=0)
        last, before = terms[-2:].max(axis=0), terms[-4:-2].max(axis=0)
        next_term = last * np.minimum(last / np.maximum(before, 1e-300), 1.0)
        left_out = np.where(complete, next_term, np.where(unused, terms, 0.0).max(axis=0))
        counts[(left_out <= allowed * largest).all(axis=0)] = parts
    return counts


def _directions(numbers: Sequence[Any]) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the directions of change of values, (directions, ...) each, and of the state.

    Each direction changes some values by random numbers; the last changes the state alone.
    """
    random = np.random.default_rng(0)
    count = min(len(numbers), MOST_DIRECTIONS)
    assignment = np.eye(count + 1)[:, np.arange(len(numbers)) % max(count, 1)]
    return [
        random.normal(size=np.shape(x)) * assignment[:, k].reshape(-1, *[1] * np.ndim(x)) for k, x in enumerate(numbers)
    ], np.eye(count + 1)[count]


@compiled("moving")
def _sizes(
    equations: Equations,
    pieces: Pieces,
    directions: list[Numbers],
    turns: Float[Numbers, " direction"],
    *,
    moving: tuple[int, ...],
) -> tuple[Numbers, Numbers]:
    """Return the sizes of the series of changes of positions and velocities, (order + 1, directions, steps) each."""
    leaves, structure = jax.tree.flatten(equations)
    order, length = pieces.used.shape[1] - 1, equations.system.column_scale[0]
    state = pieces.state.map(lambda part: jnp.moveaxis(part, 0, -1))

    def series(numbers: Any, state: State) -> Any:
        all_leaves = list(leaves)
        for k, number in zip(moving, numbers, strict=True):
            all_leaves[k] = number
        expansion = series_through(jax.tree.unflatten(structure, all_leaves), state, pieces.start[None], order)
        scaled = expansion._replace(position=expansion.position / length, velocity=expansion.velocity / length)
        flat = scaled.map(lambda part: part.reshape(order + 1, -1, len(pieces.start)))
        return jnp.concatenate(flat[:2], axis=1), jnp.concatenate(flat[2:], axis=1)

    def change(directions: Any, turn: Any) -> Any:
        state_change = jax.tree.map(lambda x: turn * jnp.ones_like(x), state)
        numbers = [jnp.asarray(leaves[k], float) for k in moving]
        changes = jax.jvp(series, (numbers, state), (directions, state_change))[1]
        return tuple(jnp.max(jnp.abs(x), axis=1) for x in changes)

    return jax.vmap(change, out_axes=1)(directions, turns)


def series_through(equations: Equations, state: State, time: Instants, order: int) -> State:
    """Return the series of the motion through a state, which JAX can differentiate in either mode."""
    inverse = _inverse(equations.matrix(state, time), jax.lax.stop_gradient(equations.factored(state, time).inverse()))
    return expand(equations, state, time, order, DenseInverse(inverse), reversible=True).state


def _inverse(matrix: Any, inverse: Any) -> Any:
    """Return the known inverse of matrices, with its derivatives.

    It is written as a linear solve: with a rule by `jax.custom_jvp`, derivatives of gradients were wrong, since JAX
    drops the rule when it recomputes values under `jax.checkpoint`.
    """

    def product(a: Any, b: Any) -> Any:
        return jnp.sum(a[:, :, None] * b[None], axis=1)

    unit = jnp.broadcast_to(jnp.eye(len(matrix))[:, :, None], matrix.shape)
    transposed = jnp.swapaxes(inverse, 0, 1)
    return solver(partial(product, matrix), partial(product, inverse), partial(product, transposed))(unit)
