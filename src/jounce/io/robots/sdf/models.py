"""Selection of a model of an SDF file, with included and nested models as links and joints of its own.

A nested model becomes links, joints and frames whose names begin with its own and ``::``, as in SDF itself, and a frame
for the model, to which the poses within it are relative.
"""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from jounce.errors import RobotFileError, no_such
from jounce.io.files.reading import named_file
from jounce.io.robots.elements.faults import RENAMED, Faults
from jounce.io.robots.elements.xml_elements import Element, read_markup
from jounce.io.robots.sdf.joints import with_named_axes
from jounce.io.robots.sdf.poses import IDENTITY, MODEL, WORLD, FramePose, Frames, check_known, flag_of
from jounce.io.robots.sdf.scopes import REFERENCES, made, named, placed, reference_pose, scope, scoped, with_pose
from jounce.io.robots.sdf.worlds import WorldJoints

MODEL_PARTS = ("static", "self_collide", "allow_auto_disable", "enable_wind", "pose", "link", "joint", "frame")
MODEL_PARTS += ("plugin", "gripper", "include", "model")
INCLUDE_PARTS = ("uri", "name", "pose", "placement_frame", "static", "plugin", "merge")
ROOT = ("model", "world")
NOT_THERE = "models that the world includes and that are not there"
NEWEST = (1, 7)  # version of the resulting models: axes name their frames
MOST_NESTED = 50
MOST_LINKS = 20_000


@dataclasses.dataclass(frozen=True)
class ChosenModel:
    """A model of a file, with all nested models among its own links and joints.

    Attributes
    ----------
    model : Element
        Model without nested models.
    pose : FramePose
        Pose in the world.
    world : Element or None
        Element ``<world>`` that contains it.
    version : tuple of int
        Version of SDF in which its joints are written.
    """

    model: Element
    pose: FramePose
    world: Element | None
    version: tuple[int, ...]


def chosen_model(
    root: Element, faults: Faults, name: str | None = None, allow: Iterable[str | PathLike[str]] = ()
) -> ChosenModel:
    """Return the model of a file with a given name, or the only one that moves.

    Parameters
    ----------
    root : Element
        Element ``<sdf>``.
    faults : Faults
        Records missing included models.
    name : str, optional
        Name of the model.
    allow
        Folders besides that of the file below which included models may lie.

    Raises
    ------
    RobotFileError
        If the model does not exist, several models move, or a model cannot be read.
    """
    check_known(root, (*ROOT, "actor", "light", "include"))
    reader = _Models(faults, tuple(allow))
    version = version_of(root)
    holders = [(root, None), *((world, world) for world in root.every("world"))]
    given: dict[str, _SourceModel] = {}
    for holder, world in holders:
        for model, its_version in reader.models(holder, version):
            label = model.attributes.get("name", "") if len(given) else model.attributes.get("name", "robot")
            if label in given:
                message = f"two models of one world have this name, the first in line {given[label].model.line}"
                raise model.error(message, "models", value=label)
            given[label] = _SourceModel(model, its_version, world)
    if not given:
        raise root.error("must hold one <model>, it holds 0", value=[])
    if name is not None and name not in given:
        raise RobotFileError(no_such("model", name, given), path=root.path, name="model", value=name)
    label = _only_one(given, reader) if name is None else name
    model, its_version, world = given[label]
    joints = WorldJoints(world)
    if joints.of([label]):
        return ChosenModel(_joined(label, given, joints, reader), IDENTITY, world, NEWEST)
    flat = reader.flattened(model, its_version, top=True)
    if reference_pose(flat)[1]:  # relative to another model, or to a frame of the world
        pose = _frames_of_world(label, given, joints, reader).of(f"{label}::{MODEL}", model, "pose")
        return ChosenModel(flat, pose, world, NEWEST)
    return ChosenModel(flat, placed(flat), world, NEWEST)


def version_of(root: Element) -> tuple[int, ...]:
    """Return the version of SDF of a file."""
    text = root.text("version", "version")
    try:
        return tuple(int(part) for part in text.split("."))
    except ValueError:
        raise root.error(
            "the version must be numbers with points between, such as 1.7", "version", value=text
        ) from None


class _SourceModel(NamedTuple):
    """A model as given in its file, its version of SDF, and the world that contains it."""

    model: Element
    version: tuple[int, ...]
    world: Element | None


