"""Units of columns: datasets say them in attributes, and CSV files may say them in their heading."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from jounce.errors import UnitError
from jounce.settings import under_own_settings
from jounce.units.shown_units import ShownUnits, unit_size

if TYPE_CHECKING:
    import xarray

_WITH_INDEX = re.compile(r".*\S\[[0-9]+\]\s*")
_WITH_UNIT = re.compile(r"(.*\S)\s*\[([^\[\]]*)\]\s*")


@under_own_settings
def in_units(dataset: xarray.Dataset, units: Mapping[str, str] | ShownUnits) -> xarray.Dataset:
    """Return a dataset of SI values in other units, which its attributes name.

    Derivatives are by s, whatever the unit of the quantity itself.

    Parameters
    ----------
    dataset : xarray.Dataset
        In SI, as ``Motion.dataset``: variables have the attribute ``units``, that of their derivative 0.
    units : dict of str to str
        By ``angle``, ``length``, ``force``, ``torque``, ``energy``, ``power``, or the name of a variable; what none is
        chosen for stays in SI.

    Raises
    ------
    UnitError
        If a name is neither, or a unit does not measure what it is chosen for.

    Examples
    --------
    >>> import jounce as jn
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0], order=1)
    >>> shown = jn.io.in_units(motion.dataset, {"angle": "deg"})
    >>> round(float(shown["psi"].sel(derivative=0)[0]), 6), shown["psi"].attrs["units"], shown["C"].attrs["units"]
    (128.272139, 'deg', 'm')
    """
    if not isinstance(units, ShownUnits):
        known = {str(name): x.attrs["units"] for name, x in dataset.data_vars.items() if "units" in x.attrs}
        units = ShownUnits(units, known)
    shown = dataset.copy()
    for name, variable in dataset.variables.items():
        if (unit := variable.attrs.get("units")) is None or name == "time":
            continue
        label, factor = units.of(unit, str(name))
        if label != unit:
            shown[name] = (variable.dims, variable.values * factor, variable.attrs | {"units": label})
    return shown


def is_si(unit: str | None) -> bool:
    """Tell whether a unit is one of SI; what says none is taken to be, and what is no unit of mechanics is none.

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
    """Return the name in the heading of a column, and the unit that it says, if it says one.

    Examples
    --------
    >>> name_and_unit("psi_d1 [deg/s]"), name_and_unit("psi"), name_and_unit("q[0]")
    (('psi_d1', 'deg/s'), ('psi', None), ('q[0]', None))
    """
    match = None if _WITH_INDEX.fullmatch(text) else _WITH_UNIT.fullmatch(text)
    return (match[1], match[2].strip()) if match else (text, None)
