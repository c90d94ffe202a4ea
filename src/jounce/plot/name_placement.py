"""Names put near what they belong to, where they cover neither each other nor, as far as can be, the drawing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.plot.drawing import Label
from jounce.plot.style import printable, shown_name

__all__ = ["place_names"]

DIRECTIONS = 16
DISTANCES = (1.7, 2.6, 3.8, 5.5, 8.0)  # of the nearest edge of a name, in units of the drawing
Pixels = Float[np.ndarray, "2"]
Points = Float[np.ndarray, "points 2"]
Boxes = Float[np.ndarray, "boxes 4"]
LEADER = 3.0  # units, from which on a thin line leads from a name to its place


def place_names(
    figure: Any,
    axes: Any,
    labels: Sequence[Label],
    instant: int,
    obstacles: Sequence[Points],
    unit: float,
    fixed: bool = True,
) -> list[tuple[Label, Any]]:
    """Write names of a scene; each takes the free place that is nearest.

    Parameters
    ----------
    figure, axes : matplotlib objects
        Their limits are final.
    labels : sequence of Label
        What is written.
    instant : int
        Index of the instant.
    obstacles : sequence of numpy.ndarray of shape (n, 2)
        Corners of the lines that should stay free.
    unit : float
        Of the drawing, m.
    fixed : bool, default True
        Whether the drawing stays so, and lines may lead from names to their places.

    Returns
    -------
    list of tuple
        Each label with its matplotlib text.
    """
    from matplotlib.patheffects import withStroke

    figure.draw_without_rendering()  # sets the places of all panels
    renderer = figure.canvas.get_renderer()
    to_pixels = axes.transData.transform
    points = [_along(to_pixels(corners)) for corners in obstacles if len(corners) and np.isfinite(corners).all()]
    taken = np.concatenate(points) if points else np.zeros((0, 2))
    pixels = float(np.diff(to_pixels([[0.0, 0.0], [unit, 0.0]]), axis=0)[0, 0])
    frame = _box(axes, renderer)
    boxes = np.array([_box(text, renderer) for text in axes.texts]).reshape(-1, 4)
    texts = []
    for label in labels:
        anchor = label.anchor[min(instant, len(label.anchor) - 1)]
        if not np.isfinite(anchor).all():
            continue
        text = axes.text(*anchor, shown_name(label.text), color=label.color, fontsize=8, ha="center", va="center")
        text.set(zorder=9, path_effects=[withStroke(linewidth=1.8, foreground="white")])
        text.set_gid(printable(f"name.{label.owner}"))
        if label.owner.startswith("bodies."):
            text.set_fontweight("bold")
        edges = _box(text, renderer)
        half = (edges[2:] - edges[:2]) / 2 + 1.0
        center, distance = _best(to_pixels(anchor), half, pixels, taken, boxes, frame)
        boxes = np.vstack([boxes, [*(center - half), *(center + half)]])
        at = axes.transData.inverted().transform(center)
        text.set_position(at)
        texts.append((label, text))
        if distance > LEADER and fixed:
            axes.plot([anchor[0], at[0]], [anchor[1], at[1]], color=label.color, linewidth=0.5, alpha=0.6, zorder=5.5)
    return texts


def _best(
    anchor: Pixels, half: Pixels, pixels: float, taken: Points, boxes: Boxes, frame: Float[np.ndarray, "4"]
) -> tuple[Pixels, float]:
    """Return the center of a name in pixels, and how far it is from its place in units, by the least cost."""
    angle = 2 * np.pi * np.arange(1, DIRECTIONS + 1) / DIRECTIONS
    directions = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    reach = np.minimum((half / np.maximum(np.abs(directions), 1e-9)).min(axis=1), half.max())  # to the edge of the name
    distance = np.repeat(DISTANCES, DIRECTIONS)
    center = (
        anchor
        + np.tile(directions, (len(DISTANCES), 1)) * (distance * pixels + np.tile(reach, len(DISTANCES)))[:, None]
    )
    low, high = center - half, center + half
    covered = ((taken > low[:, None] - 1.5) & (taken < high[:, None] + 1.5)).all(axis=2).sum(axis=1)
    overlap = np.minimum(high[:, None], boxes[:, 2:]) - np.maximum(low[:, None], boxes[:, :2])
    clash = np.maximum(0.0, overlap).prod(axis=2).sum(axis=1)
    outside = (np.maximum(0.0, frame[:2] - low) + np.maximum(0.0, high - frame[2:])).sum(axis=1)
    best = int(np.argmin(3.0 * distance + 1.5 * covered + 4.0 * clash + 5.0 * outside))
    return center[best], float(distance[best])


def _box(artist: Any, renderer: Any) -> Float[np.ndarray, "4"]:
    """Return left, lower, right and upper edge of what is drawn, in pixels."""
    return artist.get_window_extent(renderer).extents


def _along(corners: Points, step: float = 4.0) -> Points:
    """Return places along a line of corners, no farther apart than some pixels."""
    parts = [corners[:1]]
    for first, second in pairwise(corners):
        count = min(500, 1 + int(np.linalg.norm(second - first) / step))
        parts.append(first + (second - first) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(parts)
