"""Smooth curves within a deviation of the straight lines between points.

Many short lines are first merged into longer ones, so that noise and the points of a dwell add no length. Schoenberg's
operator then gives a spline with its control points on the lines: it stays in their convex hulls, turns no more often
than the lines, and rests where they rest. Knot intervals are halved where the spline is not near enough.

I. J. Schoenberg, On spline functions, in Inequalities (Academic Press, 1967), 255-291; H. Imai and M. Iri, Polygonal
approximations of a curve, in Computational Morphology (North-Holland, 1988), 71-86.
"""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from jounce.errors import TrajectoryError
from jounce.planning.paths.path import Path
from jounce.planning.pieces import SmoothPieces
from jounce.trajectory.splines import local_powers

DEGREE = 5
LEAST, MOST = 32, 8192  # pieces
LOOKS = 8  # sample points of each piece
GRADED = 2.5  # largest ratio of the lengths of neighboring pieces
TOGETHER = 0.25  # fraction of the deviation: largest distance of merged lines from those that they replace
ADJACENT = 2  # lines before and after a line that are candidates for the nearest one

_Points = Float[np.ndarray, "point joint"]


@dataclasses.dataclass(frozen=True, eq=False)
class Lines:
    """Straight lines between points of a path.

    Parameters
    ----------
    at : array of shape (point,)
        Increasing values of the path parameter at the points, such as instants, s.
    points : array of shape (point, joint)
        Positions, rad or m.
    names : tuple of str
        Names of the joints.
    kind : {"samples", "waypoints", "places"}
        Kind of the points.
    own : float, default 0
        Distance of the lines from the curve that they approximate, rad or m.
    """

    at: Float[np.ndarray, " point"]
    points: _Points
    names: tuple[str, ...]
    kind: str
    own: float = 0.0

    @property
    def size(self) -> float:
        """Diagonal of the bounding box of all points."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def distances(self, at: Float[np.ndarray, " point"], points: Float[np.ndarray, "point joint"]) -> np.ndarray:
        """Return the distances of points from the nearest lines near their parameters."""
        interval = np.clip(np.searchsorted(self.at, at, side="right") - 1, 0, len(self.at) - 2)
        distances = np.full(len(at), np.inf)
        for step in range(-ADJACENT, ADJACENT + 1):
            line = np.clip(interval + step, 0, len(self.at) - 2)
            distances = np.minimum(distances, _distances_from_lines(points, self.points[line], self.points[line + 1]))
        return distances


def _distances_from_lines(points: np.ndarray, begins: np.ndarray, ends: np.ndarray) -> Float[np.ndarray, " point"]:
    """Return the distances of points from line segments."""
    directions, offsets = ends - begins, points - begins
    lengths = (directions**2).sum(axis=-1)
    fraction = np.clip((directions * offsets).sum(axis=-1) / np.where(lengths > 0, lengths, 1.0), 0.0, 1.0)
    return np.linalg.norm(offsets - fraction[..., None] * directions, axis=-1)


def simplified_polyline(points: _Points, limit: float) -> tuple[Int[np.ndarray, " vertex"], float]:
    """Return a subset of points such that the straight lines between them are near all points, in sequence.

    Parameters
    ----------
    points : array of shape (point, joint)
        Points in sequence.
    limit : float
        Largest distance of points from the line that replaces them, and largest step back along it.

    Returns
    -------
    chosen : array of shape (vertex,)
        Indices of the subset, with the first and the last point.
    off : float
        Largest distance of a point from its line.
    """
    last_index, chosen, stride, max_distance = len(points) - 1, [0], 1, 0.0
    while chosen[-1] < last_index:
        first = chosen[-1]
        near, far, reach = first + 1, last_index + 1, stride
        while near < last_index and far > last_index:  # double the reach until it is too far
            trial = min(first + 2 * reach, last_index)
            near, far = (trial, far) if _off(points[first : trial + 1], limit) <= limit else (near, trial)
            reach = trial - first
        while far - near > 1 and far <= last_index:
            middle = (near + far) // 2
            near, far = (middle, far) if _off(points[first : middle + 1], limit) <= limit else (near, middle)
        max_distance, stride = max(max_distance, _off(points[first : near + 1], limit)), near - first
        if np.any(points[near] != points[first]):
            chosen.append(near)
        elif near == last_index:
            break
        else:  # the points return to the same position: the next line starts from it
            chosen[-1] = near
    return np.array(chosen), max_distance


def _off(points: _Points, tolerance: float) -> float:
    """Return the distance of points from the line between the first and the last; infinite if they go back along it."""
    direction, offsets = points[-1] - points[0], points - points[0]
    length = float(np.linalg.norm(direction))
    fraction = offsets @ (direction / length) if length else np.zeros(len(points))
    if np.max(np.maximum.accumulate(fraction) - fraction) > tolerance:
        return np.inf
    return float(_distances_from_lines(points, points[:1], points[-1:]).max())


def rounded(lines: Lines, deviation: float, *, timed: bool = False) -> Path:
    """Return a path with four continuous derivatives within a deviation of straight lines.

    Parameters
    ----------
    lines : Lines
        Lines that the path follows from the first to the last point.
    deviation : float
        Largest distance from the lines, rad or m.
    timed : bool, default False
        Whether the path runs over the instants of the points and is near each point at its instant; it then rests where
        the points rest. Otherwise it runs from 0 to 1, approximately over the length of the lines.

    Raises
    ------
    TrajectoryError
        If the lines do not move, or the path would need more than 8192 pieces; the message gives the place.
    """
    if timed:
        knots, points, line_distance, chosen = lines.at, lines.points, 0.0, np.arange(len(lines.at))
    else:
        chosen, line_distance = simplified_polyline(lines.points, TOGETHER * (deviation - lines.own))
        points = lines.points[chosen]
        knots = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        if not knots[-1] > 0:
            raise TrajectoryError("the path does not move: all its points are the same", name="path")
        knots = knots / knots[-1]
    instants = lines.at[chosen]
    begins = np.linspace(knots[0], knots[-1], LEAST + 1)
    while True:
        begins = _graded(begins)
        curve = _schoenberg(begins, knots, points)
        looks = np.unique(np.append(begins[:-1, None] + np.diff(begins)[:, None] * np.arange(LOOKS) / LOOKS, knots))
        difference = curve(looks) - _on(looks, knots, points)
        distances = np.linalg.norm(difference, axis=1) + line_distance + lines.own
        pieces = np.unique(np.searchsorted(begins, looks[distances > deviation], side="right") - 1)
        pieces = pieces[pieces < len(begins) - 1]
        if not len(pieces):
            size = 2 ** int(np.ceil(np.log2(len(begins) - 1)))
            if len(begins) - 1 == size:
                break
            pieces = np.argsort(-np.diff(begins), kind="stable")[: size - len(begins) + 1]  # few shapes are compiled
        if len(begins) + len(pieces) - 1 > MOST:
            index = int(np.argmax(distances))
            position = float(np.interp(looks[index], knots, instants))
            symbol = "s" if lines.kind != "samples" else "t"
            message = (
                f"a path within {deviation:.3g} rad or m of the straight lines between its {lines.kind} would turn too "
                f"often or too sharply to be followed, as at {symbol} = {position:.6g}{' s' if symbol == 't' else ''}; "
                "choose a larger deviation, or smooth them"
            )
            raise TrajectoryError(message, name=lines.names[int(np.argmax(np.abs(difference[index])))])
        begins = np.sort(np.append(begins, (begins[pieces] + begins[pieces + 1]) / 2))
    powers = local_powers(curve, begins[:-1], DEGREE)
    laws = {name: SmoothPieces(begins[:-1], powers[:, :, k], float(begins[-1])) for k, name in enumerate(lines.names)}
    times = (knots, instants) if lines.kind == "samples" else None
    note = f"within {deviation:.3g} rad or m of the straight lines between {len(lines.at)} {lines.kind}"
    return Path(
        laws, float(knots[0]), float(knots[-1]), float(distances.max()), deviation, note, times, (knots, instants)
    )


def _on(parameters: np.ndarray, knots: np.ndarray, points: _Points) -> Float[np.ndarray, "sample joint"]:
    """Return positions on straight lines."""
    return np.stack([np.interp(parameters, knots, column) for column in points.T], axis=1)


def _graded(begins: np.ndarray) -> np.ndarray:
    """Return breakpoints with pieces halved that are much longer than a neighbor."""
    while True:
        lengths = np.diff(begins)
        adjacent = np.minimum(np.append(lengths[1:], np.inf), np.append(np.inf, lengths[:-1]))
        long_pieces = np.flatnonzero(lengths > GRADED * adjacent)
        if not len(long_pieces):
            return begins
        begins = np.sort(np.append(begins, (begins[long_pieces] + begins[long_pieces + 1]) / 2))


def _schoenberg(begins: np.ndarray, knots: np.ndarray, points: _Points) -> Any:
    """Return Schoenberg's spline: its control points lie on straight lines, each at the mean of its knots."""
    from scipy.interpolate import BSpline  # importing SciPy takes half a second

    padded_knots = np.concatenate([begins[[0] * DEGREE], begins, begins[[-1] * DEGREE]])
    means = np.lib.stride_tricks.sliding_window_view(padded_knots[1:-1], DEGREE).mean(axis=1)
    return BSpline(padded_knots, _on(np.clip(means, knots[0], knots[-1]), knots, points), DEGREE)
