"""Transitions from a running motion onto a path: polynomials that start in its state and join the path smoothly."""

import dataclasses
from collections.abc import Sequence
from math import factorial, perm

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, real_numbers
from jounce.errors import TrajectoryError
from jounce.planning.paths.path import Path
from jounce.planning.pieces import JoinedPieces
from jounce.robot.model.links_and_joints import Limits
from jounce.trajectory import AbstractMotion, ExpressionMotion, FollowingMotion, PiecewiseMotion, SplineMotion
from jounce.trajectory.labels import in_order

FIELDS = ("velocity", "acceleration", "jerk")
MET = 4  # levels that agree with the path at the junction: positions to jerk
SHARES = (0.05, 0.1, 0.2, 0.4, 0.8)  # shares of the path before the candidate junctions
ROUNDING = 1e-6  # fraction of a limit or of a rate: rounding of a state
ALONG = 1e-5  # fraction of a state: largest deviation of a state on a path
STILL = 1e-9  # fraction of a limit: lower speeds are zero
LOOKS = 401
NEAR = 1e-12  # fraction of a path: places nearer to each other are the same
STEADY = "at + rate*(t - begin)"

State = Float[np.ndarray, "_ joint"]  # position, velocity, ...


def clean_state(raw_state: ArrayLike, names: Sequence[str], limits: dict[str, Limits]) -> State:
    """Return the state of a running robot with values below a billionth of a limit set to zero, and cut to the limits.

    Parameters
    ----------
    raw_state : array_like of shape (derivatives, joints)
        Positions and velocities, and if known accelerations and jerks, rad or m and s.
    names : sequence of str
        Names of the joints.
    limits : dict of str to Limits
        Limits of the joints.

    Raises
    ------
    TrajectoryError
        If the state is not valid, or has accelerations at rest.
    """
    message = f"must hold positions, velocities and perhaps accelerations and jerks of {len(names)} joints"
    state = real_numbers("state", in_order("state", raw_state, names, TrajectoryError), TrajectoryError, message).copy()
    if state.ndim != 2 or not 2 <= len(state) <= MET or state.shape[1] != len(names):
        raise TrajectoryError(message, name="state", value=f"shape {state.shape}")
    if not np.isfinite(state).all():
        raise TrajectoryError("must be finite", name="state", value=state.tolist())
    for level, field in enumerate(FIELDS[: len(state) - 1], start=1):
        for joint, name in enumerate(names):
            limit, value = getattr(limits[name], field), abs(float(state[level, joint]))
            if limit is None:
                continue
            if value < STILL * limit:
                state[level, joint] = 0.0
            elif value > limit * (1 - 2 * ROUNDING):  # the search needs a small margin
                state[level, joint] *= (1 - 2 * ROUNDING) * limit / value
    if not state[1].any() and state[2:].any():
        message = "has accelerations or jerks at rest, as where a motion begins or turns; take a neighboring instant"
        raise TrajectoryError(message, name="state", value=state[2:].tolist())
    return state


def rates_along(path: Path, state: State) -> tuple[float, ...] | None:
    """Return the derivatives of s of a state that moves along a path from its start; None if it does not."""
    p = path.derivatives(np.array([path.start]), MET - 1)[0]
    size = np.abs(p[0]).max() + np.abs(path.derivatives(np.array([path.stop]), 0)[0, 0] - p[0]).max()
    if np.abs(state[0] - p[0]).max() > ROUNDING**1.5 * size:
        return None
    rates: list[float] = []
    for level in range(1, len(state)):
        excess = state[level] - _following(p, rates, level)
        rate = float(excess @ p[1] / (p[1] @ p[1]))
        if np.abs(excess - rate * p[1]).max() > ALONG * max(float(np.abs(state[level]).max()), np.abs(excess).max()):
            return None
        rates.append(rate)
    return tuple(rates) if rates[0] > 0 else None


def _following(p: np.ndarray, rates: Sequence[float], level: int) -> Float[np.ndarray, " joint"]:
    """Return the contribution of the curvature of the path to a derivative, without that derivative of s."""
    if level == 2:
        return p[2] * rates[0] ** 2
    if level == 3:
        return p[3] * rates[0] ** 3 + 3 * p[2] * rates[0] * rates[1]
    return 0 * p[1]


