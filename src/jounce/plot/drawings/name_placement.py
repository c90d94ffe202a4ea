"""Placement of names near their anchors, where they do not cover each other and, if possible, not the drawing."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.plot.drawings.drawing import SYMBOLS, WHEELS, Label
from jounce.plot.drawings.scene import Scene, outline

DIRECTIONS = 16
DISTANCES = (1.7, 2.6, 3.8, 5.5, 8.0)  # of the nearest edge of a name, in units of the drawing
LEADER = 3.0  # units: names farther from their anchor have a leader line
SPACING = 4.0  # pixels between the points along a line that a name should not cover
MOST_INSTANTS = 9  # instants at which the names of moving elements are tried
COST_OF_DISTANCE, COST_OF_BAR, COST_OF_SYMBOL = 3.0, 1.5, 4.0  # per unit, per covered point of a bar, of a symbol
COST_OF_OVERLAP, COST_OF_EDGE, COST_OF_STRANGER = 4.0, 5.0, 30.0  # per pixel of area, per pixel outside, if ambiguous

Pixels = Float[np.ndarray, "2"]
Points = Float[np.ndarray, "points 2"]
Boxes = Float[np.ndarray, "boxes 4"]


@dataclasses.dataclass(frozen=True)
class NamePlace:
    """Position of a name relative to its anchor.

    Parameters
    ----------
    direction : tuple of float
        Unit vector from the anchor to the center of the name, upward positive.
    distance : float
        Distance from the anchor to the edge of the name, in units of the drawing.
    led : bool
        Whether the name has a leader line: if it is far, or nearer to the anchor of another name at some instant.
    """

    direction: tuple[float, float]
    distance: float
    led: bool

    def offset(self, half: Pixels, unit: float) -> Pixels:
        """Return the vector from the anchor to the center of the name, pixels, from half its size and the unit."""
        return _offsets(np.array([self.direction]), np.array([self.distance]), half, unit)[0]


def place_names(
    labels: Sequence[Label],
    halves: Sequence[Pixels],
    scene: Scene,
    to_pixels: Callable[[np.ndarray], np.ndarray],
    frame: Float[np.ndarray, "4"],
    taken: Boxes,
) -> list[NamePlace | None]:
    """Return the place of each name for all instants of a scene.

    Names are placed one after the other, each where the sum of its costs over some instants is least: its distance, the
    parts of the drawing and other names that it covers, and anchors of other names that are nearer than its own.

    Parameters
    ----------
    labels : sequence of Label
        Names with their anchors.
    halves : sequence of numpy.ndarray of shape (2,)
        Half the width and half the height of each name, pixels.
    scene : Scene
        The drawn scene.
    to_pixels : callable
        Function from points of the scene, (..., 2), m, to pixels, upward positive.
    frame : numpy.ndarray of shape (4,)
        Left, lower, right and upper end of the drawing, pixels.
    taken : numpy.ndarray of shape (boxes, 4)
        Boxes of other texts.

    Returns
    -------
    list of NamePlace
        Place of each name; None if its anchor is unknown at all instants.
    """
    unit = float(np.diff(to_pixels(np.array([[0.0, 0.0], [scene.unit, 0.0]])), axis=0)[0, 0])
    instants = _spread(max((len(label.anchor) for label in labels), default=1))
    drawn = [_drawn(scene, instant, to_pixels) for instant in instants.tolist()]
    anchors = np.array([to_pixels(_at(label.anchor, instants)) for label in labels]).reshape(-1, len(instants), 2)
    boxes = [taken for _ in instants]
    placements: list[NamePlace | None] = []
    angle = 2 * np.pi * np.arange(1, DIRECTIONS + 1) / DIRECTIONS
    directions = np.tile(np.stack([np.cos(angle), np.sin(angle)], axis=1), (len(DISTANCES), 1))
    distances = np.repeat(DISTANCES, DIRECTIONS)
    for number, half in enumerate(halves):
        offsets = _offsets(directions, distances, half, unit)
        finite = [k for k in range(len(instants)) if np.isfinite(anchors[number, k]).all()]
        if not finite:
            placements.append(None)
            continue
        cost = COST_OF_DISTANCE * distances
        for k in finite:
            anchor, others = anchors[number, k], np.delete(anchors[:, k], number, axis=0)
            cost = cost + _costs(anchor, offsets, half, *drawn[k], boxes[k], others, frame) / len(finite)
        best = int(np.argmin(cost))
        doubtful = False
        for k in finite:
            anchor, center = anchors[number, k], anchors[number, k] + offsets[best]
            box = np.concatenate([center - half, center + half])
            boxes[k] = np.vstack([boxes[k], box])
            doubtful = doubtful or bool(_is_nearer_to_others(box[None, :2], box[None, 2:], anchor, anchors[:, k])[0])
        direction, distance = (float(directions[best, 0]), float(directions[best, 1])), float(distances[best])
        placements.append(NamePlace(direction, distance, distance > LEADER or doubtful))
    return placements


def _spread(count: int) -> Int[np.ndarray, " instants"]:
    return np.unique(np.linspace(0, count - 1, min(count, MOST_INSTANTS)).round().astype(int))


def _at(points: np.ndarray, instants: Int[np.ndarray, " instants"]) -> np.ndarray:
    return points[np.minimum(instants, len(points) - 1)]


def _offsets(
    directions: Float[np.ndarray, "candidate 2"],
    distances: Float[np.ndarray, " candidate"],
    half: Pixels,
    unit: float,
) -> Float[np.ndarray, "candidate 2"]:
    """Return the vectors from an anchor to centers of a name, for distances of its edge from the anchor."""
    reach = np.minimum((half / np.maximum(np.abs(directions), 1e-9)).min(axis=1), half.max())
    return directions * (distances * unit + reach)[:, None]


def _drawn(
    scene: Scene, instant: int, to_pixels: Callable[[np.ndarray], np.ndarray]
) -> tuple[Points, Float[np.ndarray, " points"]]:
    """Return points along all drawn lines, pixels, and the cost of covering each."""
    points, costs = [np.zeros((0, 2))], [np.zeros(0)]
    for shape in scene.shapes:
        corners = outline(shape, instant)
        if shape.layer > WHEELS and len(corners) and np.isfinite(corners).all():
            covered = _along(to_pixels(corners))
            points.append(covered)
            costs.append(np.full(len(covered), COST_OF_SYMBOL if shape.layer >= SYMBOLS else COST_OF_BAR))
    return np.concatenate(points), np.concatenate(costs)


def _costs(
    anchor: Pixels,
    offsets: Float[np.ndarray, "candidate 2"],
    half: Pixels,
    drawn: Points,
    weights: Float[np.ndarray, " points"],
    boxes: Boxes,
    others: Points,
    frame: Float[np.ndarray, "4"],
) -> Float[np.ndarray, " candidate"]:
    """Return the costs of the candidate places of a name at one instant, without those of distance."""
    reach = np.abs(offsets).max(axis=0) + half + 2.0
    is_near = (np.abs(drawn - anchor) < reach).all(axis=1)
    low, high = anchor + offsets - half, anchor + offsets + half
    points = drawn[is_near]
    inside = ((points > low[:, None] - 1.5) & (points < high[:, None] + 1.5)).all(axis=2)
    overlap = np.minimum(high[:, None], boxes[:, 2:]) - np.maximum(low[:, None], boxes[:, :2])
    clash = np.maximum(0.0, overlap).prod(axis=2).sum(axis=1)
    outside = (np.maximum(0.0, frame[:2] - low) + np.maximum(0.0, high - frame[2:])).sum(axis=1)
    covered = inside @ weights[is_near]
    ambiguity = COST_OF_STRANGER * _is_nearer_to_others(low, high, anchor, others)
    return covered + COST_OF_OVERLAP * clash + COST_OF_EDGE * outside + ambiguity


def _is_nearer_to_others(
    low: np.ndarray, high: np.ndarray, anchor: Pixels, anchors: Points
) -> Bool[np.ndarray, " candidate"]:
    """Return the mask of boxes nearer to another anchor than to their own, whose names would be ambiguous."""
    others = anchors[np.linalg.norm(anchors - anchor, axis=1) > 2.0]  # a joint and its body may share an anchor
    return np.any(_gap(low, high, others) <= _gap(low, high, anchor[None]) + 1.0, axis=1)


def _gap(low: np.ndarray, high: np.ndarray, points: Points) -> Float[np.ndarray, "candidate points"]:
    """Return the distances of points from boxes, pixels."""
    return np.linalg.norm(np.maximum(0.0, np.maximum(low[:, None] - points, points - high[:, None])), axis=2)


def _along(corners: Points) -> Points:
    """Return points along a polyline, at most `SPACING` pixels apart."""
    parts = [corners[:1]]
    for first, second in pairwise(corners):
        count = min(500, 1 + int(np.linalg.norm(second - first) / SPACING))
        parts.append(first + (second - first) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(parts)
