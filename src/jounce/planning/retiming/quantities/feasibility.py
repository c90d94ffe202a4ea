"""Whether a path has a fastest motion: what stands still keeps its limits, and what moves has one."""

import numpy as np
from jaxtyping import Float

from jounce.errors import TrajectoryError
from jounce.planning.retiming.quantities.path_quantities import G, Labels, PathQuantities, Source

POINTS = 1001  # places on the path
SIDE_OFFSET = 1e-12  # of the path: both sides of where a load changes
STATIC = 1e-6  # of a limit, which what stands still must leave
IDLE = 1e-9  # of its largest value: what moves by less does not move


def check_possible(source: Source, labels: Labels, start: float, stop: float, *, bounded: bool = False) -> None:
    """Raise TrajectoryError if standing still exceeds a limit, or if no quantity with a limit changes."""
    near = SIDE_OFFSET * (stop - start) * np.array([-1.0, 1.0])
    even = np.linspace(start, stop, POINTS)
    s = np.union1d(even, (source.changes[:, None] + near).reshape(-1))
    quantities = source(s)
    at_rest = quantities.second[:, :, G]
    spare = np.minimum(_relative_margin(quantities.upper, at_rest), _relative_margin(-quantities.lower, -at_rest))
    if spare.size and spare.min() <= STATIC:
        at, column = np.unravel_index(np.argmin(spare), spare.shape)
        label, value = labels.second[column], float(at_rest[at, column])
        limit = float((quantities.upper if value > 0 else quantities.lower)[at, column])
        where = source.location(float(s[at]))
        message = (
            f"the path cannot be stopped everywhere: at {where} standing still requires a {label.word} of {value:.6g} "
            f"{label.unit}, and the limit is {limit:.6g} {label.unit}; motions that pass only by momentum are not "
            "supported; choose another path, or a smaller load"
        )
        raise TrajectoryError(message, name=label.owner)
    if bounded:
        return
    moving = _moving(quantities, rates=True)[np.isin(s, even)]
    idle = moving < IDLE
    stops = np.flatnonzero(idle[1:] & idle[:-1])  # at one place alone the motion may stop
    if len(stops):
        where = source.location(float(even[stops[0]]))
        message = f"nothing with a limit moves at {where}, so that there is no fastest law; give more limits"
        raise TrajectoryError(message, name="limits")


@np.errstate(invalid="ignore")
def _relative_margin(bound: np.ndarray, at_rest: np.ndarray) -> np.ndarray:
    """Return what is left up to an upper bound, as a share of the larger of both; infinite where there is none."""
    size = np.maximum(np.maximum(np.abs(bound), np.abs(at_rest)), np.finfo(float).tiny)
    return np.where(np.isfinite(bound), (bound - at_rest) / size, np.inf)


def bounded_everywhere(source: Source, start: float, stop: float) -> bool:
    """Return whether something with a limit of velocity, acceleration or force moves on the whole path."""
    return bool((_moving(source(np.linspace(start, stop, POINTS)), rates=False) >= IDLE).all())


def _moving(quantities: PathQuantities, *, rates: bool) -> Float[np.ndarray, " point"]:
    """Return how much moves of what has a limit, as a share of its largest value."""
    limited = np.isfinite(quantities.upper) | np.isfinite(quantities.lower)
    limited |= rates & (np.isfinite(quantities.rate_upper) | np.isfinite(quantities.rate_lower))
    parts = [
        np.abs(quantities.first) * np.isfinite(quantities.first_bounds),
        np.abs(quantities.second[:, :, :G]).max(axis=-1, initial=0.0) * limited,
        np.abs(quantities.vectors).max(axis=(-1, -2), initial=0.0),
        np.abs(quantities.fourth).max(axis=-1, initial=0.0) * rates,
    ]
    shares = np.concatenate([x / np.maximum(x.max(axis=0, initial=0.0), 1e-300) for x in parts], axis=1)
    return shares.max(axis=1, initial=0.0)
