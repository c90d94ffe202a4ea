"""Lines of the curves and surfaces of joints, in the frame of their body."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jounce.mechanism import Mechanism
from jounce.mechanism.resolve import resolve_element
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.trajectory.curve_checks import derivatives_at
from jounce.trajectory.curves import HALF_WINDOW, CurveLaw

SAMPLES, ACROSS = 401, 9  # points of a curve; lines of a surface in each direction
AROUND = 0.4  # margin of an endless curve around the path of a point, as a fraction of the path
PERIODIC = 1e-6  # fraction of the size of a curve by which a closed curve may miss its start


class CurveLines(NamedTuple):
    """Lines, each (places, components), m, and whether they are complete, unlike those of an endless curve."""

    lines: tuple[Float[np.ndarray, "place component"], ...]
    whole: bool


NONE = CurveLines((), True)


def curve_lines(mechanism: Mechanism, name: str) -> CurveLines:
    """Return the lines of the curve or the surface of a joint, by its name; none for other joints."""
    element: Any = mechanism.joints[name]
    if not element.hidden:
        return NONE
    size = POSITION_COMPONENTS[mechanism.space]
    values = resolve_element(element, mechanism.parameter_values, size, f"joints.{name}")
    curve = next((value for value in values.values() if isinstance(value, CurveLaw)), None)
    if curve is None:  # a cam, which counts turns
        return NONE
    if len(element.hidden) > 1:
        return CurveLines(() if curve.ends is None else _net(curve, [float(x) for x in curve.ends]), True)
    start = float(values["start"] or 0.0)
    low, high = start - HALF_WINDOW, start + HALF_WINDOW
    if curve.ends is not None:
        low, high = (float(x) for x in curve.ends)
    elif curve.lap is not None:
        low, high = 0.0, float(curve.lap)
    line = derivatives_at(curve.components, np.linspace(low, high, SAMPLES))[0].T
    bounded = curve.ends is not None or curve.lap is not None
    laps = np.linalg.norm(line[-1] - line[0]) <= PERIODIC * np.ptp(line, axis=0).max()
    return CurveLines((line,), bounded or bool(laps))


def _net(curve: CurveLaw, ends: list[float]) -> tuple[Float[np.ndarray, "place component"], ...]:
    """Return the lines of a surface along both parameters."""
    (first, last), (low, high) = ends[:2], ends[2:]
    u, v = np.linspace(first, last, SAMPLES // 8), np.linspace(low, high, SAMPLES // 8)
    u_lines = [(np.full(len(v), x), v) for x in np.linspace(first, last, ACROSS)]
    v_lines = [(u, np.full(len(u), x)) for x in np.linspace(low, high, ACROSS)]
    return tuple(derivatives_at(curve.components, *parameters)[0].T for parameters in (*u_lines, *v_lines))


def shown(lines: CurveLines, visited: Float[np.ndarray, "time component"], shortest: float) -> list[Any]:
    """Return the shown parts of lines: for an endless curve, those near the visited places, in the same frame."""
    finite = visited[np.isfinite(visited).all(axis=1)]
    if lines.whole or not len(finite):
        return list(lines.lines)
    low, high = finite.min(axis=0), finite.max(axis=0)
    margin = max(AROUND * float(np.linalg.norm(high - low)), shortest)
    parts = []
    for line in lines.lines:
        inside = ((line >= low - margin) & (line <= high + margin)).all(axis=1)
        index = int(np.argmin(np.linalg.norm(line - finite[0], axis=1)))
        first = last = index
        while first > 0 and inside[first - 1]:
            first -= 1
        while last < len(line) - 1 and inside[last + 1]:
            last += 1
        if last > first:
            parts.append(line[first : last + 1])
    return parts
