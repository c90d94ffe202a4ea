"""The files that an MJCF file names, checked before MuJoCo reads them, and its warnings, kept from its log file."""

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
"""Of a robot, with those that are repeated; MuJoCo's own time grows with their square."""
MOST_NESTED = 50
"""Files within files."""


@contextmanager
def quiet_mujoco(mujoco: Any) -> Iterator[None]:
    """Keep what MuJoCo warns of, which is about simulations, from Python and from a log file in the working folder."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _message: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        mujoco.set_mju_user_warning(before)


def included(root: Element, allow: Iterable[str | PathLike[str]] = ()) -> list[Element]:
    """Return the roots of all files that an MJCF file includes or attaches, each of them once.

    MuJoCo looks for them beside the main file, and then beside the one that names them.

    Raises
    ------
    RobotFileError
        One cannot be read, or lies where it may not.
    """
    elements: dict[str, Element] = {}
    waiting = [root]
    while waiting:
        holder = waiting.pop()
        for element in holder.walk():
            name = element.attributes.get("file", "")
            if element.tag not in ("include", "model") or not name:
                continue
            for folder in dict.fromkeys(Path(file).parent for file in (root.path, holder.path)):
                path = _named(element, name, root, allow, folder)
                if os.path.lexists(path):
                    if path not in elements:
                        elements[path] = _included(element, name, path)
                        waiting.append(elements[path])
                    break
    return list(elements.values())


def _included(element: Element, name: str, path: str) -> Element:
    """Read a file that an element names; one of which nothing can be read is an error of that element."""
    try:
        return read_markup(path)
    except RobotFileError as error:
        if error.line is not None:
            raise
        raise element.error(error.message, element.tag, value=name) from None


def check_copies(parts: Iterable[Element]) -> None:
    """Refuse more bodies than a robot has, which few lines of MJCF files can ask for, before MuJoCo makes them.

    Raises
    ------
    RobotFileError
        Repeated, attached and included parts hold too many bodies together.
    """
    copies = _Copies(list(parts))
    for root in copies.roots:
        copies.bodies(root)


class _Copies:
    """Counts the bodies that files stand for, each file once however often it is attached or included."""

    def __init__(self, roots: list[Element]):
        self.roots = roots
        self._files: dict[str, list[Element]] = {}  # by their names without folders
        for root in roots:
            self._files.setdefault(Path(root.path).name, []).append(root)
        self._models: dict[str | None, list[Element]] = {}
        for model in (element for root in roots for element in root.walk() if element.tag == "model"):
            for root in self._files.get(_file_of(model), []):
                name = model.attributes.get("name", root.attributes.get("model"))
                self._models.setdefault(name, []).append(root)
        self._counts: dict[int, int] = {}

    def bodies(self, root: Element, depth: int = 0) -> int:
        """Return how many bodies a file stands for, with all that it repeats, attaches and includes."""
        if id(root) in self._counts:
            return self._counts[id(root)]
        if depth > MOST_NESTED:
            raise root.error(f"files attach or include one another more than {MOST_NESTED} deep")
        self._counts[id(root)] = total = 0  # a file within itself is for MuJoCo to refuse
        waiting = [(root, 1)]
        while waiting:
            element, copies = waiting.pop()
            if element.tag == "replicate":
                copies *= max(1, int(element.number("count", "replicate", "count")))
            total += copies * self._body_count(element, depth)
            if total > MOST_BODIES or copies > MOST_BODIES:
                message = f"more than {MOST_BODIES} bodies or copies with all that is repeated"
                raise element.error(message, "replicate")
            waiting.extend((child, copies) for child in element.children)
        self._counts[id(root)] = total
        return total

    def _body_count(self, element: Element, depth: int) -> int:
        """Return how many bodies an element is or brings from other files, those of its children left out."""
        if element.tag == "attach":
            others = self._models.get(element.attributes.get("model"), [])
        elif element.tag == "include":
            others = self._files.get(_file_of(element), [])
        else:
            return element.tag == "body"
        return max((self.bodies(other, depth + 1) for other in others), default=0)


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
    """Return the line that a text of MuJoCo speaks of."""
    match = re.search(r"[Ll]ine (?:number=)?(\d+)", text)
    return None if match is None else int(match[1])


def check_assets(spec: Any, parts: Iterable[Element], allow: Iterable[str | PathLike[str]] = ()) -> None:
    """Refuse meshes and pictures that lie where they may not, or are no files: MuJoCo reads whatever it is given.

    Parameters
    ----------
    spec : mujoco.MjSpec
        With those only that will be read.
    parts : iterable of Element
        The root of the file, and those of the files that it includes.
    allow
        Folders besides that of the file that they may be below.

    Raises
    ------
    RobotFileError
        One is refused; MuJoCo says what is missing.
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
    """Give the kind of each part that comes from a file, the part, and the name of the file."""
    kinds = {"mesh": spec.meshes, "texture": spec.textures, "hfield": spec.hfields, "skin": spec.skins}
    for tag, assets in kinds.items():
        for asset in assets:
            files = [asset.file, *(asset.cubefiles if tag == "texture" else ())]
            yield from ((tag, asset, file) for file in files if file)
