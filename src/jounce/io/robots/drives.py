"""Drives of joints, or of the drivers of a mechanism, from files: springs, gears, rotors and their limits."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from os import PathLike
from typing import Any

from jounce.errors import RobotError, UnitWarning, no_such, warn_caller
from jounce.io.files.located_data import Location, Source
from jounce.io.files.source import read_source
from jounce.io.robots.closure_files import rotor_doubt
from jounce.mechanism import Mechanism
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.planning.elastic.drives import Drive
from jounce.robot.robot import Robot
from jounce.settings import under_own_settings
from jounce.units.dimensions import Dimension, describe_dimension, dimension_of

KEYS = tuple(field.name for field in dataclasses.fields(Drive))
UNITS = {
    "stiffness": ("N*m/rad", "N/m"),
    "damping": ("N*m*s/rad", "N*s/m"),
    "rotor_inertia": ("kg*m^2", "kg"),
    "gear_ratio": ("no unit", "no unit"),
    "lead": ("m", "m"),
    "deflection_limit": ("rad", "m"),
    "torque_limit": ("N*m", "N"),
    "velocity_limit": ("rad/s", "m/s"),
}
"""Units of each key if it turns, and if it slides; the motor decides for the keys of the motor."""
LONG = 2.0  # m, above the travel in a turn of any spindle or pinion: a number without a unit may be in mm
OF_MOTOR = ("rotor_inertia", "torque_limit", "velocity_limit")


@under_own_settings
def load_drives(path: str | PathLike[str], system: Robot | Mechanism) -> dict[str, Drive]:
    """Read the drives of the joints of a robot, or of the drivers of a mechanism, from a file.

    The file has the keys ``joints`` (of a robot) or ``drivers`` (of a mechanism), with an entry for each, and
    ``default``, for all. Each entry has some of the keys of `Drive`: ``stiffness``, ``damping`` and
    ``deflection_limit``, as seen at the joint; ``rotor_inertia``, ``torque_limit`` and ``velocity_limit``, of the motor
    itself; and ``gear_ratio`` or, if a rotary motor drives a slide, ``lead``. A value is a number in SI units or a
    number with a unit; ``null`` removes a value of ``default``, and in the place of an entry all of them. A default
    with units of rotation holds for rotary joints, one with units of translation for slides. A joint without an entry
    is rigid.

    Parameters
    ----------
    path
        A file ending in .yaml, .yml, .toml or .json.
    system : Robot or Mechanism
        System with the named joints or drivers.

    Returns
    -------
    dict of str to Drive
        Drives for `feedforward`.

    Raises
    ------
    RobotError
        If the file cannot be read or contains an error: the message names the file, the line, the entry and the value.

    Examples
    --------
    >>> import jounce as jn
    >>> drives = jn.io.load_drives("examples/drives/panda.yaml", jn.load_robot("examples/robots/panda.urdf"))
    >>> drives["panda_joint1"].stiffness, drives["panda_joint1"].gear_ratio
    (14000.0, 100.0)
    """
    return _DrivesFile(read_source(path, kind="drives", error_type=RobotError), system).drives()


class _DrivesFile:
    """Reads drives from the data of a file; every error names the file, the line and the entry."""

    def __init__(self, source: Source, system: Robot | Mechanism) -> None:
        self.source, self.system = source, system
        if isinstance(system, Robot):
            self.key, self.noun = "joints", "moving joint"
            self.turning = {name: system.joints[name].turning for name in system.joint_names}
        else:
            self.key, self.noun = "drivers", "driver"
            self.turning = {name: is_turning(driver) for name, driver in system.drivers.items()}

    def drives(self) -> dict[str, Drive]:
        """Return the drives in the file."""
        data = self.source.mapping((), ("title", "default", "joints", "drivers"))
        other = "drivers" if self.key == "joints" else "joints"
        if other in data:
            message = f"a {'robot' if self.key == 'joints' else 'mechanism'} has '{self.key}' in a file of drives"
            raise self.source.error(message, (other,))
        if self.key not in data and "default" not in data:
            raise self.source.error(f"a file of drives has the key '{self.key}', 'default', or both", value=list(data))
        entries = self.source.mapping((self.key,)) if self.key in data else {}
        for name in entries:
            if name not in self.turning:
                raise self.source.error(self._why_not(name), (self.key, name))
        default = self.source.mapping(("default",), KEYS) if "default" in data else {}
        fitting = {kind: self._fits(default, kind) for kind in (True, False)}
        if default and not any(fitting.values()):
            self._drive(default, dict.fromkeys(default, ("default",)), True)  # raises the error about the unit
        drives = {}
        for name, kind in self.turning.items():
            if name in entries and entries[name] is None:
                continue
            entry = self.source.mapping((self.key, name), KEYS) if name in entries else {}
            defaults = default if fitting[kind] else {}
            locations = dict.fromkeys(defaults, ("default",)) | dict.fromkeys(entry, (self.key, name))
            values = {key: raw for key, raw in {**defaults, **entry}.items() if raw is not None}
            if values:
                drives[name] = self._drive(values, locations, kind)
        return drives

    def _fits(self, default: Mapping[str, Any], turning: bool) -> bool:
        """Return whether the units of the default suit joints that turn, or joints that slide."""
        motor = turning or default.get("lead") is not None
        if turning and default.get("lead") is not None:
            return False
        for key, raw in default.items():
            dimension = None if raw is None else self._parsed(raw, ("default", key))[1]
            if dimension and dimension not in _dimensions(key, motor if key in OF_MOTOR else turning):
                return False
        return True

    def _drive(self, values: Mapping[str, Any], locations: Mapping[str, Location], turning: bool) -> Drive:
        motor = turning or values.get("lead") is not None
        if turning and values.get("lead") is not None:
            message = "is for joints and drivers that slide; this one turns, give a gear_ratio"
            raise self.source.error(message, (*locations["lead"], "lead"), value=values["lead"])
        numbers = {key: self._number(raw, key, (*locations[key], key), turning, motor) for key, raw in values.items()}
        if numbers.get("lead", 0.0) > LONG and isinstance(values["lead"], int | float):
            lead = values["lead"]
            hint = f"a lead of {lead:g} m in each turn: {lead:g} mm? A number without a unit is in SI"
            warn_caller(UnitWarning(str(self.source.error(hint, (*locations["lead"], "lead")))))
        hint = motor and rotor_doubt(numbers.get("rotor_inertia", 0.0), numbers.get("gear_ratio", 1.0), values)
        if hint:
            location = (*locations["rotor_inertia"], "rotor_inertia")
            warn_caller(UnitWarning(str(self.source.error(hint, location))))
        try:
            return Drive(**numbers)
        except RobotError as error:
            key = str(error.name)
            raise self.source.error(error.message, (*locations[key], key), value=values[key]) from None

    def _number(self, raw: Any, key: str, location: Location, turning: bool, motor: bool) -> float:
        number, dimension = self._parsed(raw, location)
        kind = motor if key in OF_MOTOR else turning
        if dimension and dimension not in _dimensions(key, kind):
            of = "motor" if key in OF_MOTOR else self.noun
            message = (
                f"the unit is that of {describe_dimension(dimension)}; a {of} that {'turns' if kind else 'slides'} has"
            )
            raise self.source.error(f"{message} {key} in {UNITS[key][not kind]}", location, value=raw)
        if not math.isfinite(number):
            raise self.source.error("must be a finite number", location, value=raw)
        return number * 2 * math.pi if key == "lead" and dimension == PER_ANGLE else number

    def _parsed(self, raw: Any, location: Location) -> tuple[float, Dimension | None]:
        parsed = self.source.value(location, raw)
        assert isinstance(parsed.value, float)  # expressions are evaluated, since no names are allowed
        return parsed.value, parsed.dimension

    def _why_not(self, name: str) -> str:
        joint = self.system.joints.get(name) if isinstance(self.system, Robot) else None
        if joint is not None and joint.mimic is not None:
            pronoun = "those" if joint.mimic.several else "that one"
            return f"this joint follows {', '.join(joint.mimic.weights)}; give {pronoun} the drive"
        if joint is not None:
            return "this joint is fixed and has no drive; leave it out"
        title = self.system.name if isinstance(self.system, Robot) else self.system.title or "the mechanism"
        return no_such(f"{self.noun} of {title}", name, self.turning)


PER_ANGLE = dimension_of(length=1, angle=-1)


def _dimensions(key: str, turning: bool) -> tuple[Dimension, ...]:
    """Return the valid dimensions of the unit of a key."""
    time = {"stiffness": -2, "damping": -1, "torque_limit": -2, "velocity_limit": -1}.get(key, 0)
    length = 2 if turning else 1
    match key:
        case "stiffness" | "damping":
            if not turning:
                return (dimension_of(mass=1, time=time),)
            return tuple(dimension_of(mass=1, length=2, time=time, **angle) for angle in ({}, {"angle": -1}))
        case "rotor_inertia":
            return (dimension_of(mass=1, length=2) if turning else dimension_of(mass=1),)
        case "torque_limit":
            return (dimension_of(mass=1, length=length, time=time),)
        case "gear_ratio":
            return ()
        case "lead":
            return dimension_of(length=1), PER_ANGLE
    bases: tuple[dict[str, int], ...] = ({"angle": 1}, {}) if turning else ({"length": 1},)
    return tuple(dimension_of(**base, **({"time": time} if time else {})) for base in bases)
