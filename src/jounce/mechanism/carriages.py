"""Carriages: bodies without mass whose positions are the hidden coordinates of joints, such as a curve parameter.

A carriage is a body of the mechanism beside those of the user. Its first coordinates are the parameters times a unit
length of the curve, and its last coordinate is that unit: the parameters follow from the pose alone.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.errors import MechanismError, UnsupportedError
from jounce.jet import Jet
from jounce.trajectory.curve_checks import derivatives_at
from jounce.trajectory.curves import HALF_WINDOW, CurveLaw, ParametricCurve, SampledCurve

ENDING = ".s"
SAMPLES = 721  # of a curve, in the search for its nearest point
ALIKE, SLIGHT = 1.25, 1e-6  # factor, and share of the curve size, by which a part as near may be farther
STEPS = 40


def carriage_of(joint: str) -> str:
    """Return the name of the carriage of a joint.

    Examples
    --------
    >>> carriage_of("track")
    'track.s'
    """
    return joint + ENDING


def carriages(name: str, element: Any) -> tuple[str, ...]:
    """Return the names of the carriages of a joint; `name` is the name of the joint, dotted or plain."""
    return (carriage_of(name.partition(".")[2] or name),) if getattr(element, "hidden", ()) else ()


def joint_of(carriage: str) -> str:
    """Return the name of the joint that a carriage belongs to."""
    return carriage.removesuffix(ENDING)


def curve_in(values: Mapping[str, Any]) -> CurveLaw:
    """Return the curve or the surface among the values of a joint in numbers."""
    return next(value for value in values.values() if isinstance(value, CurveLaw))


def carriage_guess(curve: CurveLaw, start: Any, point: Any) -> Any:
    """Return the starting position of a carriage.

    Parameters
    ----------
    curve : CurveLaw
        Curve or surface of the joint.
    start : list of float or None
        Guess of the parameters; None for the nearest point of the curve.
    point : array of shape (components,)
        Guided point at the starting guess of the bodies, in the frame of the curve, m.

    Raises
    ------
    MechanismError
        If the start is beyond an end, or if several parts of the curve are as near.
    """
    count = len(point)
    if start is None:
        start = [_nearest(curve, point)] if len(curve.components) and _is_curve(curve) else [0.0, 0.0]
    elif curve.ends is not None and not any(isinstance(x, Tracer) for x in (*curve.ends, *start)):
        for k, value in enumerate(start):
            low, high = (float(x) for x in curve.ends[2 * k : 2 * k + 2])
            if not low <= float(value) <= high:
                message = f"the start must be between the ends of the curve, {low:.6g} and {high:.6g}"
                raise MechanismError(message, name="start", value=float(value))
    parts = [x * curve.unit for x in start]
    position = (*parts, *[0.0] * (count - 1 - len(parts)), curve.unit)
    if any(isinstance(x, Tracer) for x in position):
        return jnp.stack([jnp.asarray(x, float) for x in position])
    return np.array([float(x) for x in position])


def _is_curve(curve: CurveLaw) -> bool:
    names = getattr(curve.components[0], "names", ("s",))
    return len(names) == 1


def _nearest(curve: CurveLaw, point: Any) -> Any:
    """Return the parameter of the point of a curve nearest to a given point."""
    low, high = (-HALF_WINDOW, HALF_WINDOW)
    if curve.ends is not None:
        low, high = _plain(curve.ends)
    elif curve.lap is not None:
        low, high = 0.0, _plain((curve.lap,))[0]
    grid = np.linspace(low, high, SAMPLES)
    if any(isinstance(x, Tracer) for x in jax.tree.leaves((curve, point))):  # checked below before JAX traced it
        points = curve(Jet([jnp.asarray(grid)])).coefficients[0]
        grid_distances = jnp.sum((points - jnp.asarray(point)[:, None]) ** 2, axis=0)
        return jnp.asarray(grid)[jnp.nanargmin(grid_distances)]

    derivatives = partial(derivatives_at, curve.components)
    points = derivatives(grid)[0]
    size = float(np.ptp(np.where(np.isfinite(points), points, 0.0), axis=1).max()) or 1.0
    grid_distances = np.linalg.norm(points - np.asarray(point)[:, None], axis=0)
    grid_distances = np.where(np.isfinite(grid_distances), grid_distances, np.inf)
    before, after = np.append(np.inf, grid_distances[:-1]), np.append(grid_distances[1:], np.inf)
    minima = np.flatnonzero((grid_distances <= before) & (grid_distances <= after) & np.isfinite(grid_distances))
    step = (high - low) / (SAMPLES - 1)
    lower, upper = np.maximum(grid[minima] - step, low), np.minimum(grid[minima] + step, high)
    for _ in range(STEPS):  # ternary search
        a, b = lower + (upper - lower) / 3, upper - (upper - lower) / 3
        sizes = np.split(np.linalg.norm(derivatives(np.concatenate([a, b]))[0] - np.asarray(point)[:, None], axis=0), 2)
        is_lower = sizes[0] < sizes[1]
        lower, upper = np.where(is_lower, lower, a), np.where(is_lower, b, upper)
    parameter = 0.5 * (lower + upper)
    points = derivatives(parameter)[0]
    distances = np.linalg.norm(points - np.asarray(point)[:, None], axis=0)
    ranked = np.lexsort((np.abs(parameter), np.round(distances / (SLIGHT * size))))
    best = int(ranked[0])
    for k in ranked[1:]:
        is_apart = np.linalg.norm(points[:, k] - points[:, best]) > 100 * SLIGHT * size
        crossing = (
            not is_apart
            and distances[best] < SLIGHT * size
            and _turned(derivatives, float(parameter[best]), float(parameter[k]))
        )
        if (is_apart or crossing) and distances[k] <= ALIKE * distances[best] + SLIGHT * size:
            names = " and ".join(f"s = {parameter[j]:.4g}" for j in sorted((best, int(k)), key=lambda j: parameter[j]))
            message = f"two parts of the curve are about as near to the starting guess, at {names}; give start"
            raise MechanismError(message, name="start")
    return float(parameter[best])


def _plain(values: Any) -> list[Any]:
    return [x if isinstance(x, Tracer) else float(x) for x in values]


def _turned(derivatives: Any, first: float, second: float) -> bool:
    """Return whether the tangents at two values of a parameter have different directions."""
    tangents = derivatives(np.array([first, second]))[1]
    tangents = tangents / np.linalg.norm(tangents, axis=0)
    return abs(float(tangents[:, 0] @ tangents[:, 1])) < 1 - 1e-6


def has_ends(mechanism: Any) -> bool:
    """Return whether a joint of a mechanism has a curve or a surface with ends."""
    parts = (part for joint in mechanism.joints.values() if joint.hidden for part in vars(joint).values())
    curves = [part for part in parts if isinstance(part, ParametricCurve | SampledCurve)]
    return any(not curve.closed and getattr(curve, "range", curve) is not None for curve in curves)


def check_without_ends(mechanism: Any, request: str) -> None:
    """Raise UnsupportedError if a mechanism has curves with ends, which `request` does not detect."""
    if has_ends(mechanism):
        message = (
            f"{request} does not look for the ends of curves yet, and would go on beyond; give a curve without a range"
        )
        raise UnsupportedError(message, name="joints")


def with_carriages(bodies: Mapping[str, Any], joints: Mapping[str, Any], kind: type[Any]) -> Mapping[str, Any]:
    """Return the bodies of a mechanism: those of the user first, then the carriages of the joints.

    `kind` is the class of carriages; the position of a new carriage is None, as it follows from the starting guess.
    """
    names = [carriage for name, joint in joints.items() for carriage in carriages(name, joint)]
    user_bodies = {name: body for name, body in bodies.items() if not isinstance(body, kind)}
    if not names and len(user_bodies) == len(bodies):
        return bodies
    for name in (name for name in names if name in user_bodies):
        message = "this name is that of the carriage of a joint; give the body another one"
        raise MechanismError(message, name=f"bodies.{name}")
    return {**user_bodies, **{name: bodies.get(name) or kind(None) for name in names}}