def joined_from_rest(path: Path, start: Float[np.ndarray, " joint"], parameter: float) -> Path:
    """Return a path that starts straight toward a place on another path, and continues along that path.

    Parameters
    ----------
    path : Path
        The path to join.
    start : array of shape (joint,)
        Start positions.
    parameter : float
        Parameter of the path at the junction.
    """
    p = path.derivatives(np.array([parameter]), MET - 1)[0]
    direction = p[0] - start
    length = max(float(np.linalg.norm(direction)), np.finfo(float).tiny)
    rate = length / float(np.linalg.norm(p[1]))
    powers = _between(np.stack([start, direction]), p * rate ** np.arange(MET)[:, None])
    return extended_path(path, parameter, rate, [JoinedPieces(np.zeros(1), x[:, None], 1.0) for x in powers.T], 1.0)


def extended_path(path: Path, s0: float, rate: float, laws: Sequence[SplineMotion], until: float) -> Path:
    """Return a path that follows laws over s from 0 up to a junction, and then another path at a steady rate.

    Parameters
    ----------
    path : Path
        The path to join.
    s0, rate : float
        Parameter of the path at the junction, and its derivative by s.
    laws : sequence of SplineMotion
        Laws of the joints before the junction.
    until : float
        Value of s at the junction.
    """
    stop = until + (path.stop - s0) / rate
    pairs = zip(laws, path.laws.items(), strict=True)
    longer = Path({name: _joined_law(curve, law, s0, rate, until, stop) for curve, (name, law) in pairs}, 0.0, stop)
    curve = longer.derivatives(np.linspace(0.0, until, LOOKS), 0)[:, 0]
    path_points = path.derivatives(np.linspace(path.start, path.stop, LOOKS), 0)[:, 0]
    gap = float(np.sqrt(((curve[:, None] - path_points) ** 2).sum(axis=2)).min(axis=1).max())
    words = f"from the running state onto the path, joined at s = {s0:.6g}, at most {gap:.2g} rad or m away from it"
    return dataclasses.replace(longer, deviation=path.deviation, allowed=path.allowed, words=words, joined=until)


def _joined_law(
    curve: SplineMotion, law: AbstractMotion, s0: float, rate: float, until: float, stop: float
) -> AbstractMotion:
    """Return a law that equals one law up to a value of s, and then another one at a steady rate.

    Two splines give one spline, with all its numbers in arrays, so that its compiled programs serve the next one too.
    """
    end = s0 + rate * (stop - until)
    slack = NEAR * (end - s0)
    if not isinstance(law, SplineMotion) or s0 < law.breakpoints[0] - slack or end > law.stop + slack:
        leader = ExpressionMotion(STEADY, {"at": s0, "rate": rate, "begin": until})
        return PiecewiseMotion([curve, FollowingMotion(law, leader)], [until, stop])
    begins, powers = np.asarray(law.breakpoints), np.asarray(law.coefficients)
    remaining = np.flatnonzero((begins > s0 + slack) & (begins < end - slack))
    first = remaining[0] - 1 if len(remaining) else int(np.clip(np.searchsorted(begins, s0, side="right") - 1, 0, None))
    first = max(first, 0)
    derived = [np.polynomial.polynomial.polyder(powers[:, first], k) for k in range(len(powers))]
    shifted = [np.polynomial.polynomial.polyval(s0 - begins[first], x) / factorial(k) for k, x in enumerate(derived)]
    later_powers = np.column_stack([shifted, powers[:, remaining]]) * rate ** np.arange(len(powers))[:, None]
    earlier_powers = np.asarray(curve.coefficients)
    count = max(len(earlier_powers), len(later_powers))
    padded = [np.pad(x, ((0, count - len(x)), (0, 0))) for x in (earlier_powers, later_powers)]
    breakpoints = np.concatenate([np.asarray(curve.breakpoints), [until], until + (begins[remaining] - s0) / rate])
    return JoinedPieces(breakpoints, np.concatenate(padded, axis=1), np.float64(stop))


def _between(begins: State, ends: State) -> Float[np.ndarray, "power joint"]:
    """Return the coefficients, lowest power first, of the polynomial with given derivatives at 0 and at 1."""
    count = len(begins) + len(ends)
    conditions = [(0.0, level) for level in range(len(begins))] + [(1.0, level) for level in range(len(ends))]
    rows = [[perm(k, level) * end ** max(k - level, 0) for k in range(count)] for end, level in conditions]
    return np.linalg.solve(np.array(rows), np.concatenate([begins, ends]))
