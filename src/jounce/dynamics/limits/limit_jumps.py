"""Jumps of derivatives of a trajectory, and the robot quantities that they make infinite."""

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.dynamics.limits.trajectories import FollowedTrajectory
from jounce.trajectory.law_checks.observed import observed_jumps
from jounce.trajectory.law_checks.seen_jumps import level_sizes
from jounce.trajectory.law_checks.smoothness import LeaderValues, known_jumps
from jounce.trajectory.laws.stacking import law_derivatives

SMALL = 1e-9  # fraction of the largest value of a derivative: a smaller jump is rounding
NONE = 1e-12  # fraction of the largest torque at the jump: a smaller change is rounding
SAME = 1e-9  # fraction of the duration: instants nearer to each other, or to an end, are one
EFFORT, EFFORT_RATE = 4, 5  # indices of quantities


@dataclasses.dataclass(frozen=True, eq=False)
class Jumps:
    """Jumps of the coordinates of a robot, or of their derivatives.

    Parameters
    ----------
    times : ndarray of shape (jump,)
        s, increasing.
    before, after : ndarray of shape (jump, derivative, joint)
        Coordinates and derivatives of all joints on both sides of each jump; equal where they do not jump.
    """

    times: Float[np.ndarray, " jump"]
    before: Float[np.ndarray, "jump derivative joint"]
    after: Float[np.ndarray, "jump derivative joint"]

    def above(self, level: int) -> Float[np.ndarray, "jump joint"]:
        """Return the sign of the lowest jump below a derivative, which makes it infinite; 0 if there is none."""
        signs = np.sign(self.after - self.before)[:, :level]
        level_index = np.argmax(signs != 0, axis=1)
        return np.take_along_axis(signs, level_index[:, None], axis=1)[:, 0]


@dataclasses.dataclass(frozen=True, eq=False)
class Infinite:
    """The infinite quantities of joints at jumps.

    Parameters
    ----------
    times : ndarray of shape (jump,)
        s.
    signs : ndarray of shape (jump, 6, joint)
        For position to torque rate: 0 if the quantity is finite, otherwise its sign.
    before : ndarray of shape (jump, 6, joint)
        Velocities before the jumps, and signs of accelerations, which show whether a joint slows down.
    """

    times: Float[np.ndarray, " jump"]
    signs: Float[np.ndarray, "jump 6 joint"]
    before: Float[np.ndarray, "jump 6 joint"]


def jumps_of(
    followed: FollowedTrajectory,
    grid: Float[np.ndarray, " time"],
    values: Float[np.ndarray, "time derivative joint"],
) -> Jumps:
    """Return the jumps strictly between the first and the last instant of a grid.

    Parameters
    ----------
    followed : FollowedTrajectory
        The robot on its trajectory.
    grid : array of shape (time,)
        Increasing instants, s.
    values : array of shape (time, derivative, joint)
        Coordinates on the grid; the jumps of all derivatives but the highest are found.
    """
    trajectory, order, joints = followed.trajectory, values.shape[1] - 1, values.shape[2]
    first, last = float(grid[0]), float(grid[-1])
    duration = last - first
    if not duration > 0:
        nothing = np.zeros((0, order + 1, joints))
        return Jumps(np.zeros(0), nothing, nothing)
    instants, sizes = [np.zeros(0)], [np.zeros((0, order, joints))]
    unknown_columns, bending = [], []
    leaders = LeaderValues()
    for column, law in zip(followed.columns, trajectory.laws.values(), strict=True):
        law_instants, jumps, is_complete = known_jumps(law, first, last, order - 1, leaders)
        spread = np.zeros((len(law_instants), order, joints))
        spread[:, :, column] = jumps.T
        instants.append(law_instants)
        sizes.append(spread)
        if not is_complete:
            unknown_columns.append(column)
            bending.append(law)

    def evaluate(times: np.ndarray) -> np.ndarray:
        """Return coordinates as `followed` does, without a check that they are finite."""
        derivatives = law_derivatives(list(trajectory.laws.values()), times, order)
        q = np.repeat(values[:1], len(times), axis=0)
        q[:, :, followed.columns] = np.moveaxis(derivatives, -1, 0)
        return q

    if unknown_columns:
        observed = observed_jumps(bending, first, last, order - 1)
        spread = np.zeros((len(observed.instants), order, joints))
        spread[:, :, unknown_columns] = np.where(np.isinf(observed.sizes), np.finfo(float).max, observed.sizes)
        instants.append(observed.instants)
        sizes.append(spread)
    edges, heights = _joined(np.concatenate(instants), np.concatenate(sizes), SAME * duration)
    heights = np.where(np.abs(heights) > SMALL * level_sizes(values, duration)[:-1], heights, 0.0)
    is_inside = (edges > first + SAME * duration) & (edges < last - SAME * duration) & heights.any(axis=(1, 2))
    edges, heights = edges[is_inside], heights[is_inside]
    after = evaluate(edges + SAME * duration / 2) if len(edges) else np.zeros((0, order + 1, joints))
    after = np.where(np.isfinite(after), after, 0.0)  # not finite next to a kink, as of asin(sin(t))
    before = after.copy()
    before[:, :-1] -= heights
    return Jumps(edges, before, after)


