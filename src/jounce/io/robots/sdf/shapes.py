"""Inertias of SDF links that follow from their collision shapes: ``<inertial auto="true">``."""

from __future__ import annotations

from typing import Any

import numpy as np

from jounce.errors import RobotError
from jounce.io.robots.elements.faults import DEFAULT_DENSITY, OVERWRITTEN, Faults
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.poses import IDENTITY, Frames, needed, number_of, pose_of
from jounce.rigid.inertia import Inertia

DENSITY = 1000.0  # of water, kg/m^3
SIZES = {
    "box": {"size": ("size", 1.0)},
    "capsule": {"radius": ("radius", 1.0), "length": ("length", 1.0)},
    "cone": {"radius": ("radius", 1.0), "length": ("length", 1.0)},
    "cylinder": {"radius": ("radius", 1.0), "length": ("length", 1.0)},
    "ellipsoid": {"size": ("radii", 2.0)},
    "sphere": {"radius": ("radius", 1.0)},
}
"""For each shape, the sizes of the solid: the element of each size, and its factor."""


def inertia_of_shapes(name: str, link: Element, inertial: Element, frames: Frames, faults: Faults) -> Inertia:
    """Return the inertia of a link in its frame, from its collision shapes, as the reference library of SDF does.

    The density is that of the collision, else that of ``<inertial>``, else 1000 kg/m^3. A ``<mass>`` scales the result
    to that mass. A cone has its axis along z, and its middle at the pose of the collision.

    Parameters
    ----------
    name : str
        Name of the link.
    link, inertial : Element
        Elements ``<link>`` and ``<inertial>``.
    frames : Frames
        Frames of the model, relative to which collisions may be placed.
    faults : Faults
        Records a missing density, and moments that are not used.

    Raises
    ------
    RobotFileError
        If there is no collision, the inertia of a shape is not computed, or a size is missing or impossible.
    """
    location = ("links", name, "inertial")
    collisions = link.every("collision")
    if not collisions:
        message = 'auto="true" takes the inertia from <collision> shapes, and the link has none; write mass and inertia'
        raise inertial.error(message, *location)
    for part in (part for tag in ("pose", "inertia") for part in inertial.every(tag)):
        message = 'auto="true" computes the inertia from shapes, and ignores this; leave one of them out'
        faults.add(OVERWRITTEN, name, part.error(message, *location, part.tag))
    total = Inertia.total([_of_collision(name, x, inertial, frames, faults) for x in collisions])
    if inertial.only("mass", *location) is None:
        return total
    mass = number_of(inertial, "mass", *location, default=1.0)
    if mass <= 0:
        message = 'must be greater than zero, for auto="true" scales the inertia of the shapes to it'
        raise needed(inertial, "mass").error(message, *location, "mass", value=mass)
    return Inertia(mass, total.center_of_mass, total.tensor * (mass / total.mass), strict=False)


def _of_collision(name: str, collision: Element, inertial: Element, frames: Frames, faults: Faults) -> Inertia:
    location = ("links", name, "collision", collision.attributes.get("name", ""))
    shapes = needed(collision, "geometry", *location).children
    if len(shapes) != 1 or shapes[0].tag not in SIZES:
        tag = shapes[0].tag if shapes else ""
        message = f"the inertia of this shape is not computed (of {', '.join(SIZES)} it is); write mass and inertia"
        raise (shapes[0] if shapes else collision).error(message, *location, value=f"<{tag}>" if tag else None)
    shape = shapes[0]
    sizes: dict[str, Any] = {}
    for key, (tag, factor) in SIZES[shape.tag].items():
        part = needed(shape, tag, *location)
        values = np.array(part.content_numbers(3 if key == "size" else 1, *location, tag)) * factor
        sizes[key] = values if key == "size" else float(values[0])
    given = next((x for x in (collision.only("density", *location), inertial.only("density", *location)) if x), None)
    if given is None and inertial.first("mass") is None:
        message = f"no density is given, and SDF takes {DENSITY:g} kg/m^3; give <density>"
        faults.add(DEFAULT_DENSITY, name, collision.error(message, *location))
    density = DENSITY if given is None else given.content_numbers(1, *location, "density")[0]
    try:
        solid = Inertia.solid(shape.tag, density=density, **sizes)
    except RobotError as error:
        raise shape.error(error.message, *location, error.name or "", value=error.value) from None
    middle = np.array([0.0, 0.0, -sizes["length"] / 4]) if shape.tag == "cone" else np.zeros(3)
    pose = collision.only("pose", *location)
    relative = "" if pose is None else pose.attributes.get("relative_to") or pose.attributes.get("frame") or ""
    placement = pose_of(collision, *location)
    if relative not in ("", name):
        placement = frames.of(relative, pose or collision).seen_from(frames.pose(name)).then(placement)
    return solid.moved(middle, IDENTITY.rotation).moved(*placement)
