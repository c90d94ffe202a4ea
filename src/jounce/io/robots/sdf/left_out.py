"""What SDF files hold that bears on motions or forces and is not read: springs, decay, what holds models still."""

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
    """Note what is left out of a model.

    Parameters
    ----------
    model : Element
        The element ``<model>``.
    links : dict of str to Element
        Its links by name.
    tree, closing : iterable of SdfJoint
        The joints of the tree, and those that close its loops.
    faults : Faults
        Takes what is left out.

    Raises
    ------
    RobotFileError
        A value is no number, or none that it may be; or something is left out and that is an error.
    """
    tree, closing = list(tree), list(closing)
    if flag_of(model, "static", "static") and any(joint.kind != "fixed" for joint in tree):
        error = needed(model, "static").error(left_out(STATIC, "false"), "static", value=True)
        faults.leave_out(STATIC, model.attributes.get("name", "robot"), error)
    for joint in closing:
        for axis in joint.axes:
            where, headings = ("joints", joint.name, axis.tag, "dynamics"), SPRING | IN_LOOPS
            _note_numbers(needed(joint.element, axis.tag).only("dynamics"), joint.name, headings, faults, *where)
    _note_extensions(model, tree, closing, faults)
    for name, link in links.items():
        if flag_of(link, "kinematic", "links", name):
            error = needed(link, "kinematic").error(
                left_out(KINEMATIC, "false"), "links", name, "kinematic", value=True
            )
            faults.leave_out(KINEMATIC, name, error)
        _note_numbers(link.only("velocity_decay"), name, DECAYS, faults, "links", name, "velocity_decay")


def _note_extensions(model: Element, tree: Sequence[SdfJoint], closing: Sequence[SdfJoint], faults: Faults) -> None:
    """Note what Drake adds to a model, and followers that are those of a plugin alone."""
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
    """Note plugins of a world, a model or an element for Gazebo that compute forces of fluids.

    Raises
    ------
    RobotFileError
        There is one, and what is left out is an error.
    """
    for plugin in holder.every("plugin"):
        given = [plugin.attributes.get(key, "") for key in ("name", "filename")]
        if any(map(_OF_FLUIDS.search, given)):
            error = plugin.error(LEAVE.format(FLUID_PLUGINS), "plugin", value=given[1] or given[0])
            faults.leave_out(FLUID_PLUGINS, given[0] or given[1], error)


def follower(plugin: Element) -> str:
    """Return the joint that a plugin makes follow another, empty if it is of another kind."""
    part = plugin.first("mimicJoint")
    return "" if part is None else part.content.strip()


def _note_numbers(holder: Element | None, shown: str, headings: Mapping[str, str], faults: Faults, *where: str) -> None:
    """Note the numbers within an element that are not zero, once for each heading."""
    noted = set()
    for key, heading in headings.items():
        value = number_of(holder, key, *where, default=0.0)
        if holder is not None and value and heading not in noted:
            noted.add(heading)
            error = needed(holder, key).error(left_out(heading), *where, key, value=value)
            faults.leave_out(heading, shown, error)
