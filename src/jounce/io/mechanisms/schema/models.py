"""The schema of mechanism files, as pydantic models built from the classes of joints, drivers and outputs.

It checks names, shapes and units, and converts every value to a number in SI units or an expression. The module is
imported when a file is loaded, because the import of pydantic is slow.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Annotated, Any, Literal, Union

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, create_model

from jounce.base.modules import belongs_to_package
from jounce.constraints import catalogue
from jounce.constraints.base import counted
from jounce.constraints.facts import facts_of
from jounce.constraints.friction import friction_class
from jounce.errors import JounceError, MechanismFileError, no_such
from jounce.io.mechanisms.schema.keys import FileKey, cam_types, file_keys, is_cam
from jounce.io.mechanisms.schema.output_types import HOLDERS, output_holder, output_tag, output_types
from jounce.io.mechanisms.values.curve_values import curve
from jounce.io.mechanisms.values.expressions import (
    Checked,
    nested,
    orientation,
    parts,
    points,
    problem,
    redundant_reactions,
    scalar,
    scalars,
    vector,
    vectors,
    wrenches,
)
from jounce.io.mechanisms.values.inertia_forms import inertia
from jounce.io.mechanisms.values.motion_values import cam_motion, laws, motion
from jounce.mechanism.mechanism import NEAREST, SIDES, check_body_name, check_output_name
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.units.dimensions import variables_of
from jounce.units.expression import PARAMETER_NAME, check_parameter_name

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,99}")
_Types = tuple[tuple[str, type[Any]], ...]


def _text(raw: object, _info: Any) -> str:
    if not isinstance(raw, str):
        raise problem("must be text")
    return raw


def _flag(raw: object, _info: Any) -> bool:
    if not isinstance(raw, bool):
        raise problem("must be true or false")
    return raw


def _whole(raw: object, _info: Any) -> int:
    if isinstance(raw, bool) or not isinstance(raw, int | float) or raw != raw // 1 or raw < 0:
        raise problem("must be a whole number, 0 or greater")
    return int(raw)


def _all(raw: object, _info: Any) -> bool:
    if raw not in (None, True, "all"):
        raise problem("an energy of the mechanism is that of all its bodies: write true; for one body, body: NAME")
    return True


def _units(raw: object, _info: Any) -> dict[str, str]:
    if not isinstance(raw, dict) or not all(isinstance(unit, str) for unit in raw.values()):
        raise problem("must be units by kind of quantity or name of an output, such as {angle: deg, length: mm}")
    return raw


UNITS = {
    "description": "units in which results are shown and written: of angle, length, force, torque, energy, power, "
    "or of an output by its name",
    "type": "object",
    "additionalProperties": {"type": "string", "minLength": 1},
}
ASSEMBLY = {
    "oneOf": [
        {"type": "integer", "minimum": 1},
        {"const": NEAREST},
        {"type": "object", "additionalProperties": {"enum": list(SIDES)}, "minProperties": 1},
    ]
}


def _assembly(raw: object, info: Any) -> Any:
    if isinstance(raw, dict) and raw:
        for body, side in raw.items():
            _check_body(body, info, body)
            if side not in SIDES:
                raise problem(f"must be one of {', '.join(SIDES)}", body, value=side)
        return dict(raw)
    if raw == NEAREST or (isinstance(raw, int) and not isinstance(raw, bool) and raw > 0):
        return raw
    raise problem(f"must be a number from 1, {NEAREST}, or for bodies one of {', '.join(SIDES)}")


def _names(counts: Sequence[int]) -> Any:
    """Return the annotation of a list of body names; `counts` are the permitted lengths."""

    def check(raw: object, info: Any) -> tuple[str, ...]:
        if not isinstance(raw, (list, tuple)) or len(raw) not in counts:
            raise problem(f"must be a list of {counted(counts)} names of bodies")
        for index, name in enumerate(raw):
            _check_body(name, info, index)
        return tuple(raw)

    schema = {"type": "array", "items": {"type": "string"}, "minItems": min(counts), "maxItems": max(counts)}
    return Annotated[Any, Checked(check, schema)]


def _check_body(name: Any, info: Any, *location: int) -> str:
    if not isinstance(name, str):
        raise problem("must be the name of a body", *location, value=name)
    bodies = (info.context or {}).get("bodies", ())
    if name not in bodies:
        raise problem(no_such("body", name, bodies), *location, value=name)
    return name


def _check_file_name(name: object, error: type[JounceError]) -> None:
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise error("a name is up to 100 letters, digits, _ and -")


def _named(item: Any, *checks: Callable[[Any, type[JounceError]], None], pattern: re.Pattern[str] | None = None) -> Any:
    """Return the annotation of a mapping of names to items; the default pattern is that of names in files."""
    all_checks = checks if pattern else (_check_file_name, *checks)

    def name_of(raw: object, _info: Any) -> Any:
        try:
            for check in all_checks:
                check(raw, MechanismFileError)
        except JounceError as error:
            raise problem(error.message) from None
        return raw

    key = Annotated[str, Checked(name_of, {"type": "string", "pattern": f"^{(pattern or _NAME).pattern}$"})]
    return dict[key, item]


def _model(name: str, doc: str | None, fields: dict[str, tuple[Any, Any]]) -> type[BaseModel]:
    """Return a model that forbids other keys; its fields have aliases, so that any key is permitted."""
    summary = (doc or "").strip().split("\n\n")[0]
    aliased = {
        key if key in ("space", "type", "coordinate") else f"key_{key}": (kind, Field(default, alias=key))
        for key, (kind, default) in fields.items()
    }
    config = ConfigDict(extra="forbid", protected_namespaces=(), title=name)
    return create_model(name, __config__=config, __doc__=" ".join(summary.split()), **aliased)  # type: ignore[call-overload]


_PLAIN = {
    "flag": Annotated[Any, Checked(_flag, {"type": "boolean"})],
    "whole": Annotated[Any, Checked(_whole, {"type": "integer", "minimum": 0})],
    "wrenches": wrenches(),
}


def _annotation(kind: type[Any], key: FileKey, size: int) -> Any:
    match key.kind:
        case "law":
            return motion(key.quantity, variables_of(kind))
        case "laws":
            return laws(size, key.quantity, variables_of(kind))
        case "motion":
            return motion(key.quantity, free=_has_free_laws(kind))
        case "scalar" if len(key.fields) == 1:
            return scalar(key.quantity)
        case "scalar":
            return scalars(len(key.fields), key.quantity)
        case "vector" if len(key.fields) == 1:
            return vector(size, key.quantity)
        case "vector":
            return vectors(len(key.fields), size, key.quantity)
        case "curve":
            return curve(kind.hidden, size)
        case "parts":
            kinds = {name: facts_of(kind).dimensions[field] for name, field in zip(key.names, key.fields, strict=True)}
            return parts(kinds, size)
        case "points":
            return points(size, key.quantity)
        case "flag" | "whole" | "wrenches" | "nested":
            return nested(friction_class(kind)) if key.kind == "nested" else _PLAIN[key.kind]
    choices = facts_of(kind).choices.get(key.fields[0])
    schema = {"enum": list(choices)} if choices else {"type": "string"}
    return Annotated[Any, Checked(_text, schema)]


def _has_free_laws(kind: type[Any]) -> bool:
    """Return whether laws of a class may be functions of anything: those of a user's joint that is no driver."""
    return kind.role == "joint" and not belongs_to_package(kind)


