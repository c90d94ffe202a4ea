"""Arrows and paths as numbers: how long each arrow is, where it starts and ends, and the colours along a path."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np

from jounce.reporting.peaks import derivative_unit
from jounce.viewer.take import Exertion, Spot, Take

__all__ = [
    "COLOURS",
    "KINDS",
    "Marked",
    "arrows_of",
    "coloured_path",
    "derivative_colour",
    "force_arrows",
    "force_scale",
    "length_scale",
    "quaternion_to",
    "rounded",
]

LONGEST, LONGEST_FORCE = 0.3, 0.28  # of the longest arrow, in sizes of what moves
COLOURS = {1: (0, 114, 178), 2: (213, 94, 0), 3: (0, 158, 115), 4: (170, 51, 119)}  # velocity to jounce
HIGHER = ((102, 102, 0), (80, 40, 160), (120, 60, 0), (0, 90, 90))
KINDS = {"reaction": (40, 40, 46), "driver": (136, 34, 85), "applied": (60, 110, 40)}
SHORTEST = 1e-3  # in sizes: arrows shorter than this have no direction that can be seen


@dataclasses.dataclass(frozen=True)
class Marked:
    """A point with what is shown of it.

    Parameters
    ----------
    spot : Spot
    orders : tuple of int
        Derivatives that have arrows, from 1.
    path : bool
    """

    spot: Spot
    orders: tuple[int, ...] = (1, 2)
    path: bool = True


def derivative_colour(order: int) -> tuple[int, int, int]:
    """Return the colour of the arrows of a derivative."""
    return COLOURS[order] if order in COLOURS else HIGHER[(order - 5) % len(HIGHER)]


def length_scale(take: Take, marked: Iterable[Marked], order: int) -> float:
    """Return the length of an arrow, m, by unit of the derivative, at which the longest of all is easy to see.

    It is a power of ten times 1, 2 or 5, so that the legend can name it.
    """
    sizes = [np.linalg.norm(take.motion(m.spot)[:, order], axis=-1).max() for m in marked if order in m.orders]
    largest = max(sizes, default=0.0)
    return rounded(LONGEST * take.size / largest) if largest > 0 else 1.0


def rounded(value: float) -> float:
    """Return the largest of 1, 2 or 5 times a power of ten that does not exceed a value.

    Examples
    --------
    >>> [rounded(x) for x in (0.7, 3.0, 12.0)]
    [0.5, 2.0, 10.0]
    """
    power = 10.0 ** np.floor(np.log10(value) + 1e-12)
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1 + 1e-12)) * power)


def arrows_of(take: Take, marked: Iterable[Marked], order: int, scale: float) -> np.ndarray:
    """Return start and end of the arrows of a derivative at all instants, (time, arrows, 2, 3), m.

    Planar arrows are in front of the bodies.
    """
    found = []
    for mark in marked:
        if order in mark.orders:
            motion = take.motion(mark.spot)
            start = motion[:, 0] + in_front(take)
            found.append(np.stack([start, start + scale * motion[:, order]], axis=1))
    return np.stack(found, axis=1) if found else np.zeros((len(take.time), 0, 2, 3))


def in_front(take: Take) -> np.ndarray:
    """Return the shift of what is drawn before the bodies of a planar mechanism, (3,), m."""
    return np.array([0.0, 0.0, take.looks.front])


def long_enough(arrows: np.ndarray, size: float) -> np.ndarray:
    """Return those of some arrows, (arrows, 2, 3), that are long enough to have a direction."""
    length = np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1)
    return arrows[np.isfinite(length) & (length > SHORTEST * size)]


def force_scale(take: Take, exertions: Sequence[Exertion]) -> tuple[float, float]:
    """Return the length of an arrow by N, m, zero where there are no forces, and the largest torque, N m."""
    forces = [np.linalg.norm(e.force, axis=1).max() for e in exertions if e.force is not None]
    torques = [np.linalg.norm(e.torque, axis=1).max() for e in exertions if e.torque is not None]
    largest = max(forces, default=0.0)
    scale = rounded(LONGEST_FORCE * take.size / largest) if largest > 0 else 0.0
    return scale, max(torques, default=0.0)


def force_arrows(take: Take, exertions: Sequence[Exertion], scale: float) -> np.ndarray:
    """Return start and end of force arrows at all instants, (time, arrows, 2, 3), m; they start where they act."""
    found = []
    for exertion in exertions:
        if exertion.force is not None:
            start = exertion.place + in_front(take)
            found.append(np.stack([start, start + scale * exertion.force], axis=1))
    return np.stack(found, axis=1) if found else np.zeros((len(take.time), 0, 2, 3))


def coloured_path(
    take: Take, marked: Iterable[Marked], order: int
) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    """Return the paths of points as short lines, coloured by the size of a derivative.

    Returns
    -------
    lines : array of shape (lines, 2, 3)
        m.
    colours : array of uint8, shape (lines, 2, 3)
        From dark to light.
    extremes : tuple of float
        Sizes that the darkest and the lightest colour stand for.
    """
    import matplotlib as mpl

    places, sizes = [], []
    for mark in marked:
        if mark.path and len(take.time) > 1:
            motion = take.motion(mark.spot)
            places.append(motion[:, 0] + in_front(take))
            sizes.append(np.linalg.norm(motion[:, order], axis=-1))
    if not places:
        return np.zeros((0, 2, 3)), np.zeros((0, 2, 3), np.uint8), (0.0, 0.0)
    low, high = float(min(s.min() for s in sizes)), float(max(s.max() for s in sizes))
    low = 0.0 if low <= 1e-9 * high else low
    span = high - low if high - low > 1e-9 * abs(high) else 1.0
    colours = [(mpl.colormaps["viridis"](0.93 * (s - low) / span)[:, :3] * 255).astype(np.uint8) for s in sizes]
    lines = np.concatenate([np.stack([p[:-1], p[1:]], axis=1) for p in places])
    return lines, np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in colours]), (low, high)


def quaternion_to(direction: np.ndarray) -> np.ndarray:
    """Return the quaternion, scalar part first, that turns z to a direction.

    Examples
    --------
    >>> import numpy as np
    >>> quaternion_to(np.array([0.0, 0.0, 2.0])).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    x, y, z = direction / np.linalg.norm(direction)
    if z < -1 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    found = np.array([1.0 + z, -y, x, 0.0])
    return found / np.linalg.norm(found) + 0.0


def scale_words(scale: float, order: int, size: float) -> str:
    """Say what length stands for what size of a derivative.

    Examples
    --------
    >>> scale_words(0.02, 1, 0.3)
    '0.1 m is 5 m/s'
    """
    length = rounded(0.4 * size)
    return f"{length:g} m is {length / scale:.3g} {derivative_unit('m', order)}"
