"""Motion of a robot from the pose in which it is drawn to the start of its drives, within one assembly."""

from collections.abc import Iterator
from itertools import islice, permutations

import numpy as np
from jaxtyping import Bool, Float

from jounce.errors import RobotError
from jounce.robot.closed_loops.closures import RANK_TOLERANCE, Loops

DRAWN = 0.05  # rad, or sizes of the robot: a pose is drawn closed if closing its loops moves no coordinate by more
STRIDE = 0.1  # rad, or sizes of the robot: largest step of the driven joints
STRAY = 0.3  # fraction of a step: a larger distance from the predicted position may lead to another assembly
PASSED = 0.02  # the same where a singular position may have been passed, as between two assemblies that lie close
SHORTEST = 1e-4  # fraction of the largest step
ORDERS = 6  # detours of one joint after another
RANDOM = 12  # detours through a random position

_Position = Float[np.ndarray, " joint"]
_Chosen = Bool[np.ndarray, " joint"]


def drawn_position(loops: Loops, q: _Position, free: _Chosen) -> _Position | None:
    """Return the closed position beside q, with the driven joints where they are; None if the loops are open at q."""
    try:
        position = loops.closed(q, free)
    except RobotError:
        return None
    return None if np.abs((position - q) / loops.scale).max(initial=0.0) > DRAWN else position


def position_at(loops: Loops, position: _Position, target: _Position, free: _Chosen) -> _Position | None:
    """Return the closed position that the free joints reach from another as the driven ones move to their target.

    They move straight or, if the loops cannot be kept closed on that way, on a detour: one joint after another, through
    random positions, and by a whole turn less. The result is None if none of these leads to the target.
    """
    for end in _ends(loops, position, target, free):
        for path in _ways(loops, position, end, free):
            reached: np.ndarray | None = position
            for stop in path:
                reached = None if reached is None else _followed(loops, reached, stop, free)
            if reached is not None and loops.opening(arrived := np.where(free, reached, target)) <= RANK_TOLERANCE:
                return arrived
    return None


def _ends(loops: Loops, position: _Position, target: _Position, free: _Chosen) -> Iterator[_Position]:
    """Yield the target, and those at which one joint that turns is a whole turn before it."""
    yield target
    turning = np.array([loops.tree.joints[name].turning for name in loops.tree.joint_names], bool)
    for k in np.flatnonzero(turning & ~free & (target != position)):
        earlier_end = target.copy()
        earlier_end[k] -= 2 * np.pi * np.sign(target[k] - position[k])
        yield earlier_end


def _ways(loops: Loops, position: _Position, target: _Position, free: _Chosen) -> Iterator[list[_Position]]:
    """Yield ways of the driven joints from a position to a target, each as the positions that it leads through."""
    yield [target]
    moving = np.flatnonzero(~free & (target != position))
    for order in islice(permutations(moving.tolist()), ORDERS if len(moving) > 1 else 0):
        stops = [position.copy()]
        for k in order:
            stops.append(stops[-1].copy())
            stops[-1][k] = target[k]
        yield stops[1:]
    random = np.random.default_rng(1)  # arbitrary but reproducible
    reach = np.abs(target - position) / 2 + loops.scale
    for _ in range(RANDOM if len(moving) > 1 else 0):
        stop = position.copy()
        stop[moving] = ((position + target) / 2 + reach * random.uniform(-1.0, 1.0, len(position)))[moving]
        yield [stop, target]


def _followed(loops: Loops, position: _Position, target: _Position, free: _Chosen) -> _Position | None:
    """Return the position that the free joints reach as the others move straight to a target.

    Small steps along the velocities keep the loops in one assembly. The result is None if they cannot be kept closed.
    """
    lead = np.where(free, 0.0, (target - position) / loops.scale)
    length = float(np.abs(lead).max(initial=0.0))
    slopes = _slopes(loops, position)
    fraction, max_step = 0.0, min(STRIDE / max(length, 1e-300), 1.0)
    step = max_step
    while fraction < 1.0:
        increment = min(step, 1.0 - fraction)
        change = increment * lead
        change[free] = np.linalg.lstsq(slopes[:, free], -slopes @ change, rcond=RANK_TOLERANCE)[0]
        predicted = position + loops.scale * change
        try:
            corrected = loops.closed(predicted, free)
            deviation = np.abs((corrected - predicted) / loops.scale).max() / max(np.abs(change).max(), STRIDE / 10)
            next_slopes = _slopes(loops, corrected)
        except RobotError:
            corrected, deviation, next_slopes = position, np.inf, slopes
        if deviation > (PASSED if _is_reversed(slopes[:, free], next_slopes[:, free]) else STRAY):
            step = increment / 2
            if step < SHORTEST * max_step:
                return None
            continue
        position, slopes, fraction, step = corrected, next_slopes, fraction + increment, min(2 * increment, max_step)
    return np.where(free, position, target)


def _slopes(loops: Loops, q: _Position) -> Float[np.ndarray, "row joint"]:
    """Return the velocities of the gaps that closures close, by the scaled coordinates."""
    return np.concatenate([w @ s for w, s in zip(loops.wrenches, loops.gaps(q)[1], strict=True)])


def _is_reversed(before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether the determinant of the closure equations in the free joints may have changed its sign."""
    sizes = np.linalg.svd(before, compute_uv=False)
    if not before.shape[1] or len(before) < before.shape[1] or sizes[before.shape[1] - 1] <= RANK_TOLERANCE * sizes[0]:
        return False
    return bool(np.linalg.det(before.T @ after) <= 0)
