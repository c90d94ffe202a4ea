"""Cams of a file, and their leaders by name: a driver, a joint, an initial condition or an output."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from jounce.constraints import Cam, catalogue
from jounce.constraints.cams import coordinate_of_element
from jounce.constraints.facts import at_coordinate, facts_of
from jounce.errors import JounceError
from jounce.io.files.source import Source
from jounce.io.mechanisms.schema.keys import cam_types, file_keys, is_cam
from jounce.mechanism.laws.output_drivers import driver_of_output
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.trajectory import OutputMotion

COMPONENTS = ("x", "y", "z")
OUTPUTS = {"angle": "angle", "distance": "length", "slide": "length", "displacement": "length"}
PAIRS = {"revolute": "angle", "prismatic": "length"}


@dataclasses.dataclass(frozen=True)
class CamEntry:
    """A cam before its leader is resolved.

    Attributes
    ----------
    follower : AbstractConstraint
        Driver with the law of the follower.
    of : str
        Name of the leader.
    """

    follower: Any
    of: str


def coordinates_by_name(data: Mapping[str, Any], space: str, driven: Mapping[str, str]) -> dict[str, str]:
    """Return the kind, angle or length, of each coordinate that may lead a cam, by name.

    Drivers precede joints, which precede outputs.

    Parameters
    ----------
    data : mapping
        Data of the file.
    space : str
        planar or spatial.
    driven : mapping of str to str
        Kinds of the coordinates that drivers and initial conditions prescribe, by name.
    """
    kinds: dict[str, str] = {}
    for name, raw in _entries(data, "outputs"):
        quantity = raw.get("quantity")
        if quantity is None and "point" in raw:
            kinds |= {f"{name}_{label}": "length" for label in COMPONENTS[: POSITION_COMPONENTS[space]]}
        elif isinstance(quantity, str) and quantity in OUTPUTS:
            kinds[name] = OUTPUTS[quantity]
    drivers, joints = cam_types(space), catalogue(space, "joint")
    for name, raw in _entries(data, "joints"):
        kind = str(raw.get("type"))
        if is_cam(space, dict(raw)):
            (law,) = (key for key in file_keys(drivers[kind]) if key.kind == "motion")
            kinds[name] = at_coordinate(law.quantity, raw.get("coordinate"))
        elif kind in joints and (pair := facts_of(joints[kind]).pair or kind) in PAIRS:
            kinds[name] = PAIRS[pair]
    return kinds | dict(driven)


def _entries(data: Mapping[str, Any], section: str) -> list[tuple[str, Mapping[str, Any]]]:
    given = data.get(section)
    return [(k, v) for k, v in given.items() if isinstance(v, Mapping)] if isinstance(given, Mapping) else []


def with_leaders(source: Source, space: str, elements: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the elements of a file with cams in the place of their entries.

    Parameters
    ----------
    source : Source
        Source of the file.
    space : str
        planar or spatial.
    elements : dict of str to dict
        Joints, drivers, forces, initial conditions and outputs, by kind and name.
    """

    def leader(name: str) -> Any:
        for kind in ("drivers", "joints", "initial"):
            if name in elements[kind]:
                element = elements[kind][name]
                return element.follower if isinstance(element, CamEntry) else element
        motion = OutputMotion(name, "0")
        return driver_of_output(SimpleNamespace(space=space, outputs=elements["outputs"]), motion, "motion.of")

    joints = {}
    for name, entry in elements["joints"].items():
        if isinstance(entry, CamEntry):
            location = ("joints", name, "motion", "of")
            if entry.of == name and name not in elements["drivers"]:
                raise source.error("a cam cannot follow itself", location, value=name)
            try:
                entry = Cam(entry.follower, coordinate_of_element(leader(entry.of)), entry.of)
            except JounceError as error:
                raise source.error(error.message, location, value=entry.of) from None
        joints[name] = entry
    return {**elements, "joints": joints}