def _values(kind: type[Any], size: int) -> dict[str, tuple[Any, Any]]:
    """Return the keys of a class except its bodies, as fields of a model."""
    return {key.key: (_annotation(kind, key, size), ... if key.required else None) for key in file_keys(kind)}


def _bodies(kind: type[Any]) -> dict[str, tuple[Any, Any]]:
    """Return the key of the bodies of a class, as a field of a model: ``body`` for a single one."""
    if kind.body_count > 1:
        return {"bodies": (_names(getattr(kind, "body_counts", ()) or (kind.body_count,)), ...)}
    return {"body": (Annotated[Any, Checked(_check_body, {"type": "string"})], ...)}


def _constraint_union(space: str, role: str, types: _Types) -> Any:
    """Return the union of all joints, drivers or forces of a space, distinguished by ``type``."""
    models: list[Any] = []
    for name, kind in types:
        fields = {"type": (Literal[name], ...)} | _bodies(kind)
        title = f"{space}_{name}_{role}"
        models.append(_model(title, kind.__doc__, fields | _values(kind, POSITION_COMPONENTS[space])))
    if role != "joint":
        return Annotated[Union[tuple(models)], Discriminator("type")]  # noqa: UP007
    models = [Annotated[model, Tag(name)] for model, (name, _) in zip(models, types, strict=True)]
    for name, kind in cam_types(space).items():
        fields = {"type": (Literal[name], ...)} | _bodies(kind) | _values(kind, POSITION_COMPONENTS[space])
        (law,) = (key for key in file_keys(kind) if key.kind == "motion")
        fields[law.key] = (cam_motion(law.quantity), ...)
        description = f"A cam, by its law of another coordinate. {kind.__doc__}"
        models.append(Annotated[_model(f"{space}_{name}_cam", description, fields), Tag(f"{name} cam")])

    def form(raw: object) -> Any:
        if not isinstance(raw, dict):
            return None
        return f"{raw.get('type')} cam" if is_cam(space, raw) else raw.get("type")

    return Annotated[Union[tuple(models)], Discriminator(form)]  # noqa: UP007


