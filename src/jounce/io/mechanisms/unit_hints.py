"""Values without a unit that are likely meant in another one than SI: degrees for radians, millimetres for metres."""

from __future__ import annotations

import math
import warnings
from bisect import bisect_left
from collections.abc import Iterator
from typing import Any

from jounce.constraints import catalogue
from jounce.errors import JounceError, UnitWarning
from jounce.io.files.located_data import Location, Source, dotted
from jounce.io.mechanisms.keys import ROLES, file_keys
from jounce.mechanism import Mechanism
from jounce.trajectory import Expression
from jounce.trajectory.dimensions import ANGLE, LENGTH, Dimension

MANY_TURNS = 4 * math.pi
FAR_OFF = 100.0  # times the other lengths
ALIKE = 30.0  # within which a thousandth of a length must be to them
TO_COMPARE = 3  # lengths, at least


def warn_of_units(source: Source, mechanism: Mechanism) -> None:
    """Warn of angles of many turns and of lengths far from all others, where numbers stand without a unit.

    Warns
    -----
    UnitWarning
        With the file, the line, the name and what may be meant.
    """
    for location, value in _angles(source.data, mechanism):
        round_degrees = value.is_integer() and value % 5 == 0 and abs(value) > 2 * math.pi
        if round_degrees or abs(value) > MANY_TURNS:
            _warn(source, location, f"{value:g} rad is {abs(value) / (2 * math.pi):.2g} turns: {value:g} deg?")
    lengths = [(location, abs(value), plain) for location, value, plain in _lengths(source.data, mechanism) if value]
    in_order = sorted(value for _, value, _ in lengths)
    for location, value, plain in lengths:
        if not plain or len(lengths) <= TO_COMPARE:
            continue
        usual = _median_of_others(in_order, value)
        if value > FAR_OFF * usual and usual / ALIKE < value / 1000 < ALIKE * usual:
            times = float(f"{value / usual:.1g}")
            _warn(source, location, f"{value:g} m is {times:g} times the others: {value:g} mm?")


def _median_of_others(in_order: list[float], value: float) -> float:
    """Return the median of numbers in order without one of them."""
    own, count = bisect_left(in_order, value), len(in_order) - 1
    low, high = (in_order[k + (k >= own)] for k in ((count - 1) // 2, count // 2))
    return (low + high) / 2


def _warn(source: Source, location: Location, hint: str) -> None:
    line = source.line(location)
    words = f"{source.path}, line {line}, {dotted(location)}: {hint} A number without a unit is in SI"
    warnings.warn(UnitWarning(words), stacklevel=4)


def _fields(data: dict[str, Any], mechanism: Mechanism) -> Iterator[tuple[Location, str, Any]]:
    """Return the values of elements and bodies as the file has them, with their kind."""
    for section, role in ROLES.items():
        for name, given in (data.get(section) or {}).items():
            for key in file_keys(catalogue(mechanism.space, role)[given["type"]]):
                turning = given.get("coordinate") == "angle"
                quantity = ("length", "angle")[turning] if key.quantity == "of coordinate" else key.quantity
                yield from _leaves((section, name, key.key), quantity, given.get(key.key))
    for name, given in (data.get("bodies") or {}).items():
        for key in ("position", "center_of_mass"):
            yield from _leaves(("bodies", name, key), "length", (given or {}).get(key))
        yield from _leaves(("bodies", name, "angle"), "angle", (given or {}).get("angle"))
        turn = (given or {}).get("orientation") or {}
        for key in ("angle", "angles"):
            yield from _leaves(("bodies", name, "orientation", key), "angle", turn.get(key))


def _leaves(location: Location, quantity: str, value: Any) -> Iterator[tuple[Location, str, Any]]:
    if isinstance(value, (list, tuple)):
        for index, entry in enumerate(value):
            yield from _leaves((*location, index), quantity, entry)
    elif isinstance(value, dict) and "expression" in value:
        yield (*location, "expression"), quantity, value["expression"]
    elif value is not None and not isinstance(value, dict):
        yield location, quantity, value


def _parameters(data: dict[str, Any], mechanism: Mechanism, dimension: Dimension) -> Iterator[tuple[Location, Any]]:
    for name, raw in (data.get("parameters") or {}).items():
        if dimension in mechanism.dimensions.get(name, ()):
            yield ("parameters", name), raw


def _angles(data: dict[str, Any], mechanism: Mechanism) -> Iterator[tuple[Location, float]]:
    """Return angles that stand without a unit, laws at time zero."""
    given = [(location, raw) for location, quantity, raw in _fields(data, mechanism) if quantity == "angle"]
    for location, raw in [*given, *_parameters(data, mechanism, ANGLE)]:
        text = str(raw)
        if "deg" in text or "pi" in text:
            continue
        try:
            formula = Expression(text, ["t"])
            yield location, float(formula.evaluate({"t": 0.0}))
        except JounceError:  # it has a unit, or depends on parameters
            continue


def _lengths(data: dict[str, Any], mechanism: Mechanism) -> Iterator[tuple[Location, float, bool]]:
    """Return lengths in m, and whether they stand without a unit."""
    values = mechanism.parameter_values
    for location, raw in _parameters(data, mechanism, LENGTH):
        yield location, float(values[str(location[-1])]), isinstance(raw, int | float)
    for location, quantity, raw in _fields(data, mechanism):
        if quantity == "length" and isinstance(raw, int | float):
            yield location, float(raw), True
