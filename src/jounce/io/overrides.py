"""Parameters of a mechanism file given other values from outside, as ``NAME=VALUE`` with units."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from typing import Any

from jounce.errors import JounceError, MechanismError, did_you_mean
from jounce.io.source import read_source
from jounce.io.units import describe_dimension, parse_value
from jounce.mechanism import Mechanism

__all__ = ["override"]


def override(mechanism: Mechanism, path: str | PathLike[str], assignments: Iterable[str]) -> Mechanism:
    """Return a mechanism from a file with other values of some parameters.

    Parameters
    ----------
    mechanism : Mechanism
        As `load` read it.
    path
        Its file, which says what units the parameters have.
    assignments : iterable of str
        ``NAME=VALUE``, the value as a file would have it: a number in SI units, a number with a unit, or an expression
        of the other parameters.

    Raises
    ------
    MechanismError, UnitError, ExpressionError
        A name is not a parameter, or a value does not fit.

    Examples
    --------
    >>> import jounce as jn
    >>> path = "examples/four_bar.yaml"
    >>> override(jn.load(path), path, ["BC=15 cm"]).parameters["BC"]
    0.15
    """
    values: dict[str, Any] = {}
    for text in assignments:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name or not value:
            raise MechanismError("a parameter is set by NAME=VALUE, such as 'BC=15 cm'", name="--set", value=text)
        if name not in mechanism.parameters:
            message = f"no parameter has this name; {did_you_mean(name, mechanism.parameters)}"
            raise MechanismError(message, name="--set", value=name)
        try:
            values[name] = _value(name, value, mechanism, path)
        except JounceError as error:
            raise error.located(name=f"--set {name}", value=value) from None
    changed = mechanism.with_parameters(**values) if values else mechanism
    changed.parameter_values  # noqa: B018 - asked for, so that a circle is reported now
    return changed


def _value(name: str, text: str, mechanism: Mechanism, path: str | PathLike[str]) -> Any:
    names = [other for other in mechanism.parameters if other != name]
    given = parse_value(_number_or_text(text), "any", names)
    before = read_source(path).data["parameters"][name]
    was = parse_value(before, "any", names).dimension
    if None not in (given.dimension, was) and given.dimension != was:
        message = (
            f"the file has {describe_dimension(was or ())} here, this is {describe_dimension(given.dimension or ())}"
        )
        raise MechanismError(message)
    return given.value


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
