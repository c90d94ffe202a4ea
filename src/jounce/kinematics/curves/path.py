"""Walking along a curve of configurations: steps that no other branch hides in, from the start to its end.

A step is as long as the series is good to rounding, and at most half as long as the way to the nearest singular place
of the bordered Jacobian, real or complex. It is accepted where Newton-Raphson finds the curve where the series has it,
at all of the places looked at in between, with the same sign of the determinant. Turning points of the driver are
nothing special to it. Where branches cross, the steps shrink; the crossing is then located, told and passed.
"""

import dataclasses
import enum

import numpy as np
from jaxtyping import Bool

from jounce.kinematics.curves.crossings import PASSAGE_ORDER, ChangePoint, crossing
from jounce.kinematics.curves.series import CurvePoints
from jounce.kinematics.curves.walker import LANES, ORDER, TAIL, Place, Walker, all_finite, horner

LARGEST_DEPARTURE = 1e-8  # of the curve from the series, rad or sizes of the mechanism
LARGEST_CORRECTION = 1e-10  # the last one, where rounding allows that
ROUNDINGS = 16  # of a correction, over the smallest singular value: what is left of the last one near a crossing
LARGEST_RESIDUAL = 1e-9  # of rows that repeat others
SMALLEST_STEP = 1e-9
SAME_PLACE = 1e-9
SAME_DIRECTION = 1e-6
MOST_CORRECTIONS = 50
PART_OF_WAY = 0.5  # to a singular place, made in one step


class End(enum.Enum):
    """Why a curve ends where it does."""

    CLOSED = "closed: it is back where it started"
    LENGTH = "not followed any further: it is as long as was asked for"
    SINGULAR = "singular: the curve does not go on smoothly here, as at a cusp"
    INADMISSIBLE = "a driver has no permitted value beyond: a distance is zero, or a law is not defined"


@dataclasses.dataclass
class Path:
    """Places on a curve in the order of arc length, the change points passed, and how it ends."""

    places: list[Place]
    change_points: list[ChangePoint] = dataclasses.field(default_factory=list)
    end: End = End.LENGTH
    length: float = 0.0

    def reversed(self) -> "Path":
        """Return the path gone along the other way."""
        places = [place.reversed() for place in reversed(self.places)]
        points = [point.reversed() for point in reversed(self.change_points)]
        return Path(places, points, self.end, self.length)


def walk_both_ways(walker: Walker, start: Place, length: float) -> tuple[Path, Path | None]:
    """Return the path from a place forward, and unless that closes, the one backward."""
    forward = walk(walker, start, length)
    return forward, None if forward.end is End.CLOSED else walk(walker, start.reversed(), length)


def walk(walker: Walker, start: Place, length: float) -> Path:
    """Follow a curve from a place, until it closes, ends, or is as long as asked for."""
    path, here = Path([start]), start
    while here.arc_length - start.arc_length < length:
        ahead = walker.nearing(here)
        if (found := crossing(walker, here, ahead)) is not None:
            point, there = found
            path.change_points.append(point)
            here = path.places[-1] = here.shortened(PASSAGE_ORDER)
        else:
            there = _step(walker, here, abs(ahead))
            if isinstance(there, End):
                path.end = there
                break
        back = _back_at(walker, here, start, there.arc_length - here.arc_length) if len(path.places) > 1 else None
        if back is not None:
            path.end, path.length = End.CLOSED, here.arc_length + back - start.arc_length
            break
        path.places.append(there)
        here = there
    if path.end is not End.CLOSED:
        path.length = here.arc_length - start.arc_length
    return path


def nominal(walker: Walker, place: Place) -> float:
    """Return the arc length over which the series of a place is good to rounding."""
    return walker.radius(place) * TAIL ** (1 / ORDER)


def _step(walker: Walker, here: Place, reach: float) -> Place | End:
    """Return a place further on, or why there is none."""
    step = min(nominal(walker, here), PART_OF_WAY * reach)
    parts = np.arange(1, LANES + 1) / LANES
    end = End.SINGULAR
    if not np.isfinite(step):
        return end
    bordered = walker.bordered(here.jacobian, walker.tangent(here), here.rows)
    sign, sizes = np.linalg.slogdet(bordered)[0], np.linalg.svd(bordered, compute_uv=False)
    rounding = ROUNDINGS * np.finfo(float).eps * sizes[0] / max(sizes[-1], np.finfo(float).tiny)
    correction = np.clip(rounding, LARGEST_CORRECTION, LARGEST_DEPARTURE)
    while step > SMALLEST_STEP:
        points = walker.points(here, step * parts)
        if np.all(_good(walker, here, points, sign, correction)):
            return walker.place(points, LANES - 1, here.arc_length + step, here.rows)
        end = End.SINGULAR if np.all(points.admissible) else End.INADMISSIBLE
        step *= 0.5
    return end


def _good(
    walker: Walker, here: Place, points: CurvePoints, sign: float, correction: float
) -> Bool[np.ndarray, " lane"]:
    """Tell which points are on the curve that the series describes, and on the same branch of it."""
    good = all_finite(points) & points.admissible & (points.residual <= LARGEST_RESIDUAL)
    good &= (points.first <= LARGEST_DEPARTURE) & (points.last <= correction)
    return good & (walker.signs(points, here.rows) == sign)


def _back_at(walker: Walker, here: Place, start: Place, stretch: float) -> float | None:
    """Return how far from here, within a stretch, a curve is back at its start, in the same direction."""
    step = meets(walker, here, stretch, {name: c[0] for name, c in start.coordinates.items()})
    if step is None:
        return None
    if walker.timed and abs(horner(here.value, step) - start.value[0]) > SAME_PLACE * walker.value_scale:
        return None
    ahead, first = (walker.tangent(place)[: walker.columns] for place in (here.recentered(step), start))
    return step if float(ahead @ first) > 1 - SAME_DIRECTION else None


def meets(walker: Walker, here: Place, stretch: float, target: dict[str, np.ndarray]) -> float | None:
    """Return how far from a place, within a stretch, its curve goes through a configuration, if it does."""
    if np.max(np.abs(walker.difference(here.at(0.0), target))) > 1.5 * stretch + SAME_PLACE:
        return None
    step = 0.0
    for _ in range(MOST_CORRECTIONS):
        there = here.recentered(step)
        away = walker.difference({name: c[0] for name, c in there.coordinates.items()}, target)
        change = float(walker.tangent(there)[: walker.columns] @ away)
        step -= change
        if not -stretch <= step <= 2 * stretch:
            return None
        if abs(change) < 1e-14:
            break
    if not -SAME_PLACE < step <= stretch or np.max(np.abs(walker.difference(here.at(step), target))) > SAME_PLACE:
        return None
    return step
