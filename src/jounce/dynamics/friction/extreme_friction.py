"""Bounds of static friction: the largest contribution of friction to a holding force.

At rest the friction force f of a joint lies anywhere in its cone: along the slip directions, no larger than ``mu |p|``
with the normal force p. Normal forces depend on the friction of all joints, ``p = p_0 - S f``, and the contribution to
the holding force is ``k f``. The set of such f is not convex, as a joint may be pressed either way.

If every joint slips in one direction, ``k f`` is largest at a vertex, where the friction of all joints is full: as a
function of the friction of one joint, the others being full, the contribution is convex and largest at an end. The
signs of the friction determine a vertex. Going from a vertex to a better one mostly finds the best one. A concave
Lagrangian proves that none is better; otherwise all vertices are compared.
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

IMPROVEMENTS = 100  # largest number of iterations of the directions of friction
ALL_SIGNS = 12  # joints for which all signs are compared: 4096 combinations
STARTS = 64  # random starts of searches, where directions are not only signs
LOADS = 4  # random loads, where no normal force acts without friction
HALVINGS = 45  # bisections for the share of friction at which it locks
LOCKED = 1e12  # times the normal force without friction: only rounding gives more, where friction locks
LARGE = 1e6  # times the friction without locking: counts as infinite
CONCAVE = 1e-11  # fraction of the largest curvature: less is rounding
ALONG = 1e-8  # rad: tolerance of the optimal direction of friction
SMALLEST = 1e-150  # N: smaller normal forces count as zero


@compiled(brief=True)
def _pressed(pressing: Numbers, columns: Numbers) -> tuple[Any, Any]:
    """Return the normal forces of joints and their sizes for full friction, given by its columns."""
    joints, components, lanes = pressing.shape

    def sizes(rows: Any) -> Any:
        square = jnp.sum(rows.reshape(joints, components, lanes) ** 2, axis=1)
        return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)

    _, rows, forces = Coupling.of(sizes, pressing.reshape(-1, lanes), columns)
    return rows.reshape(joints, components, lanes), forces


class ExtremeFriction:
    """The possible static friction in the joints of a mechanism, at several instants.

    Parameters
    ----------
    pressing : array of shape (joints, components, instants)
        Normal force of each joint without friction, N.
    changes : array of shape (directions, joints, components, instants)
        Decrease of the normal forces for unit friction in each slip direction.
    joints : sequence of int
        Joint of each slip direction, in ascending order.
    coefficients : array of shape (joints,)
        Friction coefficients.
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
        self, contributions: Float[np.ndarray, "direction lane"]
    ) -> tuple[Float[np.ndarray, " lane"], Bool[np.ndarray, " lane"]]:
        """Return the largest contribution of friction to a quantity, and whether it is proven to be the largest.

        Parameters
        ----------
        contributions : array of shape (directions, instants)
            Contribution of unit friction in each slip direction.

        Returns
        -------
        most : array of shape (instants,)
            Infinite where friction locks and has no bound; NaN where it is not determined.
        proven : array of bool, shape (instants,)
        """
        contributions = contributions[self._given]
        if not len(contributions):
            return np.zeros(contributions.shape[1]), np.ones(contributions.shape[1], bool)
        start = self._directions_of(contributions, np.ones_like(contributions))
        chosen, value, proven = self._improved(start, contributions)
        for lane in np.flatnonzero(~self.pressing.any(axis=(0, 1))):
            value[lane], proven[lane] = np.inf if self._locks_unloaded(contributions, int(lane)) else 0.0, True
        for lane in np.flatnonzero(~proven):
            value[lane], proven[lane] = self._searched(int(lane), contributions[:, lane], chosen[:, lane])
        return value, proven

    def _locks_unloaded(self, contributions: np.ndarray, lane: int) -> bool:
        """Return whether friction of unloaded joints locks, as it does under any of several random loads."""
        loads = np.random.default_rng(0).normal(size=(*self.pressing.shape[:2], LOADS))
        loads = np.concatenate([loads, -loads], axis=-1)
        changes = np.repeat(self.changes[..., lane : lane + 1], 2 * LOADS, axis=-1)
        loaded = ExtremeFriction(loads, changes, self.joints, self.coefficients)
        return bool(np.isinf(loaded.most(np.repeat(contributions[:, lane : lane + 1], 2 * LOADS, axis=1))[0]).any())

    def _blocks(self, values: np.ndarray) -> np.ndarray:
        """Return the sums over the directions of each joint."""
        sums = np.zeros((len(self.coefficients), *values.shape[1:]))
        np.add.at(sums, self.joints, values)
        return sums

    def _directions_of(self, contributions: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
        """Return the unit vector of contributions for each joint, or that of `otherwise` where they are zero."""
        size = np.sqrt(self._blocks(contributions**2))[self.joints]
        fallback = otherwise / np.sqrt(self._blocks(otherwise**2))[self.joints]
        max_size = size.max(axis=0, initial=0.0)
        clear = size > 1e-14 * max_size
        return np.where(clear, contributions / np.where(clear, size, 1.0), fallback)

    def _held(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the normal forces, their sizes, and the friction, for full friction along given directions."""
        joints, components, lanes = self.pressing.shape
        full_friction = self.coefficients[self.joints][:, None] * directions
        columns = np.zeros((joints, joints, components, lanes))
        np.add.at(columns, self.joints, full_friction[:, None, None] * self.changes)
        columns = columns.reshape(joints, -1, lanes)
        pressing, sizes = in_chunks(lambda k: _pressed(self.pressing[..., k], columns[..., k]), lanes)
        sizes = np.where(sizes <= LOCKED * np.abs(self.pressing).max(axis=(0, 1)), sizes, np.nan)
        return pressing, sizes, full_friction * sizes[self.joints]

    def _improved(self, directions: np.ndarray, contributions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return improved directions of friction, their contribution, and whether it is proven to be the largest."""
        for _ in range(IMPROVEMENTS):
            gain, sizes, regular = self._gain(directions, contributions)
            improved = np.where(regular, self._directions_of(gain, directions), directions)
            change = np.abs(improved - directions).max(axis=0, initial=0.0)
            if not (change > 1e-14).any():
                break
            directions = improved
        gain, sizes, regular = self._gain(directions, contributions)
        change = np.abs(self._directions_of(gain, directions) - directions).max(axis=0, initial=0.0)
        proven = regular & (change <= ALONG) & self._is_concave(gain, sizes, regular)
        return directions, np.sum(contributions * self._held(directions)[2], axis=0), proven

    def _gain(self, directions: np.ndarray, contributions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the total derivative of the contribution by the friction in each direction, the normal forces, and
        whether both are regular.
        """
        pressing, sizes, _ = self._held(directions)
        is_known = np.isfinite(sizes).all(axis=0)
        pressing, sizes = np.where(is_known, pressing, 0.0), np.where(is_known, sizes, 0.0)
        slopes = -np.einsum("jcl,djcl->jdl", pressing, self.changes) / np.maximum(sizes, SMALLEST)[:, None]
        full_friction = self.coefficients[self.joints][:, None] * directions
        unit = np.eye(len(directions))[..., None]
        matrix = unit - full_friction[:, None] * slopes[self.joints]
        regular = is_known & np.isfinite(contributions).all(axis=0) & np.isfinite(matrix).all(axis=(0, 1))
        matrix, right = np.where(regular, matrix, unit), np.where(regular, contributions, 0.0)
        return np.linalg.solve(matrix.transpose(2, 1, 0), right.T[..., None])[..., 0].T, sizes, regular

    def _is_concave(self, gain: np.ndarray, sizes: np.ndarray, regular: np.ndarray) -> np.ndarray:
        """Return whether the Lagrangian with squared cones is concave, so that a stationary point is the maximum."""
        cone_size = self.coefficients[:, None] * np.maximum(sizes, SMALLEST)
        weights = np.where(regular, np.sqrt(self._blocks(gain**2)) / (2 * cone_size), 0.0)
        curved = np.einsum("jl,j,djcl,ejcl->lde", weights, self.coefficients**2, self.changes, self.changes)
        curvature = np.eye(len(self.joints)) * weights[self.joints].T[:, None] - curved
        fit = np.isfinite(curvature).all(axis=(1, 2))
        eigenvalue = np.linalg.eigvalsh(np.where(fit[:, None, None], curvature, 0.0)).min(axis=1, initial=0.0)
        return fit & (eigenvalue >= -CONCAVE * weights.max(axis=0, initial=0.0))

    def _searched(self, lane: int, contributions: np.ndarray, chosen: np.ndarray) -> tuple[float, bool]:
        """Return the largest contribution at an instant by comparing all signs, or by a search from many directions."""
        if not np.isfinite(contributions).all():
            return np.nan, True
        count = len(self.joints)
        is_complete = self.signs_only and count <= ALL_SIGNS
        if is_complete:
            trials = np.array(list(itertools.product((1.0, -1.0), repeat=count))).T
        else:
            random = np.random.default_rng(0).normal(size=(count, STARTS))
            trials = np.concatenate([chosen[:, None], self._directions_of(random, random)], axis=1)
        lanes = np.full(trials.shape[1], lane)
        repeated = ExtremeFriction(self.pressing[..., lanes], self.changes[..., lanes], self.joints, self.coefficients)
        wide = np.repeat(contributions[:, None], len(lanes), axis=1)
        if not is_complete:
            trials, _, _ = repeated._improved(trials, wide)
        value = np.sum(wide * repeated._held(trials)[2], axis=0)
        locked = np.isnan(value)
        if locked.any():
            value[locked] = repeated._at_lock(trials, wide)[locked]
        if (value == np.inf).any():
            return np.inf, True
        return (np.nan, False) if np.isnan(value).any() else (float(value.max()), is_complete)

    def _at_lock(self, directions: np.ndarray, contributions: np.ndarray) -> np.ndarray:
        """Return the limit of the contribution as friction grows until it locks: infinite with its sign, or NaN."""
        fraction, locked = np.zeros(contributions.shape[1]), np.ones(contributions.shape[1])
        value = np.zeros(contributions.shape[1])
        for _ in range(HALVINGS):
            middle = (fraction + locked) / 2
            trial = np.sum(contributions * self._held(directions * middle)[2], axis=0)
            fit = np.isfinite(trial)
            fraction, locked, value = (
                np.where(fit, middle, fraction),
                np.where(fit, locked, middle),
                np.where(fit, trial, value),
            )
        loads = np.abs(self.pressing).max(axis=(0, 1))
        size = np.abs(contributions).max(axis=0) * loads
        return np.where(np.abs(value) > LARGE * size, np.copysign(np.inf, value), np.nan)
