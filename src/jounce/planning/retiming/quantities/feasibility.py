"""Feasibility of retiming a path: limits hold at rest, and every motion has a limit."""

import numpy as np
from jaxtyping import Float

from jounce.errors import TrajectoryError
from jounce.planning.retiming.quantities.path_quantities import G, Labels, PathQuantities, Source

POINTS = 1001  # sample points of the path
SIDE_OFFSET = 1e-12  # fraction of the path: offset to either side of a load change
STATIC = 1e-6  # fraction of a limit that must remain at rest
IDLE = 1e-9  # fraction of the largest value of a quantity: smaller values count as zero


def check_possible(source: Source, labels: Labels, start: float, stop: float, *, bounded: bool = False) -> None:
    """Raise TrajectoryError if a limit is exceeded at rest, or if no limited quantity changes on a part of the path."""
    offsets = SIDE_OFFSET * (stop - start) * np.array([-1.0, 1.0])
    even = np.linspace(start, stop, POINTS)
    s = np.union1d(even, (source.changes[:, None] + offsets).reshape(-1))
    quantities = source(s)
    static = quantities.second[:, :, G]
    margins = np.minimum(_relative_margin(quantities.upper, static), _relative_margin(-quantities.lower, -static))
    if margins.size and margins.min() <= STATIC:
        point, column = np.unravel_index(np.argmin(margins), margins.shape)
        label, value = labels.second[column], float(static[point, column])
        limit = float((quantities.upper if value > 0 else quantities.lower)[point, column])
        place = source.location(float(s[point]))
        message = (
            f"the path cannot be stopped everywhere: at {place} standing still requires a {label.word} of {value:.6g} "
            f"{label.unit}, and the limit is {limit:.6g} {label.unit}; motions that pass only by momentum are not "
            "supported; choose another path, or a smaller load"
        )
        raise TrajectoryError(message, name=label.owner)
    if bounded:
        return
    speeds = _moving(quantities, rates=True)[np.isin(s, even)]
    idle = speeds < IDLE
    stops = np.flatnonzero(idle[1:] & idle[:-1])  # a single idle point may be a stop of the motion
    if len(stops):
        place = source.location(float(even[stops[0]]))
        message = f"nothing with a limit moves at {place}, so that there is no fastest law; give more limits"
        raise TrajectoryError(message, name="limits")


@np.errstate(invalid="ignore")
def _relative_margin(bound: np.ndarray, rest_values: np.ndarray) -> np.ndarray:
    """Return the margin to an upper bound, relative to the larger of value and bound; infinite without a bound."""
    size = np.maximum(np.maximum(np.abs(bound), np.abs(rest_values)), np.finfo(float).tiny)
    return np.where(np.isfinite(bound), (bound - rest_values) / size, np.inf)


def bounded_everywhere(source: Source, start: float, stop: float) -> bool:
    """Return whether a quantity with a limit of velocity, acceleration or force moves everywhere on the path."""
    return bool((_moving(source(np.linspace(start, stop, POINTS)), rates=False) >= IDLE).all())


def _moving(quantities: PathQuantities, *, rates: bool) -> Float[np.ndarray, " point"]:
    """Return the largest coefficient of a limited quantity at each point, relative to its largest along the path."""
    limited = np.isfinite(quantities.upper) | np.isfinite(quantities.lower)
    limited |= rates & (np.isfinite(quantities.rate_upper) | np.isfinite(quantities.rate_lower))
    sizes = [
        np.abs(quantities.first) * np.isfinite(quantities.first_bounds),
        np.abs(quantities.second[:, :, :G]).max(axis=-1, initial=0.0) * limited,
        np.abs(quantities.vectors).max(axis=(-1, -2), initial=0.0),
        np.abs(quantities.fourth).max(axis=-1, initial=0.0) * rates,
    ]
    shares = np.concatenate([x / np.maximum(x.max(axis=0, initial=0.0), 1e-300) for x in sizes], axis=1)
    return shares.max(axis=1, initial=0.0)