def _only_one(given: dict[str, _SourceModel], reader: _Models) -> str:
    """Return the only model, the only one that moves or is not static, or the first of several that are connected."""
    if len(given) == 1:
        return next(iter(given))
    movable = [name for name, item in given.items() if not _static(item.model)]
    worlds = {id(item.world): item.world for item in given.values()}
    joints = {key: WorldJoints(world) for key, world in worlds.items()}
    moved = {(key, name) for key, x in joints.items() for joint in _not_fixed(x.joints) for name in x.models(joint)}
    moving = [x for x in movable if (id(given[x].world), x) in moved or _moves(given[x], reader)]
    for names in (moving, movable if not moving else []):
        if names and joints[id(given[names[0]].world)].connected(names[0], given).issuperset(names):
            return names[0]
    candidates = moving or movable or list(given)
    phrase = "that move" if moving else "and none that moves"
    message = (
        f"holds {len(candidates) if moving else len(given)} models {phrase}; choose one with model=NAME (--model NAME)"
    )
    raise given[candidates[1]].model.error(message, "models", value=candidates)


def _static(model: Element) -> bool:
    return flag_of(model, "static", "static")


def _moves(given: _SourceModel, reader: _Models) -> bool:
    """Return whether a model has moving joints, of its own or of nested models."""
    if _not_fixed(part for part in given.model.walk() if part.tag == "joint"):
        return True
    if not any(part.tag == "include" for part in given.model.walk()):
        return False
    flat = reader.flattened(given.model, given.version, top=True)
    return bool(_not_fixed(flat.every("joint")))


def _not_fixed(joints: Iterable[Element]) -> list[Element]:
    return [joint for joint in joints if joint.attributes.get("type") not in ("fixed", None)]


def _joined(label: str, given: dict[str, _SourceModel], joints: WorldJoints, reader: _Models) -> Element:
    """Return the models that joints of the world connect as one model; static ones are fixed to the world."""
    members = joints.connected(label, given)
    children = [*joints.frames.values()]
    root = dataclasses.replace(given[label].model, attributes={"name": label}, children=children)
    for name in (name for name in given if name in members):
        model = reader.flattened(given[name].model, given[name].version, top=True)
        root.children += scope(name, model)
        frames = Frames(model, named(model))
        if _static(model) and frames.links:
            ends = {"parent": WORLD, "child": f"{name}::{frames.canonical_link()}"}
            fixed = [made(model, tag, text) for tag, text in ends.items()]
            attributes = {"name": f"{name}::{WORLD}_fixed", "type": "fixed"}
            root.children.append(dataclasses.replace(model, tag="joint", attributes=attributes, children=fixed))
    root.children += joints.of(members)
    own = {part.attributes.get("name") for part in root.children}
    named_frames = {x.attributes.get(key, MODEL) for part in root.children for x in part.walk() for key in REFERENCES}
    if foreign := {name for name in named_frames - {MODEL} if not own & {name, f"{name}::{MODEL}"}}:
        frames = _frames_of_world(label, given, joints, reader)
        known = sorted(foreign & (frames.elements.keys() | given.keys()))
        root.children += [with_pose(made(root, "frame", name=x), frames.of(x, root)) for x in known]
    return root


def _frames_of_world(label: str, given: dict[str, _SourceModel], joints: WorldJoints, reader: _Models) -> Frames:
    """Return the frames of the world that contains a model, with those of all its models."""
    model, _, world = given[label]
    whole = dataclasses.replace(model, attributes={"name": WORLD}, children=[*joints.frames.values()])
    for name, item in given.items():
        if item.world is world:
            whole.children += scope(name, reader.flattened(item.model, item.version, top=True))
    return Frames(whole, named(whole))


