"""Smooth curves within a deviation of the straight lines between points.

Many short lines are taken together first, so that noise and the points of a dwell add no way. The operator of
Schoenberg then gives a spline whose control points lie on the lines: it stays in their hulls, turns no more often than
they do, and stands still where they do. Intervals between its knots are halved where it is not near enough.

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
from jounce.trajectory import SplineMotion
from jounce.trajectory.splines import local_powers

DEGREE = 5
LEAST, MOST = 32, 8192  # pieces
LOOKS = 8  # in each piece
GRADED = 2.5  # largest ratio of the lengths of neighboring pieces
TOGETHER = 0.25  # of the deviation: largest distance of lines from the many that they replace
ADJACENT = 2  # lines before and after one, among which the nearest is sought

_Points = Float[np.ndarray, "point joint"]


@dataclasses.dataclass(frozen=True, eq=False)
class Lines:
    """Straight lines between points of a path.

    Parameters
    ----------
    at : array of shape (point,)
        Instants of the points, s, or what else the path runs over, increasing.
    points : array of shape (point, joint)
        Positions, rad or m.
    names : tuple of str
        Of the joints.
    kind : {"samples", "waypoints", "places"}
        What the points are.
    own : float, default 0
        How far the lines are from what they stand for, rad or m.
    """

    at: Float[np.ndarray, " point"]
    points: _Points
    names: tuple[str, ...]
    kind: str
    own: float = 0.0

    @property
    def size(self) -> float:
        """The diagonal of the box that holds all points."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def distances(self, at: Float[np.ndarray, " point"], points: Float[np.ndarray, "point joint"]) -> np.ndarray:
        """Return how far points are from the lines about where they should be."""
        own = np.clip(np.searchsorted(self.at, at, side="right") - 1, 0, len(self.at) - 2)
        nearest = np.full(len(at), np.inf)
        for step in range(-ADJACENT, ADJACENT + 1):
            line = np.clip(own + step, 0, len(self.at) - 2)
            nearest = np.minimum(nearest, _distances_from_lines(points, self.points[line], self.points[line + 1]))
        return nearest


def polynomials_at(law: SplineMotion, at: Float[np.ndarray, " point"]) -> Float[np.ndarray, " point"]:
    """Return the values of the polynomials of a spline, without a program of its own."""
    begins, powers = np.asarray(law.breakpoints, float), np.asarray(law.coefficients, float)
    piece = np.clip(np.searchsorted(begins, at, side="right") - 1, 0, len(begins) - 1)
    return np.polynomial.polynomial.polyval(at - begins[piece], powers[:, piece], tensor=False)


def _distances_from_lines(points: np.ndarray, begins: np.ndarray, ends: np.ndarray) -> Float[np.ndarray, " point"]:
    """Return distances from lines between two points each."""
    along, since = ends - begins, points - begins
    lengths = (along**2).sum(axis=-1)
    share = np.clip((along * since).sum(axis=-1) / np.where(lengths > 0, lengths, 1.0), 0.0, 1.0)
    return np.linalg.norm(since - share[..., None] * along, axis=-1)


def simplified_polyline(points: _Points, near: float) -> tuple[Int[np.ndarray, " vertex"], float]:
    """Return few of many points such that straight lines between them come near all, in their sequence.

    Parameters
    ----------
    points : array of shape (point, joint)
        In their sequence.
    near : float
        How far points may be from the line that takes their place, and how far back along it they may go.

    Returns
    -------
    chosen : array of shape (vertex,)
        Indices, the first and the last point among them.
    off : float
        How far a point is from its line, at most.
    """
    last, chosen, stride, off = len(points) - 1, [0], 1, 0.0
    while chosen[-1] < last:
        first = chosen[-1]
        good, bad, reach = first + 1, last + 1, stride
        while good < last and bad > last:  # twice as far, again and again, until it is too far
            beyond = min(first + 2 * reach, last)
            good, bad = (beyond, bad) if _off(points[first : beyond + 1], near) <= near else (good, beyond)
            reach = beyond - first
        while bad - good > 1 and bad <= last:
            middle = (good + bad) // 2
            good, bad = (middle, bad) if _off(points[first : middle + 1], near) <= near else (good, middle)
        off, stride = max(off, _off(points[first : good + 1], near)), good - first
        if np.any(points[good] != points[first]):
            chosen.append(good)
        elif good == last:
            break
        else:  # back where it was: what comes next starts there
            chosen[-1] = good
    return np.array(chosen), off


