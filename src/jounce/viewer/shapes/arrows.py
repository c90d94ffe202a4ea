"""Arrows and paths as numbers: how long each arrow is, where it starts and ends, and the colors along a path."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float, UInt8

from jounce.plot.labels import rounded_down
from jounce.units.shown_units import derivative_unit
from jounce.viewer.shapes.appearance import BodyPoint, Color
from jounce.viewer.shapes.recording import Load, Recording, Vectors

LONGEST, LONGEST_FORCE = 0.3, 0.28  # of the longest arrow, in sizes of what moves
COLORS = {1: (0, 114, 178), 2: (213, 94, 0), 3: (0, 158, 115), 4: (170, 51, 119)}  # velocity to jounce
HIGHER = ((102, 102, 0), (80, 40, 160), (120, 60, 0), (0, 90, 90))
LOAD_COLORS = {"reaction": (40, 40, 46), "driver": (136, 34, 85), "applied": (60, 110, 40)}
LOAD_WORDS = {"reaction": "reactions of joints", "driver": "forces of drivers", "applied": "applied forces"}
SHORTEST = 1e-3  # in sizes: arrows shorter than this have no direction that can be seen

Arrows = Float[np.ndarray, "time arrows 2 3"]
"""Start and end of arrows at all instants, m."""


@dataclasses.dataclass(frozen=True)
class TracedPoint:
    """A point with the arrows and the path that are shown of it.

    Parameters
    ----------
    point : BodyPoint
    orders : tuple of int
        Derivatives that have arrows, from 1.
    path : bool
    """

    point: BodyPoint
    orders: tuple[int, ...] = (1, 2)
    path: bool = True


def derivative_color(order: int) -> Color:
    """Return the color of the arrows of a derivative."""
    return COLORS[order] if order in COLORS else HIGHER[(order - 5) % len(HIGHER)]


def length_scale(recording: Recording, vectors: Iterable[Vectors], share: float = LONGEST) -> float:
    """Return the length of an arrow, m, by unit of vectors, at which the longest of all is easy to see.

    It is a power of ten times 1, 2 or 5, so that the legend can name it; zero where all vectors vanish.
    """
    largest = max((float(np.linalg.norm(vector, axis=-1).max()) for vector in vectors), default=0.0)
    return rounded_down(share * recording.size / largest) if largest > 0 else 0.0


def load_scale(recording: Recording, loads: Sequence[Load]) -> tuple[float, float]:
    """Return the length of an arrow by N, m, zero where there are no forces, and the largest torque, N m."""
    torques = [float(np.linalg.norm(load.torque, axis=1).max()) for load in loads if load.torque is not None]
    forces = (load.force for load in loads if load.force is not None)
    return length_scale(recording, forces, LONGEST_FORCE), max(torques, default=0.0)


def arrows_along(recording: Recording, pairs: Sequence[tuple[Vectors, Vectors]], scale: float) -> Arrows:
    """Return arrows from places along vectors, drawn to a scale; planar ones are in front of the bodies."""
    if not pairs:
        return np.zeros((len(recording.time), 0, 2, 3))
    start, vector = (np.stack(part, axis=1) for part in zip(*pairs, strict=True))
    start = start + in_front(recording)
    return np.stack([start, start + scale * vector], axis=2)


def in_front(recording: Recording) -> Float[np.ndarray, "3"]:
    """Return the shift of what is drawn before the bodies of a planar mechanism, m."""
    return np.array([0.0, 0.0, recording.appearance.front])


def long_enough(arrows: Float[np.ndarray, "arrows 2 3"], size: float) -> Float[np.ndarray, "long 2 3"]:
    """Return those of some arrows that are long enough to have a direction."""
    length = np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1)
    return arrows[np.isfinite(length) & (length > SHORTEST * size)]


def colored_paths(
    recording: Recording, traced: Iterable[TracedPoint], order: int
) -> tuple[Float[np.ndarray, "lines 2 3"], UInt8[np.ndarray, "lines 2 3"], tuple[float, float]]:
    """Return the paths of points as short lines, colored by the size of a derivative.

    Returns
    -------
    lines : numpy.ndarray of shape (lines, 2, 3)
        m.
    colors : numpy.ndarray of uint8, shape (lines, 2, 3)
        From dark to light.
    extremes : tuple of float
        Sizes that the darkest and the lightest color stand for, of which the first is zero.
    """
    motions = [recording.motion(each.point) for each in traced if each.path and len(recording.time) > 1]
    if not motions:
        return np.zeros((0, 2, 3)), np.zeros((0, 2, 3), np.uint8), (0.0, 0.0)
    points = np.stack([motion[:, 0] for motion in motions]) + in_front(recording)
    sizes = np.linalg.norm([motion[:, order] for motion in motions], axis=-1)
    most = float(sizes.max())
    colors = path_colors(sizes / (most or 1.0))
    lines, ends = (np.stack([x[:, :-1], x[:, 1:]], axis=2).reshape(-1, 2, 3) for x in (points, colors))
    return lines, ends, (0.0, most)


def path_colors(share: Float[np.ndarray, "*batch"]) -> UInt8[np.ndarray, "*batch 3"]:
    """Return the colors of a path where a size has a share, from 0 to 1, of its range."""
    import matplotlib as mpl

    return (mpl.colormaps["viridis"](0.93 * share)[..., :3] * 255).astype(np.uint8)


def scale_words(scale: float, order: int, size: float) -> str:
    """Say what length stands for what size of a derivative.

    Examples
    --------
    >>> scale_words(0.02, 1, 0.3)
    '0.1 m is 5 m/s'
    """
    length = rounded_down(0.4 * size)
    return f"{length:g} m is {length / scale:.3g} {derivative_unit('m', order)}"
