"""Units outside the table of common ones, looked up in pint, which is imported only then."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from typing import Any

from jounce.errors import UnitError
from jounce.units.dimensions import NUMBER, Dimension, dimension_of
from jounce.units.table import nearest_unit

_BASES = {"meter": "length", "radian": "angle", "second": "time", "kilogram": "mass"}

_PREFIXABLE = frozenset("newton pascal joule watt hertz bar watt_hour liter force_gram".split())
"""Units that take every prefix. Those of length, time, mass and angle go up to kilo: Mm is a slip for mm."""

_TO_KILO = frozenset("meter second gram radian".split())
_LARGE = frozenset("mega giga tera peta exa zetta yotta ronna quetta".split())

_MECHANICAL: frozenset[Dimension] = frozenset(
    dimension_of(mass=mass, length=length, time=time, angle=angle)
    for mass, length, time, angle in [
        *((0, power, 0, 0) for power in (1, 2, 3)),  # length, area, volume
        *((0, 0, power, 0) for power in (1, -1)),
        *((0, 0, power, 1) for power in (0, -1)),  # angle, angular velocity
        *((0, 1, power, 0) for power in (-1, -2)),  # velocity, acceleration
        (1, 0, 0, 0),
        *((1, 1, power, 0) for power in (-1, -2)),  # momentum, force
        *((1, 2, power, 0) for power in (-2, -3)),  # energy or torque, power
        *((1, -1, power, 0) for power in (-1, -2)),  # viscosity, pressure
        (0, 2, -1, 0),
    ]
)
"""Dimensions of units of mechanics, which do not include that of a yarn count (length/mass) or a steradian."""

_PURE = frozenset("percent permille ppm".split())


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def ask_pint(name: str) -> tuple[float, Dimension] | None:
    """Return the size of a unit in SI base units and its dimension, with the radian; None if pint does not know it.

    Raises
    ------
    UnitError
        If the unit has a dimension that no mechanism uses, has no fixed zero, or has a prefix that nobody uses.
    """
    registry = _registry()
    try:
        readings = registry.parse_unit_name(name)
        if not readings:
            return None
        prefix, unit, _ = readings[0]
        factor, units = registry.get_base_units(prefix + unit)
        items = registry.Quantity(factor, units).unit_items()
        powers = {_BASES.get(str(base), str(base)): power for base, power in items}
        is_multiplicative = registry._is_multiplicative(prefix + unit)
    except (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError):
        return None
    label = name.encode("ascii", "backslashreplace").decode("ascii")
    if not is_multiplicative:
        raise UnitError(f"the unit '{label}' has no fixed zero, it cannot be used")
    are_integer = all(Fraction(power).denominator == 1 for power in powers.values())
    dimension = dimension_of(**{base: int(power) for base, power in powers.items()}) if are_integer else None
    if dimension is None or (dimension not in _MECHANICAL and not (dimension == NUMBER and unit in _PURE)):
        message = f"the unit '{label}' ({unit}) has a dimension that no mechanism uses"
        raise UnitError(f"{message}; {nearest_unit(name)}".rstrip("; "))
    if prefix and (unit not in _PREFIXABLE | _TO_KILO or (unit in _TO_KILO and prefix in _LARGE)):
        raise UnitError(
            f"the unit '{label}' would be {prefix}{unit}, which nobody uses; {nearest_unit(name)}".rstrip("; ")
        )
    return float(factor), dimension
