"""Warnings of values without a unit that are likely in degrees instead of radians, or millimeters instead of m."""

from __future__ import annotations

import math
import re
import warnings
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from jounce.constraints import catalogue
from jounce.constraints.cams import Cam
from jounce.constraints.facts import at_coordinate
from jounce.errors import JounceError, UnitWarning
from jounce.io.files.located_data import Location, Source, dotted
from jounce.io.files.samples import sampled_dimension
from jounce.io.mechanisms.schema.key_check import ROLES
from jounce.io.mechanisms.schema.keys import file_keys, is_cam
from jounce.mechanism import Mechanism
from jounce.mechanism.laws.angle_laws import (
    IN_SI,
    DriverLaw,
    degrees_doubt,
    laws_of,
    laws_of_angles,
    names_angle,
    number_doubt,
    settle,
)
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.resolve import resolve
from jounce.mechanism.time import instants_of
from jounce.trajectory import AbstractMotion, ExpressionMotion
from jounce.trajectory.law_checks.unit_doubts import values_of
from jounce.units import Expression
from jounce.units.dimensions import ANGLE, LENGTH, Dimension
from jounce.units.values import parse_value

FAR_OFF = 100.0  # least ratio to the usual length
ALIKE = 30.0  # largest ratio of a thousandth of such a length to the usual one
WIDE = 0.3  # largest likely tolerance, relative to the length
TO_COMPARE = 3  # least number of lengths to compare
LARGE = 5.0  # m, from which a machine may be meant in millimeters
FAST = 120.0  # m/s, above the speeds of such large machines
LIGHT = 0.1  # kg/m, below the mass per size of such large machines
NUMBER = re.compile(r"(?<![\w.])\d+\.?\d*(?:[eE][-+]?\d+)?")
SLENDER = 1e-5  # least inertia of a body, relative to mass times size squared


def warn_of_units(source: Source, mechanism: Mechanism) -> None:
    """Warn of angles and angle laws that are likely in degrees, and of lengths and length laws likely in millimeters.

    Warns
    -----
    UnitWarning
        With the file, the line, the name and the unit that may be meant.
    """
    warned = set()
    for location, value in _angles(source.data, mechanism):
        if doubt := number_doubt(value):
            warned.add(location[:3])
            _warn(source, location, doubt)
    run, laws = _run(mechanism), list(laws_of_angles(mechanism))
    angles = frozenset(name for name, dimensions in mechanism.dimensions.items() if ANGLE in dimensions)
    for law in laws:
        place: Location = ("drivers", law.name, "motion")
        doubt = degrees_doubt(law.law, *run)
        if place in warned or doubt:
            settle(law.driver)  # warned of now, or confirmed by its unit
        if doubt and place not in warned and not names_angle(law, angles) and not _has_unit(source, place):
            _warn(source, place, doubt)
    _warn_of_lengths(source, mechanism, laws)


def warn_of_values(before: Mechanism, after: Mechanism, given: Iterable[str], option: str) -> None:
    """Warn of plain numbers for parameters that are likely in degrees or millimeters, compared with the old values.

    Parameters
    ----------
    before, after : Mechanism
        Mechanism with the values of a file, and with the new ones.
    given : iterable of str
        Names of the parameters whose new values are plain numbers.
    option : str
        Option by which they are given.

    Warns
    -----
    UnitWarning
        With the option, the name and the unit that may be meant.
    """
    old, new, warned = before.parameter_values, after.parameter_values, False
    for name in given:
        if not (hint := _doubt(after.dimensions.get(name, ()), float(new[name]), float(old[name]), "what it was")):
            continue
        warned = True
        warnings.warn(UnitWarning(f"{option} {name}: {hint} {IN_SI}"), stacklevel=3)
    run = _run(before)
    doubted_before = {law.name for law in laws_of_angles(before) if degrees_doubt(law.law, *run)}
    run = _run(after)
    for law in laws_of_angles(after):
        if not (doubt := degrees_doubt(law.law, *run)):
            continue
        settle(law.driver)
        if not warned and law.name not in doubted_before:
            warnings.warn(UnitWarning(f"{option}: now the law of drivers.{law.name} {doubt} {IN_SI}"), stacklevel=3)


