"""Dimensions of values: those permitted for each kind of value, and those of expressions.

Plane angle counts as a base dimension, so that degrees are refused where a length is expected.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from jounce.errors import UnitError
from jounce.units.expression import CONSTANTS, Expression

Dimension = tuple[tuple[str, int | Fraction], ...]
"""Powers of the base quantities, sorted by name; empty for a pure number."""


def dimension_of(**powers: int | Fraction) -> Dimension:
    """Return the dimension of given powers of length, angle, time and mass."""
    return tuple(sorted((name, power) for name, power in powers.items() if power))


def times(first: Dimension, second: Dimension, power: int | Fraction = 1) -> Dimension:
    """Return the dimension of the product of a value and a power of another."""
    powers: dict[str, int | Fraction] = dict(first)
    for name, count in second:
        total = Fraction(powers.get(name, 0)) + Fraction(count) * power
        powers[name] = total.numerator if total.denominator == 1 else total
    return dimension_of(**powers)


NUMBER = dimension_of()
LENGTH, ANGLE, TIME, MASS = (dimension_of(**{name: 1}) for name in ("length", "angle", "time", "mass"))
FORCE = dimension_of(mass=1, length=1, time=-2)
TORQUE = times(FORCE, LENGTH)
_PER_TIME, _PER_ANGLE = dimension_of(time=-1), dimension_of(angle=-1)
_STIFFNESS, _DAMPING = times(FORCE, LENGTH, -1), dimension_of(mass=1, time=-1)
_TORSIONAL_DAMPING = times(TORQUE, TIME)

KINDS: dict[str, tuple[str, tuple[Dimension, ...]]] = {
    "length": ("a length, such as 5 cm", (LENGTH,)),
    "angle": ("an angle, such as 30 deg", (ANGLE, NUMBER)),
    "time": ("a time, such as 2 s", (TIME,)),
    "ratio": ("a pure number", (NUMBER,)),
    "length per angle": ("a length (per radian), such as 5 cm", (LENGTH, times(LENGTH, _PER_ANGLE))),
    "mass": ("a mass, such as 2 kg", (MASS,)),
    "density": ("a density, such as 7850 kg/m^3", (dimension_of(mass=1, length=-3),)),
    "first moment": ("a first moment of mass, such as 0.2 kg*m", (dimension_of(mass=1, length=1),)),
    "force": ("a force, such as 10 N", (FORCE,)),
    "torque": ("a torque, such as 2 N*m", (TORQUE,)),
    "stiffness": ("a stiffness, such as 500 N/m", (_STIFFNESS,)),
    "damping": ("a damping, such as 3 N*s/m", (_DAMPING,)),
    "torsional stiffness": ("a torsional stiffness, such as 2 N*m/rad", (TORQUE, times(TORQUE, _PER_ANGLE))),
    "torsional damping": (
        "a torsional damping, such as 0.1 N*m*s/rad",
        (_TORSIONAL_DAMPING, times(_TORSIONAL_DAMPING, _PER_ANGLE)),
    ),
    "inertia": ("a moment of inertia, such as 0.1 kg*m^2", (dimension_of(mass=1, length=2),)),
    "angular speed": ("an angular speed, such as 10 rpm", (dimension_of(angle=1, time=-1), dimension_of(time=-1))),
    "speed": ("a speed, such as 1 mm/s", (dimension_of(length=1, time=-1),)),
    "acceleration": ("an acceleration, such as 9.81 m/s^2", (dimension_of(length=1, time=-2),)),
    "any": ("a value", ()),
}
"""Kinds of value: a description, and the permitted dimensions (any if empty)."""

_SI_UNITS = {"length": "m", "angle": "rad", "time": "s", "mass": "kg"}
_WORDS: dict[Dimension, str] = {
    **{powers[0]: words.partition(",")[0] for words, powers in KINDS.values() if len(powers) == 1},
    **{KINDS[kind][1][1]: f"a {kind}" for kind in ("torsional stiffness", "torsional damping")},
    ANGLE: "an angle",
    dimension_of(length=2): "an area",
    dimension_of(length=3): "a volume",
}


def describe_dimension(dimension: Dimension) -> str:
    """Return a description of a dimension.

    Examples
    --------
    >>> describe_dimension((("length", 1), ("time", -2)))
    'an acceleration'
    >>> describe_dimension((("length", 1), ("time", -3)))
    'length/time^3'
    """
    if dimension in _WORDS:
        return _WORDS[dimension]
    numerator = "*".join(base if power == 1 else f"{base}^{power}" for base, power in dimension if power > 0) or "1"
    denominator = "/".join(base if power == -1 else f"{base}^{-power}" for base, power in dimension if power < 0)
    return f"{numerator}/{denominator}" if denominator else numerator


def si_unit(dimension: Dimension) -> str:
    """Return the SI unit of a dimension, as a file states it; empty for a pure number.

    Examples
    --------
    >>> si_unit(TORQUE), si_unit(dimension_of(mass=1, time=-1)), si_unit(dimension_of(time=-1))
    ('N*m', 'N*s/m', '1/s')
    """
    powers = dict(dimension)
    with_force = powers.get("mass") == 1 and "time" in powers
    parts = (
        [("N", 1), *times(dimension, FORCE, -1)]
        if with_force
        else sorted(dimension, key=lambda entry: entry[0] != "mass")
    )
    named = [(_SI_UNITS.get(base, base), power) for base, power in parts]
    over = "*".join(unit if power == 1 else f"{unit}^{power}" for unit, power in named if power > 0)
    under = "".join(f"/{unit}" if power == -1 else f"/{unit}^{-power}" for unit, power in named if power < 0)
    return (over or "1") + under if dimension else ""


def check_dimension(dimension: Dimension, kind: str, noun: str, *, exactly: bool = True) -> None:
    """Raise UnitError unless a dimension suits a kind of value; ``noun`` names the value.

    For computed values (not ``exactly``), powers of angles are ignored: a radius times an angle is a length.
    """
    expected, allowed = KINDS[kind]
    if not exactly:
        dimension_of_it, fitting = without_angles(dimension), [without_angles(entry) for entry in allowed]
    else:
        dimension_of_it, fitting = dimension, list(allowed)
    if fitting and dimension_of_it not in fitting:
        raise UnitError(f"expected {expected}, but {noun} is {describe_dimension(dimension)}")


def is_rate(dimension: Dimension, bases: Iterable[str], order: int, by: str = "time") -> bool:
    """Return whether a dimension is that of a derivative of some kind of value by time, or by another quantity.

    If `by` is an angle or a length, powers of angles are ignored: mm, mm/rad and mm/deg^2 are rates of a cam by its
    angle.
    """
    rates = [times(KINDS[base][1][0], dimension_of(**{by: 1}), -order) for base in bases]
    return dimension in rates if by == "time" else without_angles(dimension) in map(without_angles, rates)


def per_power(order: int, unit: str = "s") -> str:
    """Return the words for the order of a derivative, to follow the unit of the quantity."""
    return ("", f" per {unit}")[order] if order < 2 else f" per {unit}^{order}"


def check_one_of(dimension: Dimension, allowed: tuple[Dimension, ...], *, exactly: bool = True) -> None:
    """Raise UnitError unless the dimension of a new value of a parameter is permitted."""
    if dimension in allowed or (not exactly and without_angles(dimension) in map(without_angles, allowed)):
        return
    message = f"this is {describe_dimension(dimension)}, but the parameter is {describe_dimension(allowed[0])}"
    raise UnitError(message)


def without_angles(dimension: Dimension) -> Dimension:
    """Return a dimension without its powers of angles, which are pure numbers in SI."""
    return tuple(entry for entry in dimension if entry[0] != "angle")


@dataclass(frozen=True)
class _Part:
    """The dimension of a part of an expression, as far as known.

    Attributes
    ----------
    dimension : Dimension or None
        Dimension; None if nothing is known, as for a parameter without a unit.
    doubt : int
        0 if the dimension is certain; `LIKELY` or `DOUBTFUL` if a number in a product may have an unwritten unit, as
        500 in ``-500*(x - a)``, or 12 in ``m/12``, for a rod of 1 m.
    stated : bool
        Whether the part contains a parameter with a unit; without one, it may be in any unit, as ``sin(t)``.
    number : float or None
        Value of a number.
    """

    dimension: Dimension | None
    doubt: int = 0
    stated: bool = False
    number: float | None = None


LIKELY, DOUBTFUL = 1, 2

_UNKNOWN = _Part(None, DOUBTFUL)

_GEOMETRIC = frozenset(("length", "angle", "time", "length per angle"))
"""Kinds of values for which ``BC/2`` is half of BC, and not BC divided by 2 of some unit."""


def inferred(
    expression: Expression,
    dimensions: Mapping[str, Dimension],
    variables: Mapping[str, Dimension | None] | None = None,
    kind: str = "any",
) -> Dimension | None:
    """Return the dimension of an expression; None if it is not certain.

    Only parameters with units make a dimension certain. Numbers in an expression are in SI, and may have an unwritten
    unit: a product with a number has no certain dimension. Where a length, an angle or a time is expected, integers up
    to 12 and 0.5 count as pure numbers, unless the expression contains a variable.

    Parameters
    ----------
    expression : Expression
        Expression of named values.
    dimensions : mapping of str to Dimension
        Dimensions of the parameters with units.
    variables : mapping of str to Dimension or None, optional
        Dimensions of time and other variables of a law; None if unknown.
    kind : str, default "any"
        Expected kind of value, one of `KINDS`.

    Raises
    ------
    UnitError
        If values of different dimensions are added, or a function is applied to a value with a dimension.

    Examples
    --------
    >>> from jounce.units.dimensions import LENGTH, TIME, inferred
    >>> inferred(Expression("pi*r/T"), {"r": LENGTH, "T": TIME})
    (('length', 1), ('time', -1))
    >>> inferred(Expression("r + T"), {"r": LENGTH, "T": TIME})
    Traceback (most recent call last):
    ...
    jounce.errors.UnitError: 'r + T' adds a time to a length
    """
    part = _Reader(expression, dimensions, variables or {}).read()
    certain = part.stated and part.doubt <= (LIKELY if kind in _GEOMETRIC else 0)
    return part.dimension or None if certain else None  # a ratio may be meant as a share of 1 m


class _Reader:
    """Derives the dimension of an expression from those of its names."""

    def __init__(
        self, expression: Expression, dimensions: Mapping[str, Dimension], variables: Mapping[str, Dimension | None]
    ):
        self.text, self.expression, self.known, self.variables = expression.text, expression, dimensions, variables
        self.varies = bool(expression.names & variables.keys())

    def read(self) -> _Part:
        return self.expression.folded(self._number, self._name, self._apply)

    def _number(self, value: float) -> _Part:
        if value == 0:
            return _UNKNOWN
        if value == CONSTANTS["deg"]:
            return _Part(ANGLE, number=value)
        is_small = not self.varies and (value == 0.5 or (value.is_integer() and value <= 12))
        return _Part(NUMBER, 0 if value == CONSTANTS["pi"] else LIKELY if is_small else DOUBTFUL, number=value)

    def _name(self, name: str) -> _Part:
        if name in self.known:
            return _Part(self.known[name], stated=True)
        dimension = self.variables.get(name)
        return _UNKNOWN if dimension is None else _Part(dimension)

    def _apply(self, operation: str, parts: list[_Part]) -> _Part:
        first, second = parts[0], parts[-1]
        if operation in ("pos", "neg", "abs"):
            return replace(first, number=-first.number if operation == "neg" and first.number is not None else None)
        if operation in ("+", "-", "atan2"):
            total = self._sum(first, second)
            return total if operation != "atan2" else replace(total, dimension=ANGLE, doubt=0)
        if operation in ("*", "/"):
            return self._product(first, second, 1 if operation == "*" else -1)
        if operation == "sign":
            return _Part(NUMBER)
        if operation == "sqrt":
            return self._power(first, Fraction(1, 2))
        if operation == "**":
            if second.number is not None and math.isfinite(second.number):
                return self._power(first, Fraction(second.number).limit_denominator(100))
            self._pure(second, "an exponent")
            return replace(first, number=None) if first.dimension == NUMBER else _UNKNOWN
        self._pure(first, f"the argument of {operation}")
        is_inverse = operation in ("asin", "acos", "atan")
        return _Part(ANGLE, stated=first.stated) if is_inverse else _Part(NUMBER)

    def _pure(self, part: _Part, noun: str) -> None:
        if not part.doubt and part.stated and part.dimension is not None and without_angles(part.dimension):
            raise UnitError(f"{noun} in '{self.text}' is {describe_dimension(part.dimension)}, not a pure number")

    def _sum(self, first: _Part, second: _Part) -> _Part:
        stated = sorted((p for p in (first, second) if p.stated and p.doubt < DOUBTFUL), key=lambda p: p.doubt)
        if not stated:
            return _UNKNOWN
        dimensions = [without_angles(part.dimension or ()) for part in stated]
        if len(stated) == 2 and dimensions[0] != dimensions[1]:
            if stated[1].doubt:
                return _UNKNOWN
            a, b = (describe_dimension(part.dimension or ()) for part in (second, first))
            raise UnitError(f"'{self.text}' adds {a} to {b}")
        best, other = stated[0], second if stated[0] is first else first
        if len(stated) == 1 and not other.doubt and other.dimension and other.dimension == best.dimension:
            return replace(best, stated=False)  # t - start may be in any unit, as t may
        return replace(best, number=None)

    @staticmethod
    def _product(first: _Part, second: _Part, power: int) -> _Part:
        if first.dimension is None or second.dimension is None:
            return _UNKNOWN
        dimension = times(first.dimension, second.dimension, power)
        number = None if None in (first.number, second.number) else math.nan
        if number is not None and (power > 0 or second.number):
            number = first.number * second.number**power  # type: ignore[operator]
        return _Part(dimension, max(first.doubt, second.doubt), first.stated or second.stated, number)

    @staticmethod
    def _power(part: _Part, power: Fraction) -> _Part:
        if part.dimension is None:
            return part
        return _Part(times(NUMBER, part.dimension, power), part.doubt, part.stated)


def variables_of(kind: Any) -> dict[str, Dimension | None]:
    """Return the variables of a force law, including time, with their dimensions; None if unknown."""
    base = {"N": LENGTH, "N*m": ANGLE}.get(kind.unit) if kind.__module__.startswith("jounce.") else None
    dimensions: dict[str, Dimension | None] = {"t": TIME}
    for names, dimension in ((kind.displacement_names, base), (kind.velocity_names, base and times(base, _PER_TIME))):
        dimensions |= dict.fromkeys(names, dimension)
    return dimensions
