"""A check of the keys and types of mechanism files by the published schema, before JAX is imported."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import Any

from jounce.errors import JounceError, did_you_mean, show_value
from jounce.io.files.located_data import Location, Source
from jounce.io.files.source import read_source

ROLES = {"joints": "joint", "drivers": "driver", "forces": "force", "initial": "driver"}
"""Sections of a file whose entries have a ``type``, and the role of each."""

LARGEST = 200_000  # largest size of a file that is read twice, bytes
_HINTS = {
    ("planar", "orientation"): "a planar body has an angle",
    ("spatial", "angle"): "a spatial body has an orientation",
}

_OTHER_WORDS = {
    "fixed": ("weld", "welded", "rigid", "clamp"),
    "revolute": ("hinge", "pin", "pivot", "rotational", "turning"),
    "prismatic": ("slider", "sliding", "linear", "translational"),
    "spherical": ("ball", "ball_joint", "ball_and_socket"),
    "double_revolute": ("rod", "link", "bar"),
    "double_spherical": ("rod", "link", "bar"),
    "universal": ("cardan", "hooke"),
    "screw": ("helical",),
    "parallel2": ("pin_in_slot", "slot"),
}
"""Other common names of joint types."""


def check_keys(path: str | PathLike[str]) -> None:
    """Raise the error that `load` would raise if a file violates the syntax, or has an unknown key or type.

    Files that pass may still be wrong. Only the types of this package are known: do not call this function if a user's
    own joints or forces are imported.

    Parameters
    ----------
    path
        File ending in .yaml, .toml or .json; a file without a mechanism passes.

    Raises
    ------
    MechanismFileError
        With the line, the entry and the nearest valid name.
    """
    file, schema = Path(path), _schema()
    if not schema or not file.is_file() or file.stat().st_size > LARGEST:
        return
    if file.read_bytes().lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):  # a robot, whatever the ending
        return
    source = read_source(file, many=True)
    space = source.data.get("space") if isinstance(source.data, dict) else None
    if space not in ("planar", "spatial"):
        return
    problems = [problem for problem in _problems(source, str(space), schema) if problem is not None]
    if problems:
        raise min(problems, key=lambda problem: problem.line or 0)


def unknown_key(source: Source, space: str, location: Location, valid: Iterable[str]) -> JounceError:
    """Return the error for an unknown key of an entry, with the valid ones."""
    hint = _HINTS.get((space, str(location[-1]))) if location[0] == "bodies" else None
    if str(location[-1])[:1].isdigit():
        hint = "a comma ends a value here; for a decimal comma write a point, such as 4.5 mm"
    return source.error(
        f"unknown key {show_value(location[-1])}; {hint or did_you_mean(location[-1], valid)}", location
    )


def unknown_type(
    source: Source, space: str, location: Location, entry: dict[str, Any], types: Callable[[str, str], Iterable[str]]
) -> JounceError:
    """Return the error for a joint, driver or force without a valid type; `types` returns the valid ones."""
    role = ROLES[str(location[0])]
    valid = types(space, role)
    glued = next((key for key in entry if str(key).startswith("type:")), None)
    if "type" not in entry and glued is not None:
        return source.error(
            f"a colon must be followed by a space: write {str(glued).replace(':', ': ', 1)}", (*location, glued)
        )
    if "type" not in entry:
        return source.error(f"is missing; valid: {', '.join(sorted(valid))}", (*location, "type"))
    name = entry["type"]
    other_spaces = [
        f"a {other_space} {other_role}"
        for other_space in ("planar", "spatial")
        for other_role in ("joint", "driver", "force")
        if isinstance(name, str) and name in types(other_space, other_role)
    ]
    note = f"it is the type of {' and '.join(other_spaces)}; " if other_spaces else ""
    synonyms = [word for word in valid if str(name).lower() in _OTHER_WORDS.get(word, ()) and not other_spaces]
    hint = f"it is called '{synonyms[0]}' here" if synonyms else note + did_you_mean(name, valid)
    message = f"no {space} {role} has this type; {hint}"
    return source.error(message, (*location, "type"), value=name)


@functools.cache
def _schema() -> dict[str, Any]:
    """Return the definitions of the published schema; empty if the package was copied without it."""
    name = "mechanism.schema.json"
    for path in (Path(__file__).with_name(name), Path(__file__).parents[5] / "docs" / "schema" / name):
        if path.is_file():
            return json.loads(path.read_text(encoding="utf-8"))["$defs"]
    return {}


def _problems(source: Source, space: str, schema: dict[str, Any]) -> Iterator[JounceError | None]:
    """Yield an error for each unknown key or type, or None for an entry that cannot be judged."""
    data = source.data
    yield from _unknown(source, space, (), data, schema[f"{space}_mechanism"])
    entries = {section: data[section] for section in (*ROLES, "bodies") if isinstance(data.get(section), dict)}
    for section, names in entries.items():
        for name, entry in names.items():
            if not isinstance(entry, dict):
                continue
            if section == "bodies":
                yield from _unknown(source, space, (section, name), entry, schema[f"{space}_body"])
                continue
            kind = entry.get("type")
            if not isinstance(kind, str) or kind not in _types(space, ROLES[section]):
                cam = section == "joints" and "motion" in entry and f"{space}_{kind}_cam" in schema
                yield None if cam else unknown_type(source, space, (section, name), entry, _types)
                continue
            if section == "joints" and "motion" in entry:  # a cam may share its name with a joint
                continue
            yield from _unknown(source, space, (section, name), entry, schema[f"{space}_{kind}_{ROLES[section]}"])


def _types(space: str, role: str) -> list[str]:
    """Return the types of this package for a role."""
    start, end = f"{space}_", f"_{role}"
    types = [name[len(start) : -len(end)] for name in _schema() if name.startswith(start) and name.endswith(end)]
    return [name for name in types if not name.endswith("_of_a")]  # names of outputs


def _unknown(
    source: Source, space: str, location: Location, entry: dict[str, Any], model: dict[str, Any]
) -> Iterator[JounceError]:
    """Yield an error for each key of an entry that is not in its model."""
    valid = model["properties"]
    for key in entry:
        if key not in valid:
            yield unknown_key(source, space, (*location, key), valid)