def warn_of_variations(mechanism: Mechanism, forms: Mapping[str, str], option: str) -> None:
    """Warn of ranges and spreads of parameters in plain numbers that are likely in degrees or millimeters.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with the values of a file.
    forms : dict of str to str
        ``LOW:HIGH``, ``LOW:HIGH:COUNT``, ``normal:SIGMA`` or ``uniform:HALFWIDTH``, by parameter.
    option : str
        Option by which they are given.

    Warns
    -----
    UnitWarning
        Once for each parameter.
    """
    values = mechanism.parameter_values
    for name, form in forms.items():
        dimensions, nominal = mechanism.dimensions.get(name, ()), abs(float(values.get(name, 0.0)))
        first, *others = (part.strip() for part in form.split(":"))
        spread = first in ("normal", "uniform")
        for text in others[:1] if spread else (first, *others[:1]):
            if not is_plain(text):
                continue
            value = abs(float(text))
            if not spread or ANGLE in dimensions:
                hint = _doubt(dimensions, value, nominal, "what it is")
            else:
                is_wide = LENGTH in dimensions and value > WIDE * nominal > 0
                hint = f"a spread of {text} m about {nominal:g} m: {text} mm?" if is_wide else ""
            if hint:
                warnings.warn(UnitWarning(f"{option} {name}: {hint} {IN_SI}"), stacklevel=3)
                break


