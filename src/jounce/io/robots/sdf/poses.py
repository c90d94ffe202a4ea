"""Poses in SDF files: each is relative to a named frame, and resolved along the chain of frames."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jounce.errors import no_such
from jounce.io.robots.elements.quaternions import rotation_of
from jounce.io.robots.elements.xml_elements import Element

MODEL = "__model__"
WORLD = "world"
MAX_CHAIN = 1000  # frames in a chain of references


class FramePose(NamedTuple):
    """The pose of a frame in another frame: its origin, and its axes as columns."""

    position: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]

    def then(self, inner: FramePose) -> FramePose:
        """Return the pose of an inner frame in the outer frame of this pose."""
        return FramePose(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)

    def seen_from(self, outer: FramePose) -> FramePose:
        """Return the pose of this frame in another one, given both poses in one frame."""
        return FramePose(outer.rotation.T @ (self.position - outer.position), outer.rotation.T @ self.rotation)


IDENTITY = FramePose(np.zeros(3), np.eye(3))


class Frames:
    """The frames of a model: its links, joints and further frames by name, and their poses in the model.

    Parameters
    ----------
    model : Element
        Element ``<model>``.
    elements : dict of str to Element
        Links, joints and frames by name.
    """

    def __init__(self, model: Element, elements: dict[str, Element]):
        self.model, self.elements = model, elements
        self.links = [name for name, element in elements.items() if element.tag == "link"]
        self._resolved: dict[str, FramePose] = {MODEL: IDENTITY}

    def pose(self, name: str) -> FramePose:
        """Return the pose of a frame in the model."""
        chain = [name]
        while chain[-1] not in self._resolved:
            element = self.elements[chain[-1]]
            self._extend(chain, self._reference(element), element)
        for name in reversed(chain[:-1]):
            element = self.elements[name]
            self._resolved[name] = self._resolved[self._reference(element)].then(pose_of(element, name))
        return self._resolved[name]

    def of(self, name: str, element: Element, *location: str) -> FramePose:
        """Return the pose of a frame in the model; `element` is the one that names the frame."""
        return self.pose(self._known(name, element, *location))

    def link(self, name: str, element: Element, *location: str) -> str:
        """Return the link to which a frame is fixed, or ``world``; `element` is the one that names the frame."""
        chain = [name]
        while True:
            name = chain[-1]
            if name == WORLD:
                return name
            link_name = self._known(name, element, *location)
            if link_name == MODEL:
                return self.canonical_link()
            target = self.elements[link_name]
            if target.tag == "link":
                return link_name
            next_name = text_of(target, "child", "joints", name) if target.tag == "joint" else _attachment(target)
            self._extend(chain, next_name, target)

    def canonical_link(self) -> str:
        """Return the canonical link of the model: the first one, unless it names another."""
        if not self.links:
            raise self.model.error("a robot needs at least one <link>")
        chosen = self.model.attributes.get("canonical_link") or self.links[0]
        if chosen not in self.links:
            raise self.model.error(no_such("link", chosen, self.links), "canonical_link", value=chosen)
        return chosen

    def _extend(self, chain: list[str], name: str, element: Element) -> None:
        if name in chain or len(chain) > MAX_CHAIN:
            circle = " -> ".join([*chain[-5:], name])
            raise element.error("is placed relative to itself", f"{element.tag}s", chain[-1], value=circle)
        chain.append(name)

    def _reference(self, element: Element) -> str:
        """Return the frame to which the pose of an element is relative."""
        pose = element.first("pose")
        given = "" if pose is None else pose.attributes.get("relative_to") or pose.attributes.get("frame") or ""
        if not given:
            if element.tag == "link":
                return MODEL
            given = _attachment(element) if element.tag == "frame" else text_of(element, "child")
        return self._known(given, pose or element)

    def _known(self, name: str, element: Element, *location: str) -> str:
        """Return the name of an existing frame; the name of a nested model denotes its own frame."""
        if name == MODEL or name in self.elements:
            return name
        if (nested := f"{name}::{MODEL}") in self.elements:
            return nested
        raise element.error(no_such("link, joint or frame", name, self.elements), *location, value=name)


def _attachment(frame: Element) -> str:
    return frame.attributes.get("attached_to") or MODEL


def pose_of(element: Element, *name: str) -> FramePose:
    """Return the pose of an element relative to its reference frame, by turns about fixed axes or a quaternion."""
    from scipy.spatial.transform import Rotation

    pose = element.first("pose")
    if pose is None or not pose.content.strip():
        return IDENTITY
    form = pose.attributes.get("rotation_format", "euler_rpy")
    if form == "quat_xyzw":
        numbers = pose.content_numbers(7, *name, "pose")
        return FramePose(np.array(numbers[:3]), rotation_of(numbers[3:], pose, *name, "pose"))
    if form != "euler_rpy":
        raise pose.error("rotation_format must be euler_rpy or quat_xyzw", *name, "pose", value=form)
    *position, roll, pitch, yaw = pose.content_numbers(6, *name, "pose")
    degrees = pose.attributes.get("degrees", "false").strip() in ("true", "1")
    return FramePose(np.array(position), Rotation.from_euler("xyz", [roll, pitch, yaw], degrees=degrees).as_matrix())


def needed(element: Element, tag: str, *name: str) -> Element:
    """Return the only child with a tag, which is required."""
    single = element.only(tag, *name)
    if single is None:
        raise element.error(f"<{element.tag}> has no <{tag}>", *name)
    return single


def text_of(element: Element, tag: str, *name: str) -> str:
    """Return the text of a required child, which must not be blank."""
    child = needed(element, tag, *name)
    text = child.content.strip()
    if not text:
        raise child.error(f"<{tag}> is empty", *name, tag)
    return text


def number_of(element: Element | None, tag: str, *name: str, default: float, infinite: bool = False) -> float:
    """Return the number in a child; the default if there is no child."""
    child = None if element is None else element.only(tag, *name)
    return default if child is None else child.content_numbers(1, *name, tag, infinite=infinite)[0]


def flag_of(element: Element | None, tag: str, *name: str, default: bool = False) -> bool:
    """Return the truth value in a child; the default if there is no child."""
    child = None if element is None else element.only(tag, *name)
    if child is None:
        return default
    word = child.content.strip().lower()
    if word not in ("true", "1", "false", "0"):
        raise child.error(f"<{tag}> must be true or false", *name, value=word)
    return word in ("true", "1")


def check_known(element: Element, valid: Iterable[str], *name: str) -> None:
    """Record elements that SDF does not have; those of other programs have a prefix, such as ``gz:``."""
    for child in element.children:
        if child.tag not in valid and ":" not in child.tag:
            child.leave_out_unknown(no_such("element of SDF here", child.tag, valid), *name)


def vector_of(element: Element, *name: str) -> Float[np.ndarray, "3"]:
    """Return the direction in an element as a unit vector."""
    values = np.array(element.content_numbers(3, *name))
    length = float(np.linalg.norm(values))
    if length < 1e-9:
        raise element.error("must have a direction", *name, value=values.tolist())
    return values / length
