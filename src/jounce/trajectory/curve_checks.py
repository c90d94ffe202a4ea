"""Checks of the smoothness of curves: corners, gaps, jumps of curvature and cusps are reported with locations."""

import re
from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.errors import MechanismError
from jounce.jet import Jet

Parameters = Float[np.ndarray, " place"]
Values = Float[np.ndarray, "level component place"]

LANES = 1024  # parameters evaluated together, always the same number, so that nothing is compiled for others
SAMPLES = 801  # samples of a curve
HALVINGS = 45  # of an interval, after which only a jump remains in it
LEVELS = 4  # derivatives by the parameter that must be continuous
JUMP = 1e-6  # fraction of the largest value; smaller changes are rounding
CUSP = 1e-6  # fraction of the median of the tangents, below which a tangent vanishes
SLOW = 0.3  # fraction of this median, below which a minimum is refined
NARROWINGS = 70  # of an interval around a minimum of the tangent
SHARPEST = 50.0  # deg between chords at a corner
SHARP = 10.0  # deg between chords at a corner with smaller turns beside it
SINGLE = 6.0  # least ratio of the turn at such a corner to those beside it
WIDEST = 8.0  # largest ratio of a chord to the median of the chords
SMOOTH = {"sin", "cos", "tan", "exp", "sinh", "cosh", "tanh", "atan", "asinh", "erf", "expm1"}
_POWER = re.compile(r"\*\*\s*[0-9]+(?![0-9.eE])")  # an integer exponent
_FUNCTION = re.compile(r"([A-Za-z_]\w*)\s*\(")


def refuses_without_ends(formulas: Sequence[Any]) -> str:
    """Return the function in the expressions of a curve that requires a range, as it is not smooth; empty if none."""
    texts = [f.expression.text for f in formulas]
    functions = {function for text in texts for function in _FUNCTION.findall(text)} - SMOOTH
    if functions:
        return min(functions)
    return "a power" if any(len(_POWER.findall(text)) < text.count("**") for text in texts) else ""


def check_curve(formulas: Sequence[Any], window: Sequence[float], *, stated: bool, closed: bool) -> None:
    """Raise MechanismError for a corner, a gap or a cusp of a curve within a window of its parameter.

    Parameters
    ----------
    formulas : sequence of callable
        Coordinates as functions on jets of the parameter.
    window : sequence of two float
        First and last value of the parameter.
    stated : bool
        Whether the curve must be defined in the whole window.
    closed : bool
        Whether the curve is closed.
    """

    def evaluate(parameters: Parameters) -> Values:
        return derivatives_at(formulas, parameters)

    low, high = window
    parameters = np.linspace(low, high, SAMPLES)
    values = evaluate(parameters)
    finite = np.isfinite(values[:2]).all(axis=(0, 1))
    if stated and not finite.all():
        s = float(parameters[np.argmin(finite)])
        raise MechanismError(f"the curve or its tangent is not finite at s = {s:.6g}; state a range where they are")
    defined = np.where(finite)[0]
    if not defined.size:
        return
    _check_cusps(evaluate, parameters[defined], values[:, :, defined])
    if any(_may_break(f.expression.text) for f in formulas):
        _check_jumps(evaluate, parameters, values)
    if closed:
        _check_seam(evaluate, low, high, values)


def derivatives_at(formulas: Sequence[Any], parameters: Parameters, *fixed_parameters: Parameters) -> Values:
    """Return coordinates of a curve, or of a surface along its first parameter, and their derivatives by it."""
    derivatives = []
    for first in range(0, len(parameters), LANES):
        arguments = [np.resize(x[first : first + LANES], LANES) for x in (parameters, *fixed_parameters)]
        varied, *constants = (jnp.asarray(x) for x in arguments)
        jets = [Jet.variable(varied, LEVELS), *(Jet.constant(x, LEVELS) for x in constants)]
        count = len(parameters[first : first + LANES])
        coordinates = [np.stack([np.asarray(c) for c in f(*jets).dense().derivatives()]) for f in formulas]
        derivatives.append(np.stack(coordinates, axis=1)[..., :count])
    return np.concatenate(derivatives, axis=-1)


def _may_break(text: str) -> bool:
    """Return whether an expression may have kinks or poles."""
    return "/" in text or "**" in text or not set(_FUNCTION.findall(text)) <= SMOOTH - {"tan"}


def _check_cusps(evaluate: Callable[[Parameters], Values], parameters: Parameters, values: Values) -> None:
    speed = np.linalg.norm(values[1], axis=0)
    usual = float(np.median(speed))
    if usual == 0:
        raise MechanismError("the curve is a single point: its tangent vanishes everywhere")
    before, after = np.append(np.inf, speed[:-1]), np.append(speed[1:], np.inf)
    minima = np.flatnonzero((speed <= before) & (speed <= after) & (speed < SLOW * usual))
    if not minima.size:
        return
    low, high = parameters[np.maximum(minima - 1, 0)], parameters[np.minimum(minima + 1, len(parameters) - 1)]
    for _ in range(NARROWINGS):  # ternary search for the shortest tangent
        lower, upper = low + (high - low) / 3, high - (high - low) / 3
        sizes = np.split(np.linalg.norm(evaluate(np.concatenate([lower, upper]))[1], axis=0), 2)
        nearer = sizes[0] < sizes[1]
        low, high = np.where(nearer, low, lower), np.where(nearer, upper, high)
    middle = 0.5 * (low + high)
    candidates = np.concatenate([middle, parameters[minima]])
    sizes = np.linalg.norm(evaluate(candidates)[1], axis=0)
    if sizes.min() < CUSP * usual:
        s = float(candidates[np.argmin(sizes)])
        message = f"the curve has a cusp at s = {_shown(s)}: its tangent vanishes there, and no motion along it"
        raise MechanismError(f"{message} is determined; leave that place out by a range, or take another parameter")


