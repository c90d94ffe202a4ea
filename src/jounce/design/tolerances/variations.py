"""Variations of parameters of a design, written as ``3cm:5cm:101``, ``12cm:16cm`` or ``normal:0.1mm``."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import real_numbers
from jounce.errors import ExpressionError, JounceError, MechanismError, check_name, did_you_mean
from jounce.mechanism import Mechanism
from jounce.units.assignments import assignments

FORMS = "LOW:HIGH, LOW:HIGH:COUNT, normal:SIGMA or uniform:HALFWIDTH"
MOST_VALUES = 10_000_000  # of one parameter

Reader = Callable[[str, str], float]
"""Function from the name of a parameter and a text, with or without a unit, to a value, SI."""


@dataclasses.dataclass(frozen=True)
class Interval:
    """All values between two bounds, or evenly spaced values with both ends.

    Parameters
    ----------
    low, high : float
        Bounds, SI.
    count : int, optional
        Number of values; by default the interval is continuous.
    """

    low: float
    high: float
    count: int | None = None

    @property
    def values(self) -> Float[np.ndarray, " value"]:
        """The values of an interval with a count."""
        assert self.count is not None
        return np.linspace(self.low, self.high, self.count)

    def quantile(self, share: Float[np.ndarray, "*batch"], nominal: float) -> Float[np.ndarray, "*batch"]:
        """Return the quantiles for probabilities."""
        del nominal
        return self.low + (self.high - self.low) * share

    def deviation(self) -> float:
        """Return the standard deviation of the uniform distribution over the interval."""
        return (self.high - self.low) / math.sqrt(12)


@dataclasses.dataclass(frozen=True)
class Uniform:
    """Uniform distribution within a half-width of the nominal value."""

    halfwidth: float

    def quantile(self, share: Float[np.ndarray, "*batch"], nominal: float) -> Float[np.ndarray, "*batch"]:
        """Return the quantiles for probabilities."""
        return nominal + self.halfwidth * (2 * share - 1)

    def deviation(self) -> float:
        """Return the standard deviation."""
        return self.halfwidth / math.sqrt(3)


@dataclasses.dataclass(frozen=True)
class Normal:
    """Normal distribution about the nominal value."""

    sigma: float

    def quantile(self, share: Float[np.ndarray, "*batch"], nominal: float) -> Float[np.ndarray, "*batch"]:
        """Return the quantiles for probabilities."""
        from scipy.special import ndtri

        return nominal + self.sigma * ndtri(share)

    def deviation(self) -> float:
        """Return the standard deviation."""
        return self.sigma


@dataclasses.dataclass(frozen=True, eq=False)
class Values:
    """A list of values."""

    values: Float[np.ndarray, " value"]

    @property
    def count(self) -> int:
        """Number of values."""
        return len(self.values)


Variation = Interval | Uniform | Normal | Values


def read_variations(forms: Any, read: Reader) -> dict[str, Variation]:
    """Return the variations of parameters.

    Parameters
    ----------
    forms : dict of str to object
        For each parameter, by name: a text of one of the forms, a pair of bounds, bounds and a count, or a list or an
        array of values; numbers SI.
    read : callable
        Function that reads a value of a parameter from a text, and raises an error for unknown names.

    Raises
    ------
    JounceError
        If no parameter varies, a form or a value cannot be read, or bounds are reversed.
    """
    if not isinstance(forms, Mapping) or not forms:
        raise MechanismError(f"say what varies, as {FORMS} for each parameter", name="vary", value=forms)
    return {name: _variation(str(name), form, read) for name, form in forms.items()}


def named_forms(texts: Iterable[str]) -> dict[str, str]:
    """Return forms by the names of their parameters, from texts such as ``BC=12cm:16cm``.

    Raises
    ------
    MechanismError
        If a text has no name or no form, or a name occurs twice.

    Examples
    --------
    >>> named_forms(["BC=12cm:16cm", "AB = normal:0.1mm"])
    {'BC': '12cm:16cm', 'AB': 'normal:0.1mm'}
    """
    return assignments(texts, "--vary", f"a parameter varies by NAME=FORM, where FORM is {FORMS}", MechanismError)


def reader_of(mechanism: Mechanism) -> Reader:
    """Return a function that reads values of the parameters of a mechanism, with or without units.

    Examples
    --------
    >>> import jounce as jn
    >>> reader_of(jn.load("examples/four_bar.yaml"))("BC", "14 cm")
    0.14
    """

    def reader(name: str, text: str) -> float:
        check_name("parameter", name, mechanism.parameters, MechanismError, name="vary")
        return float(mechanism.with_parameters(**{name: text}).parameter_values[name])

    return reader


def _variation(name: str, form: Any, read: Reader) -> Variation:
    location = f"vary {name}"
    if isinstance(form, Interval | Uniform | Normal | Values):
        return form
    try:
        return _from_text(name, form, read) if isinstance(form, str) else _from_numbers(form)
    except JounceError as error:
        if error.name is not None and not error.name.startswith("parameters."):
            raise
        raise type(error)(error.message, name=location, value=form if error.value is None else error.value) from None


def _from_text(name: str, text: str, read: Reader) -> Variation:
    first, *entries = (part.strip() for part in text.split(":"))
    spreads = {"normal": Normal, "uniform": Uniform}
    if first in spreads:
        if len(entries) != 1 or not entries[0]:
            raise MechanismError(f"must be {first}:SIZE, such as {first}:0.1mm", value=text)
        size = _value(name, entries[0], read)
        if size <= 0:
            raise MechanismError("the spread must be above zero", value=entries[0])
        return spreads[first](size)
    if len(entries) not in (1, 2) or not all((first, *entries)):
        hint = f"; {did_you_mean(first, spreads)}" if first.isalpha() and entries else ""
        raise MechanismError(f"must be {FORMS}{hint}", value=text)
    return _interval(_value(name, first, read), _value(name, entries[0], read), *entries[1:])


def _value(name: str, text: str, read: Reader) -> float:
    try:
        return read(name, text)
    except ExpressionError as error:
        if text.isidentifier():
            raise MechanismError(f"must be {FORMS}", value=text) from None
        raise error


def _from_numbers(form: Any) -> Variation:
    if isinstance(form, tuple):
        if len(form) not in (2, 3):
            raise MechanismError("must be (low, high), (low, high, count), or a list of values", value=form)
        return _interval(*(_number(bound) for bound in form[:2]), *form[2:])
    expected = "(low, high), (low, high, count), or a list of finite numbers"
    values = np.array(real_numbers(None, form, MechanismError, expected))
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise MechanismError(f"must be {expected}", value=form)
    return Values(values)


def _number(value: Any) -> float:
    number = real_numbers(None, value, MechanismError, "a finite number")
    if number.ndim or not np.isfinite(number):
        raise MechanismError("a bound must be a finite number", value=value)
    return float(number)


def _interval(low: float, high: float, count: Any = None) -> Interval:
    if count is None:
        if not low < high:
            raise MechanismError("the lower bound must be below the upper one", value=[low, high])
        return Interval(low, high)
    text = str(count).strip()
    number = int(text) if text.isdecimal() and len(text) < 12 else 0
    if not 1 <= number <= MOST_VALUES or isinstance(count, bool):
        raise MechanismError(f"the count must be a whole number from 1 to {MOST_VALUES}", value=count)
    if not (low < high or (low == high and number == 1)):
        raise MechanismError("the lower bound must be below the upper one", value=[low, high])
    if number == 1 and low != high:
        raise MechanismError("one value has one bound, not two; give both the same, or a count of 2 or more", value=1)
    return Interval(low, high, number)


def spreads(variations: Mapping[str, Variation]) -> dict[str, Normal | Uniform | Interval]:
    """Return variations as probability distributions.

    Raises
    ------
    MechanismError
        If a variation is a list of values, or has a count.
    """
    distributions: dict[str, Normal | Uniform | Interval] = {}
    for name, variation in variations.items():
        if isinstance(variation, Values) or getattr(variation, "count", None) is not None:
            message = "is drawn from a range, not a list: LOW:HIGH without COUNT, normal:SIGMA or uniform:HALFWIDTH"
            raise MechanismError(message, name=f"vary {name}")
        distributions[name] = variation
    return distributions
