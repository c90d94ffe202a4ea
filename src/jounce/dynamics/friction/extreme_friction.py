"""How much friction at rest can do at most, for and against what holds a mechanism.

At rest friction is any within its cone: in each joint the force f along its slip, no larger than ``mu |p|``, p being
what presses its surfaces. That follows from the friction of all joints, ``p = p_0 - S f``, and what holds the mechanism
from ``k f``. The set of such f is not convex, as a joint may be pressed either way.

Where every slip has one direction, the most of ``k f`` is at a vertex, where all joints have all of their friction:
with any of them short of it, what is left is a convex function of the others, whose largest value is at an end. What is
a vertex follows from the signs of the friction; those of the largest are mostly found by going from one to a better
one. That none is better is proven by a Lagrangian that is concave, or else by looking at all of them.
"""

import itertools
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.shapes import Numbers
from jounce.dynamics.friction.coupling import Coupling
from jounce.execution.chunks import in_chunks
from jounce.execution.compilation import compiled

IMPROVEMENTS = 100  # of the directions of friction, one after the other
ALL_SIGNS = 12  # joints: as many have 4096 combinations of signs
STARTS = 64  # of searches, where directions are not signs
LOADS = 4  # of chance, where nothing presses the joints
HALVINGS = 45  # of the share of friction at which it locks
LOCKED = 1e12  # times what presses without friction: as large only by rounding where friction locks
LARGE = 1e6  # times the size of friction without locking
CONCAVE = 1e-11  # of the largest curvature: less is rounding
ALONG = 1e-8  # rad, within which friction has the direction that does most
SMALLEST = 1e-150  # N: what presses less does not press


@compiled(brief=True)
def _pressed(pressing: Numbers, columns: Numbers) -> tuple[Any, Any]:
    """Return what presses joints and its size, where each has all of its friction, whose columns are given."""
    joints, components, lanes = pressing.shape

    def sizes(rows: Any) -> Any:
        square = jnp.sum(rows.reshape(joints, components, lanes) ** 2, axis=1)
        return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)

    _, rows, forces = Coupling.of(sizes, pressing.reshape(-1, lanes), columns)
    return rows.reshape(joints, components, lanes), forces


