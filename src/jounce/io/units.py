"""Values as a mechanism file writes them: a number (SI), a number with a unit, or an expression of parameters.

Common units are in a table, so that a usual file loads without pint; every other unit is asked of pint, which is
imported only then. Plane angle counts as a dimension of its own here, so that degrees are refused where a length is
expected.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal, DivisionByZero, InvalidOperation, Overflow, localcontext
from functools import lru_cache
from typing import Any

from jounce.errors import ExpressionError, UnitError, did_you_mean, show_value
from jounce.trajectory.expression import CONSTANTS, MAX_CHARACTERS, Expression

__all__ = ["KINDS", "Dimension", "Value", "check_dimension", "parse_unit", "parse_value"]

Dimension = tuple[tuple[str, int], ...]
"""Powers of the base quantities, sorted by name; empty for a pure number."""


def _dimension(**powers: int) -> Dimension:
    return tuple(sorted((name, power) for name, power in powers.items() if power))


def _per_angle(dimension: Dimension) -> Dimension:
    return _dimension(**dict(dimension), angle=-1)


NUMBER = _dimension()
_LENGTH, _ANGLE, _TIME, _MASS = (_dimension(**{name: 1}) for name in ("length", "angle", "time", "mass"))
_FORCE = _dimension(mass=1, length=1, time=-2)
_TORQUE = _dimension(mass=1, length=2, time=-2)
_TORSIONAL_DAMPING = _dimension(mass=1, length=2, time=-1)
_TURN = 2 * math.pi

_COMMON: dict[str, tuple[Decimal | float, Dimension]] = {
    **{name: (Decimal(size), _LENGTH) for name, size in [("m", "1"), ("dm", "0.1"), ("cm", "0.01"), ("mm", "0.001")]},
    **{name: (Decimal(size), _LENGTH) for name, size in [("um", "1e-6"), ("km", "1e3"), ("in", "0.0254")]},
    **{name: (Decimal(size), _LENGTH) for name, size in [("inch", "0.0254"), ("ft", "0.3048")]},
    **dict.fromkeys(("deg", "degree", "degrees", "\N{DEGREE SIGN}"), (CONSTANTS["deg"], _ANGLE)),
    **dict.fromkeys(("rev", "turn", "turns"), (_TURN, _ANGLE)),
    "rad": (Decimal(1), _ANGLE),
    "mrad": (Decimal("0.001"), _ANGLE),
    "rpm": (_TURN / 60, _dimension(angle=1, time=-1)),
    **{name: (Decimal(size), _TIME) for name, size in [("s", "1"), ("ms", "1e-3"), ("us", "1e-6"), ("min", "60")]},
    "h": (Decimal(3600), _TIME),
    "Hz": (Decimal(1), _dimension(time=-1)),
    "kg": (Decimal(1), _MASS),
    "g": (Decimal("0.001"), _MASS),
    "t": (Decimal(1000), _MASS),
    "N": (Decimal(1), _FORCE),
    "kN": (Decimal(1000), _FORCE),
}
"""Size in SI units and dimension. Decimal sizes make ``13.21 cm`` the double nearest to 0.1321."""

_PINT_BASES = {"meter": "length", "radian": "angle", "second": "time", "kilogram": "mass"}

KINDS: dict[str, tuple[str, tuple[Dimension, ...]]] = {
    "length": ("a length, such as 5 cm", (_LENGTH,)),
    "angle": ("an angle, such as 30 deg", (_ANGLE, NUMBER)),
    "time": ("a time, such as 2 s", (_TIME,)),
    "ratio": ("a pure number", (NUMBER,)),
    "length per angle": ("a length (per radian), such as 5 cm", (_LENGTH, _dimension(length=1, angle=-1))),
    "mass": ("a mass, such as 2 kg", (_MASS,)),
    "density": ("a density, such as 7850 kg/m^3", (_dimension(mass=1, length=-3),)),
    "first moment": ("a first moment of mass, such as 0.2 kg*m", (_dimension(mass=1, length=1),)),
    "force": ("a force, such as 10 N", (_FORCE,)),
    "torque": ("a torque, such as 2 N*m", (_TORQUE,)),
    "stiffness": ("a stiffness, such as 500 N/m", (_dimension(mass=1, time=-2),)),
    "damping": ("a damping, such as 3 N*s/m", (_dimension(mass=1, time=-1),)),
    "torsional stiffness": ("a torsional stiffness, such as 2 N*m/rad", (_TORQUE, _per_angle(_TORQUE))),
    "torsional damping": (
        "a torsional damping, such as 0.1 N*m*s/rad",
        (_TORSIONAL_DAMPING, _per_angle(_TORSIONAL_DAMPING)),
    ),
    "inertia": ("a moment of inertia, such as 0.1 kg*m^2", (_dimension(mass=1, length=2),)),
    "acceleration": ("an acceleration, such as 9.81 m/s^2", (_dimension(length=1, time=-2),)),
    "any": ("a value", ()),
}
"""Kinds of value: how to word each, and the dimensions that its unit may have (any when none is listed)."""


@dataclass(frozen=True)
class Value:
    """A value from a file: a number in SI units or an expression, and the dimension of its unit (None without one)."""

    value: float | Expression
    dimension: Dimension | None = None


_NUMBER_PATTERN = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_ATOM = r"[A-Za-z_\u00b0\u00b5\u03bc][A-Za-z_0-9]*"
_POWER = r"(?:\s*(?:\*\*|\^)\s*(?:[-+]?[0-9]{1,2}|\(\s*[-+]?[0-9]{1,2}\s*\)))?"
_WITH_UNIT = re.compile(rf"({_NUMBER_PATTERN})\s*({_ATOM}{_POWER}(?:\s*[*/]\s*{_ATOM}{_POWER})*)")
_FACTOR = re.compile(rf"\s*([*/]?)\s*({_ATOM})({_POWER})")


@lru_cache(maxsize=256)
def parse_unit(text: str) -> tuple[Decimal | float, Dimension]:
    """Return the size of a unit in SI units, and its dimension.

    Parameters
    ----------
    text : str
        Names of units joined by ``*`` and ``/``, with whole powers: ``kg*m^2/s**2``.

    Raises
    ------
    UnitError
        A unit does not exist, or has no fixed zero, as degC.

    Examples
    --------
    >>> parse_unit("mm/s")
    (Decimal('0.001'), (('length', 1), ('time', -1)))
    """
    size: Decimal | float = Decimal(1)
    powers: dict[str, int] = {}
    for operator, name, exponent in _FACTOR.findall(text):
        factor, dimension = _COMMON.get(name) or _ask_pint(name)
        power = int(exponent.strip(" *^()") or 1) * (-1 if operator == "/" else 1)
        if isinstance(size, Decimal) and isinstance(factor, Decimal):
            size = size * factor**power
        else:
            size = float(size) * float(factor) ** power
        for base, count in dimension:
            powers[base] = powers.get(base, 0) + count * power
    return size, _dimension(**powers)


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def _ask_pint(name: str) -> tuple[float, Dimension]:
    """Look a unit up in pint, in SI base units with the radian kept."""
    registry = _registry()
    unknown = UnitError(f"unknown unit '{_ascii(name)}'; {did_you_mean(name, _COMMON, limit=0)}".rstrip("; "))
    try:
        if name not in registry:
            raise unknown
        factor, units = registry.get_base_units(name)
        powers = dict(registry.Quantity(factor, units).unit_items())
        dimension = _dimension(
            **{_PINT_BASES.get(str(base), str(base)): _whole(power) for base, power in powers.items()}
        )
        if not registry._is_multiplicative(name):
            raise UnitError(f"the unit '{_ascii(name)}' has no fixed zero, it cannot be used")
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        raise unknown from None
    return float(factor), dimension


def _whole(power: int | float) -> int:
    if power != int(power):
        raise UnitError("a unit with a broken power cannot be used")
    return int(power)


def _ascii(text: str) -> str:
    return text.encode("ascii", "backslashreplace").decode("ascii")


def describe_dimension(dimension: Dimension) -> str:
    """Word a dimension.

    Examples
    --------
    >>> describe_dimension((("length", 1), ("time", -2)))
    'an acceleration'
    >>> describe_dimension((("length", 1), ("time", -3)))
    'length/time^3'
    """
    named = {powers[0]: words.partition(",")[0] for words, powers in KINDS.values() if len(powers) == 1}
    named |= {KINDS[kind][1][1]: f"a {kind}" for kind in ("torsional stiffness", "torsional damping")}
    if dimension in named:
        return named[dimension]
    if dimension == _ANGLE:
        return "an angle"
    over = "*".join(base if power == 1 else f"{base}^{power}" for base, power in dimension if power > 0) or "1"
    under = "/".join(base if power == -1 else f"{base}^{-power}" for base, power in dimension if power < 0)
    return f"{over}/{under}" if under else over


def check_dimension(dimension: Dimension, kind: str, what: str) -> None:
    """Raise UnitError unless a dimension fits a kind of value; ``what`` names what has the dimension."""
    words, allowed = KINDS[kind]
    if allowed and dimension not in allowed:
        raise UnitError(f"expected {words}, but {what} is {describe_dimension(dimension)}")


def parse_value(
    raw: object, kind: str = "any", names: Iterable[str] = (), dimensions: Mapping[str, Dimension] | None = None
) -> Value:
    """Read one value of a file.

    Parameters
    ----------
    raw : object
        What the file holds: a number, or text with a number and a unit, or an expression.
    kind : str
        What is expected, one of ``KINDS``.
    names : iterable of str
        Names that an expression may use.
    dimensions : mapping of str to Dimension, optional
        Dimensions of those parameters that were given with a unit. An expression that is one such name alone is
        checked; the dimension of a longer expression is up to its author.

    Returns
    -------
    Value
        The number in SI units, or the expression.

    Raises
    ------
    UnitError, ExpressionError
        What is wrong, without the place and without the value.

    Examples
    --------
    >>> parse_value("13.21 cm", "length").value
    0.1321
    >>> parse_value("AB/2", "length", names=["AB"]).value
    Expression('AB/2')
    """
    if isinstance(raw, bool) or not isinstance(raw, (int, float, str)):
        raise UnitError("must be a number, a number with a unit, or an expression")
    if isinstance(raw, str):
        return _parse_text(raw, kind, names, dimensions or {})
    try:
        number = float(raw)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnitError("must be a finite number")
    return Value(number)


def _parse_text(text: str, kind: str, names: Iterable[str], dimensions: Mapping[str, Dimension]) -> Value:
    if len(text) > MAX_CHARACTERS:
        raise ExpressionError(f"a value has at most {MAX_CHARACTERS} characters")
    known = set(names)
    if with_unit := _WITH_UNIT.fullmatch(text.strip()):
        return _parse_with_unit(*with_unit.groups(), kind=kind, known=known)
    if text.strip().lower() in {".nan", "nan", "inf", ".inf", "-inf", "-.inf", "+inf", "infinity", "-infinity"}:
        raise UnitError("must be a finite number")
    expression = Expression(text, known)
    if not expression.names:
        return Value(expression.evaluate())
    if expression.text in dimensions:
        check_dimension(dimensions[expression.text], kind, f"the parameter '{expression.text}'")
        return Value(expression, dimensions[expression.text])
    return Value(expression)


def _parse_with_unit(number: str, unit: str, *, kind: str, known: set[str]) -> Value:
    try:
        size, dimension = parse_unit(unit)
        check_dimension(dimension, kind, f"the unit of {show_value(f'{number} {unit}')}")
    except UnitError as error:
        first = re.match(_ATOM, unit)
        if first and first.group() in known:
            raise UnitError(f"{error.message}; a product needs its *, as in {number}*{unit}") from None
        raise
    except (ArithmeticError, InvalidOperation):
        raise UnitError(f"unit out of range in {show_value(unit)}") from None
    if isinstance(size, Decimal):
        try:
            with localcontext(prec=40):
                value = float(Decimal(number) * size)
        except (DivisionByZero, InvalidOperation, Overflow):
            value = math.inf
    else:
        value = float(number) * size
    if not math.isfinite(value):
        raise UnitError("must be a finite number")
    return Value(value, dimension)
