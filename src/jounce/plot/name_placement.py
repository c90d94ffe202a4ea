"""Names put near what they belong to, where they cover neither each other nor, as far as can be, the drawing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from jounce.plot.style import printable, shown_name

__all__ = ["place_names"]

DIRECTIONS = 16
DISTANCES = (1.7, 2.6, 3.8, 5.5, 8.0)  # of the nearest edge of a name, in units of the drawing
LEADER = 3.0  # units, from which on a thin line leads from a name to its place


def place_names(
    figure: Any,
    axes: Any,
    labels: Sequence[Any],
    instant: int,
    obstacles: Sequence[np.ndarray],
    unit: float,
    still: bool = True,
) -> list[tuple[Any, Any]]:
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
    still : bool, default True
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
    frame = axes.get_window_extent(renderer)
    boxes: list[np.ndarray] = [_box(text.get_window_extent(renderer)) for text in axes.texts]
    texts = []
    for label in labels:
        place = label.anchor[min(instant, len(label.anchor) - 1)]
        if not np.isfinite(place).all():
            continue
        text = axes.text(*place, shown_name(label.text), color=label.colour, fontsize=8, ha="center", va="center")
        text.set(zorder=9, path_effects=[withStroke(linewidth=1.8, foreground="white")])
        text.set_gid(printable(f"name.{label.owner}"))
        if label.owner.startswith("bodies."):
            text.set_fontweight("bold")
        extent = text.get_window_extent(renderer)
        half = np.array([extent.width, extent.height]) / 2 + 1.0
        center, distance = _best(to_pixels(place), half, pixels, taken, boxes, frame)
        boxes.append(np.array([*(center - half), *(center + half)]))
        at = axes.transData.inverted().transform(center)
        text.set_position(at)
        texts.append((label, text))
        if distance > LEADER and still:
            axes.plot([place[0], at[0]], [place[1], at[1]], color=label.colour, linewidth=0.5, alpha=0.6, zorder=5.5)
    return texts


def _best(
    place: np.ndarray, half: np.ndarray, pixels: float, taken: np.ndarray, boxes: list[np.ndarray], frame: Any
) -> tuple[np.ndarray, float]:
    """Return the centre of a name in pixels, and how far it is from its place in units, by the least cost."""
    best, found = np.inf, (place, 0.0)
    for distance in DISTANCES:
        for k in range(DIRECTIONS):
            angle = 2 * np.pi * (k + 1) / DIRECTIONS
            way = np.array([np.cos(angle), np.sin(angle)])
            reach = min(h / max(abs(w), 1e-9) for h, w in zip(half, way, strict=True))
            center = place + way * (distance * pixels + min(reach, half.max()))
            low, high = center - half, center + half
            covered = np.sum(np.all((taken > low - 1.5) & (taken < high + 1.5), axis=1))
            clash = sum(
                max(0.0, min(high[0], b[2]) - max(low[0], b[0])) * max(0.0, min(high[1], b[3]) - max(low[1], b[1]))
                for b in boxes
            )
            outside = np.sum(
                np.maximum(0.0, [frame.x0 - low[0], frame.y0 - low[1], high[0] - frame.x1, high[1] - frame.y1])
            )
            cost = 3.0 * distance + 1.5 * covered + 4.0 * clash + 5.0 * outside
            if cost < best:
                best, found = cost, (center, distance)
    return found


def _box(extent: Any) -> np.ndarray:
    return np.array([extent.x0, extent.y0, extent.x1, extent.y1])


def _along(corners: np.ndarray, step: float = 4.0) -> np.ndarray:
    """Return places along a line of corners, no farther apart than some pixels."""
    parts = [corners[:1]]
    for first, second in pairwise(corners):
        count = min(500, 1 + int(np.linalg.norm(second - first) / step))
        parts.append(first + (second - first) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(parts)
