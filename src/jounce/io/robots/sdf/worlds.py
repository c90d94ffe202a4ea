"""Joints and frames of an SDF world, which connect and place its models."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from jounce.errors import no_such
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.poses import MODEL, WORLD
from jounce.io.robots.sdf.scopes import REFERENCES, made

ENDS = ("parent", "child")


class WorldJoints:
    """Joints and frames of a world, as parts of one model whose frame is that of the world.

    Parameters
    ----------
    world : Element or None
        Element ``<world>``, if there is one.
    """

    def __init__(self, world: Element | None):
        parts = [] if world is None else [*world.every("frame"), *world.every("joint")]
        placed = [_with_world_frame(part) for part in parts]
        self.frames = {part.attributes.get("name", ""): part for part in placed if part.tag == "frame"}
        self.joints = [self._with_world_link(part) for part in placed if part.tag == "joint"]

    def of(self, models: Iterable[str]) -> list[Element]:
        """Return the joints at some of the models."""
        names = set(models)
        return [joint for joint in self.joints if self.models(joint) & names]

    def connected(self, label: str, models: Iterable[str]) -> set[str]:
        """Return the models that joints connect to one of them, with that one.

        Raises
        ------
        RobotFileError
            If such a joint is at a model that the world does not have.
        """
        members, before, valid = {label}, 0, list(models)
        while len(members) != before:
            before = len(members)
            for joint in self.of(members):
                for end in self.models(joint).difference(valid):
                    raise joint.error(no_such("model of this world", end, valid), "joints", value=end)
                members |= self.models(joint)
        return members

    def models(self, joint: Element) -> set[str]:
        """Return the names of the models at the ends of a joint."""
        ends = {self._target(part.content.strip()) for tag in ENDS for part in joint.every(tag)}
        return {end.partition("::")[0] for end in ends - {WORLD}}

    def _target(self, name: str) -> str:
        """Return what a name stands for: a frame of the world is attached to a part of a model, or to the world."""
        passed = {""}
        while name in self.frames and name not in passed:
            passed.add(name)
            attached = self.frames[name].attributes.get("attached_to") or WORLD
            name = WORLD if attached == MODEL else attached
        return name

    def _with_world_link(self, joint: Element) -> Element:
        """Return a joint whose ends at frames fixed in the world are the world itself."""
        fixed = [part.tag in ENDS and self._target(part.content.strip()) == WORLD for part in joint.children]
        pairs = zip(joint.children, fixed, strict=True)
        children = [made(part, part.tag, WORLD) if is_fixed else part for part, is_fixed in pairs]
        return dataclasses.replace(joint, children=children)


def _with_world_frame(element: Element) -> Element:
    """Return an element in which the frame of the world is that of the model that contains it."""
    attributes = {key: MODEL if key in REFERENCES and x == WORLD else x for key, x in element.attributes.items()}
    children = [_with_world_frame(child) for child in element.children]
    return dataclasses.replace(element, attributes=attributes, children=children)
