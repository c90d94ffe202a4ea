"""Detection of applied forces with a kink or a jump at an operating point, where they cannot be linearized."""

import numpy as np

from jounce.dynamics.statics.independent_coordinates import ROUNDING, Reduction
from jounce.dynamics.statics.variations import sizes_of_forces

STEPS = (1e-4, 1e-6)  # rad or sizes of the mechanism, and as much by s
BENT = 0.1  # share of the difference of slopes that remains at a kink with the shorter step
FAINT = 1e-6  # fraction of the slope: a smaller difference of slopes is rounding
COUNTS = 1e-9  # fraction of the stiffness: a smaller difference of slopes does not matter


def kinked(reduction: Reduction) -> list[str]:
    """Return the names of applied forces whose slopes differ on the two sides of a small motion.

    The difference of the slopes of a smooth law shrinks with the step; that of a kink stays. Each coordinate and each
    velocity is tested.
    """
    point, count = reduction.point, len(reduction.names)
    if not point.equations.system.forces or not count:
        return []
    columns = reduction.changes[:2, :, : 2 * count]  # of positions and velocities
    sizes = np.abs(columns).max(axis=(0, 1), initial=1e-300)
    columns = columns / sizes
    counts = _significant_difference(reduction, sizes)

    def forces(step: float) -> list[np.ndarray]:
        changes = point.changes(columns * step)
        return [np.asarray(x) for x in sizes_of_forces(point.equations, point.coordinates, point.clock, changes)]

    rest_forces, bends = forces(0.0), []
    for step in STEPS:
        pairs = zip(forces(step), rest_forces, forces(-step), strict=True)
        bends.append(
            [(np.abs(a - 2 * b + c) / step, np.maximum(np.abs(a - b), np.abs(b - c)) / step) for a, b, c in pairs]
        )
    names = []
    for group, members, coarse, fine in zip(point.equations.system.forces, point.model.forces, *bends, strict=True):
        lever = point.model.length if group.element.unit == "N" else 1.0
        slope = fine[1].max(axis=2, keepdims=True)  # the steepest, which multiplies rounding of positions
        bent = (fine[0] > BENT * coarse[0]) & (fine[0] > FAINT * slope) & (fine[0] * lever > counts)
        # a difference that grows as the step shrinks is a jump, or rounding if it is small
        bent &= (fine[0] < coarse[0] / BENT) | (fine[0] * STEPS[1] * lever > COUNTS * np.abs(point.loads).max())
        has_kink = (bent | ~np.isfinite(fine[0])).any(axis=(0, 2))
        names += [name for name, is_kinked in zip(members, has_kink, strict=True) if is_kinked]
    return names


def _significant_difference(reduction: Reduction, sizes: np.ndarray) -> np.ndarray:
    """Return the least difference of slopes that matters for stiffness and damping, N m and N m s, for each lane."""
    count = len(reduction.names)
    stiffness, mass = (
        float(np.max(np.diag(reduction.noise(level)) / ROUNDING / sizes[:count] ** 2, initial=1e-300))
        for level in (0, 2)
    )
    return COUNTS * np.repeat([stiffness, np.sqrt(stiffness * mass)], count)
