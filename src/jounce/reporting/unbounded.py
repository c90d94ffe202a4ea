"""Outputs that grow without bound toward the change points of a motion, for which a largest value is meaningless.

A motion passes a change point smoothly, but quantities computed from the factored Jacobian, such as reactions, can have
a pole at it.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from jounce.kinematics import ChunkedMotion, Motion, solve
from jounce.mechanism import AbstractMotionOutput

DISTANCES = 4.0 ** -np.arange(5, 9)  # distances from a change point, in radii of the Taylor series
POLE = 3.0  # least growth of a pole from one distance to the next; a pole of first order grows fourfold
LIKENESS = 0.05  # relative tolerance of the growth


def unbounded_outputs(motion: Motion | ChunkedMotion) -> dict[str, list[float]]:
    """Return the outputs that grow without bound toward change points of a motion, with the instants, s.

    Parameters
    ----------
    motion : Motion or ChunkedMotion
        The solved motion, which is solved again near its change points.
    """
    first, last = float(motion.time[0]), float(motion.time[-1])
    points = [point for point in motion.passages if first <= point.instant <= last]
    forces = {n: x for n, x in motion.mechanism.outputs.items() if isinstance(x, AbstractMotionOutput)}
    if not points or not forces:
        return {}
    sides = np.array([[p.instant + side * p.radius * DISTANCES for side in (-1, 1)] for p in points])
    inside = (sides >= first) & (sides <= last)
    instants = np.unique(np.append(sides[inside], (first, last)))  # the whole motion, to stay on its branch
    # order 0, as derivatives lose all digits so near to a change point, and have the same poles
    near = solve(dataclasses.replace(motion.mechanism, outputs=forces), instants, order=0, strict=False)
    indices = np.searchsorted(instants, np.where(inside, sides, first))
    unbounded: dict[str, list[float]] = {}
    for name, values in near.outputs.items():
        sizes = np.abs(values[:, 0].reshape(len(instants), -1))[indices]
        grows = (inside.all(axis=-1) & _poles(sizes)).any(axis=-1)
        if grows.any():
            unbounded[name] = [points[k].instant for k in np.flatnonzero(grows)]
    return unbounded


def _poles(sizes: Float[np.ndarray, "point side distance component"]) -> Bool[np.ndarray, "point side"]:
    """Return whether a magnitude grows like a pole: by the same factor from each distance to the next."""
    with np.errstate(invalid="ignore", divide="ignore"):
        growth = sizes[:, :, 1:] / sizes[:, :, :-1]
        are_constant = np.abs(growth / growth[:, :, -1:] - 1.0) < LIKENESS
    return np.any(((growth > POLE) & are_constant).all(axis=2), axis=-1)
