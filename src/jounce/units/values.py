"""Values of a mechanism file: a number (SI), a number with a unit, or an expression of parameters.

Common units are in a table; others are looked up in a library of units, which is imported only then.
"""

from __future__ import annotations

import math
import re
from collections import ChainMap
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation, Overflow, localcontext
from functools import lru_cache

from jounce.errors import ExpressionError, JounceError, UnitError, show_value
from jounce.units.dimensions import ANGLE, NUMBER, Dimension, check_dimension, inferred, times
from jounce.units.expression import CONSTANTS, FUNCTIONS, MAX_CHARACTERS, Expression
from jounce.units.pint_units import ask_pint
from jounce.units.table import COMMON, COMPACT, Size, nearest_unit

_DIGITS = str.maketrans("\N{SUPERSCRIPT ONE}\N{SUPERSCRIPT TWO}\N{SUPERSCRIPT THREE}\N{SUPERSCRIPT FOUR}", "1234")
_NUMBER_PATTERN = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?+"  # possessive: 1e3 is no 1 with a unit e3
_ATOM = r"[A-Za-z_\u00b0\u00b5\u03bc][A-Za-z_0-9]*"
_WHOLE = r"[-+]?[0-9]{1,2}"
_POWER = rf"(?:\s*(?:\*\*|\^)\s*(?:{_WHOLE}|\(\s*{_WHOLE}\s*\))|\u207b?[\u00b9\u00b2\u00b3\u2074])?"
_DOTS = "\u00b7\u22c5"
_SIGN = r"(?:\s*[*/\u00b7\u22c5]\s*|\s+)"
_TERM = rf"{_ATOM}{_POWER}"
_GROUP = rf"\(\s*{_TERM}(?:{_SIGN}{_TERM})*\s*\)"
_WITH_UNIT = re.compile(
    rf"({_NUMBER_PATTERN})\s*((?:1?\s*/\s*(?:{_GROUP}|{_TERM})|{_TERM})(?:{_SIGN}(?:{_GROUP}|{_TERM}))*)"
)
MOST_LOOKED_AT = 5  # number of possible units to look up within an invalid expression
_DECIMAL_COMMA = re.compile(rf"([-+]?[0-9]+),([0-9]+)\s*({_TERM}(?:{_SIGN}{_TERM})*)?")
_UNIT_WITHIN = re.compile(rf"(?<![A-Za-z_0-9.])([0-9]+\.?[0-9]*(?:[eE][-+]?[0-9]+)?)\s+({_ATOM})")
_PIECE = re.compile(rf"({_SIGN})?(?:({_ATOM})({_POWER})|\(([^()]*)\))")
_TIMES_DEG = re.compile(rf"{_NUMBER_PATTERN}\s*\*\s*deg")


@dataclass(frozen=True)
class Value:
    """A value of a file: a number in SI units or an expression, and its dimension (None if unknown)."""

    value: float | Expression
    dimension: Dimension | None = None


@lru_cache(maxsize=256)
def parse_unit(text: str) -> tuple[Size, Dimension]:
    """Return the size of a unit in SI units, and its dimension.

    Parameters
    ----------
    text : str
        Names of units with integer powers, joined by ``*``, ``/`` or spaces: ``kg*m^2/s**2``, ``N/(m*s)``; or a product
        as engineers write it, ``kNm``, ``N/mm2``.

    Raises
    ------
    UnitError
        If a unit does not exist, is outside mechanics, or has no fixed zero, as degC.

    Examples
    --------
    >>> parse_unit("mm/s")
    (Decimal('0.001'), (('length', 1), ('time', -1)))
    >>> parse_unit("kNm/rad")[0]
    Decimal('1000')
    """
    size: Size = Decimal(1)
    total: Dimension = NUMBER
    divided = False
    text = text.strip().removeprefix("1").lstrip() if re.match(r"1\s*/", text.strip()) else text.strip()
    for sign, name, exponent, group in _PIECE.findall(text):
        is_divisor = "/" in sign
        if divided and sign and not sign.strip():
            raise UnitError("a space after a / can be read in two ways; write * and parentheses")
        divided |= is_divisor
        factor, dimension = parse_unit(group) if group else _powered(name, _whole_power(exponent))
        power = -1 if is_divisor else 1
        size, total = _product(size, factor, power), times(total, dimension, power)
    return size, total


def _whole_power(text: str) -> int:
    digits = text.translate(_DIGITS).replace("\N{SUPERSCRIPT MINUS}", "-")
    return int(digits.strip(" *^()") or 1)


