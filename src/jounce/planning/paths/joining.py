"""From a running motion onto a path: a polynomial that begins with its state and ends on the path, smoothly."""

import dataclasses
from collections.abc import Sequence
from math import perm

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, real_numbers
from jounce.errors import TrajectoryError
from jounce.planning.paths.path import Path
from jounce.planning.pieces import JoinedPieces
from jounce.robot.model.links_and_joints import Limits
from jounce.trajectory import ExpressionMotion, FollowingMotion, PiecewiseMotion

FIELDS = ("velocity", "acceleration", "jerk")
MET = 4  # positions to jerk of the path, where it is joined
SHARES = (0.05, 0.1, 0.2, 0.4, 0.8)  # of the path before the point where it may be joined
ROUNDING = 1e-6  # of a limit, or of a rate: rounding of a state
ALONG = 1e-5  # of a state: a smaller deviation from a path is on it
STILL = 1e-9  # of a limit: a smaller speed stands still
LOOKS = 401
STEADY = "at + rate*(t - begin)"

State = Float[np.ndarray, "_ joint"]  # position, velocity, ...


def clean_state(given: ArrayLike, names: Sequence[str], limits: dict[str, Limits]) -> State:
    """Return the state of a running robot without rounding errors: below a billionth of a limit, or just above one.

    Parameters
    ----------
    given : array_like of shape (derivatives, joints)
        Positions and velocities, and if known accelerations and jerks, rad or m and s.
    names : sequence of str
        Of the joints.
    limits : dict of str to Limits
        Of the joints.

    Raises
    ------
    TrajectoryError
        If it is no such state, exceeds a limit by more than a millionth, or has accelerations at rest.
    """
    message = f"must hold positions, velocities and perhaps accelerations and jerks of {len(names)} joints"
    state = real_numbers("state", given, TrajectoryError, message).copy()
    if state.ndim != 2 or not 2 <= len(state) <= MET or state.shape[1] != len(names):
        raise TrajectoryError(message, name="state", value=f"shape {state.shape}")
    if not np.isfinite(state).all():
        raise TrajectoryError("must be finite", name="state", value=state.tolist())
    for level, field in enumerate(FIELDS[: len(state) - 1], start=1):
        for joint, name in enumerate(names):
            limit, value = getattr(limits[name], field), abs(float(state[level, joint]))
            if limit is None:
                continue
            if value > limit * (1 + ROUNDING):
                message = f"the {field} of {name} is above its limit of {limit:g} where the motion is to begin"
                raise TrajectoryError(message, name="state", value=float(state[level, joint]))
            if value < STILL * limit:
                state[level, joint] = 0.0
            elif value > limit * (1 - 2 * ROUNDING):  # a search needs a little to spare
                state[level, joint] *= (1 - 2 * ROUNDING) * limit / value
    if not state[1].any() and state[2:].any():
        message = "has accelerations or jerks at rest, as where a motion begins or turns; take a neighboring instant"
        raise TrajectoryError(message, name="state", value=state[2:].tolist())
    return state


def rates_along(path: Path, state: State) -> tuple[float, ...] | None:
    """Return the derivatives of s with which a state runs along a path from its start; None if it is not on it."""
    p = path.derivatives(np.array([path.start]), MET - 1)[0]
    size = np.abs(p[0]).max() + np.abs(path.derivatives(np.array([path.stop]), 0)[0, 0] - p[0]).max()
    if np.abs(state[0] - p[0]).max() > ROUNDING**1.5 * size:
        return None
    rates: list[float] = []
    for level in range(1, len(state)):
        rest = state[level] - _following(p, rates, level)
        rate = float(rest @ p[1] / (p[1] @ p[1]))
        if np.abs(rest - rate * p[1]).max() > ALONG * max(float(np.abs(state[level]).max()), np.abs(rest).max()):
            return None
        rates.append(rate)
    return tuple(rates) if rates[0] > 0 else None


def _following(p: np.ndarray, rates: Sequence[float], level: int) -> Float[np.ndarray, " joint"]:
    """Return the contribution of curvature to the derivative of a level, without that of s itself."""
    if level == 2:
        return p[2] * rates[0] ** 2
    if level == 3:
        return p[3] * rates[0] ** 3 + 3 * p[2] * rates[0] * rates[1]
    return 0 * p[1]


def joined(path: Path, state: State, share: float) -> Path:
    """Return the path that begins with a state at a rate of 1, and goes on as another one from a share of that.

    Parameters
    ----------
    path : Path
        The path to join.
    state : array of shape (derivative, joint)
        Positions, velocities, ...; at rest the path begins straight toward the point at which it joins the other.
    share : float
        Part of the parameter of the path that is left out.
    """
    at = path.start + share * (path.stop - path.start)
    p = path.derivatives(np.array([at]), MET - 1)[0]
    way = p[0] - state[0]
    speed = float(np.linalg.norm(state[1]))
    begins = state if speed else np.stack([state[0], way])
    speed = speed or float(np.linalg.norm(way))
    rate = speed / float(np.linalg.norm(p[1]))
    duration = max(float(np.linalg.norm(way)), np.finfo(float).tiny) / speed
    ends = p * rate ** np.arange(MET)[:, None]
    powers = _between(begins, ends, duration)
    stop = duration + (path.stop - at) / rate
    leader = ExpressionMotion(STEADY, {"at": at, "rate": rate, "begin": duration})
    laws = {
        name: PiecewiseMotion(
            [JoinedPieces(np.zeros(1), powers[:, [k]], duration), FollowingMotion(law, leader)], [duration, stop]
        )
        for k, (name, law) in enumerate(path.laws.items())
    }
    whole = Path(dict(laws), 0.0, stop)
    own = whole.derivatives(np.linspace(0.0, duration, LOOKS), 0)[:, 0]
    there = path.derivatives(np.linspace(path.start, path.stop, LOOKS), 0)[:, 0]
    away = float(np.sqrt(((own[:, None] - there) ** 2).sum(axis=2)).min(axis=1).max())
    words = f"from the running state onto the path, joined at s = {at:.6g}, at most {away:.2g} rad or m away from it"
    return dataclasses.replace(whole, deviation=path.deviation, allowed=path.allowed, words=words)


def _between(begins: State, ends: State, duration: float) -> Float[np.ndarray, "power joint"]:
    """Return the coefficients, lowest power first, of a polynomial with some derivatives at its two ends."""
    count = len(begins) + len(ends)
    conditions = [(0.0, level) for level in range(len(begins))] + [(1.0, level) for level in range(len(ends))]
    rows = [[perm(k, level) * at ** max(k - level, 0) for k in range(count)] for at, level in conditions]
    scale = duration ** np.arange(count)
    right = np.concatenate([begins * scale[: len(begins), None], ends * scale[: len(ends), None]])
    return np.linalg.solve(np.array(rows), right) / scale[:, None]
