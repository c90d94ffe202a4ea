"""Smallest and largest values of the outputs of a motion and of their derivatives, with their times and units."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

import numpy as np

__all__ = ["Peak", "derivative_name", "derivative_unit", "peaks", "rate_name", "scalar_outputs"]

NAMES = ("position", "velocity", "acceleration", "jerk", "jounce")
COMPONENTS = ("x", "y", "z")


@dataclasses.dataclass(frozen=True)
class Peak:
    """Extreme values of one derivative of one output over the instants that were solved.

    Parameters
    ----------
    output : str
        Name of the output, with its component where it has some: ``C_x``.
    derivative : str
        ``position``, ``velocity``, ..., or ``torque``, ``yank``, ..., see `rate_name`.
    unit : str
    minimum, maximum : float
        In the unit; NaN where no instant was solved.
    minimum_at, maximum_at : float
        The first instants at which they are reached, s.
    size : float
        The largest magnitude that any component of the output has in this derivative.
    """

    output: str
    derivative: str
    unit: str
    minimum: float
    minimum_at: float
    maximum: float
    maximum_at: float
    size: float

    @property
    def largest(self) -> tuple[bool, bool]:
        """Whether the minimum and the maximum have the largest magnitude; both where they differ by rounding only."""
        low, high = abs(self.minimum), abs(self.maximum)
        near = 1e-12 * self.size
        varies = self.maximum - self.minimum > near
        return varies and low >= high - near, varies and high >= low - near


def derivative_name(order: int) -> str:
    """Name a time derivative of a position or an angle.

    Examples
    --------
    >>> [derivative_name(k) for k in (0, 3, 4, 5, 22)]
    ['position', 'jerk', 'jounce', '5th', '22nd']
    """
    if order < len(NAMES):
        return NAMES[order]
    last = order % 10 if order // 10 % 10 != 1 else 0
    return str(order) + {1: "st", 2: "nd", 3: "rd"}.get(last, "th")


def rate_name(output: Any, order: int) -> str:
    """Name a time derivative of an output: velocity, jerk, ..., or for a force yank, second rate, ...

    Examples
    --------
    >>> import jounce as jn
    >>> [rate_name(jn.AngleOutput("crank"), k) for k in (0, 1, 4)]
    ['position', 'velocity', 'jounce']
    >>> [rate_name(jn.DriverTorqueOutput("theta"), k) for k in (0, 1, 2, 6)]
    ['torque', 'yank', 'second rate', '6th rate']
    """
    names = output.rate_names
    if not names:
        return derivative_name(order + output.lost_orders)
    return names[order] if order < len(names) else f"{derivative_name(order)} rate"


def derivative_unit(unit: str, order: int) -> str:
    """Return the unit of a time derivative of a quantity.

    Examples
    --------
    >>> derivative_unit("m", 0), derivative_unit("m", 1), derivative_unit("rad/s", 3)
    ('m', 'm/s', 'rad/s^4')
    """
    per_time = re.search(r"/s(?:\^(\d+))?$", unit)
    base = unit[: per_time.start()] if per_time else unit
    total = order + (int(per_time[1] or 1) if per_time else 0)
    return base if total == 0 else f"{base}/s" if total == 1 else f"{base}/s^{total}"


def scalar_outputs(motion: Any) -> dict[str, tuple[str, np.ndarray]]:
    """Return the outputs of a motion one component at a time.

    Returns
    -------
    dict
        For each name, as in the columns of a CSV file, the name of its output and its values, shape (time, order + 1).
    """
    found = {}
    for name, values in motion.outputs.items():
        if values.ndim == 2:
            found[name] = name, values
        else:
            found |= {f"{name}_{COMPONENTS[c]}": (name, values[..., c]) for c in range(values.shape[2])}
    return found


def peaks(motion: Any) -> list[Peak]:
    """Return the peak values of each output, component by component, and of each derivative.

    Parameters
    ----------
    motion : Motion
        The peaks are those at its instants; between them the motion may go a little beyond.

    Returns
    -------
    list of Peak
        Outputs in the order of the mechanism, derivatives in rising order.

    Examples
    --------
    >>> import jounce as jn
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), order=1)
    >>> [(p.output, p.derivative, p.unit, round(p.maximum, 4), p.maximum_at) for p in peaks(motion)][:2]
    [('psi', 'position', 'rad', 2.6436, 1.5), ('psi', 'velocity', 'rad/s', 1.5179, 1.07)]
    """
    found = []
    for column, (name, values) in scalar_outputs(motion).items():
        output = motion.mechanism.outputs[name]
        for order in range(values.shape[1]):
            extremes = _extremes(values[:, order], motion.time)
            magnitudes = np.abs(motion.outputs[name][:, order])
            size = float(np.max(magnitudes, initial=0.0, where=np.isfinite(magnitudes)))
            unit = derivative_unit(output.unit, order)
            found.append(Peak(column, rate_name(output, order), unit, *extremes, size))
    return found


def _extremes(values: np.ndarray, time: np.ndarray) -> tuple[float, float, float, float]:
    solved = np.flatnonzero(np.isfinite(values))
    if not solved.size:
        return math.nan, math.nan, math.nan, math.nan
    low, high = solved[np.argmin(values[solved])], solved[np.argmax(values[solved])]
    return float(values[low]), float(time[low]), float(values[high]), float(time[high])
