"""Common units of engineers, with their SI sizes and dimensions; others are looked up in pint."""

from __future__ import annotations

from decimal import Decimal

from jounce.errors import did_you_mean
from jounce.jet.turns import WHOLE_TURN
from jounce.units.dimensions import ANGLE, FORCE, LENGTH, MASS, TIME, TORQUE, Dimension, dimension_of, times
from jounce.units.expression import CONSTANTS

Size = Decimal | float


def _sizes(dimension: Dimension, text: str) -> dict[str, tuple[Size, Dimension]]:
    pairs = (pair.split("=") for pair in text.split())
    return {name: (Decimal(size), dimension) for name, size in pairs}


COMMON: dict[str, tuple[Size, Dimension]] = {
    **_sizes(LENGTH, "m=1 dm=0.1 cm=0.01 mm=0.001 um=1e-6 km=1e3 in=0.0254 inch=0.0254 ft=0.3048"),
    **_sizes(LENGTH, "mil=2.54e-5 thou=2.54e-5"),
    **dict.fromkeys(("deg", "degree", "degrees", "\N{DEGREE SIGN}"), (CONSTANTS["deg"], ANGLE)),
    **dict.fromkeys(("rev", "turn", "turns", "U", "r", "tr"), (WHOLE_TURN, ANGLE)),
    **_sizes(ANGLE, "rad=1 mrad=0.001"),
    **dict.fromkeys(("rpm", "RPM"), (WHOLE_TURN / 60, dimension_of(angle=1, time=-1))),
    **_sizes(TIME, "s=1 sec=1 ms=1e-3 us=1e-6 min=60 h=3600"),
    **_sizes(dimension_of(time=-1), "Hz=1 kHz=1000"),
    **_sizes(MASS, "kg=1 g=0.001 mg=1e-6 t=1000"),
    **_sizes(FORCE, "N=1 mN=0.001 kN=1000 MN=1e6 kgf=9.80665 kp=9.80665"),
    **_sizes(TORQUE, "J=1 kJ=1000"),
    **_sizes(times(TORQUE, TIME, -1), "W=1 kW=1000 PS=735.49875 CV=735.49875"),
    **_sizes(dimension_of(mass=1, length=-1, time=-2), "Pa=1 kPa=1e3 MPa=1e6 GPa=1e9 bar=1e5"),
}
"""Size in SI units and dimension. Decimal sizes make ``13.21 cm`` the double nearest to 0.1321."""

_LENGTHS = ("mm", "cm", "dm", "m")
COMPACT: dict[str, tuple[str, ...]] = {
    **{f"{force}{arm}": (force, arm) for force in ("N", "mN", "kN", "MN") for arm in _LENGTHS},
    **{f"{prefix}Nm": (f"{prefix}N", "m") for prefix in "ucd"},
    **{f"{mass}{arm}": (mass, arm) for mass in ("kg", "g") for arm in _LENGTHS},
    **{f"{force}ms": (force, "m", "s") for force in ("N", "mN", "kN")},
    **{f"{force}s": (force, "s") for force in ("N", "kN")},
    **{f"{power}{time}": (power, time) for power in ("W", "kW") for time in "sh"},
    **dict.fromkeys(("lbft", "ftlb", "lbfft", "ftlbf"), ("lbf", "ft")),
    **dict.fromkeys(("lbin", "inlb", "lbfin", "inlbf"), ("lbf", "in")),
    "ozin": ("ozf", "in"),
}
"""Products written without a sign; a power belongs to the last factor, as in ``kgm^2``."""


LONG = tuple(
    f"{prefix}{unit}{ending}"
    for unit in ("meter", "gram", "second", "newton", "radian", "watt", "pascal")
    for prefix in ("", "milli", "centi", "micro", "kilo")
    for ending in ("", "s")
)
"""Units written in full, which pint knows, to suggest for misspelled ones."""


def nearest_unit(name: str) -> str:
    """Return a suggestion of a unit: one that differs in capitals only, or else the nearest; may be empty."""
    names = [*COMMON, *COMPACT, *LONG]
    matches = [unit for unit in names if unit.lower() == name.lower() and unit != name]
    return f"did you mean '{matches[0]}'?" if matches else did_you_mean(name, names, limit=0)