def _joined(
    instants: np.ndarray, sizes: np.ndarray, gap: float
) -> tuple[Float[np.ndarray, " jump"], Float[np.ndarray, "jump level joint"]]:
    """Return jumps in order of time, with those at the same instant merged."""
    if not len(instants):
        return instants, sizes
    sequence = np.argsort(instants, kind="stable")
    instants, sizes = instants[sequence], sizes[sequence]
    begins = np.flatnonzero(np.append(True, np.diff(instants) > gap))
    maxima, minima = np.maximum.reduceat(sizes, begins), np.minimum.reduceat(sizes, begins)
    return instants[begins], np.where(maxima >= -minima, maxima, minima)


def infinite_quantities(followed: FollowedTrajectory, jumps: Jumps, drives: bool) -> Infinite:
    """Return which quantities are infinite at jumps.

    All derivatives above one that jumps are infinite. A torque is infinite if a position or velocity that moves a mass
    jumps, since the momentum jumps. A torque rate is infinite if the torque jumps or is infinite.

    Parameters
    ----------
    followed : FollowedTrajectory
        The robot on its trajectory.
    jumps : Jumps
        Jumps of coordinates, velocities and accelerations.
    drives : bool
        Whether torques include armature inertia, damping and friction of the drives.
    """
    count, joints = len(jumps.times), jumps.after.shape[2]
    signs, before = np.zeros((count, 6, joints)), np.zeros((count, 6, joints))
    if not count:
        return Infinite(jumps.times, signs, before)
    for level in (1, 2, 3):
        signs[:, level] = jumps.above(level)
    before[:, 1], before[:, 2] = jumps.before[:, 1], signs[:, 2]
    steady = jumps.after.copy()
    steady[:, 2:] = 0.0
    states = np.stack([jumps.after, jumps.before, steady, _pushed(steady, jumps, 0), _pushed(steady, jumps, 1)])
    times = np.tile(jumps.times, len(states))
    efforts = followed.torques(states.reshape(-1, *states.shape[2:]), times, drives)[:, 0]
    efforts = efforts.reshape(len(states), count, joints)
    threshold = NONE * np.abs(efforts).max(axis=(0, 2))[:, None]
    after, effort_before, rest_effort, *pushed = efforts
    changes = np.stack([*(pushed_effort - rest_effort for pushed_effort in pushed), after - effort_before])
    changed = np.where(np.abs(changes) > threshold, np.sign(changes), 0.0)
    for quantity, effort_signs in ((EFFORT, changed[:2]), (EFFORT_RATE, changed)):
        level_index = np.argmax(effort_signs != 0, axis=0)
        signs[:, quantity] = np.take_along_axis(effort_signs, level_index[None], axis=0)[0]
    return Infinite(jumps.times, signs, before)


def _pushed(steady: np.ndarray, jumps: Jumps, level: int) -> Float[np.ndarray, "jump derivative joint"]:
    """Return a steady motion with an acceleration along the jump of a derivative, scaled to a largest entry of 1."""
    jump = jumps.after[:, level] - jumps.before[:, level]
    size = np.abs(jump).max(axis=1, keepdims=True)
    pushed = steady.copy()
    pushed[:, 2] = np.divide(jump, size, out=np.zeros_like(jump), where=size > 0)
    return pushed
