"""Detection of angles that are likely in degrees, by the values of a law over a run, whatever its form.

No rule can know what was meant. Values are doubtful if they are many turns, or a whole or half number of rad above one
turn, and go back and forth, or from rest to rest, as positions in degrees do. The angle of a shaft that keeps turning
may take any value, and so may angles in rad that are round in degrees, because they had their unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeGuard

import numpy as np
from jaxtyping import Float

from jounce.errors import JounceError
from jounce.jet import Jet
from jounce.trajectory.laws.composed import FollowingMotion
from jounce.trajectory.laws.piecewise import PiecewiseMotion
from jounce.trajectory.laws.profiles import AbstractProfile
from jounce.trajectory.laws.segments import SegmentedMotion
from jounce.trajectory.motion import AbstractMotion, ExpressionMotion, FunctionMotion, SplineMotion

INSTANTS = 201
TURN = 2 * math.pi
MANY_TURNS = 2 * TURN  # a larger value without a unit is rarely in rad
AT_REST = 0.05  # fraction of the fastest step: largest first or last step of a motion from rest to rest
DWELL = 0.03  # fraction of the run: least duration of rest of a position
ROUND = 1e-7  # relative tolerance of round values
ENDLESS = 1e300  # larger values are no angles, and sums overflow
NEAR = 1e-3  # tolerance of the largest value of a law as a whole or half number
OUTSIDE = 2.0  # largest plausible ratio to the limits of a joint
SLACK = 0.05  # fraction of a range of degrees, by which limits may be violated

Values = Float[np.ndarray, " instants"]
_OPERATIONS: dict[str, Any] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "**": np.power,
    "neg": np.negative,
    "pos": np.positive,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": np.arctan2,
}


def looks_like_degrees(value: float) -> bool:
    """Return whether a number in rad is likely in degrees: many turns, or a round number above one turn.

    Examples
    --------
    >>> [looks_like_degrees(x) for x in (6.0, 10.0, 12.0, 90.0, math.radians(1080))]
    [False, True, False, True, False]
    """
    turns = math.degrees(value / 5)
    if math.isfinite(turns) and abs(turns - round(turns)) <= ROUND * abs(turns):
        return False  # it had its unit, or is a multiple of pi
    return abs(value) > MANY_TURNS or (abs(value) > TURN and value % 5 == 0)


def values_of(law: AbstractMotion, first: float, last: float) -> Values | None:
    """Return sampled values of a law between two instants; None if they are not defined."""
    grid = np.linspace(first, last, INSTANTS)
    try:
        values = _values(law, grid)
    except (JounceError, TypeError, ValueError, ArithmeticError):  # raised when the law is used
        return None
    return values if values.shape == grid.shape and np.abs(values).max() < ENDLESS else None


def _values(law: AbstractMotion, grid: Values) -> Values:
    """Return values of a law, without compilation if it is an expression or consists of polynomials.

    A Python function is called once, with all instants if it accepts them. A profile from rest to rest is replaced by a
    cubic with the same ends.
    """
    if isinstance(law, ExpressionMotion):
        parameters = {name: float(value) for name, value in law.parameters.items()}
        with np.errstate(all="ignore"):
            values = law.expression.folded(float, {**parameters, "t": grid}.__getitem__, _operated)
        return np.broadcast_to(np.asarray(values, float), grid.shape)
    if isinstance(law, FollowingMotion) and law.parts:
        path, leader = law.parts
        is_exact = isinstance(leader, ExpressionMotion | FollowingMotion) or _is_polynomial(leader)
        if not is_exact and _is_polynomial(path):  # it is followed from its beginning to its end, at some pace
            return _spline_values(path, np.linspace(float(path.breakpoints[0]), float(path.stop), len(grid)))
        return _values(path, _values(leader, grid))
    if isinstance(law, PiecewiseMotion) and law.parts and law.beyond == "continue":
        index = np.searchsorted(np.array(law.until, float), grid, side="right")
        path = [grid[index == k] for k in range(len(law.parts))]
        return np.concatenate([_values(piece_law, x) for piece_law, x in zip(law.parts, path, strict=True) if len(x)])
    if isinstance(law, AbstractProfile):
        fraction = np.clip((grid - float(law.start_time)) / float(law.duration), 0.0, 1.0)
        return float(law.start) + (float(law.end) - float(law.start)) * fraction**2 * (3 - 2 * fraction)
    if _is_polynomial(law):
        return _spline_values(law, grid)
    if type(law) is FunctionMotion and (values := _of_all(law.function, grid)) is not None:
        return values
    return np.asarray(law(Jet([grid])).coefficients[0], float)


def _of_all(function: Callable[[Any], Any], grid: Values) -> Values | None:
    """Return the values of a function of one instant at all instants; None if it does not accept arrays."""
    try:
        with np.errstate(all="ignore"):
            values = np.asarray(function(grid), float)
    except Exception:  # noqa: BLE001 - any error of a user's function
        return None
    return values if values.shape == grid.shape else None


def _operated(operation: str, arguments: list[Any]) -> Any:
    """Return the result of an operator or a function of expressions for NumPy arrays."""
    return _OPERATIONS[operation](*arguments) if operation in _OPERATIONS else getattr(np, operation)(*arguments)


def _is_polynomial(law: AbstractMotion) -> TypeGuard[SplineMotion]:
    if not isinstance(law, SplineMotion) or np.ndim(law.stop):
        return False
    piecewise = type(law)._within in (SplineMotion._within, SegmentedMotion._within)
    return piecewise and type(law)._evaluated is SplineMotion._evaluated


def _spline_values(law: SplineMotion, grid: Values) -> Values:
    begins, stop = np.asarray(law.breakpoints, float), float(law.stop)
    first, turns = begins[0], np.zeros_like(grid)
    if law.beyond == "repeat":
        turns = np.floor((grid - first) / (stop - first))
    elif law.beyond != "continue":
        grid = np.clip(grid, first, stop)
    grid = grid - turns * (stop - first)
    index = np.clip(np.searchsorted(begins, grid, side="right") - 1, 0, len(begins) - 1)
    local, values = grid - begins[index], np.zeros_like(grid)
    for power in np.asarray(law.coefficients, float)[::-1]:
        values = values * local + power[index]
    if isinstance(law, SegmentedMotion):
        amplitude, frequency, phase = np.asarray(law.sines, float)[:, index]
        values = values + amplitude * np.sin(local * frequency + phase)
    return values + turns * float(np.asarray(law.advance))


def degrees_meant(values: Values, lower: float | None = None, upper: float | None = None) -> str:
    """Return why the values of an angle are likely in degrees, with their range; an empty text if they are not.

    Parameters
    ----------
    values : array of shape (instants,)
        Values in order of time, rad.
    lower, upper : float, optional
        Limits of the values, rad.

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 201)
    >>> degrees_meant(30 + 60 * np.sin(2 * np.pi * t))
    'goes from -30 to 90 rad, 19 turns: degrees?'
    >>> degrees_meant(2 * np.pi * 100 * t), degrees_meant(0.5 * np.sin(2 * np.pi * t))
    ('', '')
    """
    low, high = float(values.min()), float(values.max())
    peak = max(abs(low), abs(high))
    limit = max((abs(x) for x in (lower, upper) if x is not None), default=0.0)
    if limit and peak <= max(OUTSIDE * limit, TURN):
        return ""
    if lower is not None and upper is not None:
        slack = math.degrees(SLACK * (upper - lower))
        is_within = math.degrees(lower) - slack <= low and high <= math.degrees(upper) + slack
    else:
        is_within = False
    if not is_within and not (
        (looks_like_degrees(low if -low > high else high) or _is_round(values)) and _is_position(values)
    ):
        return ""
    turns = max(high - low, peak) / TURN
    phrase = f"goes from {_round(low)} to {_round(high)} rad" if high > low else f"is {_round(low)} rad"
    return f"{phrase}, {turns:.2g} turns: degrees?"


def _round(value: float) -> str:
    return f"{value + 0.0:.4g}"


def _is_round(values: Values) -> bool:
    """Return whether the peak of values is a whole or half number of rad between one and two turns."""
    sizes = np.abs(values)
    top = int(np.argmax(sizes))
    left, peak, right = sizes[max(top - 1, 0)], sizes[top], sizes[min(top + 1, len(sizes) - 1)]
    if 0 < top < len(sizes) - 1 and (bend := 2 * peak - left - right) > 0:
        peak += (right - left) ** 2 / (8 * bend)
    return bool(TURN < peak <= MANY_TURNS and abs(2 * peak - round(2 * peak)) <= NEAR)


def _is_position(values: Values) -> bool:
    """Return whether values are those of a positioned angle: back and forth, or from rest to rest.

    Neighboring extremes of opposite signs are values beside a pole.
    """
    if (
        abs(int(np.argmax(values)) - int(np.argmin(values))) == 1
        and values.max() > 0 > values.min()
        and len(values) > 2
    ):
        return False
    fallen = float((np.maximum.accumulate(values) - values).max())
    risen = float((values - np.minimum.accumulate(values)).max())
    if min(fallen, risen) > TURN:
        return True
    steps = np.abs(np.diff(values))
    fastest = float(steps.max())
    if not fastest or max(fallen, risen) <= TURN:
        return False
    ends = bool(steps[0] <= AT_REST * fastest), bool(steps[-1] <= AT_REST * fastest)
    is_resting = steps <= ROUND * fastest
    return all(ends) or float(is_resting.mean()) >= DWELL


def trajectory_doubt(laws: dict[str, Any], first: float, last: float, limits: dict[str, Any]) -> str:
    """Return which joints of a trajectory are likely in degrees; an empty text if none is.

    Parameters
    ----------
    laws : dict of str to AbstractMotion
        Laws of the joints that turn.
    first, last : float
        Interval of time, s.
    limits : dict of str to Limits
        Limits of these joints.
    """
    doubts = {}
    for name, law in laws.items():
        values = values_of(law, first, last)
        if values is not None and (text := degrees_meant(values, limits[name].lower, limits[name].upper)):
            doubts[name] = text
    if not doubts:
        return ""
    name, text = next(iter(doubts.items()))
    similar = f" (and {count - 1} joint{'s' if count > 2 else ''} like it)" if (count := len(doubts)) > 1 else ""
    return f"{name} {text}{similar} A number without a unit is in SI; head the column '{name} [deg]', or convert to rad"
