"""Applied forces that have a kink or a jump where a mechanism is: no linear law stands for them there."""

import numpy as np
from jaxtyping import Bool

from jounce.dynamics.reduction import Reduction
from jounce.dynamics.variations import sizes_of_forces

STEPS = (1e-4, 1e-6)  # rad or sizes of the mechanism, and as much by s
BENT = 0.1  # of the larger step: where slopes still differ by so much over a step a hundred times shorter
FAINT = 1e-6  # of the slope: a difference of slopes that is smaller is rounding


def kinked(reduction: Reduction) -> list[str]:
    """Return the names of applied forces whose slopes differ on the two sides of a small motion.

    A smooth law bends less the shorter the step is; a kink stays. Each coordinate and each velocity is looked at.
    """
    place, count = reduction.place, len(reduction.names)
    if not place.equations.system.forces or not count:
        return []
    lanes = slice(0, 2 * count)  # of positions and velocities
    columns = reduction.changes[:2, :, lanes]
    columns = columns / np.abs(columns).max(axis=(0, 1), initial=1e-300)
    arguments = place.equations, place.coordinates, place.clock

    def sizes(step: float) -> list[np.ndarray]:
        return [np.asarray(x) for x in sizes_of_forces(*arguments, place.changes(columns * step))]

    still = sizes(0.0)
    found: list[Bool[np.ndarray, " instance"]] = []
    bends = []
    for step in STEPS:
        pairs = zip(sizes(step), still, sizes(-step), strict=True)
        bends.append(
            [(np.abs(a - 2 * b + c) / step, np.maximum(np.abs(a - b), np.abs(b - c)) / step) for a, b, c in pairs]
        )
    for large, small, value in zip(*bends, still, strict=True):
        slope = small[1].max(axis=2, keepdims=True)  # the steepest: what rounding of the place costs follows from it
        rounding = 64 * np.finfo(float).eps * np.abs(value) / STEPS[1]
        bad = (small[0] > BENT * large[0]) & (small[0] > FAINT * slope + rounding)
        found.append((bad | ~np.isfinite(small[0])).any(axis=(0, 2)))
    names = place.model.forces
    return [
        name
        for members, bad in zip(names, found, strict=True)
        for name, is_bad in zip(members, bad, strict=True)
        if is_bad
    ]
