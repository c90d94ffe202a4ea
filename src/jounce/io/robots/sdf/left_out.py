"""Parts of SDF files that affect motions or forces and are not read: springs, decay, fixed or kinematic models."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from jounce.io.robots.elements.faults import (
    BUSHINGS,
    FLUID_PLUGINS,
    JOINT_SPRINGS,
    LEAVE,
    PLUGINS,
    ROTORS,
    Faults,
    left_out,
)
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.joints import ROTOR, SdfJoint, rotor_of
from jounce.io.robots.sdf.poses import flag_of, needed, number_of

STATIC = "<static>, which holds all joints of this model where they are"
KINEMATIC = "<kinematic>, by which no force moves these links"
DECAY = "the decay of the velocities of links"
IN_LOOPS = {"damping": "damping of joints that close a loop", "friction": "friction of joints that close a loop"}
DECAYS = {"linear": DECAY, "angular": DECAY}
MIMICS = ("mimic", "drake:mimic")
OF_MODEL = {"drake:linear_bushing_rpy": BUSHINGS}
SPRING = {"spring_stiffness": JOINT_SPRINGS}
_OF_FLUIDS = re.compile("buoyancy|hydrodynamics|lift[-_]?drag|wind", re.IGNORECASE)


def note_left_out(
    model: Element, links: Mapping[str, Element], tree: Iterable[SdfJoint], closing: Iterable[SdfJoint], faults: Faults
) -> None:
    """Record the parts of a model that are left out.

    Parameters
    ----------
    model : Element
        Element ``<model>``.
    links : dict of str to Element
        Links of the model by name.
    tree, closing : iterable of SdfJoint
        Joints of the tree, and joints that close its loops.
    faults : Faults
        Records the parts.

    Raises
    ------
    RobotFileError
        If a value is no number or is not valid, or if a part that is left out is an error.
    """
    tree, closing = list(tree), list(closing)
    if flag_of(model, "static", "static") and any(joint.kind != "fixed" for joint in tree):
        error = needed(model, "static").error(left_out(STATIC, "false"), "static", value=True)
        faults.leave_out(STATIC, model.attributes.get("name", "robot"), error)
    for joint in closing:
        for axis in joint.axes:
            location, headings = ("joints", joint.name, axis.tag, "dynamics"), SPRING | IN_LOOPS
            _note_numbers(needed(joint.element, axis.tag).only("dynamics"), joint.name, headings, faults, *location)
    _note_extensions(model, tree, closing, faults)
    for name, link in links.items():
        if flag_of(link, "kinematic", "links", name):
            error = needed(link, "kinematic").error(
                left_out(KINEMATIC, "false"), "links", name, "kinematic", value=True
            )
            faults.leave_out(KINEMATIC, name, error)
        _note_numbers(link.only("velocity_decay"), name, DECAYS, faults, "links", name, "velocity_decay")


def _note_extensions(model: Element, tree: Sequence[SdfJoint], closing: Sequence[SdfJoint], faults: Faults) -> None:
    """Record the extensions of Drake, and joints that follow others by a plugin only."""
    for tag, heading in OF_MODEL.items():
        for element in model.every(tag):
            faults.leave_out(heading, f"<{tag}>", element.error(LEAVE.format(heading), tag))
    free = {joint.name for joint in tree if not any(x.tag in MIMICS for x in joint.element.walk())}
    for plugin in model.every("plugin"):
        if (name := follower(plugin)) in free:
            faults.leave_out(PLUGINS, name, plugin.error(LEAVE.format(PLUGINS), "joints", name))
    for joint in (*closing, *(joint for joint in tree if len(joint.axes) != 1 and joint.kind != "fixed")):
        if inertia := rotor_of(joint.element, "joints", joint.name):
            error = joint.element.error(left_out(ROTORS), "joints", joint.name, ROTOR, value=inertia)
            faults.leave_out(ROTORS, joint.name, error)


def note_fluids(holder: Element, faults: Faults) -> None:
    """Record Gazebo plugins of a world, a model or an element that compute forces of fluids.

    Raises
    ------
    RobotFileError
        If there is one, and parts that are left out are errors.
    """
    for plugin in holder.every("plugin"):
        given = [plugin.attributes.get(key, "") for key in ("name", "filename")]
        if any(map(_OF_FLUIDS.search, given)):
            error = plugin.error(LEAVE.format(FLUID_PLUGINS), "plugin", value=given[1] or given[0])
            faults.leave_out(FLUID_PLUGINS, given[0] or given[1], error)


def follower(plugin: Element) -> str:
    """Return the joint that a plugin makes follow another; empty if it is no such plugin."""
    part = plugin.first("mimicJoint")
    return "" if part is None else part.content.strip()


def _note_numbers(
    holder: Element | None, label: str, headings: Mapping[str, str], faults: Faults, *location: str
) -> None:
    """Record the nonzero numbers within an element, once for each heading."""
    noted = set()
    for key, heading in headings.items():
        value = number_of(holder, key, *location, default=0.0)
        if holder is not None and value and heading not in noted:
            noted.add(heading)
            error = needed(holder, key).error(left_out(heading), *location, key, value=value)
            faults.leave_out(heading, label, error)