class ExtremeFriction:
    """The friction that joints of a mechanism at rest can have, at some instants.

    Parameters
    ----------
    pressing : array of shape (joints, components, instants)
        What presses the surfaces of each joint together without friction, N.
    changes : array of shape (directions, joints, components, instants)
        By how much that is less for friction of one in each direction of slip.
    joints : sequence of int
        The joint of each direction, in their order.
    coefficients : array of shape (joints,)
        Of friction.
    """

    def __init__(
        self,
        pressing: Float[np.ndarray, "joint component lane"],
        changes: Float[np.ndarray, "direction joint component lane"],
        joints: Sequence[int] | np.ndarray,
        coefficients: Float[np.ndarray, " joint"],
    ):
        rubbing = np.asarray(coefficients, float) > 0
        self._given = rubbing[np.asarray(joints, int)]  # directions of joints that have friction
        self.pressing, self.changes = pressing[rubbing], changes[self._given][:, rubbing]
        self.joints = (np.cumsum(rubbing) - 1)[np.asarray(joints, int)[self._given]]
        self.coefficients = np.asarray(coefficients, float)[rubbing]
        self.signs_only = len(np.unique(self.joints)) == len(self.joints)

    def most(
        self, along: Float[np.ndarray, "direction lane"]
    ) -> tuple[Float[np.ndarray, " lane"], Bool[np.ndarray, " lane"]]:
        """Return the most that friction does along a direction, and whether that is proven.

        Parameters
        ----------
        along : array of shape (directions, instants)
            What friction of one in each direction adds to what is requested.

        Returns
        -------
        most : array of shape (instants,)
            Infinite where friction locks, so that friction has no bound; NaN where it is not determined.
        proven : array of bool, shape (instants,)
        """
        along = along[self._given]
        if not len(along):
            return np.zeros(along.shape[1]), np.ones(along.shape[1], bool)
        start = self._directions_of(along, np.ones_like(along))
        chosen, value, proven = self._improved(start, along)
        for lane in np.flatnonzero(~self.pressing.any(axis=(0, 1))):
            value[lane], proven[lane] = np.inf if self._locks_unloaded(along, int(lane)) else 0.0, True
        for lane in np.flatnonzero(~proven):
            value[lane], proven[lane] = self._searched(int(lane), along[:, lane], chosen[:, lane])
        return value, proven

    def _locks_unloaded(self, along: np.ndarray, lane: int) -> bool:
        """Return whether friction without a normal force locks: whether it does so under some loads."""
        loads = np.random.default_rng(0).normal(size=(*self.pressing.shape[:2], LOADS))
        loads = np.concatenate([loads, -loads], axis=-1)
        changes = np.repeat(self.changes[..., lane : lane + 1], 2 * LOADS, axis=-1)
        loaded = ExtremeFriction(loads, changes, self.joints, self.coefficients)
        return bool(np.isinf(loaded.most(np.repeat(along[:, lane : lane + 1], 2 * LOADS, axis=1))[0]).any())

    def _blocks(self, values: np.ndarray) -> np.ndarray:
        """Return the sums over the directions of each joint."""
        sums = np.zeros((len(self.coefficients), *values.shape[1:]))
        np.add.at(sums, self.joints, values)
        return sums

    def _directions_of(self, along: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
        """Return unit vectors along, for each joint; where nothing is along, as otherwise given."""
        size = np.sqrt(self._blocks(along**2))[self.joints]
        others = otherwise / np.sqrt(self._blocks(otherwise**2))[self.joints]
        largest = size.max(axis=0, initial=0.0)
        clear = size > 1e-14 * largest
        return np.where(clear, along / np.where(clear, size, 1.0), others)

    def _held(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what presses joints, its size, and the friction, where all of it is along some directions."""
        joints, components, lanes = self.pressing.shape
        most = self.coefficients[self.joints][:, None] * directions
        columns = np.zeros((joints, joints, components, lanes))
        np.add.at(columns, self.joints, most[:, None, None] * self.changes)
        columns = columns.reshape(joints, -1, lanes)
        pressing, sizes = in_chunks(lambda k: _pressed(self.pressing[..., k], columns[..., k]), lanes)
        sizes = np.where(sizes <= LOCKED * np.abs(self.pressing).max(axis=(0, 1)), sizes, np.nan)
        return pressing, sizes, most * sizes[self.joints]

    def _improved(self, directions: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return directions that do more, what they do, and whether nothing does more."""
        for _ in range(IMPROVEMENTS):
            gain, sizes, regular = self._gain(directions, along)
            better = np.where(regular, self._directions_of(gain, directions), directions)
            turned = np.abs(better - directions).max(axis=0, initial=0.0)
            if not (turned > 1e-14).any():
                break
            directions = better
        gain, sizes, regular = self._gain(directions, along)
        turned = np.abs(self._directions_of(gain, directions) - directions).max(axis=0, initial=0.0)
        proven = regular & (turned <= ALONG) & self._is_concave(gain, sizes, regular)
        return directions, np.sum(along * self._held(directions)[2], axis=0), proven

    def _gain(self, directions: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what more friction in each direction does, with all that it changes; what presses; and where known."""
        pressing, sizes, _ = self._held(directions)
        known = np.isfinite(sizes).all(axis=0)
        pressing, sizes = np.where(known, pressing, 0.0), np.where(known, sizes, 0.0)
        slopes = -np.einsum("jcl,djcl->jdl", pressing, self.changes) / np.maximum(sizes, SMALLEST)[:, None]
        most = self.coefficients[self.joints][:, None] * directions
        unit = np.eye(len(directions))[..., None]
        matrix = unit - most[:, None] * slopes[self.joints]
        regular = known & np.isfinite(along).all(axis=0) & np.isfinite(matrix).all(axis=(0, 1))
        matrix, right = np.where(regular, matrix, unit), np.where(regular, along, 0.0)
        return np.linalg.solve(matrix.transpose(2, 1, 0), right.T[..., None])[..., 0].T, sizes, regular

    def _is_concave(self, gain: np.ndarray, sizes: np.ndarray, regular: np.ndarray) -> np.ndarray:
        """Tell whether the Lagrangian of the squared cones is concave, so that what is stationary is the most."""
        least = self.coefficients[:, None] * np.maximum(sizes, SMALLEST)
        weights = np.where(regular, np.sqrt(self._blocks(gain**2)) / (2 * least), 0.0)
        curved = np.einsum("jl,j,djcl,ejcl->lde", weights, self.coefficients**2, self.changes, self.changes)
        whole = np.eye(len(self.joints)) * weights[self.joints].T[:, None] - curved
        fit = np.isfinite(whole).all(axis=(1, 2))
        lowest = np.linalg.eigvalsh(np.where(fit[:, None, None], whole, 0.0)).min(axis=1, initial=0.0)
        return fit & (lowest >= -CONCAVE * weights.max(axis=0, initial=0.0))

    def _searched(self, lane: int, along: np.ndarray, chosen: np.ndarray) -> tuple[float, bool]:
        """Return the most that friction does at an instant, by looking at all signs, or from many directions."""
        if not np.isfinite(along).all():
            return np.nan, True
        count = len(self.joints)
        every = self.signs_only and count <= ALL_SIGNS
        if every:
            trials = np.array(list(itertools.product((1.0, -1.0), repeat=count))).T
        else:
            random = np.random.default_rng(0).normal(size=(count, STARTS))
            trials = np.concatenate([chosen[:, None], self._directions_of(random, random)], axis=1)
        lanes = np.full(trials.shape[1], lane)
        many = ExtremeFriction(self.pressing[..., lanes], self.changes[..., lanes], self.joints, self.coefficients)
        wide = np.repeat(along[:, None], len(lanes), axis=1)
        if not every:
            trials, _, _ = many._improved(trials, wide)
        value = np.sum(wide * many._held(trials)[2], axis=0)
        locked = np.isnan(value)
        if locked.any():
            value[locked] = many._at_lock(trials, wide)[locked]
        if (value == np.inf).any():
            return np.inf, True
        return (np.nan, False) if np.isnan(value).any() else (float(value.max()), every)

    def _at_lock(self, directions: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return where what friction does goes as its share grows to where it locks: to infinity, or NaN."""
        share, locked = np.zeros(along.shape[1]), np.ones(along.shape[1])
        value = np.zeros(along.shape[1])
        for _ in range(HALVINGS):
            middle = (share + locked) / 2
            now = np.sum(along * self._held(directions * middle)[2], axis=0)
            fit = np.isfinite(now)
            share, locked, value = (
                np.where(fit, middle, share),
                np.where(fit, locked, middle),
                np.where(fit, now, value),
            )
        loads = np.abs(self.pressing).max(axis=(0, 1))
        size = np.abs(along).max(axis=0) * loads
        return np.where(np.abs(value) > LARGE * size, np.copysign(np.inf, value), np.nan)
