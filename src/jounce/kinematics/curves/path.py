"""Continuation along a curve of configurations, in steps that miss no other branch, from the start to its end.

A step is as long as the series is exact to rounding, and covers at most half the distance to the nearest real or
complex singular point of the bordered Jacobian. It is accepted if Newton-Raphson confirms the series at several points
of the step, with the same sign of the determinant. Turning points of the driver need no special treatment. Where
branches cross, the steps shrink; the crossing is then located, recorded and passed.
"""

import dataclasses
import enum

import numpy as np
from jaxtyping import Bool
from numpy.polynomial.polynomial import polyval

from jounce.kinematics.curves.crossings import PASSAGE_ORDER, ChangePoint, crossing
from jounce.kinematics.curves.path_tracker import LANES, ORDER, TAIL, CurvePoint, PathTracker, all_finite
from jounce.kinematics.curves.series import CurvePoints

LARGEST_DEPARTURE = 1e-8  # of the curve from the series, rad or sizes of the mechanism
LARGEST_CORRECTION = 1e-10  # last correction, unless rounding makes it larger
ROUNDINGS = 16  # bound of rounding in a correction near a crossing, in units of rounding by the condition number
LARGEST_RESIDUAL = 1e-9  # of redundant rows
SMALLEST_STEP = 1e-9
NEGLIGIBLE = 1e-9
SAME_DIRECTION = 1e-6
MOST_CORRECTIONS = 50
SHARE_OF_DISTANCE = 0.5  # to a singular point, covered in one step


class End(enum.Enum):
    """Why a curve ends."""

    CLOSED = "closed: it is back where it started"
    LENGTH = "not followed any further: it is as long as was asked for"
    SINGULAR = "singular: the curve does not go on smoothly here, as at a cusp"
    INADMISSIBLE = "a driver has no permitted value beyond: a distance is zero, or a law is not defined"


@dataclasses.dataclass
class Path:
    """Points of a curve in the order of arc length, the change points passed, and the end."""

    points: list[CurvePoint]
    change_points: list[ChangePoint] = dataclasses.field(default_factory=list)
    end: End = End.LENGTH
    length: float = 0.0

    def reversed(self) -> "Path":
        """Return the path in the reversed direction."""
        points = [point.reversed() for point in reversed(self.points)]
        change_points = [point.reversed() for point in reversed(self.change_points)]
        return Path(points, change_points, self.end, self.length)


def track_both_directions(tracker: PathTracker, start: CurvePoint, length: float) -> tuple[Path, Path | None]:
    """Return the path forward from a point, and the one backward unless the first closes."""
    forward = track(tracker, start, length)
    return forward, None if forward.end is End.CLOSED else track(tracker, start.reversed(), length)


def track(tracker: PathTracker, start: CurvePoint, length: float) -> Path:
    """Follow a curve from a point, until it closes, ends, or is as long as requested."""
    path, point = Path([start]), start
    while point.arc_length - start.arc_length < length:
        ahead = tracker.singularity_distance(point)
        if (crossed := crossing(tracker, point, ahead)) is not None:
            change_point, next_point = crossed
            path.change_points.append(change_point)
            point = path.points[-1] = point.shortened(PASSAGE_ORDER)
        else:
            next_point = _next_point(tracker, point, abs(ahead))
            if isinstance(next_point, End):
                path.end = next_point
                break
        step = next_point.arc_length - point.arc_length
        closing_step = _closing_step(tracker, point, start, step) if len(path.points) > 1 else None
        if closing_step is not None:
            path.end, path.length = End.CLOSED, point.arc_length + closing_step - start.arc_length
            break
        path.points.append(next_point)
        point = next_point
    if path.end is not End.CLOSED:
        path.length = point.arc_length - start.arc_length
    return path


def _next_point(tracker: PathTracker, point: CurvePoint, distance: float) -> CurvePoint | End:
    """Return the next accepted point, or the reason for the end of the curve."""
    step = min(tracker.radius(point) * TAIL ** (1 / ORDER), SHARE_OF_DISTANCE * distance)
    parts = np.arange(1, LANES + 1) / LANES
    end = End.SINGULAR
    if not np.isfinite(step):
        return end
    bordered = tracker.bordered(point.jacobian, tracker.tangent(point), point.rows)
    sign, sizes = np.linalg.slogdet(bordered)[0], np.linalg.svd(bordered, compute_uv=False)
    rounding = ROUNDINGS * np.finfo(float).eps * sizes[0] / max(sizes[-1], np.finfo(float).tiny)
    correction = np.clip(rounding, LARGEST_CORRECTION, LARGEST_DEPARTURE)
    while step > SMALLEST_STEP:
        points = tracker.points(point, step * parts)
        if np.all(_accepted(tracker, point, points, sign, correction)):
            return tracker.point_at_lane(points, LANES - 1, point.arc_length + step, point.rows)
        end = End.SINGULAR if np.all(points.admissible) else End.INADMISSIBLE
        step *= 0.5
    return end


def _accepted(
    tracker: PathTracker, point: CurvePoint, points: CurvePoints, sign: float, correction: float
) -> Bool[np.ndarray, " lane"]:
    """Return which points are on the curve of the series, and on the same branch."""
    accepted = all_finite(points) & points.admissible & (points.residual <= LARGEST_RESIDUAL)
    accepted &= (points.first <= LARGEST_DEPARTURE) & (points.last <= correction)
    return accepted & (tracker.signs(points, point.rows) == sign)


def _closing_step(tracker: PathTracker, point: CurvePoint, start: CurvePoint, length: float) -> float | None:
    """Return the step, within a length, at which a curve is back at its start in the same direction, or None."""
    step = step_to_configuration(tracker, point, length, {name: c[0] for name, c in start.coordinates.items()})
    if step is None:
        return None
    if tracker.timed and abs(polyval(step, point.value) - start.value[0]) > NEGLIGIBLE * tracker.value_scale:
        return None
    tangent, start_tangent = (tracker.tangent(point)[: tracker.columns] for point in (point.recentered(step), start))
    return step if float(tangent @ start_tangent) > 1 - SAME_DIRECTION else None


def step_to_configuration(
    tracker: PathTracker, point: CurvePoint, length: float, target: dict[str, np.ndarray]
) -> float | None:
    """Return the step, within a length, at which a curve passes a configuration, or None."""
    if np.max(np.abs(tracker.difference(point.at(0.0), target))) > 1.5 * length + NEGLIGIBLE:
        return None
    step = 0.0
    for _ in range(MOST_CORRECTIONS):
        next_point = point.recentered(step)
        difference = tracker.difference({name: c[0] for name, c in next_point.coordinates.items()}, target)
        change = float(tracker.tangent(next_point)[: tracker.columns] @ difference)
        step -= change
        if not -length <= step <= 2 * length:
            return None
        if abs(change) < 1e-14:
            break
    if not -NEGLIGIBLE < step <= length or np.max(np.abs(tracker.difference(point.at(step), target))) > NEGLIGIBLE:
        return None
    return step
