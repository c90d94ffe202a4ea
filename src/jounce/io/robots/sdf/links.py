"""Links of SDF files: their inertias and the gravity of the world."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from jounce.io.robots.elements.faults import FLUID_MASS, PARTLY_INERTIAL, WITHOUT_INERTIAL, Faults, left_out
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.poses import Frames, check_known, number_of, pose_of
from jounce.io.robots.sdf.shapes import inertia_of_shapes
from jounce.rigid.inertia import Inertia

GRAVITY = (0.0, 0.0, -9.81)
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
SHOWN = ("visual", "collision", "sensor", "light", "audio_sink", "audio_source", "projector", "particle_emitter")
LINK = ("pose", "inertial", "gravity", "enable_wind", "self_collide", "kinematic", "must_be_base_link", "battery")
LINK += ("velocity_decay", "material", "plugin", "frame", *SHOWN)
INERTIAL = ("pose", "mass", "inertia", "density", "auto_inertia_params", "fluid_added_mass", "frame")


def read_inertia(name: str, element: Element, frames: Frames, faults: Faults) -> Inertia | None:
    """Return the inertia of a link in its frame; None if all of it is zero."""
    location = ("links", name)
    check_known(element, LINK, *location)
    inertial = element.only("inertial", *location)
    if inertial is None:
        message = "<inertial> is missing: SDF takes the link for 1 kg with moments of 1 kg m^2; give it its own"
        faults.add(WITHOUT_INERTIAL, name, element.error(message, *location))
        return Inertia(1.0, tensor=np.eye(3))
    location = (*location, "inertial")
    check_known(inertial, INERTIAL, *location)
    _check_readable(name, inertial, faults, *location)
    if inertial.attributes.get("auto", "false").strip() in ("true", "1"):
        inertia = inertia_of_shapes(name, element, inertial, frames, faults)
        faults.check(inertia, name, inertial.line)
        return inertia
    moments = inertial.only("inertia", *location)
    if moments is not None:
        check_known(moments, TENSOR, *location, "inertia")
    _check_whole(name, inertial, moments, faults)
    mass = number_of(inertial, "mass", *location, default=1.0)
    xx, xy, xz, yy, yz, zz = (
        number_of(moments, key, *location, "inertia", default=float(key[1] == key[2])) for key in TENSOR
    )
    if mass < 0:
        raise inertial.error("must be greater than zero", *location, "mass", value=mass)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if mass == 0 and not tensor.any():
        return None
    inertia = Inertia(mass, tensor=tensor, strict=False)
    faults.check(inertia, name, (moments or inertial).line)
    return inertia.moved(*pose_of(inertial, *location))


def _check_readable(name: str, inertial: Element, faults: Faults, *location: str) -> None:
    """Raise an error for an inertia with another reference frame; record the mass of a fluid, which is left out."""
    pose, added = inertial.only("pose", *location), inertial.only("fluid_added_mass", *location)
    given = {} if pose is None else pose.attributes
    frame = given.get("relative_to") or given.get("frame") or name
    if pose is not None and frame != name:
        message = "an inertia is placed in the frame of its link, relative to nothing else"
        raise pose.error(message, *location, "pose", value=frame)
    for entry in [] if added is None else added.children:
        if value := entry.content_numbers(1, *location, added.tag if added else "", entry.tag)[0]:
            error = entry.error(left_out(FLUID_MASS), *location, "fluid_added_mass", value=value)
            faults.leave_out(FLUID_MASS, name, error)


def _check_whole(name: str, inertial: Element, moments: Element | None, faults: Faults) -> None:
    """Record a missing mass or missing moments, for which SDF takes 1."""
    missing = [] if inertial.first("mass") is not None else ["mass"]
    missing += [key for key in ("ixx", "iyy", "izz") if moments is None or moments.first(key) is None]
    if missing:
        message = f"<inertial> does not give {', '.join(missing)}, which SDF takes for 1; give all of it"
        faults.add(PARTLY_INERTIAL, name, inertial.error(message, "links", name, "inertial"))


def gravity_of(world: Element | None) -> Float[np.ndarray, "3"]:
    """Return the gravity in the axes of the world.

    Parameters
    ----------
    world : Element or None
        Element ``<world>`` with the model.
    """
    holders = [] if world is None else [world, *world.every("physics")]  # up to SDF 1.5, in the physics
    for holder in holders:
        if (element := holder.only("gravity", "world")) is not None:
            return np.array(element.content_numbers(3, "world", "gravity"))
    return np.array(GRAVITY)
