"""Files that an MJCF file names, checked before MuJoCo reads them, and MuJoCo's warnings, kept from its log file."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from jounce.errors import RobotFileError
from jounce.io.files.reading import MAX_SAMPLES, named_file, read_file
from jounce.io.robots.elements.xml_elements import Element, read_markup

MOST_BODIES = 2000
"""Largest number of bodies of a robot, with repeated ones; the time of MuJoCo grows with its square."""
MOST_NESTED = 50
"""Deepest nesting of files."""


@contextmanager
def quiet_mujoco(mujoco: Any) -> Iterator[None]:
    """Suppress warnings of MuJoCo, which concern simulations, in Python and in a log file in the working folder."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _message: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        mujoco.set_mju_user_warning(before)


def included(root: Element, allow: Iterable[str | PathLike[str]] = ()) -> list[Element]:
    """Return the roots of all files that an MJCF file includes or attaches, each once.

    Like MuJoCo, look for each file beside the main file, and then beside the file that names it.

    Raises
    ------
    RobotFileError
        If a file cannot be read, or lies where it may not.
    """
    elements: dict[str, Element] = {}
    pending = [root]
    while pending:
        holder = pending.pop()
        for element in holder.walk():
            name = element.attributes.get("file", "")
            if element.tag not in ("include", "model") or not name:
                continue
            for folder in dict.fromkeys(Path(file).parent for file in (root.path, holder.path)):
                path = _named(element, name, root, allow, folder)
                if os.path.lexists(path):
                    if path not in elements:
                        elements[path] = _included(element, name, path)
                        pending.append(elements[path])
                    break
    return list(elements.values())


def _included(element: Element, name: str, path: str) -> Element:
    """Return the root of a file that an element names; an error of the whole file is reported for that element."""
    try:
        return read_markup(path)
    except RobotFileError as error:
        if error.line is not None:
            raise
        raise element.error(error.message, element.tag, value=name) from None


def check_copies(parts: Iterable[Element]) -> None:
    """Raise an error for more bodies than any robot has, which few lines of MJCF can create, before MuJoCo does.

    Raises
    ------
    RobotFileError
        If repeated, attached and included parts hold too many bodies.
    """
    copies = _Copies(list(parts))
    for root in copies.roots:
        copies.bodies(root)


class _Copies:
    """Counts the bodies of files, each file once however often it is attached or included."""

    def __init__(self, roots: list[Element]):
        self.roots = roots
        self._files: dict[str, list[Element]] = {}  # by name without folders
        for root in roots:
            self._files.setdefault(Path(root.path).name, []).append(root)
        self._models: dict[str | None, list[Element]] = {}
        for model in (element for root in roots for element in root.walk() if element.tag == "model"):
            for root in self._files.get(_file_of(model), []):
                name = model.attributes.get("name", root.attributes.get("model"))
                self._models.setdefault(name, []).append(root)
        self._counts: dict[int, int] = {}

    def bodies(self, root: Element, depth: int = 0) -> int:
        """Return the number of bodies of a file, with all that it repeats, attaches and includes."""
        if id(root) in self._counts:
            return self._counts[id(root)]
        if depth > MOST_NESTED:
            raise root.error(f"files attach or include one another more than {MOST_NESTED} deep")
        self._counts[id(root)] = total = 0  # MuJoCo refuses a file within itself
        pending = [(root, 1)]
        while pending:
            element, copies = pending.pop()
            if element.tag == "replicate":
                copies *= max(1, int(element.number("count", "replicate", "count")))
            total += copies * self._body_count(element, depth)
            if total > MOST_BODIES or copies > MOST_BODIES:
                message = f"more than {MOST_BODIES} bodies or copies with all that is repeated"
                raise element.error(message, "replicate")
            pending.extend((child, copies) for child in element.children)
        self._counts[id(root)] = total
        return total

    def _body_count(self, element: Element, depth: int) -> int:
        """Return the number of bodies of an element or the files that it brings, without its children."""
        if element.tag == "attach":
            attached = self._models.get(element.attributes.get("model"), [])
        elif element.tag == "include":
            attached = self._files.get(_file_of(element), [])
        else:
            return element.tag == "body"
        return max((self.bodies(other, depth + 1) for other in attached), default=0)


def _file_of(element: Element) -> str:
    """Return the name of the file of an element, without folders."""
    return Path(element.attributes.get("file", "")).name


def _named(
    element: Element, name: str, root: Element, allow: Iterable[str | PathLike[str]], folder: str | PathLike[str]
) -> str:
    """Return the path of a file that an element names."""
    try:
        return named_file(name, root.path, allow, folder=folder, error=RobotFileError)
    except RobotFileError as error:
        raise element.error(error.message, element.tag, value=name) from None


def line_of(text: str) -> int | None:
    """Return the line that a text of MuJoCo mentions; None if it mentions none."""
    match = re.search(r"[Ll]ine (?:number=)?(\d+)", text)
    return None if match is None else int(match[1])


def check_fusion(spec: Any, mujoco: Any, root: Element) -> None:
    """Raise an error for a given inertia that MuJoCo drops where it fuses bodies without joints with their parents."""
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    if not (always and spec.compiler.fusestatic):
        return
    for body in spec.bodies:
        fused, pending = [], list(body.bodies) if len(body.joints) else []
        while pending:
            child = pending.pop()
            if not len(child.joints):
                fused.append(child)
                pending += list(child.bodies)
        shaped = any(len(child.geoms) for child in fused)
        for part in [body, *fused] if shaped else fused:
            if part.explicitinertial and not len(part.geoms):
                message = "with fusestatic and inertiafromgeom, MuJoCo drops the inertia of a body without shapes"
                raise root.error(f"{message}; remove fusestatic", f"bodies.{part.name}")


def check_assets(spec: Any, parts: Iterable[Element], allow: Iterable[str | PathLike[str]] = ()) -> None:
    """Raise an error for meshes and pictures in forbidden places, or that are no files: MuJoCo reads anything.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Specification with only the parts that will be read.
    parts : iterable of Element
        Root of the file, and those of the included files.
    allow
        Folders besides that of the file below which they may lie.

    Raises
    ------
    RobotFileError
        If a file is refused; MuJoCo itself reports missing files.
    """
    roots = list(parts)
    folders = list(dict.fromkeys(Path(part.path).parent for part in roots))
    for tag, asset, file in _asset_files(spec):
        directory = spec.texturedir if tag == "texture" else spec.meshdir
        name = str(Path(directory) / (Path(file).name if spec.strippath else file))
        element = Element(tag, {}, roots[0].path, line_of(asset.info) or roots[0].line)
        for folder in folders:
            path = _named(element, name, roots[0], allow, folder)
            if os.path.lexists(path):
                try:
                    read_file(path, MAX_SAMPLES, what=f"the {tag}", error=RobotFileError)
                except RobotFileError as error:
                    raise element.error(error.message, tag, value=file) from None


def _asset_files(spec: Any) -> Iterator[tuple[str, Any, str]]:
    """Yield each part that comes from a file: its kind, the part, and the name of the file."""
    kinds = {"mesh": spec.meshes, "texture": spec.textures, "hfield": spec.hfields, "skin": spec.skins}
    for tag, assets in kinds.items():
        for asset in assets:
            files = [asset.file, *(asset.cubefiles if tag == "texture" else ())]
            yield from ((tag, asset, file) for file in files if file)
