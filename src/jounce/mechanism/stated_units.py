"""A check that the units of parameters suit their uses, in mechanisms built in Python."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from jounce.base.modules import Module, belongs_to_package
from jounce.constraints.facts import at_coordinate, facts_of, field_kinds, value_fields
from jounce.errors import JounceError
from jounce.forces import AbstractForce
from jounce.trajectory import Expression
from jounce.units.dimensions import TIME, Dimension, variables_of
from jounce.units.values import parse_value

_BODY = {"position": "length", "angle": "angle", "mass": "mass", "inertia": "inertia", "center_of_mass": "length"}
_Use = tuple[str, Any, str, dict[str, Dimension | None]]
"""Location of a value, the value, its expected dimension, and the variables that it may contain."""


def check_stated_units(mechanism: Any, dimensions: Mapping[str, Dimension]) -> None:
    """Raise UnitError if parameters are used where values of other dimensions are expected, as in a file."""
    for location, value, expected, variables in _uses(mechanism):
        if isinstance(value, list | tuple | np.ndarray):
            entries = np.ravel(np.asarray(value, dtype=object)).tolist()
        else:
            entries = [value]
        for entry in entries:
            text = entry.text if isinstance(entry, Expression) else entry
            if not isinstance(text, str) or not any(name in text for name in dimensions):
                continue
            try:
                parse_value(text, expected, mechanism.parameters, dimensions, variables)
            except JounceError as error:
                raise error.located(name=location, value=text) from None


def _uses(mechanism: Any) -> Iterator[_Use]:
    for name, body in mechanism.bodies.items():
        for field, expected in _BODY.items():
            yield f"bodies.{name}.{field}", getattr(body, field), expected, {}
    yield "gravity", mechanism.gravity, "acceleration", {}
    for kind, elements in mechanism.elements.items():
        for name, element in elements.items():
            yield from _uses_of(element, f"{kind}.{name}")


def _uses_of(element: Module, location: str, clock: Dimension | None = TIME) -> Iterator[_Use]:
    """Yield the values of an element; `clock` is the dimension of the variable of motion laws, None if unknown."""
    kinds, dimensions = field_kinds(type(element)), facts_of(type(element)).dimensions
    for field in value_fields(type(element)):
        kind, value, place = kinds[field], getattr(element, field), f"{location}.{field}"
        expected = at_coordinate(dimensions[field], getattr(element, "coordinate", None))
        if kind in ("part", "nested") and value is not None:
            yield from _uses_of(value, place, None)  # the law of a cam depends on a coordinate
        elif kind in ("law", "laws") and isinstance(element, AbstractForce):
            yield place, value, expected, variables_of(type(element))
        elif kind == "motion":
            yield place, value, expected, {"t": clock if belongs_to_package(type(element)) else None}
        elif kind in ("scalar", "vector", "points"):
            yield place, value, "any" if expected == "direction" else expected, {}
