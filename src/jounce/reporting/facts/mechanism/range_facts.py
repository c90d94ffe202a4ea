"""Range of a driver from the start of a mechanism, and the quality of motion transmission, as plain data."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from jounce.kinematics import Curve, trace
from jounce.kinematics.transmission import extremes, recognized
from jounce.mechanism import Mechanism
from jounce.reporting.facts.curve_facts import value_words
from jounce.reporting.text.summaries import Facts

POOR_ANGLE = math.radians(40.0)  # transmission angle below which forces and play grow (VDI 2123)
POOR_SHARE = 0.05  # smallest singular value, as a fraction of its median on the branch


class TransmissionFacts(TypedDict):
    """Extremes of the transmission angle, rad, with the values of the driver."""

    smallest: float
    smallest_at: float
    largest: float
    largest_at: float


class RangeFacts(TypedDict):
    """The branch of the start of a mechanism; bounds are null if the driver makes whole turns."""

    driver: str
    unit: str
    low: float | None
    high: float | None
    low_is_dead_point: bool
    high_is_dead_point: bool
    circuit_closed: bool
    type: str | None
    transmission: TransmissionFacts | None
    smallest_singular_value: float
    smallest_singular_value_at: float
    change_points: list[float]
    warnings: list[str]


def range_facts(mechanism: Mechanism, driver: str | None = None) -> dict[str, Any] | None:
    """Return the range of the driver on the branch of the start: RangeFacts; None without drivers.

    Parameters
    ----------
    mechanism : Mechanism
        The driven mechanism.
    driver : str, optional
        Name of the driver to vary, if there are several.
    """
    curve = trace(mechanism, driver=driver, order=0)
    if curve.driver is None:
        return None
    low, high = curve.range
    is_unlimited = not math.isfinite(low)
    linkage = recognized(mechanism, curve.driver)
    transmission = None
    if linkage is not None:
        (lowest, least_at), (highest, most_at) = extremes(linkage, low, high)
        transmission = {"smallest": lowest, "smallest_at": least_at, "largest": highest, "largest_at": most_at}
    sizes, values = _on_branch(curve)
    index = int(np.argmin(sizes))
    facts = {
        "driver": curve.driver,
        "unit": curve.unit,
        "low": None if is_unlimited else low,
        "high": None if is_unlimited else high,
        "low_is_dead_point": _is_limit(curve, low),
        "high_is_dead_point": _is_limit(curve, high),
        "circuit_closed": curve.closed,
        "type": None if linkage is None else linkage.type,
        "transmission": transmission,
        "smallest_singular_value": float(sizes[index]),
        "smallest_singular_value_at": float(values[index]),
        "change_points": [curve.value(point.arc_length) for point in curve.change_points],
    }
    return facts | {"warnings": _warnings(facts, is_unlimited, float(np.median(sizes)))}


def _is_limit(curve: Curve, value: float) -> bool:
    """Return whether the driver reverses at a value; an open curve may end for another reason."""
    return any(abs(x.value - value) <= 1e-9 * max(abs(value), 1e-300) for x in curve.turning_points)


def _on_branch(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Return the smallest singular values on the branch of the start, with the values of the driver."""
    points, branch = curve.arc_lengths, curve.branches[0]
    inside = (points >= branch.start) & (points <= branch.stop)
    if curve.closed:
        inside |= points - curve.length >= branch.start
    return curve.smallest_singular_values[inside], curve.values[inside, 0]


def _warnings(facts: Facts, is_unlimited: bool, median: float) -> list[str]:
    messages = []
    unit = facts["unit"]
    if (transmission := facts["transmission"]) is not None and transmission["smallest"] < POOR_ANGLE:
        place = value_words(transmission["smallest_at"], unit)
        angle = f"{math.degrees(transmission['smallest']):.3g} deg"
        messages.append(
            f"poor transmission: the transmission angle goes down to {angle}, at {facts['driver']} = {place}"
        )
    elif facts["transmission"] is None and is_unlimited and facts["smallest_singular_value"] < POOR_SHARE * median:
        place = value_words(facts["smallest_singular_value_at"], unit)
        messages.append(f"poor transmission: close to a singular position at {facts['driver']} = {place}")
    ends = " and ".join(value_words(facts[end], unit) for end in ("low", "high") if facts[f"{end}_is_dead_point"])
    if ends:
        messages.append(f"{facts['driver']} turns back at dead points: {ends}; keep its law well inside")
    if facts["change_points"]:
        place = ", ".join(value_words(value, unit) for value in facts["change_points"])
        messages.append(f"branches cross at change points: {facts['driver']} = {place}")
    return messages


def range_words(facts: Facts) -> str:
    """Return the range of a driver and the quality of its transmission in words."""
    unit, driver = facts["unit"], facts["driver"]
    lines = ["Range"]
    if facts["low"] is None:
        lines.append(f"  {driver} makes whole turns on this circuit")
    else:
        lines.append(f"  {driver} from {value_words(facts['low'], unit)} to {value_words(facts['high'], unit)}")
        lines += [
            f"  (its {end} value is as far as the curve was followed)"
            for end, key in (("least", "low"), ("largest", "high"))
            if not facts[f"{key}_is_dead_point"]
        ]
    if facts["type"]:
        lines.append(f"  {facts['type']}")
    if (transmission := facts["transmission"]) is not None:
        lowest, highest = (math.degrees(transmission[end]) for end in ("smallest", "largest"))
        lines.append(f"  transmission angle from {lowest:.6g} deg to {highest:.6g} deg")
    smallest = value_words(facts["smallest_singular_value_at"], unit)
    lines.append(f"  smallest singular value {facts['smallest_singular_value']:.3g}, at {driver} = {smallest}")
    return "\n".join([*lines, *(f"  warning: {warning}" for warning in facts["warnings"])])
