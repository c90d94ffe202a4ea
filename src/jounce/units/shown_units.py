"""Units of shown and written results; internal values are in SI.

A unit is chosen for a kind of quantity, or for an output by its name. It determines the units of time derivatives: an
angle in deg has velocities in deg/s; and of quotients: an angle over a length is in deg/mm if these are chosen.
Products do not follow from the units of lengths and forces: a torque stays in N m unless a unit of torque is chosen.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.errors import JounceError, UnitError, no_such
from jounce.units.assignments import assignments
from jounce.units.dimensions import (
    ANGLE,
    FORCE,
    LENGTH,
    TIME,
    TORQUE,
    Dimension,
    describe_dimension,
    dimension_of,
    times,
)
from jounce.units.values import parse_unit, parse_value

QUANTITIES: dict[str, tuple[str, Dimension]] = {
    "angle": ("rad", ANGLE),
    "length": ("m", LENGTH),
    "force": ("N", FORCE),
    "torque": ("N*m", TORQUE),
    "energy": ("J", TORQUE),
    "power": ("W", times(TORQUE, TIME, -1)),
}
"""Kinds of quantity for which a unit can be chosen: the SI unit, and the dimension."""


_RAISED = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")


def derivative_unit(unit: str, order: int) -> str:
    """Return the unit of a time derivative of a quantity.

    Examples
    --------
    >>> derivative_unit("m", 0), derivative_unit("m", 1), derivative_unit("rad/s", 3)
    ('m', 'm/s', 'rad/s^4')
    """
    per_time = re.search(r"/s(?:\^(\d+))?$", unit)
    base = unit[: per_time.start()] if per_time else unit
    total = order + (int(per_time[1] or 1) if per_time else 0)
    return base if total == 0 else f"{base}/s" if total == 1 else f"{base}/s^{total}"


def raised(unit: str) -> str:
    """Return a unit in typeset form: raised exponents, spaces for products.

    Examples
    --------
    >>> raised("N*m/s^2") == "N m/s\u00b2", raised("10^-3 rad/s^4") == "10\u207b\u00b3 rad/s\u2074"
    (True, True)
    """
    return re.sub(r"\^(-?\d+)", lambda match: match[1].translate(_RAISED), unit.replace("*", " "))


def time_axes(instants: Float[Numbers, " time"], levels: int) -> dict[str, Any]:
    """Return the axes of an array of a quantity and its derivatives at instants, s, labeled for `xarray`."""
    orders = {"long_name": "order of the time derivative"}
    return {
        "time": ("time", instants, {"units": "s", "long_name": "time"}),
        "derivative": ("derivative", np.arange(levels), orders),
    }


def component_axes(output: Any, count: int) -> dict[str, list[str]]:
    """Return the axes of the components of an output, one or those of a matrix, by name, with their labels."""
    return {axis: list(labels) for axis, labels in output.axes or (("component", output.labels[:count]),)}


def derivatives_of(name: str) -> str:
    """Return the long name of an array of a quantity and its derivatives, with the unit of the quantity itself.

    Plots label an axis with the long name and the unit, whatever derivative they show.

    Examples
    --------
    >>> derivatives_of("psi")
    'psi, each derivative by s'
    """
    return f"{name}, each derivative by s"


def unit_size(text: str) -> tuple[float, Dimension]:
    """Return the size of a unit in SI units, and its dimension.

    Raises
    ------
    UnitError
        If the text is no unit of mechanics.
    """
    if not isinstance(text, str) or not re.match(r"[A-Za-z\u00b0\u00b5\u03bc]|1\s*/", text.strip()):
        raise UnitError("must be a unit, such as deg or mm", value=text)
    try:
        quantity = parse_value(f"1 {text.strip()}")
    except JounceError as error:
        raise UnitError(error.message, value=text) from None
    if quantity.dimension is None or not isinstance(quantity.value, float):
        raise UnitError("must be a unit, such as deg or mm", value=text)
    return quantity.value, quantity.dimension


@dataclass(frozen=True)
class ShownUnits:
    """Units in which quantities are shown, by their kind or by the name of an output.

    Parameters
    ----------
    chosen : dict of str to str
        Units by ``angle``, ``length``, ``force``, ``torque``, ``energy``, ``power``, or by the name of an output, which
        takes precedence.
    outputs : dict of str to str, optional
        SI units of the existing outputs, by name.

    Raises
    ------
    UnitError
        If a name is neither, or a unit does not suit the quantity.

    Examples
    --------
    >>> units = ShownUnits({"angle": "deg", "length": "mm"})
    >>> units.of("rad/s"), units.of("N*m")
    (('deg/s', 57.29577951308232), ('N*m', 1.0))
    >>> units.of("rad/m^2")
    ('deg/mm^2', 5.7295779513082324e-05)
    """

    chosen: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self):
        if not isinstance(self.chosen, Mapping):
            raise UnitError("must be units by kind of quantity or name of an output", name="units", value=self.chosen)
        for name, unit in self.chosen.items():
            if name not in QUANTITIES and name not in self.outputs:
                message = no_such("quantity and no output", name, [*QUANTITIES, *self.outputs])
                raise UnitError(message, name=f"units.{name}")
            try:
                _, dimension = unit_size(unit)
            except UnitError as error:
                raise error.located(name=f"units.{name}") from None
            dimensions = [self._of_output(name), self._of_kind(name)]
            if dimension not in dimensions:
                phrase = " or ".join(describe_dimension(x) for x in dimensions if x is not None)
                message = f"measures {describe_dimension(dimension)}, not {phrase}"
                raise UnitError(message, name=f"units.{name}", value=unit)

    def _of_output(self, name: str) -> Dimension | None:
        """Return the dimension of the output with a name; None if there is none."""
        return _dimension(self.outputs[name]) if name in self.outputs else None

    def _of_kind(self, name: str) -> Dimension | None:
        """Return the dimension of a kind of quantity; None for other names."""
        return QUANTITIES[name][1] if name in QUANTITIES else None

    def _chosen(self, name: str, dimension: Dimension | None) -> str | None:
        """Return the unit chosen for a name if it has a given dimension: a name may be that of a kind as well."""
        unit = self.chosen.get(name)
        return unit if unit is not None and unit_size(unit)[1] == dimension else None

    def of(self, unit: str, name: str = "") -> tuple[str, float]:
        """Return the unit in which a quantity is shown, and the factor of its SI values.

        Parameters
        ----------
        unit : str
            SI unit of the quantity: that of an output, or of a time derivative of one.
        name : str, optional
            Name of the output.
        """
        per_time = re.search(r"/s(?:\^(\d+))?$", unit)
        order = int(per_time[1] or 1) if per_time else 0
        base = unit[: per_time.start()] if per_time else unit
        if shown := self._chosen(name, self._of_output(name)):
            rate = re.search(r"/s(?:\^(\d+))?$", self.outputs[name])
            order -= int(rate[1] or 1) if rate else 0
            return derivative_unit(shown, order), 1.0 / unit_size(shown)[0]
        numerator, *denominators = base.split("/")
        (shown, factor), parts = self._of_base(numerator), []
        for part in denominators:
            known, _, exponent = part.partition("^")
            unit_below, size = self._of_base(known)
            parts.append(f"/{unit_below}" + (f"^{exponent}" if exponent else ""))
            factor /= size ** int(exponent or 1)
        return derivative_unit("".join([shown, *parts]), order), factor

    def _of_base(self, base: str) -> tuple[str, float]:
        """Return the unit in which a kind of quantity is shown, and the factor of its SI values."""
        kind = next((kind for kind, (unit, _) in QUANTITIES.items() if unit == base), "")
        shown = self._chosen(kind, self._of_kind(kind))
        return (shown, 1.0 / unit_size(shown)[0]) if shown else (base, 1.0)

    def merged(self, others: Mapping[str, str] | None) -> "ShownUnits":
        """Return these units, with some of them replaced."""
        return ShownUnits({**self.chosen, **(others or {})}, self.outputs)


def _dimension(unit: str) -> Dimension:
    """Return the dimension of the unit of an output."""
    return dimension_of() if unit in ("", "1") else parse_unit(unit)[1]


def units_given(texts: Iterable[str]) -> dict[str, str]:
    """Return units by name from texts such as ``angle=deg,length=mm``.

    Raises
    ------
    UnitError
        If a name or a unit is missing, or a name is given twice.

    Examples
    --------
    >>> units_given(["angle=deg,length=mm", "C=cm"])
    {'angle': 'deg', 'length': 'mm', 'C': 'cm'}
    """
    parts = (part for given in texts for part in given.split(","))
    return assignments(parts, "--units", "units are given by NAME=UNIT, such as angle=deg,length=mm", UnitError)
