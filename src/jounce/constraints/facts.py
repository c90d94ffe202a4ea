"""Facts that the class of a joint, driver, force or output states about itself and its fields.

A class states a fact as a class variable, which subclasses inherit or override. Facts of single fields are mappings
from the name of a field, or from its name without the body, ``axis`` for ``axis_i`` and ``axis_j``; each entry is
inherited separately. The base classes state the facts of fields with usual names.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from jounce.errors import MechanismError, no_such
from jounce.units.dimensions import KINDS

WORDS = (
    "Scalar",
    "Vector",
    "Law",
    "Laws",
    "Wrenches",
    "Whole",
    "Flag",
    "Points",
    "Nested",
    "Curve",
    "Part",
)  # annotations of fields by kind of value
BODY_ENDINGS = ("_i", "_j", "_m")  # of fields, by the body to which they belong

USUAL_DIMENSIONS: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("point", "points", "length", "radius", "lead"), "length"),
        **dict.fromkeys(("vector", "axis", "normal"), "direction"),
    }
)
"""Dimensions of fields with usual names, unless a class states others."""

USUAL_SIGNS: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("length", "radius"), "positive"),
        **dict.fromkeys(("lead", "vector", "axis", "normal"), "not zero"),
    }
)
"""Signs of fields with usual names, unless a class states others."""

BY_COORDINATE: Mapping[str, Mapping[bool, str]] = MappingProxyType(
    {
        "of coordinate": {True: "angle", False: "length"},
        "per angle": {True: "ratio", False: "length per angle"},
    }
)
"""Dimensions that depend on whether the field ``coordinate`` is ``angle``."""

SIGNS: Mapping[str, str] = MappingProxyType(
    {
        "positive": "must be greater than zero",
        "not negative": "must not be negative",
        "not zero": "must not be zero",
        "pressure angle": "must be from 0 to 45 deg; a number without a unit is in rad",
        "helix angle": "must be between -90 and 90 deg; a number without a unit is in rad",
        "efficiency": "must be above 0 and at most 1",
        "at most 1": "must be at most 1; zero or less means self-locking",
        "lead angle": "must be above 0 and below 90 deg; a number without a unit is in rad",
        "any": "",
    }
)
"""Signs that may be required of values, and the message about a value without that sign."""

_MACHINES = {
    "planar": ("revolute", "rod", "slot", "prismatic", "coordinate", "gear", "rolling", "curve", "belt", "rope"),
    "spatial": (
        "spherical",
        "rod",
        "plane",
        "universal",
        "revolute",
        "cylindrical",
        "prismatic",
        "screw",
        "gear",
        "rolling",
        "curve",
        "surface",
        "wheel",
        "rope",
    ),
}
_DRIVES = ("coordinate", "slide", "distance", "rotation")
_LOADS = ("spring", "slide spring", "slide", "distance", "rotation", "spiral", "point force")
_SYMBOL_FIELDS = {"rolling": ("radius",), "wheel": ("radius",), "coordinate": ("coordinate",)}
PAIRS = {
    "revolute": ("point_i", "point_j"),
    "rod": ("point_i", "point_j", "length"),
    "prismatic": ("point_i", "point_j", "vector_i"),
}
"""Pairs by which planar linkages are recognized, and the fields that they require."""
_DISTANCES = {"revolute": "zero", "rod": "length"}  # between the points of such pairs


@dataclasses.dataclass(frozen=True, eq=False)
class Facts:
    """The facts that a class of joints, drivers, forces or outputs states or inherits.

    Parameters
    ----------
    dimensions : mapping of str to str
        Dimension of each field: a word of `jounce.units.dimensions.KINDS`; ``direction`` for a vector of any unit; ``of
        coordinate`` or ``per angle`` if it depends on the field ``coordinate``; ``any``.
    signs : mapping of str to str
        Sign of each field: ``positive``, ``not negative``, ``not zero`` (for a vector, nonzero length), ``any``.
    choices : mapping of str to tuple of str
        Permitted words of text fields.
    held_parallel : tuple of tuple of str
        Pairs of fields, on the first and the second body, whose directions the joint holds parallel.
    never_parallel : tuple of tuple of str
        Pairs of fields on one body, the first of which must not be parallel to the second.
    squared_distance : str
        Field of a distance, a value or a law, if the residual is a squared distance minus its square.
    point_distance : str
        Distance at which the joint holds ``point_i`` and ``point_j``: ``zero``, or the field of the distance; else
        empty.
    rolls_along : tuple of str
        For a disc that rolls on the first body: fields of the direction of its line, and in space of the axis of the
        disc. Its center ``point_j`` lies ``radius`` to the right of the line through ``point_i``.
    symbol : str
        Symbol to draw, see `symbols`; ``none`` for nothing, empty for a mark of an unknown element.
    pair : str
        One of `PAIRS` to which the joint is equivalent, else empty.
    """

    dimensions: Mapping[str, str]
    signs: Mapping[str, str]
    choices: Mapping[str, tuple[str, ...]]
    held_parallel: tuple[tuple[str, str], ...]
    never_parallel: tuple[tuple[str, str], ...]
    squared_distance: str
    point_distance: str
    rolls_along: tuple[str, ...]
    symbol: str
    pair: str


NAMES = tuple(field.name for field in dataclasses.fields(Facts))


@lru_cache(maxsize=1000)
def facts_of(kind: type[Any]) -> Facts:
    """Return the facts of a class.

    Raises
    ------
    MechanismError
        If the class states an impossible fact, such as one of a missing field or in an unknown word; or if a field has
        the name of a fact.

    Examples
    --------
    >>> from jounce import planar, spatial
    >>> from jounce.constraints.facts import facts_of
    >>> facts_of(spatial.Prismatic).held_parallel
    (('axis_i', 'axis_j'), ('normal_i', 'normal_j'))
    >>> dict(facts_of(planar.Rolling).signs)["radius"]
    'positive'
    """
    fields = tuple(value_fields(kind))
    for field in dataclasses.fields(kind):
        if field.name in NAMES:
            message = f"no field of {kind.__qualname__} may have this name, by which a class states a fact; rename it"
            raise MechanismError(message, name="field", value=field.name)
    pair = _of_residual(kind, "pair")
    facts = Facts(
        dimensions={name: _of_field(kind, "dimensions", name, "any") for name in fields},
        signs={name: _of_field(kind, "signs", name, "any") for name in fields},
        choices={name: choices for name in fields if (choices := _of_field(kind, "choices", name, ()))},
        held_parallel=_pairs(kind, "held_parallel"),
        never_parallel=_pairs(kind, "never_parallel"),
        squared_distance=_of_residual(kind, "squared_distance"),
        point_distance=_of_residual(kind, "point_distance") or _DISTANCES.get(pair, ""),
        rolls_along=tuple(getattr(kind, "rolls_along", ())),
        symbol=getattr(kind, "symbol", ""),
        pair=pair,
    )
    _check(kind, facts, fields)
    return facts


def _of_field(kind: type[Any], fact: str, field: str, default: Any) -> Any:
    """Return the fact of a field from the first class that states it, in method resolution order."""
    for base in kind.__mro__:
        declared = vars(base).get(fact, {})
        if not isinstance(declared, Mapping):
            message = f"the class {base.__qualname__} must state this by field, in a dictionary"
            raise MechanismError(message, name=fact, value=declared)
        for name in (field, stem_of(field)):
            if name in declared:
                return declared[name]
    return default


def _pairs(kind: type[Any], fact: str) -> tuple[tuple[str, str], ...]:
    """Return the pairs of fields that a class states, checked."""
    pairs = getattr(kind, fact, ())
    for pair in pairs:
        if isinstance(pair, str) or len(pair) != 2:
            message = f"the class {kind.__qualname__} must state pairs of fields, such as (('axis_i', 'axis_j'),)"
            raise MechanismError(message, name=fact, value=pairs)
    return tuple((first, second) for first, second in pairs)


def _of_residual(kind: type[Any], fact: str) -> str:
    """Return a fact stated by the class that defines the residual, or by a class derived from it; else empty."""
    for base in kind.__mro__:
        if fact in vars(base):
            return vars(base)[fact]
        if "residual" in vars(base) and "stands_for" not in vars(base):
            return ""
    return ""


def _check(kind: type[Any], facts: Facts, fields: tuple[str, ...]) -> None:
    """Raise MechanismError if a class states an impossible fact."""

    def must_be(fact: str, word: str, valid: Any, noun: str) -> None:
        if word not in valid:
            message = f"the class {kind.__qualname__}: {no_such(noun, word, list(valid))}"
            raise MechanismError(message, name=fact, value=word)

    for fact, name in _named_fields(facts):
        must_be(fact, name, fields, "field")
    for fact, name in _stated_fields(kind):
        must_be(fact, name, {*fields, *map(stem_of, fields)}, "field")
    dimensions = (*KINDS, *BY_COORDINATE, "direction")
    for field in fields:
        must_be(f"dimensions.{field}", facts.dimensions[field], dimensions, "dimension")
        must_be(f"signs.{field}", facts.signs[field], SIGNS, "sign")
    if facts.point_distance and not facts.pair:
        must_be("point_distance", facts.point_distance, ("zero", *fields), "field")
    if facts.pair:
        must_be("pair", facts.pair, PAIRS, "pair")
        for name in PAIRS[facts.pair]:
            must_be(f"pair {facts.pair}", name, fields, "field")
    if facts.symbol:
        must_be("symbol", facts.symbol, ("none", *symbols(kind)), "symbol")
        for name in _SYMBOL_FIELDS.get(facts.symbol, ()):
            must_be(f"symbol {facts.symbol}", name, fields, "field")


def _named_fields(facts: Facts) -> Iterator[tuple[str, str]]:
    """Yield the names of facts of a class, each with a field that it names."""
    for fact in ("held_parallel", "never_parallel"):
        yield from ((fact, name) for pair in getattr(facts, fact) for name in pair)
    if facts.squared_distance:
        yield "squared_distance", facts.squared_distance
    if facts.point_distance and not facts.pair:
        yield from (("point_distance", name) for name in ("point_i", "point_j"))
    if facts.rolls_along:
        yield from (("rolls_along", name) for name in (*facts.rolls_along, "point_i", "point_j", "radius"))


def _stated_fields(kind: type[Any]) -> Iterator[tuple[str, str]]:
    """Yield the names of facts that a class or its bases state by field, each with a field.

    The facts of usual names are left out.
    """
    for base in kind.__mro__:
        for fact in ("dimensions", "signs", "choices"):
            declared = vars(base).get(fact, {})
            if declared is not USUAL_SIGNS and declared is not USUAL_DIMENSIONS:
                yield from ((fact, name) for name in declared)


def symbols(kind: type[Any]) -> tuple[str, ...]:
    """Return the symbols that a class may state.

    Examples
    --------
    >>> from jounce import planar
    >>> from jounce.constraints.facts import symbols
    >>> symbols(planar.Revolute)
    ('revolute', 'rod', 'slot', 'prismatic', 'coordinate', 'gear', 'rolling', 'curve', 'belt', 'rope')
    """
    if kind.role in ("driver", "force"):
        return _DRIVES if kind.role == "driver" else _LOADS
    return _MACHINES.get(kind.space) or tuple(dict.fromkeys((*_MACHINES["planar"], *_MACHINES["spatial"])))


def stem_of(field: str) -> str:
    """Return the name of a field without the ending of its body."""
    return field[:-2] if field[-2:] in BODY_ENDINGS else field


def has_other_sign(sign: str, smallest: Any, largest: Any) -> Any:
    """Return whether values lack the required sign, given their least entries and largest magnitudes.

    Examples
    --------
    >>> has_other_sign("positive", -1.0, 1.0), has_other_sign("not zero", -1.0, 1.0)
    (True, False)
    """
    match sign:
        case "positive":
            return smallest <= 0
        case "not negative":
            return smallest < 0
        case "not zero":
            return largest == 0
        case "pressure angle":
            return smallest < 0 or largest > math.pi / 4
        case "lead angle":
            return smallest <= 0 or largest >= math.pi / 2
        case "helix angle":
            return largest >= math.pi / 2
        case "efficiency":
            return smallest <= 0 or largest > 1
        case "at most 1":
            return smallest > 1
    return False


def at_coordinate(dimension: str, coordinate: object) -> str:
    """Return the dimension of a field, resolved by the field ``coordinate`` if it depends on it.

    Examples
    --------
    >>> at_coordinate("of coordinate", "angle"), at_coordinate("per angle", "x"), at_coordinate("mass", "x")
    ('angle', 'length per angle', 'mass')
    """
    return BY_COORDINATE[dimension][coordinate == "angle"] if dimension in BY_COORDINATE else dimension


def dimension_of_field(element: Any, field: str) -> str:
    """Return the dimension of a field of an element, resolved by its coordinate.

    Examples
    --------
    >>> from jounce import drivers
    >>> dimension_of_field(drivers.CoordinateDriver(("ground", "crank"), "angle", motion="t"), "motion")
    'angle'
    """
    dimension = facts_of(type(element)).dimensions.get(field, "any")
    return at_coordinate(dimension, getattr(element, "coordinate", ""))


@lru_cache(maxsize=1000)
def value_fields(kind: type[Any]) -> Mapping[str, dataclasses.Field]:
    """Return the fields of a joint, driver or force that users give, by name, without `bodies`."""
    return {field.name: field for field in dataclasses.fields(kind) if field.name != "bodies" and field.init}


@lru_cache(maxsize=1000)
def field_kinds(kind: type[Any]) -> Mapping[str, str]:
    """Return the kinds of the fields that users give, by name; see `field_kind`."""
    return {name: field_kind(field) for name, field in value_fields(kind).items()}


def field_kind(field: dataclasses.Field) -> str:
    """Return ``scalar``, ``vector``, ``motion``, ``law``, ``laws``, ``wrenches``, ``whole``, ``flag``, ``points``,
    ``nested``, ``curve``, ``part`` or ``text``.
    """
    if isinstance(field.type, str):  # under ``from __future__ import annotations``
        word = field.type.rpartition(".")[2].strip()
        return "motion" if word == "MotionLaw" else word.lower() if word in WORDS else "text"
    return next(iter(getattr(field.type, "__metadata__", ())), "text")