def _off(points: _Points, near: float) -> float:
    """Return how far points are from the line between the first and the last; infinite if they go back along it."""
    along, since = points[-1] - points[0], points - points[0]
    length = float(np.linalg.norm(along))
    fraction = since @ (along / length) if length else np.zeros(len(points))
    if np.max(np.maximum.accumulate(fraction) - fraction) > near:
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
        Whether it runs over the instants of the points, and is near them at each; it then stands still where they do.
        Otherwise it runs from 0 to 1, over about the length of the lines.

    Raises
    ------
    TrajectoryError
        If the lines do not move, or it would take more pieces than are sensible: the message says where.
    """
    if timed:
        knots, points, off, chosen = lines.at, lines.points, 0.0, np.arange(len(lines.at))
    else:
        chosen, off = simplified_polyline(lines.points, TOGETHER * (deviation - lines.own))
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
        distances = np.linalg.norm(difference, axis=1) + off + lines.own
        far = np.unique(np.searchsorted(begins, looks[distances > deviation], side="right") - 1)
        far = far[far < len(begins) - 1]
        if not len(far):
            size = 2 ** int(np.ceil(np.log2(len(begins) - 1)))
            if len(begins) - 1 == size:
                break
            far = np.argsort(-np.diff(begins), kind="stable")[: size - len(begins) + 1]  # few shapes are compiled
        if len(begins) + len(far) - 1 > MOST:
            at = int(np.argmax(distances))
            where = float(np.interp(looks[at], knots, instants))
            word = "s" if lines.kind != "samples" else "t"
            message = (
                f"a path within {deviation:.3g} rad or m of the straight lines between its {lines.kind} would turn too "
                f"often or too sharply to be followed, as at {word} = {where:.6g}{' s' if word == 't' else ''}; "
                "choose a larger deviation, or smooth them"
            )
            raise TrajectoryError(message, name=lines.names[int(np.argmax(np.abs(difference[at])))])
        begins = np.sort(np.append(begins, (begins[far] + begins[far + 1]) / 2))
    powers = local_powers(curve, begins[:-1], DEGREE)
    laws = {name: SmoothPieces(begins[:-1], powers[:, :, k], float(begins[-1])) for k, name in enumerate(lines.names)}
    times = (knots, instants) if lines.kind == "samples" else None
    words = f"within {deviation:.3g} rad or m of the straight lines between {len(lines.at)} {lines.kind}"
    return Path(
        laws, float(knots[0]), float(knots[-1]), float(distances.max()), deviation, words, times, (knots, instants)
    )


def _on(at: np.ndarray, knots: np.ndarray, points: _Points) -> Float[np.ndarray, "sample joint"]:
    """Return places on straight lines."""
    return np.stack([np.interp(at, knots, column) for column in points.T], axis=1)


def _graded(begins: np.ndarray) -> np.ndarray:
    """Halve pieces that are much longer than a neighbor."""
    while True:
        lengths = np.diff(begins)
        adjacent = np.minimum(np.append(lengths[1:], np.inf), np.append(np.inf, lengths[:-1]))
        long = np.flatnonzero(lengths > GRADED * adjacent)
        if not len(long):
            return begins
        begins = np.sort(np.append(begins, (begins[long] + begins[long + 1]) / 2))


def _schoenberg(begins: np.ndarray, knots: np.ndarray, points: _Points) -> Any:
    """Return the spline whose control points lie on straight lines, at the mean of the knots that belong to each."""
    from scipy.interpolate import BSpline  # here, since importing SciPy takes half a second

    whole = np.concatenate([begins[[0] * DEGREE], begins, begins[[-1] * DEGREE]])
    means = np.lib.stride_tricks.sliding_window_view(whole[1:-1], DEGREE).mean(axis=1)
    return BSpline(whole, _on(np.clip(means, knots[0], knots[-1]), knots, points), DEGREE)
