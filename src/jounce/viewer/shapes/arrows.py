"""Arrows and paths as arrays: scales, starts and ends of arrows, and colors along paths."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float, UInt8

from jounce.plot.labels import rounded_down
from jounce.units.shown_units import derivative_unit
from jounce.viewer.shapes.appearance import BodyPoint, Color
from jounce.viewer.shapes.recording import Load, Recording, Vectors

LONGEST, LONGEST_FORCE = 0.3, 0.28  # of the longest arrow, in sizes of the recording
COLORS = {1: (0, 114, 178), 2: (213, 94, 0), 3: (0, 158, 115), 4: (170, 51, 119)}  # velocity to jounce
HIGHER = ((102, 102, 0), (80, 40, 160), (120, 60, 0), (0, 90, 90))
LOAD_COLORS = {"reaction": (40, 40, 46), "driver": (136, 34, 85), "applied": (60, 110, 40)}
LOAD_WORDS = {"reaction": "reactions of joints", "driver": "forces of drivers", "applied": "applied forces"}
SHORTEST = 1e-3  # in sizes: shorter arrows have no visible direction

Arrows = Float[np.ndarray, "time arrows 2 3"]
"""Start and end of arrows at all instants, m."""


@dataclasses.dataclass(frozen=True)
class TracedPoint:
    """A point with its shown arrows and path.

    Parameters
    ----------
    point : BodyPoint
    orders : tuple of int
        Derivatives with arrows, from 1.
    path : bool
    """

    point: BodyPoint
    orders: tuple[int, ...] = (1, 2)
    path: bool = True


def derivative_color(order: int) -> Color:
    """Return the color of the arrows of a derivative."""
    return COLORS[order] if order in COLORS else HIGHER[(order - 5) % len(HIGHER)]


def length_scale(recording: Recording, vectors: Iterable[Vectors], share: float = LONGEST) -> float:
    """Return the length of an arrow per unit of vectors, m, at which the longest arrow is easy to see.

    It is a power of ten times 1, 2 or 5, for the legend; zero if all vectors vanish.
    """
    largest = max((float(np.linalg.norm(vector, axis=-1).max()) for vector in vectors), default=0.0)
    return rounded_down(share * recording.size / largest) if largest > 0 else 0.0


def load_scale(recording: Recording, loads: Sequence[Load]) -> tuple[float, float]:
    """Return the length of an arrow per N, m, zero without forces, and the largest torque, N m."""
    torques = [float(np.linalg.norm(load.torque, axis=1).max()) for load in loads if load.torque is not None]
    forces = (load.force for load in loads if load.force is not None)
    return length_scale(recording, forces, LONGEST_FORCE), max(torques, default=0.0)


def arrows_along(recording: Recording, pairs: Sequence[tuple[Vectors, Vectors]], scale: float) -> Arrows:
    """Return arrows from positions along vectors, to a scale; planar ones are in front of the bodies."""
    if not pairs:
        return np.zeros((len(recording.time), 0, 2, 3))
    start, vector = (np.stack(part, axis=1) for part in zip(*pairs, strict=True))
    start = start + in_front(recording)
    return np.stack([start, start + scale * vector], axis=2)


def in_front(recording: Recording) -> Float[np.ndarray, "3"]:
    """Return the displacement to the front of the bodies of a planar mechanism, m."""
    return np.array([0.0, 0.0, recording.appearance.front])


def long_enough(arrows: Float[np.ndarray, "arrows 2 3"], size: float) -> Float[np.ndarray, "long 2 3"]:
    """Return the arrows that are long enough for a visible direction."""
    length = np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1)
    return arrows[np.isfinite(length) & (length > SHORTEST * size)]


def colored_paths(
    recording: Recording, traced: Iterable[TracedPoint], order: int
) -> tuple[Float[np.ndarray, "lines 2 3"], UInt8[np.ndarray, "lines 2 3"], tuple[float, float]]:
    """Return the paths of points as short lines, colored by the magnitude of a derivative.

    Returns
    -------
    lines : numpy.ndarray of shape (lines, 2, 3)
        Lines, m.
    colors : numpy.ndarray of uint8, shape (lines, 2, 3)
        Colors, from dark to light.
    extremes : tuple of float
        Magnitudes of the darkest color, zero, and of the lightest color.
    """
    motions = [recording.motion(trace.point) for trace in traced if trace.path and len(recording.time) > 1]
    if not motions:
        return np.zeros((0, 2, 3)), np.zeros((0, 2, 3), np.uint8), (0.0, 0.0)
    points = np.stack([motion[:, 0] for motion in motions]) + in_front(recording)
    sizes = np.linalg.norm([motion[:, order] for motion in motions], axis=-1)
    largest = float(sizes.max())
    colors = path_colors(sizes / (largest or 1.0))
    lines, ends = (np.stack([x[:, :-1], x[:, 1:]], axis=2).reshape(-1, 2, 3) for x in (points, colors))
    return lines, ends, (0.0, largest)


def path_colors(fraction: Float[np.ndarray, "*batch"]) -> UInt8[np.ndarray, "*batch 3"]:
    """Return the colors of a path for fractions, from 0 to 1, of the range of a magnitude."""
    import matplotlib as mpl

    return (mpl.colormaps["viridis"](0.93 * fraction)[..., :3] * 255).astype(np.uint8)


def scale_words(scale: float, order: int, size: float) -> str:
    """Return the scale of arrows of a derivative in words.

    Examples
    --------
    >>> scale_words(0.02, 1, 0.3)
    '0.1 m is 5 m/s'
    """
    length = rounded_down(0.4 * size)
    return f"{length:g} m is {length / scale:.3g} {derivative_unit('m', order)}"