def output_form(raw: object) -> Any:
    """Return the tag of the form of an output in a file; None if the output is not a mapping."""
    if not isinstance(raw, dict):
        return None
    return output_tag(raw.get("quantity"), next((key for key in HOLDERS if key in raw), "body"))


def _output_union(space: str) -> Any:
    """Return the union of all outputs of a space."""
    models = []
    for tag, (quantity, kind) in output_types(space).items():
        fields: dict[str, tuple[Any, Any]] = _bodies(kind) if kind.body_count else {}
        if output_holder(kind) == "mechanism":
            fields["mechanism"] = (Annotated[Any, Checked(_all, {"enum": [True, "all", None]})], ...)
        if quantity is not None:
            fields["quantity"] = (Literal[quantity], ...)
        fields |= _values(kind, POSITION_COMPONENTS[space])
        models.append(Annotated[_model(f"{space}_{tag.replace(' ', '_')}", kind.__doc__, fields), Tag(tag)])
    return Annotated[Union[tuple(models)], Discriminator(output_form)]  # noqa: UP007


def _body_model(space: str) -> type[BaseModel]:
    size = POSITION_COMPONENTS[space]
    attitude = {"angle": (scalar("angle"), 0.0)} if space == "planar" else {"orientation": (orientation(), None)}
    fields: dict[str, tuple[Any, Any]] = {
        "position": (vector(size, "length"), (0.0,) * size),
        **attitude,
        "mass": (scalar("mass"), None),
        "inertia": (inertia(space), None),
        "center_of_mass": (vector(size, "length"), None),
    }
    return _model(f"{space}_body", "A moving body; its pose is the starting guess for assembly.", fields)


@lru_cache(maxsize=8)
def _file_model(space: str, joints: _Types, drivers: _Types, forces: _Types) -> type[BaseModel]:
    time = {"start": (scalar("time"), 0.0), "stop": (scalar("time"), ...)}
    time |= {"step": (scalar("time"), None), "count": (scalar("ratio"), None)}
    fields = {
        "space": (Literal[space], ...),
        "bodies": (_named(_body_model(space), check_body_name), ...),
        "title": (Annotated[Any, Checked(_text, {"type": "string"})], ""),
        "units": (Annotated[Any, Checked(_units, UNITS)], {}),
        "assembly": (Annotated[Any, Checked(_assembly, ASSEMBLY)], None),
        "gravity": (vector(POSITION_COMPONENTS[space], "acceleration"), None),
        "parameters": (_named(scalar("any"), check_parameter_name, pattern=PARAMETER_NAME), {}),
        "joints": (_named(_constraint_union(space, "joint", joints)), {}),
        "drivers": (_named(_constraint_union(space, "driver", drivers)), {}),
        "forces": (_named(_constraint_union(space, "force", forces)), {}),
        "initial": (_named(_constraint_union(space, "driver", drivers)), {}),
        "outputs": (_named(_output_union(space), check_output_name), {}),
        "redundant_reactions": (redundant_reactions(), "unique"),
        "time": (_model(f"{space}_time", "Instants from start to stop, by step or by count.", time), None),
    }
    return _model(f"{space}_mechanism", f"A {space} mechanism.", fields)


def file_model(space: str, *, own_types: bool = True) -> type[BaseModel]:
    """Return the model of a file of a space, with every joint, driver and force that is registered now.

    Without `own_types`, only those of this package are included.
    """
    types = []
    for role in ("joint", "driver", "force"):
        models = catalogue(space, role).items()
        types.append(tuple((n, kind) for n, kind in models if own_types or kind.__module__.startswith("jounce.")))
    return _file_model(space, *types)