class _Models:
    """Reads models and the models that they include, each file once."""

    def __init__(self, faults: Faults, allow: tuple[str | PathLike[str], ...]):
        self.faults, self.allow = faults, allow
        self.files: dict[str, tuple[Element, tuple[int, ...]]] = {}
        self.open: list[str] = []
        self.links = 0

    def models(self, holder: Element, version: tuple[int, ...]) -> Iterator[tuple[Element, tuple[int, ...]]]:
        """Yield the models of a file or a world, and their versions, with included ones; missing ones are recorded."""
        for child in holder.children:
            if child.tag == "model":
                yield child, version
            elif child.tag == "include":
                path = self._path(child)
                if path is None:
                    uri = self._uri(child)
                    error = child.error(
                        "there is no such model; allow the folder that holds it with --allow", value=uri
                    )
                    self.faults.leave_out(NOT_THERE, uri, error)
                    continue
                yield self._included(child, path)

    def flattened(self, model: Element, version: tuple[int, ...], *, top: bool = False) -> Element:
        """Return a model in the newest version, with nested models among its own links, joints and frames."""
        check_known(model, MODEL_PARTS)
        children: list[Element] = []
        for child in model.children:
            if child.tag in ("model", "include"):
                children += self._nested(child, version)
                continue
            if child.tag == "link":
                self.links += 1
                if self.links > MOST_LINKS:
                    raise child.error(f"more than {MOST_LINKS} links with all that is included", "links")
            children.append(self._newest(child, model, version) if child.tag == "joint" else child)
        result = dataclasses.replace(model, children=children)
        if not top:
            named(result)
        return result

    def _newest(self, joint: Element, model: Element, version: tuple[int, ...]) -> Element:
        """Return a joint in the newest version: its axes name their frames, and no link has its name."""
        name = joint.attributes.get("name", "")
        if version < (1, 7) and any(link.attributes.get("name") == name for link in model.every("link")):
            used_names = {part.attributes.get("name") for part in model.children}
            new = f"{name}_joint"
            while new in used_names:
                new += "_"
            message = f"a link has the name of this joint, which is called {new}; give it another"
            self.faults.add(RENAMED, name, joint.error(message, "joints", name))
            joint = dataclasses.replace(joint, attributes={**joint.attributes, "name": new})
        return with_named_axes(joint, version)

    def _nested(self, child: Element, version: tuple[int, ...]) -> list[Element]:
        """Return the parts of a nested or included model, with their names in the containing model."""
        model, merged = child, False
        if child.tag == "include":
            path = self._path(child)
            if path is None:
                advice = "put it beside the file, or allow the folder that holds it with --allow DIR (allow=[DIR])"
                raise child.error(f"there is no such model; {advice}", "include", value=self._uri(child))
            merged = child.attributes.get("merge", "false").strip() in ("true", "1")
            if path in self.open or len(self.open) > MOST_NESTED:
                raise child.error("models include one another without end", "include", value=self._uri(child))
            self.open.append(path)
            model, version = self._included(child, path)
        flat = self.flattened(model, version)
        if child.tag == "include":
            self.open.pop()
        name = model.text("name", "models")
        return scoped(flat, name, reference_pose(flat), flat.only("pose") or child, merged=merged)

    def _included(self, include: Element, path: str) -> tuple[Element, tuple[int, ...]]:
        """Return an included model, with the name, the pose and the static flag of the including element."""
        check_known(include, INCLUDE_PARTS, "include")
        if path not in self.files:
            root = read_markup(path, self.faults)
            if root.tag != "sdf":
                raise include.error("included models must be of SDF", "include", value=f"<{root.tag}>")
            models = root.every("model")
            if len(models) != 1:
                raise include.error(f"the file must hold one <model>, it holds {len(models)}", "include", value=path)
            self.files[path] = models[0], version_of(root)
        model, version = self.files[path]
        attributes = dict(model.attributes)
        if (given := include.only("name", "include")) is not None:
            attributes["name"] = given.content.strip()
        replaced = {tag: part for tag in ("pose", "static") if (part := include.only(tag, "include")) is not None}
        if (frame := include.only("placement_frame", "include")) is not None:
            attributes["placement_frame"] = frame.content.strip()
        children = [*replaced.values(), *(x for x in model.children if x.tag not in replaced)]
        return dataclasses.replace(model, attributes=attributes, children=children), version

    def _uri(self, include: Element) -> str:
        uri = include.only("uri", "include")
        if uri is None or not uri.content.strip():
            raise include.error("<include> has no <uri>", "include")
        return uri.content.strip()

    def _path(self, include: Element) -> str | None:
        """Return the file of an included model; None if it is missing."""
        uri = self._uri(include)
        match = re.fullmatch(r"(?:(model|package|file)://)?(.*)", uri)
        assert match is not None  # it matches anything
        kind, name = match.groups()
        if "://" in name or not name.strip("/"):
            return None
        folder = Path(include.path).parent
        folders = [folder, *(folder.parents if kind in ("model", "package") else ()), *map(Path, self.allow)]
        for directory in folders:
            target = directory / name
            if not os.path.lexists(target):
                continue
            file = _manifest(target) if target.is_dir() else str(target)
            try:
                path = named_file(file, include.path, self.allow, folder=directory, error=RobotFileError)
            except RobotFileError as error:
                raise include.error(error.message, "include", value=uri) from None
            return path if os.path.lexists(path) else None
        return None


def _manifest(folder: Path) -> str:
    """Return the file of a model folder: the newest one of its manifest, else model.sdf."""
    config = folder / "model.config"
    if os.path.lexists(config):
        files = [x for x in read_markup(str(config)).every("sdf") if x.content.strip()]
        versions = [tuple(int(n) for n in re.findall(r"\d+", x.attributes.get("version", "0"))) for x in files]
        if files:
            return str(folder / files[versions.index(max(versions))].content.strip())
    return str(folder / "model.sdf")
