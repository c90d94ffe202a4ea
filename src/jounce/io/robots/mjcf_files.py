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
from jounce.io.robots.xml_elements import Element, read_markup

MOST_BODIES = 2000
"""Of a robot, with those that are repeated; MuJoCo's own time grows with their square."""


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
    found: dict[str, Element] = {}
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
                    if path not in found:
                        found[path] = _included(element, name, path)
                        waiting.append(found[path])
                    break
    return list(found.values())


def _included(element: Element, name: str, path: str) -> Element:
    """Read a file that an element names; one of which nothing can be read is an error of that element."""
    try:
        return read_markup(path)
    except RobotFileError as error:
        if error.line is not None:
            raise
        raise element.error(error.message, element.tag, value=name) from None


def check_copies(parts: Iterable[Element]) -> None:
    """Refuse more bodies than a robot has, which few lines of an MJCF file can ask for, before MuJoCo makes them.

    Raises
    ------
    RobotFileError
        Repeated parts hold too many bodies together.
    """
    roots = list(parts)
    models = {Path(root.path).name: root for root in roots}
    total = 0
    for root in roots:
        named = {element.attributes.get("name"): element for element in root.walk() if element.tag == "model"}
        waiting = [(root, 1)]
        while waiting:
            element, copies = waiting.pop()
            if element.tag == "replicate":
                copies *= max(1, int(element.number("count", "replicate", "count")))
            elif element.tag in ("body", "attach"):
                total += copies * _bodies(element, named, models)
            if total > MOST_BODIES or copies > MOST_BODIES:
                raise element.error(f"more than {MOST_BODIES} bodies with all that is repeated", "replicate")
            waiting.extend((child, copies) for child in element.children)


def _bodies(element: Element, named: dict[str | None, Element], models: dict[str, Element]) -> int:
    """Return how many bodies an element stands for: those of the model that it attaches, else itself."""
    model = named.get(element.attributes.get("model"))
    root = None if model is None else models.get(Path(model.attributes.get("file", "")).name)
    return 1 if element.tag == "body" or root is None else sum(part.tag == "body" for part in root.walk())


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
    found = re.search(r"[Ll]ine (?:number=)?(\d+)", text)
    return None if found is None else int(found[1])


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
        kept = spec.texturedir if tag == "texture" else spec.meshdir
        name = str(Path(kept) / (Path(file).name if spec.strippath else file))
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