def is_plain(text: str) -> bool:
    """Return whether a text is a number without a unit."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _doubt(dimensions: Iterable[Dimension], value: float, reference: float, label: str) -> str:
    """Return why the number of a parameter is likely in degrees or millimeters; an empty text if it is not."""
    if ANGLE in dimensions and (hint := number_doubt(value)):
        return hint
    if LENGTH in dimensions and reference and is_thousandfold(abs(value), abs(reference)):
        return f"{value:g} m is {float(f'{abs(value / reference):.1g}'):g} times {label}: {value:g} mm?"
    return ""


def is_thousandfold(value: float, typical: float, times: float = FAR_OFF) -> bool:
    """Return whether a length is far larger than usual, but usual if it is in millimeters."""
    return value > times * typical and typical / ALIKE < value / 1000 < ALIKE * typical


def _run(mechanism: Mechanism) -> tuple[float, float]:
    """Return the first and the last instant of a mechanism, s; (0, 1) if it has no time grid."""
    try:
        instants = None if mechanism.time is None else instants_of(mechanism.time, mechanism.parameter_values)
    except JounceError:  # raised when the grid is used
        instants = None
    return (0.0, 1.0) if instants is None else (float(instants[0]), float(instants[-1]))


def _has_unit(source: Source, location: Location) -> bool:
    """Return whether the samples of a law state their unit."""
    raw = source.at(location)
    if not isinstance(raw, dict) or not isinstance(raw.get("samples"), str):
        return False
    columns = {key: raw[key] for key in ("time", "value") if key in raw}
    try:
        return bool(source.read_named(raw["samples"], location, lambda path: sampled_dimension(path, **columns)))
    except JounceError:
        return False


def _warn_of_length_laws(source: Source, mechanism: Mechanism, typical: float) -> None:
    """Warn of length laws that go too far and too fast for a machine of the usual length."""
    first, last = _run(mechanism)
    for name, _, law in laws_of(mechanism, "length"):
        location: Location = ("drivers", name, "motion")
        if last <= first or _has_unit(source, location) or not _has_plain_number(source, law, FAR_OFF * typical):
            continue
        if (values := values_of(law, first, last)) is None:
            continue
        farthest = float(np.abs(values).max())
        fastest = float(np.abs(np.diff(values)).max()) * (len(values) - 1) / (last - first)
        if fastest > FAST and is_thousandfold(farthest, typical):
            ways = f"goes to {farthest:.3g} m at up to {fastest:.3g} m/s, where lengths are about {typical:.3g} m"
            _warn(source, location, f"{ways}: millimeters?")


def _has_plain_number(source: Source, law: AbstractMotion, bound: float) -> bool:
    """Return whether an expression or its parameters have a plain number above `bound`; True for other laws."""
    if not isinstance(law, ExpressionMotion):
        return True
    parameters = source.data.get("parameters") or {}
    given = [parameters.get(name) for name in law.expression.names]
    numbers = [*(x for x in given if isinstance(x, int | float)), *map(float, NUMBER.findall(law.expression.text))]
    return max(map(abs, numbers), default=0.0) > bound


def _warn_of_lengths(source: Source, mechanism: Mechanism, laws: Iterable[DriverLaw]) -> None:
    lengths = [(location, abs(value), plain) for location, value, plain in _lengths(source.data, mechanism) if value]
    in_order = sorted(value for _, value, _ in lengths)
    stated = None
    for location, value, plain in lengths:
        if not plain:
            continue
        typical, phrase = math.nan, "the others"
        if len(lengths) > TO_COMPARE:
            typical = _median_of_others(in_order, value)
        if value >= 1.0 and not is_thousandfold(value, typical):
            stated = _stated_lengths(source.data, mechanism) if stated is None else stated
            typical, phrase = float(np.median(stated)) if stated else math.nan, "those with a unit"
        if is_thousandfold(value, typical):
            times = float(f"{value / typical:.1g}")
            _warn(source, location, f"{value:g} m is {times:g} times {phrase}: {value:g} mm?")
    if all_lengths := (_stated_lengths(source.data, mechanism) if stated is None else stated) or in_order:
        _warn_of_length_laws(source, mechanism, float(np.median(all_lengths)))
    if len(lengths) < TO_COMPARE or in_order[-1] < LARGE or not all(plain for *_, plain in lengths):
        return
    if (doubt := _too_large(mechanism, in_order[-1], laws)) and not _stated_lengths(source.data, mechanism):
        location = max(lengths, key=lambda x: x[1])[0]
        _warn(source, location, f"the lengths of this file go up to {in_order[-1]:g} m, {doubt}: millimeters?")


def _too_large(mechanism: Mechanism, size: float, laws: Iterable[DriverLaw]) -> str:
    """Return why the motion or the masses rule out a mechanism of this size, m; an empty text if they do not."""
    first, last = _run(mechanism)
    for law in laws:
        values = values_of(law.law, first, last)
        if values is not None and last > first:
            fastest = float(np.abs(np.diff(values)).max()) * (len(values) - 1) / (last - first)
            if fastest * size > FAST:
                return f"which would move at {fastest * size:.3g} m/s"
    parameters = mechanism.parameter_values
    masses = {name: body.mass for name, body in mechanism.bodies.items() if body.mass is not None}
    heaviest = max((abs(float(resolve(mass, parameters))) for mass in masses.values()), default=math.nan)
    if heaviest < LIGHT * size:
        return f"of masses up to {heaviest:g} kg"
    for name, mass in masses.items():
        inertia = mechanism.bodies[name].inertia
        if inertia is not None:
            largest = float(np.abs(np.asarray(resolve(inertia, parameters), float)).max())
            if 0 < largest < SLENDER * float(resolve(mass, parameters)) * size**2:
                return f"of a body with an inertia of {largest:g} kg m^2"
    return ""


def _stated_lengths(data: dict[str, Any], mechanism: Mechanism) -> list[float]:
    """Return the lengths of a file that have a unit, m; expressions are left out."""
    names, lengths = dict.fromkeys(mechanism.parameters), []
    given = [raw for _, quantity, raw in _fields(data, mechanism) if quantity == "length"]
    for raw in [*(raw for _, raw in _parameters(data, mechanism, LENGTH)), *given]:
        if not isinstance(raw, str):
            continue
        try:
            value = parse_value(raw, "any", names)
        except JounceError:
            continue
        if value.dimension == LENGTH and isinstance(value.value, float) and value.value:
            lengths.append(abs(value.value))
    return lengths


def _median_of_others(in_order: list[float], value: float) -> float:
    """Return the median of sorted numbers without one of them."""
    index, count = bisect_left(in_order, value), len(in_order) - 1
    low, high = (in_order[k + (k >= index)] for k in ((count - 1) // 2, count // 2))
    return (low + high) / 2


def _warn(source: Source, location: Location, hint: str) -> None:
    line = source.line(location)
    message = f"{source.path}, line {line}, {dotted(location)}: {hint} {IN_SI}"
    warnings.warn(UnitWarning(message), stacklevel=4)


def _fields(data: dict[str, Any], mechanism: Mechanism) -> Iterator[tuple[Location, str, Any]]:
    """Yield the values of elements, bodies and outputs as the file gives them, with location and kind."""
    for section, role in ROLES.items():
        for name, given in (data.get(section) or {}).items():
            element_role = "driver" if section == "joints" and is_cam(mechanism.space, given) else role
            for key in file_keys(catalogue(mechanism.space, element_role)[given["type"]]):
                quantity = at_coordinate(key.quantity, given.get("coordinate"))
                yield from _leaves((section, name, key.key), quantity, given.get(key.key))
    for name, given in (data.get("bodies") or {}).items():
        for key in ("position", "center_of_mass"):
            yield from _leaves(("bodies", name, key), "length", (given or {}).get(key))
        yield from _leaves(("bodies", name, "angle"), "angle", (given or {}).get("angle"))
        turn = (given or {}).get("orientation") or {}
        for key in ("angle", "angles"):
            yield from _leaves(("bodies", name, "orientation", key), "angle", turn.get(key))
    for name, given in (data.get("outputs") or {}).items():
        if isinstance(given, dict):
            yield from _leaves(("outputs", name, "point"), "length", given.get("point"))


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
    """Yield the angles without a unit, including laws at time zero."""
    given = [(location, raw) for location, quantity, raw in _fields(data, mechanism) if quantity == "angle"]
    for location, raw in [*given, *_parameters(data, mechanism, ANGLE), *_angles_of_leaders(data, mechanism)]:
        text = str(raw)
        if "deg" in text or "pi" in text:
            continue
        try:
            formula = Expression(text, ["t"])
            yield location, float(formula.evaluate({"t": 0.0}))
        except JounceError:  # a value with a unit, or one that depends on parameters
            continue


def _angles_of_leaders(data: dict[str, Any], mechanism: Mechanism) -> Iterator[tuple[Location, Any]]:
    """Yield the angles of leaders at which segments and pieces of laws end, the largest one of each law."""
    for section, elements in (("drivers", mechanism.drivers), ("joints", mechanism.joints)):
        for name, element in elements.items():
            law = ((data.get(section) or {}).get(name) or {}).get("motion")
            if not isinstance(law, dict) or not isinstance(law.get("of"), str):
                continue
            leader = element.leader if isinstance(element, Cam) else mechanism.drivers.get(law["of"])
            if leader is None or not is_turning(leader):
                continue
            entries = [
                (key, k, entry) for key in ("profile", "piecewise") for k, entry in enumerate(law.get(key) or ())
            ]
            lengths = [((section, name, "motion", key, k, field), entry[field]) for key, k, entry in entries
                       for field in ("duration", "until") if isinstance(entry.get(field), int | float)]  # fmt: skip
            yield from sorted(lengths, key=lambda length: -length[1])[:1]


def _lengths(data: dict[str, Any], mechanism: Mechanism) -> Iterator[tuple[Location, float, bool]]:
    """Yield the lengths, m, and whether they have no unit."""
    values = mechanism.parameter_values
    for location, raw in _parameters(data, mechanism, LENGTH):
        yield location, float(values[str(location[-1])]), isinstance(raw, int | float)
    for location, quantity, raw in _fields(data, mechanism):
        if quantity == "length" and isinstance(raw, int | float):
            yield location, float(raw), True