def _powered(name: str, power: int) -> tuple[Size, Dimension]:
    """Return the size and dimension of a power of a unit; in a compact product, the last factor has the power."""
    factors = COMPACT.get(name) if name not in COMMON else None
    if factors is None and name not in COMMON and (digit := re.fullmatch(r"([A-Za-z]+)([2-4])", name)) and power == 1:
        return _powered(digit[1], int(digit[2]))
    size: Size = Decimal(1)
    total: Dimension = NUMBER
    for factor in factors or (name,):
        factor_size, dimension = COMMON.get(factor) or _looked_up(factor)
        count = power if factor is (factors or (name,))[-1] else 1
        size, total = _product(size, factor_size, count), times(total, dimension, count)
    return size, total


def _product(size: Size, factor: Size, power: int) -> Size:
    if isinstance(size, Decimal) and isinstance(factor, Decimal):
        return size * factor**power
    return float(size) * float(factor) ** power


def _looked_up(name: str) -> tuple[Size, Dimension]:
    """Return the size and dimension of a unit in the library of units."""
    if answer := ask_pint(name):
        return answer
    label = name.encode("ascii", "backslashreplace").decode("ascii")
    raise UnitError(f"unknown unit '{label}'; {nearest_unit(name)}".rstrip("; "))


def parse_value(
    raw: object,
    kind: str = "any",
    names: Iterable[str] = (),
    dimensions: Mapping[str, Dimension] | None = None,
    variables: Mapping[str, Dimension | None] | None = None,
) -> Value:
    """Return a value of a file in SI units, or as an expression.

    Parameters
    ----------
    raw : object
        Value in the file: a number, or text with a number and a unit, or an expression.
    kind : str
        Expected kind of value, one of ``KINDS``.
    names : iterable of str
        Names permitted in expressions; a dictionary is not copied.
    dimensions : mapping of str to Dimension, optional
        Dimensions of the parameters with units; those of expressions are derived and checked.
    variables : mapping of str to Dimension or None, optional
        Additional names permitted in expressions, of variables: time, s, and others of a law.

    Returns
    -------
    Value
        Number in SI units, or expression.

    Raises
    ------
    UnitError, ExpressionError
        If the value is not valid; the message contains neither location nor value.

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
        variables = variables or {}
        known_names = ChainMap(dict(variables), names) if isinstance(names, dict) else {*names, *variables}
        return _parse_text(raw, kind, known_names, dimensions or {}, variables)
    try:
        number = float(raw)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnitError("must be a finite number")
    return Value(number)


def stated_dimensions(
    parameters: Mapping[str, object], known: Mapping[str, Dimension] | None = None
) -> dict[str, Dimension]:
    """Return the dimensions of parameters that have a unit, or follow from parameters with units.

    A product with a number has no certain dimension, because the number may have any unit.

    Parameters
    ----------
    parameters : mapping of str to object
        Values of the parameters, as in a file.
    known : mapping of str to Dimension, optional
        Known dimensions, which are also returned.

    Examples
    --------
    >>> stated_dimensions({"area": "a*a", "a": "5 cm", "double": "2*a"})
    {'a': (('length', 1),), 'area': (('length', 2),)}
    """
    dimensions, pending, count = dict(known or {}), dict(parameters), -1
    while len(dimensions) > count:
        count = len(dimensions)
        for name, raw in list(pending.items()):
            try:
                dimension = parse_value(raw, "any", parameters, dimensions).dimension
            except JounceError:  # reported elsewhere, with its location
                continue
            if dimension is not None:
                dimensions.setdefault(name, dimension)
                del pending[name]
    return dimensions


def _parse_text(
    text: str,
    kind: str,
    known_names: Collection[str],
    dimensions: Mapping[str, Dimension],
    variables: Mapping[str, Dimension | None],
) -> Value:
    if len(text) > MAX_CHARACTERS:
        raise ExpressionError(f"a value has at most {MAX_CHARACTERS} characters")
    if comma := _DECIMAL_COMMA.fullmatch(text.strip()):
        point = f"{comma[1]}.{comma[2]} {comma[3] or ''}".strip()
        alternative = f" or {comma[1]}{comma[2]} {comma[3] or ''}".rstrip() if len(comma[2]) == 3 else ""
        raise UnitError(f"a number has a decimal point and no thousands separator: write {point}{alternative}")
    with_unit = _WITH_UNIT.fullmatch(text.strip())
    if with_unit and not _divided_by_a_name(with_unit[2], known_names):
        return _parse_with_unit(*with_unit.groups(), kind=kind, known_names=known_names, variables=variables)
    if text.strip().lower() in {".nan", "nan", "inf", ".inf", "-inf", "-.inf", "+inf", "infinity", "-infinity"}:
        raise UnitError("must be a finite number")
    try:
        expression = Expression(text, known_names)
    except ExpressionError as error:
        raise _with_units_named(error, text, known_names) from None
    if not expression.names:
        if _TIMES_DEG.fullmatch(expression.text):
            check_dimension(ANGLE, kind, show_value(expression.text))
        return Value(expression.evaluate())
    if expression.text in dimensions:
        check_dimension(dimensions[expression.text], kind, f"the parameter '{expression.text}'")
        return Value(expression, dimensions[expression.text])
    given = {name: dimensions[name] for name in expression.names if name in dimensions and name not in variables}
    dimension = inferred(expression, given, variables, kind)
    if dimension is not None:
        check_dimension(dimension, kind, f"'{expression.text}'", exactly=False)
    return Value(expression, dimension)


def expression_in_si(text: str) -> Expression:
    """Return the expression of a text in a place without units, which only files and parameters may state.

    Raises
    ------
    UnitError
        If the text contains a number with a unit.
    ExpressionError
        If the text is no expression.
    """
    try:
        return Expression(text)
    except ExpressionError as error:
        if _unit_within(text, ()) is None:
            raise
        message = "units are read in files, and in parameters; give a number in SI units, or a parameter"
        raise UnitError(message, value=text) from error


def _with_units_named(error: ExpressionError, text: str, known_names: Collection[str]) -> JounceError:
    """Return an error about a number with a unit in an expression, if there is one; otherwise the given error."""
    if (quantity := _unit_within(text, known_names)) is None:
        return error
    message = (
        f"a number with a unit must stand alone: '{quantity}' cannot be a part of an expression; define a "
        "parameter with this value, and write its name here"
    )
    return UnitError(message)


def _unit_within(text: str, known_names: Collection[str]) -> str | None:
    """Return the first number with a unit in a text that is no expression; None if there is none."""
    for number, unit in _UNIT_WITHIN.findall(text)[:MOST_LOOKED_AT]:
        if unit in known_names or unit in CONSTANTS:
            continue
        try:
            parse_unit(unit)
        except UnitError:
            continue
        return f"{number} {unit}"
    return None


def _divided_by_a_name(unit: str, known_names: Collection[str]) -> bool:
    """Return whether a division by a name of an expression follows a number: 1/t is no number per tonne."""
    first = re.match(_ATOM, unit.lstrip("/ "))
    return unit.startswith("/") and first is not None and (first.group() in known_names or first.group() == "pi")


def _multiplied(sign: re.Match[str]) -> str:
    """Return the sign between two factors, with * for a space."""
    return sign[0].strip() or "*"


def _parse_with_unit(
    number: str, unit: str, *, kind: str, known_names: Collection[str], variables: Mapping[str, Dimension | None]
) -> Value:
    first = re.match(_ATOM, unit)
    variable = next((atom for atom in re.finditer(_ATOM, unit) if atom.start() and atom[0] in variables), None)
    if variable:  # in a law, t is no tonne
        before = unit[: variable.start()].rstrip()
        if set(re.findall(_ATOM, before)) <= {*known_names, *CONSTANTS}:
            raise UnitError(f"a product needs its *, as in {number}*{re.sub(_SIGN, _multiplied, unit)}")
        sign = "/" if before.endswith("/") else "*"
        given = f"{number} {before.rstrip(f'*/ {_DOTS}')}"
        message = f"a number with a unit must stand alone, and '{variable[0]}' would be a unit, too; give "
        if "(" in before:
            raise UnitError(f"{message}it as a parameter, and write its name here")
        raise UnitError(f"{message}'{given}' as a parameter, such as c: {given}, and write c{sign}{variable[0]}")
    try:
        size, dimension = parse_unit(unit)
        check_dimension(dimension, kind, f"the unit of {show_value(f'{number} {unit}')}")
    except UnitError as error:
        if first and first.group() in {*known_names, "pi", *FUNCTIONS}:
            raise UnitError(f"{error.message}; a product needs its *, as in {number}*{unit}") from None
        raise
    except (ArithmeticError, InvalidOperation):
        raise UnitError(f"unit out of range in {show_value(unit)}") from None
    if isinstance(size, Decimal):
        try:
            with localcontext(prec=40):
                value = float(Decimal(number) * size)
        except (ArithmeticError, InvalidOperation, Overflow):
            value = math.inf
    else:
        value = float(number) * size
    if not math.isfinite(value):
        raise UnitError("must be a finite number")
    return Value(value, dimension)
