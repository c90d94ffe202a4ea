"""The keys of each type in a mechanism file, derived from the fields of its class.

Fields that differ only in their body, such as ``point_i`` and ``point_j``, form one key with a list, ``points``; a
single ``vector_i`` is the key ``vector``; every other field keeps its name. So files can contain a user's own joint as
soon as its class exists.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import MISSING, dataclass
from typing import Any

from jounce.base.modules import belongs_to_package
from jounce.constraints import catalogue
from jounce.constraints.facts import facts_of, field_kind, value_fields
from jounce.io.files.located_data import Location

_PLURALS = {"point": "points", "vector": "vectors", "axis": "axes", "normal": "normals", "radius": "radii"}


@dataclass(frozen=True)
class FileKey:
    """One key of a joint, driver or output.

    Attributes
    ----------
    key : str
        Name in a file.
    fields : tuple of str
        Fields of the class that it fills; several fields for a list with an entry for each body.
    kind : str
        ``scalar``, ``vector``, ``motion``, ``law``, ``laws``, ``wrenches``, ``whole``, ``flag``, ``points``, ``curve``,
        ``text``, ``parts`` or ``nested``.
    quantity : str
        Kind of quantity that the class states: one of ``units.KINDS``; or ``direction`` (any unit, the same for all
        components), or ``of coordinate`` and ``per angle``, which follow from the key ``coordinate`` of the same entry.
    required : bool
        Whether the key must be given.
    """

    key: str
    fields: tuple[str, ...]
    kind: str
    quantity: str
    required: bool
    names: tuple[str, ...] = ()
    """Keys within this one, for each field, if it holds a mapping; then `kind` is ``parts``."""


def file_keys(kind: type[Any]) -> tuple[FileKey, ...]:
    """Return the keys of a class of joints, drivers or outputs, except ``type``, ``quantity`` and ``bodies``.

    Text keys come first, since the units of other keys may follow from them.

    Examples
    --------
    >>> from jounce.constraints import catalogue
    >>> [key.key for key in file_keys(catalogue("planar", "joint")["double_revolute"])]
    ['points', 'length']
    """
    fields = value_fields(kind)
    groups: dict[str, list[str]] = {}
    parts = getattr(kind, "parts", {})
    nested = {field for members in parts.values() for field in members.values()}
    for name in (name for name in fields if name not in nested):
        stem, _, body = name.rpartition("_")
        groups.setdefault(stem if stem in _PLURALS and body in ("i", "j", "m") else name, []).append(name)
    keys = []
    for stem, names in groups.items():
        first = fields[names[0]]
        key = stem if len(names) == 1 else _PLURALS[stem]
        required = first.default is MISSING and first.default_factory is MISSING
        keys.append(FileKey(key, tuple(names), field_kind(first), facts_of(kind).dimensions[names[0]], required))
    keys += [
        FileKey(key, tuple(members.values()), "parts", "any", True, tuple(members)) for key, members in parts.items()
    ]
    return tuple(sorted(keys, key=lambda k: k.kind != "text"))


def cam_types(space: str) -> dict[str, type[Any]]:
    """Return the drivers of this package whose coordinates cams may have, by type.

    Examples
    --------
    >>> sorted(cam_types("planar"))
    ['coordinate', 'distance', 'slide']
    """
    return {
        name: kind
        for name, kind in catalogue(space, "driver").items()
        if belongs_to_package(kind) and hasattr(kind, "evaluate")
    }


def is_cam(space: str, entry: dict[str, Any]) -> bool:
    """Return whether an entry of the joints of a file is a cam: a driver whose law depends on another coordinate."""
    kind = entry.get("type")
    if "motion" not in entry or not isinstance(kind, str) or kind not in cam_types(space):
        return False
    classes = catalogue(space, "joint").get(kind)
    return classes is None or all(key.key != "motion" for key in file_keys(classes))


def location_of(keys: Iterable[FileKey], field: str) -> Location:
    """Return the location in a file of the value of a field, relative to its joint, driver or output."""
    for key in keys:
        if field in key.fields:
            index = key.fields.index(field)
            return (key.key,) if len(key.fields) == 1 else (key.key, key.names[index] if key.names else index)
    first, _, remainder = field.partition(".")
    return (first, remainder) if remainder else (field,)