def _check_jumps(evaluate: Callable[[Parameters], Values], parameters: Parameters, values: Values) -> None:
    """Raise MechanismError for a jump, found by bisection of the half of each interval in which values change more."""
    sizes = np.max(np.where(np.isfinite(values), np.abs(values), 0.0), axis=(1, 2))

    def change(a: Values, b: Values) -> Float[np.ndarray, "level place"]:
        return np.nan_to_num(np.abs(a - b).max(axis=1), nan=0.0, posinf=1e300) / np.maximum(sizes, 1e-300)[:, None]

    for level in range(LEVELS + 1):
        low, high, first, last = parameters[:-1], parameters[1:], values[..., :-1], values[..., 1:]
        for _ in range(HALVINGS):
            if not (change(first, last)[level] > JUMP).any():
                break
            middle = 0.5 * (low + high)
            middle_values = evaluate(middle)
            left = change(first, middle_values)[level] >= change(middle_values, last)[level]
            low, high = np.where(left, low, middle), np.where(left, middle, high)
            first, last = np.where(left, first, middle_values), np.where(left, middle_values, last)
        else:
            jumps = change(first, last)[level]
            if jumps.max() > JUMP:
                place = _shown(float(low[np.argmax(jumps)]))
                raise MechanismError(f"the curve {_WORDS[level]} at s = {place}; {_ADVICE}")


_WORDS = (
    "has a gap",
    "has a corner",
    "has a jump of its curvature",
    *(f"has a jump of its derivative {k} by s" for k in (3, 4)),
)
_ADVICE = "it must be smooth where a point moves along it: round it off, or leave that place out by a range"


def _check_seam(evaluate: Callable[[Parameters], Values], low: float, high: float, values: Values) -> None:
    """Raise MechanismError unless a closed curve continues beyond its end as at its beginning."""
    offsets = np.linspace(0.0, 0.3 * (high - low), 7)
    begins, ends = evaluate(low + offsets), evaluate(high + offsets)
    sizes = np.abs(values).max(axis=(1, 2))
    sizes[0] = max(np.ptp(values[0], axis=1))
    if (gap := np.linalg.norm(ends[0, :, 0] - begins[0, :, 0])) > JUMP * sizes[0]:
        raise MechanismError(
            f"the curve does not close: there is a gap of {gap:.3g} m between its end and its beginning"
        )
    for level in range(1, LEVELS + 1):
        if np.abs(ends[level, :, 0] - begins[level, :, 0]).max() > JUMP * max(sizes[level], sizes[1]):
            raise MechanismError(f"the curve {_WORDS[level]} where its end meets its beginning; {_ADVICE}")
    if np.abs(ends[0] - begins[0]).max() > JUMP * sizes[0]:
        message = "the expressions of a closed curve must go on periodically beyond its end, as sines do"
        raise MechanismError(f"{message}; give the curve by samples")


def check_points(points: np.ndarray, *, closed: bool, least: int) -> Float[np.ndarray, "point component"]:
    """Return points of a curve after a check of its smoothness; a closed one repeats its first point at the end."""
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise MechanismError("points of a curve are rows of two or three numbers", name="points", value=points.shape)
    failures = np.argwhere(~np.isfinite(points))
    if len(failures):
        raise MechanismError("must be finite", name=f"points[{failures[0][0]}]", value=points[failures[0][0]].tolist())
    size = float(np.ptp(points, axis=0).max(initial=0.0))
    if closed and len(points) and np.linalg.norm(points[-1] - points[0]) > 1e-9 * size:
        points = np.concatenate([points, points[:1]])
    elif closed:
        points = np.concatenate([points[:-1], points[:1]])
    if len(points) <= least:
        raise MechanismError(f"a curve needs at least {least + 1} points; give more", name="points", value=len(points))
    steps = np.diff(points, axis=0)
    chords = np.linalg.norm(steps, axis=1)
    if (chords <= 1e-12 * size).any():
        row = int(np.argmin(chords)) + 1
        raise MechanismError("this point repeats the one before", name=f"points[{row}]", value=points[row].tolist())
    if chords.max() > WIDEST * np.median(chords):
        row = int(np.argmax(chords))
        parameters = " and ".join(str(points[k].tolist()) for k in (row, row + 1))
        message = f"there is a gap of {chords[row]:.3g} m between {parameters}, where others are"
        raise MechanismError(
            f"{message} {np.median(chords):.3g} m apart; give points between, all nearly evenly", name=f"points[{row}]"
        )
    directions = steps / chords[:, None]
    next_directions = np.roll(directions, -1, axis=0) if closed else directions[1:]
    turns = np.degrees(np.arccos(np.clip((directions[: len(next_directions)] * next_directions).sum(axis=1), -1, 1)))
    neighbors = (
        [np.roll(turns, shift) for shift in (-1, 1)] if closed else [np.append(turns[1:], 0), np.append(0, turns[:-1])]
    )
    corners = (turns > SHARPEST) | ((turns > SHARP) & (turns > SINGLE * np.maximum(*neighbors)))
    if corners.any():
        row = int(np.argmax(np.where(corners, turns, 0.0))) + 1
        message = f"the curve has a corner of {turns[row - 1]:.0f} deg; round it off, or give more points"
        raise MechanismError(message, name=f"points[{row % (len(points) - 1)}]", value=points[row].tolist())
    return points


def _shown(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-9 else value:.6g}"
