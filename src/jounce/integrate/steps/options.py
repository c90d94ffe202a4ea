"""Options of simulations: their checks, and the requested instants."""

from collections.abc import Callable, Mapping
from typing import Any, TypedDict

import numpy as np
from jaxtyping import Float

from jounce.errors import MechanismError
from jounce.integrate.steps.methods import AbstractMethod, Taylor
from jounce.kinematics.position_analysis.solve import checked_order
from jounce.mechanism import time_grid
from jounce.mechanism.time import TimeLike

TAYLOR = Taylor()
TOLERANCES = (1e-17, 1e-2)  # below rounding, truncation errors still add up in the energy


class SimulationOptions(TypedDict, total=False):
    """The options of `jounce.simulate` for mechanisms and robots."""

    method: AbstractMethod | None
    tolerance: float
    events: object
    longest_step: float
    strict: bool
    progress: Callable[[int, int], None] | None


def checked_options(
    order: object, method: object, tolerance: object, longest_step: object
) -> tuple[int, AbstractMethod]:
    """Return order and method of a simulation, or raise MechanismError for an option that is not valid."""
    order = checked_order(order)
    method = TAYLOR if method is None else method
    if not isinstance(method, AbstractMethod):
        raise MechanismError("must be a method, such as jn.Taylor()", name="method", value=method)
    low, high = TOLERANCES
    if not (isinstance(tolerance, int | float) and low <= tolerance <= high):
        message = f"the tolerance must be a number from {low:g} to {high:g}"
        raise MechanismError(message, name="tolerance", value=tolerance)
    if isinstance(longest_step, bool) or not (isinstance(longest_step, int | float) and longest_step > 0):
        raise MechanismError("must be greater than zero", name="longest_step", value=longest_step)
    return order, method


def instants_of(time: TimeLike | None, parameters: Mapping[str, Any]) -> Float[np.ndarray, " time"]:
    """Return the instants of a run, which may go backward."""
    if not isinstance(time, (list, tuple, np.ndarray)) or np.ndim(time) != 1 or len(time) < 2:
        return time_grid(time, parameters)
    try:
        backward = bool(time[-1] < time[0])
    except TypeError:
        backward = False  # not numbers: refused below
    instants = time_grid(list(time)[::-1] if backward else time, parameters)
    return instants[::-1] if backward else instants
