"""Limits of the drivers and outputs of a mechanism from files."""

from __future__ import annotations

import dataclasses
import math
from os import PathLike
from typing import Any

from jounce.errors import MechanismFileError, no_such
from jounce.io.files.located_data import Location
from jounce.io.files.source import read_source
from jounce.mechanism import Mechanism
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.robot.model.links_and_joints import Limits
from jounce.settings import under_own_settings
from jounce.units.dimensions import describe_dimension, dimension_of

RATES = {"velocity": 1, "acceleration": 2, "jerk": 3}
EFFORTS = {"effort": 2, "effort_rate": 3}
OTHER_WORDS = {
    **dict.fromkeys(("torque", "force", "max_torque", "max_force", "max_effort"), "effort"),
    **dict.fromkeys(("torque_rate", "force_rate", "rotatum", "yank"), "effort_rate"),
}


@under_own_settings
def load_drive_limits(path: str | PathLike[str], mechanism: Mechanism) -> dict[str, Limits]:
    """Read limits of the drivers and outputs of a mechanism from a file, for `retime`.

    The file has the keys ``drivers`` and ``outputs``, with entries by name: ``velocity``, ``acceleration`` and
    ``jerk``, and for drivers ``effort`` (force or torque) and ``effort_rate`` (yank).

    Parameters
    ----------
    path
        A file ending in .yaml, .yml, .toml or .json.
    mechanism : Mechanism
        Mechanism with the drivers and outputs.

    Returns
    -------
    dict of str to Limits
        Limits by the name of the driver or output.

    Raises
    ------
    MechanismFileError
        If the file cannot be read or contains an error: the message names the file, the line and the entry.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.io.load_drive_limits("examples/limits/press.yaml", jn.load("examples/press.yaml"))["motor"].effort
    15000.0
    """
    source = read_source(path, kind="limits", error_type=MechanismFileError)
    data = source.mapping((), ("title", "drivers", "outputs"))
    limits: dict[str, Limits] = {}
    for kind, elements_of_kind in (("drivers", mechanism.drivers), ("outputs", mechanism.outputs)):
        for name in source.mapping((kind,)) if kind in data else ():
            location: Location = (kind, name)
            if name not in elements_of_kind:
                raise source.error(no_such(kind[:-1], name, list(elements_of_kind)), location)
            if name in limits:
                raise source.error("a driver and an output of one name cannot both have limits; rename one", location)
            keys = (*RATES, *EFFORTS) if kind == "drivers" else tuple(RATES)
            values: dict[str, float] = {}
            for key, raw in source.mapping(location, keys, others=OTHER_WORDS if kind == "drivers" else None).items():
                value = source.value((*location, key), raw)
                turns = _turns(mechanism, kind, name)
                dimension = _dimension(key, turns)
                if value.dimension and value.dimension != dimension:
                    message = f"must be {describe_dimension(dimension)}, not {describe_dimension(value.dimension)}"
                    raise source.error(message, (*location, key), value=raw)
                if not isinstance(value.value, float) or not math.isfinite(value.value) or value.value <= 0:
                    raise source.error("must be a finite number greater than zero", (*location, key), value=raw)
                values[key] = value.value
            limits[name] = dataclasses.replace(Limits(), **values)
    if not limits:
        raise source.error("a file of limits of a mechanism has the keys 'drivers', 'outputs' or both")
    return limits


def _turns(mechanism: Mechanism, kind: str, name: str) -> bool:
    if kind == "drivers":
        return is_turning(mechanism.drivers[name])
    return str(getattr(mechanism.outputs[name], "unit", "m")).startswith("rad")


def _dimension(key: str, turns: bool) -> Any:
    if key in EFFORTS:
        return dimension_of(mass=1, length=2 if turns else 1, time=-EFFORTS[key])
    return dimension_of(**{"angle" if turns else "length": 1, "time": -RATES[key]})
