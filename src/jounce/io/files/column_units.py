"""Units of columns, which datasets state in attributes and CSV files in their heading."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from jounce.errors import UnitError
from jounce.settings import under_own_settings
from jounce.units.dimensions import ANGLE, LENGTH, TIME, Dimension
from jounce.units.shown_units import ShownUnits, unit_size

if TYPE_CHECKING:
    import xarray

_WITH_INDEX = re.compile(r".*\S\[[0-9]+\]\s*")
_WITH_UNIT = re.compile(r"(.*\S)\s*\[([^\[\]]*)\]\s*")
_IN_PARENTHESES = re.compile(r"(.*\S)\s*\(([^()]*)\)\s*")
_LAST_WORD = re.compile(
    r"(?P<name>.*?[^\W_])_(?:(?P<unit>deg|degrees?|rad|mm)(?P<rate>(?:_|_per_|p|/)s(?P<power>2?))?"
    r"|(?P<whole>dps|rpm|s|sec|ms|us|ns))",
    re.IGNORECASE,
)
_SAID = {  # patterns of names that state a unit other than SI
    "angle": re.compile(r"(?:(?<![a-z])deg(?:s|rees?)?|(?-i:(?<=[a-z0-9])Deg(?:s|rees?)?))(?![a-z])", re.IGNORECASE),
    "length": re.compile(r"(?<![a-z])mm$", re.IGNORECASE),
    "time": re.compile(r"(?<![a-z])[mun]s$", re.IGNORECASE),
}


@under_own_settings
def in_units(dataset: xarray.Dataset, units: Mapping[str, str] | ShownUnits) -> xarray.Dataset:
    """Return a dataset of SI values in other units, and state these units in its attributes.

    Time derivatives are per second, whatever the unit of the quantity.

    Parameters
    ----------
    dataset : xarray.Dataset
        Values in SI, as ``Motion.dataset``: variables have an attribute ``units``, the unit of their derivative 0.
    units : dict of str to str
        Units by ``angle``, ``length``, ``force``, ``torque``, ``energy``, ``power``, or the name of a variable; other
        quantities stay in SI.

    Raises
    ------
    UnitError
        If a name is neither, or a unit does not suit the quantity.

    Examples
    --------
    >>> import jounce as jn
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0], order=1)
    >>> shown = jn.io.in_units(motion.dataset, {"angle": "deg"})
    >>> round(float(shown["psi"].sel(derivative=0)[0]), 6), shown["psi"].attrs["units"], shown["C"].attrs["units"]
    (128.272139, 'deg', 'm')
    """
    if not isinstance(units, ShownUnits):
        stored_units = {str(name): x.attrs["units"] for name, x in dataset.data_vars.items() if "units" in x.attrs}
        units = ShownUnits(units, stored_units)
    converted = dataset.copy()
    for name, variable in dataset.variables.items():
        if (unit := variable.attrs.get("units")) is None or name == "time":
            continue
        label, factor = units.of(unit, str(name))
        if label != unit:
            converted[name] = (variable.dims, variable.values * factor, variable.attrs | {"units": label})
    return converted


def is_si(unit: str | None) -> bool:
    """Return whether a unit is an SI unit; no unit counts as SI, and a unit outside mechanics does not.

    Examples
    --------
    >>> is_si("rad/s"), is_si("mm"), is_si("1")
    (True, False, True)
    """
    try:
        return unit in (None, "", "1") or unit_size(str(unit))[0] == 1.0
    except UnitError:
        return False


def heading(name: str, unit: str) -> str:
    """Return the heading of a column with its unit.

    Examples
    --------
    >>> heading("psi_d1", "deg/s")
    'psi_d1 [deg/s]'
    """
    return f"{name} [{unit or 1}]"


def name_and_unit(text: str) -> tuple[str, str | None]:
    """Return the name in the heading of a column, and its unit in brackets; None if there is none.

    Examples
    --------
    >>> name_and_unit("psi_d1 [deg/s]"), name_and_unit("psi"), name_and_unit("q[0]")
    (('psi_d1', 'deg/s'), ('psi', None), ('q[0]', None))
    """
    match = None if _WITH_INDEX.fullmatch(text) else _WITH_UNIT.fullmatch(text)
    return (match[1], match[2].strip()) if match else (text, None)


def name_and_last_word(text: str) -> tuple[str, str | None]:
    """Return the name in the heading of a column, and its unit without brackets; None if there is none.

    Examples
    --------
    >>> name_and_last_word("elbow_deg"), name_and_last_word("elbow_vel_deg_per_s"), name_and_last_word("time_ms")
    (('elbow', 'deg'), ('elbow_vel', 'deg/s'), ('time', 'ms'))
    >>> name_and_last_word("elbow (mm)"), name_and_last_word("elbow"), name_and_last_word("pin (left)")
    (('elbow', 'mm'), ('elbow', None), ('pin (left)', None))
    """
    if match := _IN_PARENTHESES.fullmatch(text):
        return (match[1], match[2]) if _moves(match[2]) else (text, None)
    if (match := _LAST_WORD.fullmatch(text)) is None:
        return text, None
    if match["whole"]:
        return match["name"], {"dps": "deg/s"}.get(match["whole"].lower(), match["whole"].lower())
    power = f"^{match['power']}" if match["power"] else ""
    return match["name"], match["unit"].lower() + (f"/s{power}" if match["rate"] else "")


def _moves(text: str) -> bool:
    """Return whether a text is a unit of angle, length, time or their rates."""
    try:
        return {base for base, _ in unit_size(text)[1]} <= {"angle", "length", "time"}
    except UnitError:
        return False


def unit_unread(name: str, dimensions: Iterable[Dimension]) -> str | None:
    """Return the unit other than SI that a name seems to state for one of some dimensions; None if there is none.

    Examples
    --------
    >>> from jounce.units.dimensions import ANGLE, TIME
    >>> unit_unread("elbow_deg_0", [ANGLE]), unit_unread("elbowDeg", [ANGLE]), unit_unread("degree_of_freedom", [TIME])
    ('deg', 'deg', None)
    >>> unit_unread("time_ms", [TIME]), unit_unread("elbow", [ANGLE]), unit_unread("elbow (rad)", [ANGLE])
    ('ms', None, None)
    >>> unit_unread("lift (cm)", [])
    'cm'
    """
    match = _IN_PARENTHESES.fullmatch(name)
    if match and _moves(match[2]):
        return None if is_si(match[2]) else match[2]
    measured = {base for dimension in dimensions for base, _ in dimension if base != "time" or dimension == TIME}
    matches = (match for base, pattern in _SAID.items() if base in measured and (match := pattern.search(name)))
    match = next(matches, None)
    return None if match is None else "deg" if match[0][0] in "dD" else match[0].lower()


def names_a_unit(name: str) -> bool:
    """Return whether a name, as the heading of a column, states a unit, in brackets or not.

    Examples
    --------
    >>> names_a_unit("elbow_deg"), names_a_unit("elbow_deg_d1"), names_a_unit("q [1]"), names_a_unit("elbow")
    (True, True, True, False)
    """
    read = name_and_unit(name)[1] or name_and_last_word(name)[1] or unit_unread(name, (ANGLE, LENGTH, TIME))
    return read is not None
