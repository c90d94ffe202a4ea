"""Whether a path has a fastest motion: what stands still keeps its limits, and what moves has one."""

import numpy as np
from jaxtyping import Float

from jounce.errors import TrajectoryError
from jounce.planning.retiming.quantities import G, Labels, PathQuantities, Source

LOOKS = 1001  # places on the path
STATIC = 1e-6  # of a limit, which what stands still must leave
IDLE = 1e-9  # of its largest value: what moves by less does not move


def check_possible(source: Source, labels: Labels, start: float, stop: float, *, bounded: bool = False) -> None:
    """Raise TrajectoryError where what is needed to stand still is beyond a limit, or nothing limited moves."""
    s = np.linspace(start, stop, LOOKS)
    found = source(s)
    still = found.second[:, :, G]
    spare = np.minimum(found.upper - still, still - found.lower) / np.maximum(np.abs(still), 1.0)
    if spare.size and spare.min() <= STATIC:
        at, column = np.unravel_index(np.argmin(spare), spare.shape)
        label, value = labels.second[column], float(still[at, column])
        limit = float((found.upper if value > 0 else found.lower)[at, column])
        where = source.place(float(s[at]))
        message = (
            f"no time law exists: at {where} this joint needs a {label.word} of {value:.6g} {label.unit} to stand "
            f"still, and its limit is {limit:.6g} {label.unit}; choose another path, or a smaller load"
        )
        raise TrajectoryError(message, name=label.owner)
    if bounded:
        return
    moving = _moving(found, rates=True)
    still_there = np.flatnonzero(moving < IDLE)
    if len(still_there):
        where = source.place(float(s[still_there[0]]))
        message = f"nothing that has a limit moves at {where}, so that no law is the fastest; give more limits"
        raise TrajectoryError(message, name="limits")


def bounded_everywhere(source: Source, start: float, stop: float) -> bool:
    """Tell whether on the whole path something moves whose velocity, acceleration or force has a limit."""
    return bool((_moving(source(np.linspace(start, stop, LOOKS)), rates=False) >= IDLE).all())


def _moving(found: PathQuantities, *, rates: bool) -> Float[np.ndarray, " point"]:
    """Return how much moves of what has a limit, as a share of its largest value."""
    limited = np.isfinite(found.upper) | np.isfinite(found.lower) | (rates & np.isfinite(found.rates))
    parts = [
        np.abs(found.first) * np.isfinite(found.first_bounds),
        np.abs(found.second[:, :, :G]).max(axis=-1, initial=0.0) * limited,
        np.abs(found.vectors).max(axis=(-1, -2), initial=0.0),
        np.abs(found.fourth).max(axis=-1, initial=0.0) * rates,
    ]
    shares = np.concatenate([x / np.maximum(x.max(axis=0, initial=0.0), 1e-300) for x in parts], axis=1)
    return shares.max(axis=1, initial=0.0)
