"""Entries of ROS messages as files: names, numbers of joints, and times."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from jounce.io.files.located_data import Location, Source

NANO = 1_000_000_000
LARGEST = 2**63
CUT = "..."
"""Text that ``ros2 topic echo`` prints in place of omitted entries."""


def joint_names(source: Source, location: Location, own: Any) -> tuple[str, ...]:
    """Return a list of different names."""
    check_whole(source, location, own)
    if not isinstance(own, list) or not own or not all(isinstance(name, str) for name in own):
        raise source.error("must be a list of names", location, value=own)
    if len(set(own)) < len(own):
        raise source.error("a joint is named twice", location, value=own)
    return tuple(own)


def check_whole(source: Source, location: Location, given: Any) -> None:
    """Raise an error if a list was shortened where it was printed."""
    if isinstance(given, list) and CUT in given:
        message = "was cut where it was printed; echo it with --full-length"
        raise source.error(message, location)


def joint_row(source: Source, location: Location, given: Any, count: int, unknown: bool = False) -> list[float]:
    """Return a number for each joint; NaN, of what is not measured, only where some may be unknown."""
    check_whole(source, location, given)
    numbers = [number_of(x) for x in given] if isinstance(given, list) else []
    valid = [x for x in numbers if x is not None and (math.isfinite(x) or (unknown and math.isnan(x)))]
    if not isinstance(given, list) or not len(valid) == len(given) == count:
        raise source.error(f"must be {count} finite numbers, one for each joint: {location[-1]}", location, value=given)
    return valid


def number_of(given: Any) -> float | None:
    """Return a number, infinite if it is too large for a float; None for anything else."""
    if isinstance(given, bool) or not isinstance(given, int | float):
        return None
    try:
        return float(given)
    except OverflowError:
        return math.inf


def seconds_of(source: Source, location: Location, given: Any) -> float:
    """Return the time of a point since the start, s."""
    if given is None:
        message = (
            "is missing: the time of each point since the start, as {sec: 1, nanosec: 0} or as a number of seconds"
        )
        raise source.error(message, location)
    number = number_of(given)
    if number is not None and math.isfinite(number) and number >= 0:
        return number
    return float(stamp_of(source, location, given))


def stamp_of(source: Source, location: Location, given: Any) -> Decimal:
    """Return a time of ROS 2 or ROS, s, exactly."""
    parts = ("sec", "nanosec") if isinstance(given, Mapping) and "sec" in given else ("secs", "nsecs")
    if not isinstance(given, Mapping) or set(given) - set(parts):
        raise source.error("must be a time, as {sec: 1, nanosec: 0}", location, value=given)
    values = [given.get(part, 0) for part in parts]
    for part, value in zip(parts, values, strict=True):
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < LARGEST:
            raise source.error("must be a whole number, 0 or greater, of 64 bits", (*location, part), value=value)
    return Decimal(values[0]) + Decimal(values[1]) / NANO
