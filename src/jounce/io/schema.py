"""The schema of mechanism files, as pydantic models built from the classes of joints, drivers and outputs.

It checks names, shapes and units, and turns every value into a number in SI units or an expression. Imported only when a
file is loaded, since pydantic takes a while.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Any, Literal, Union

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, create_model
from pydantic_core import PydanticCustomError, core_schema

from jounce.constraints import catalogue
from jounce.constraints.planar import COORDINATES
from jounce.errors import ExpressionError, JounceError, did_you_mean
from jounce.io.fields import FileKey, file_keys, output_tag, output_types
from jounce.io.units import KINDS, Value, parse_value
from jounce.mechanism.outputs import FRAMES
from jounce.trajectory.expression import CONSTANTS, FUNCTIONS

__all__ = ["Samples", "file_model"]

COMPONENTS = {"planar": 2, "spatial": 3}
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,99}")
_CHOICES = {"coordinate": COORDINATES, "frame": FRAMES}
_Types = tuple[tuple[str, type[Any]], ...]
_PARAMETER = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")


def problem(message: str, *at: str | int, value: object = ...) -> PydanticCustomError:
    """Return an error for pydantic to collect; ``at`` leads on from the entry being validated."""
    return PydanticCustomError("jounce", "{message}", {"message": message, "at": at, "value": value})


def _below(error: PydanticCustomError, *at: str | int) -> PydanticCustomError:
    """Return the same error one or more steps further down."""
    context = error.context or {}
    return problem(context["message"], *at, *context["at"], value=context["value"])


class _Checked:
    """An annotation: validated by a function of the value and pydantic's context, with a JSON schema of its own."""

    def __init__(self, function: Callable[[Any, Any], Any], schema: dict[str, Any]) -> None:
        self.function = function
        self.schema = schema

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(self.function)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return self.schema


def _parse(raw: Any, quantity: str, info: Any, extra_names: tuple[str, ...] = ()) -> Value:
    if quantity in ("of coordinate", "per angle"):
        turning = info.data.get("coordinate") == "angle"
        by_coordinate = {"of coordinate": ("length", "angle"), "per angle": ("length per angle", "ratio")}
        quantity = by_coordinate[quantity][turning]
    context = info.context or {}
    try:
        names = (*context.get("names", ()), *extra_names)
        return parse_value(raw, quantity, names, context.get("dimensions"))
    except JounceError as error:
        quoted = isinstance(error, ExpressionError) and error.column is not None  # the text is in the message
        raise problem(error.message, value=None if quoted else raw) from None


def _words(quantity: str) -> str:
    if quantity in KINDS:
        return KINDS[quantity][0]
    return {"of coordinate": "a length or an angle", "per angle": "a pure number or a length"}.get(quantity, "a value")


def _scalar_schema(quantity: str, described: str = "") -> dict[str, Any]:
    text = f"{_words(quantity)}: a number (SI), a number with a unit, or an expression of parameters{described}"
    return {"description": text, "anyOf": [{"type": "number"}, {"type": "string", "minLength": 1}]}


def scalar(quantity: str) -> Any:
    """Return the annotation of one value of a kind of ``units.KINDS``."""
    return Annotated[
        Any, _Checked(lambda raw, info: _parse(raw, quantity, info).value, _scalar_schema(quantity))
    ]


def _vector_value(raw: Any, size: int, quantity: str, info: Any, *at: str | int) -> tuple[Any, ...]:
    if not isinstance(raw, (list, tuple)) or len(raw) != size:
        raise problem(f"must be a list of {size} values", *at, value=raw)
    parsed = []
    for index, item in enumerate(raw):
        try:
            parsed.append(_parse(item, "any" if quantity == "direction" else quantity, info))
        except PydanticCustomError as error:
            raise _below(error, *at, index) from None
    if quantity == "direction":
        used = {item.dimension for item in parsed if item.value != 0 and isinstance(item.value, float)}
        if len(used) > 1:
            raise problem("the components of a direction must all have the same unit, or none", *at, value=raw)
    return tuple(item.value for item in parsed)


def _vector_schema(size: int, quantity: str) -> dict[str, Any]:
    words = "a direction, of any length but zero" if quantity == "direction" else _words(quantity)
    items = {"anyOf": [{"type": "number"}, {"type": "string", "minLength": 1}]}
    return {"type": "array", "description": words, "items": items, "minItems": size, "maxItems": size}


def vector(size: int, quantity: str) -> Any:
    """Return the annotation of a list of values of one kind."""
    return Annotated[
        Any, _Checked(lambda raw, info: _vector_value(raw, size, quantity, info), _vector_schema(size, quantity))
    ]


def _vectors(count: int, size: int, quantity: str) -> Any:
    """Return the annotation of a list of vectors, one on each body."""

    def check(raw: Any, info: Any) -> tuple[Any, ...]:
        if not isinstance(raw, (list, tuple)) or len(raw) != count:
            raise problem(f"must be a list of {count} vectors, one on each body")
        return tuple(_vector_value(item, size, quantity, info, index) for index, item in enumerate(raw))

    schema = {"type": "array", "items": _vector_schema(size, quantity), "minItems": count, "maxItems": count}
    return Annotated[Any, _Checked(check, schema)]


class Samples(BaseModel):
    """A motion law through samples: a CSV file, the degree of the spline, and the columns of time and value."""

    model_config = ConfigDict(extra="forbid", strict=True)
    samples: str
    degree: int = Field(default=5, ge=1, le=11)
    time: str | None = None
    value: str | None = None


def _motion(quantity: str) -> Any:
    """Return the annotation of a motion law."""

    def check(raw: Any, info: Any) -> Any:
        if not isinstance(raw, dict):
            return _parse(raw, quantity, info, ("t",)).value
        if raw.keys() == {"expression"}:
            try:
                return _parse(raw["expression"], quantity, info, ("t",)).value
            except PydanticCustomError as error:
                raise _below(error, "expression") from None
        valid = ["expression"] if "expression" in raw else list(Samples.model_fields)
        for key in raw.keys() - set(valid):
            raise problem(f"unknown key '{key}'; {did_you_mean(key, valid)}", key, value=None)
        if "samples" not in raw:
            raise problem("must be an expression, or samples: the name of a CSV file")
        for key, kind in (("samples", str), ("degree", int), ("time", str), ("value", str)):
            if key in raw and (not isinstance(raw[key], kind) or isinstance(raw[key], bool)):
                raise problem("must be a whole number" if kind is int else "must be a name", key, value=raw[key])
        if not 1 <= raw.get("degree", 5) <= 11:
            raise problem("the degree of a spline is from 1 to 11", "degree", value=raw["degree"])
        return Samples(**raw)

    described = " and of t, the time in s"
    law = _scalar_schema(quantity, described)
    formula = {"type": "object", "properties": {"expression": law}, "required": ["expression"]}
    spline = Samples.model_json_schema()
    for entry in (spline["properties"]["time"], spline["properties"]["value"]):
        entry.pop("anyOf")
        entry |= {"type": "string", "description": "name of a column; by default time, and the only other one"}
        entry.pop("default")
    schema = {
        "description": law["description"],
        "anyOf": [*law["anyOf"], formula | {"additionalProperties": False}, spline],
    }
    return Annotated[Any, _Checked(check, schema)]


def _orientation(raw: Any, info: Any) -> dict[str, Any]:
    """Read one of the three forms of an orientation; the values stay numbers or expressions."""
    forms: dict[str, tuple[str, ...]] = {
        "quaternion": ("quaternion",),
        "euler": ("euler", "angles"),
        "axis": ("axis", "angle"),
    }
    if not isinstance(raw, dict):
        raise problem("must be {quaternion: [e0, e1, e2, e3]}, {axis, angle} or {euler: zxz, angles}")
    form = next((form for form in forms if form in raw), None)
    valid = forms[form] if form else [key for keys in forms.values() for key in keys]
    for key in raw:
        if key not in valid:
            raise problem(f"unknown key '{key}'; {did_you_mean(key, valid)}", key, value=None)
    for key in valid if form else ("quaternion",):
        if key not in raw:
            raise problem("is missing", key, value=None)
    if form == "quaternion":
        return {"quaternion": _vector_value(raw["quaternion"], 4, "ratio", info, "quaternion")}
    if form == "euler":
        if not isinstance(raw["euler"], str):
            raise problem("must be three letters, such as zxz", "euler", value=raw["euler"])
        return {"euler": raw["euler"], "angles": _vector_value(raw["angles"], 3, "angle", info, "angles")}
    try:
        angle = _parse(raw["angle"], "angle", info).value
    except PydanticCustomError as error:
        raise _below(error, "angle") from None
    return {"axis": _vector_value(raw["axis"], 3, "direction", info, "axis"), "angle": angle}


def _orientation_schema() -> dict[str, Any]:
    forms = [
        {"quaternion": _vector_schema(4, "ratio")},
        {"axis": _vector_schema(3, "direction"), "angle": _scalar_schema("angle")},
        {
            "euler": {"type": "string", "pattern": "^([xyz]{3}|[XYZ]{3})$"},
            "angles": _vector_schema(3, "angle"),
        },
    ]
    closed = {"type": "object", "additionalProperties": False}
    text = "lower-case Euler letters turn about fixed axes, upper-case ones about the moving axes of the body"
    return {"description": text, "oneOf": [closed | {"properties": f, "required": list(f)} for f in forms]}


def _inertia(raw: Any, info: Any) -> Any:
    """Read a spatial inertia: three principal moments, or the full symmetric matrix."""
    if isinstance(raw, (list, tuple)) and len(raw) == 3 and all(isinstance(row, (list, tuple)) for row in raw):
        return tuple(_vector_value(row, 3, "inertia", info, index) for index, row in enumerate(raw))
    if not isinstance(raw, (list, tuple)) or len(raw) != 3:
        raise problem("must be a list of 3 principal moments, or 3 rows of 3")
    return _vector_value(raw, 3, "inertia", info)


def _text(raw: Any, info: Any) -> str:
    if not isinstance(raw, str):
        raise problem("must be text")
    return raw


def _names(count: int) -> Any:
    """Return the annotation of a list of names of bodies."""

    def check(raw: Any, info: Any) -> tuple[str, ...]:
        if not isinstance(raw, (list, tuple)) or len(raw) != count:
            raise problem(f"must be a list of {count} names of bodies")
        for index, name in enumerate(raw):
            _check_body(name, info, index)
        if len(set(raw)) != len(raw):
            raise problem("the bodies must differ, a body cannot be joined with itself")
        return tuple(raw)

    schema = {"type": "array", "items": {"type": "string"}, "minItems": count, "maxItems": count}
    return Annotated[Any, _Checked(check, schema)]


def _check_body(name: Any, info: Any, *at: int) -> str:
    if not isinstance(name, str):
        raise problem("must be the name of a body", *at, value=name)
    known = (info.context or {}).get("bodies", ())
    if name not in known:
        raise problem(f"no body has this name; {did_you_mean(name, known)}", *at, value=name)
    return name


def _named(item: Any, pattern: re.Pattern[str], check: Callable[[str], str | None] = lambda name: None) -> Any:
    """Return the annotation of a mapping of names to items."""

    def name_of(raw: Any, info: Any) -> str:
        if not isinstance(raw, str) or not pattern.fullmatch(raw):
            start = "" if pattern is _NAME else ", not starting with a digit"
            dash = " and -" if pattern is _NAME else ""
            raise problem(f"a name is up to 100 letters, digits, _{dash}{start}")
        if message := check(raw):
            raise problem(message)
        return raw

    key = Annotated[str, _Checked(name_of, {"type": "string", "pattern": f"^{pattern.pattern}$"})]
    return dict[key, item]


def _body_name(name: str) -> str | None:
    return "the body 'ground' always exists, give this one another name" if name == "ground" else None


def _parameter_name(name: str) -> str | None:
    import keyword

    if name in CONSTANTS or name in FUNCTIONS or name == "t":
        return f"the name '{name}' is reserved for expressions"
    return f"the word '{name}' cannot be a name in expressions" if keyword.iskeyword(name) else None


def _output_name(name: str) -> str | None:
    if name in ("time", "derivative", "component") or re.search(r"_d[0-9]+$", name):
        return f"the name '{name}' is reserved for columns of the results"
    return None


def _model(name: str, doc: str | None, fields: dict[str, tuple[Any, Any]]) -> type[BaseModel]:
    """Create a closed model; fields of awkward names are fine, since they are known by alias only."""
    summary = (doc or "").strip().split("\n\n")[0]
    aliased = {
        key if key in ("space", "type", "coordinate") else f"key_{key}": (kind, Field(default, alias=key))
        for key, (kind, default) in fields.items()
    }
    config = ConfigDict(extra="forbid", protected_namespaces=(), title=name)
    return create_model(name, __config__=config, __doc__=" ".join(summary.split()), **aliased)  # type: ignore[call-overload]


def _annotation(key: FileKey, size: int, choices: dict[str, tuple[str, ...]]) -> Any:
    if key.kind == "motion":
        return _motion(key.quantity)
    if key.kind == "scalar":
        return scalar(key.quantity)
    if key.kind == "vector":
        return vector(size, key.quantity) if len(key.fields) == 1 else _vectors(len(key.fields), size, key.quantity)
    words = {"enum": list(choices[key.key])} if key.key in choices else {"type": "string"}
    return Annotated[Any, _Checked(_text, words)]


def _values(kind: type[Any], size: int) -> dict[str, tuple[Any, Any]]:
    """Return the keys of a class besides its bodies, as fields of a model."""
    choices = _CHOICES if kind.__module__.startswith("jounce.") else {}
    return {
        key.key: (_annotation(key, size, choices), ... if key.required else None) for key in file_keys(kind)
    }


def _constraint_union(space: str, role: str, types: _Types) -> Any:
    """Return the union of all joints or drivers of a space, told apart by ``type``."""
    models = []
    for name, kind in types:
        fields = {"type": (Literal[name], ...), "bodies": (_names(kind.body_count), ...)}
        title = f"{space}_{name}_{role}"
        models.append(_model(title, kind.__doc__, fields | _values(kind, COMPONENTS[space])))
    return Annotated[Union[tuple(models)], Discriminator("type")]  # noqa: UP007


def output_form(raw: Any) -> Any:
    if not isinstance(raw, dict):
        return None
    return output_tag(raw.get("quantity"), 2 if "bodies" in raw else 1)


def _output_union(space: str) -> Any:
    """Return the union of all outputs of a space."""
    models = []
    body = Annotated[Any, _Checked(_check_body, {"type": "string"})]
    for tag, (quantity, kind) in output_types(space).items():
        fields: dict[str, tuple[Any, Any]] = {"body": (body, ...)}
        if kind.body_count > 1:
            fields = {"bodies": (_names(kind.body_count), ...)}
        if quantity is not None:
            fields["quantity"] = (Literal[quantity], ...)
        fields |= _values(kind, COMPONENTS[space])
        models.append(Annotated[_model(f"{space}_{tag.replace(' ', '_')}", kind.__doc__, fields), Tag(tag)])
    return Annotated[Union[tuple(models)], Discriminator(output_form)]  # noqa: UP007


def _body_model(space: str) -> type[BaseModel]:
    size = COMPONENTS[space]
    fields: dict[str, tuple[Any, Any]] = {"position": (vector(size, "length"), (0.0,) * size)}
    if space == "planar":
        fields |= {"angle": (scalar("angle"), 0.0), "inertia": (scalar("inertia"), None)}
    else:
        matrix = {"type": "array", "items": {}, "minItems": 3, "maxItems": 3}
        matrix["description"] = "a list of 3 principal moments, or 3 rows of 3"
        fields["orientation"] = (Annotated[Any, _Checked(_orientation, _orientation_schema())], None)
        fields["inertia"] = (Annotated[Any, _Checked(_inertia, matrix)], None)
    fields |= {"mass": (scalar("mass"), None), "center_of_mass": (vector(size, "length"), None)}
    return _model(f"{space}_body", "A moving body; its pose is the starting guess for assembly.", fields)


@lru_cache(maxsize=8)
def _file_model(space: str, joints: _Types, drivers: _Types) -> type[BaseModel]:
    time = {"start": (scalar("time"), 0.0), "stop": (scalar("time"), ...)}
    time |= {"step": (scalar("time"), None), "count": (scalar("ratio"), None)}
    optional = {
        "title": (Annotated[Any, _Checked(_text, {"type": "string"})], ""),
        "gravity": (vector(COMPONENTS[space], "acceleration"), None),
        "parameters": (_named(scalar("any"), _PARAMETER, _parameter_name), {}),
        "joints": (_named(_constraint_union(space, "joint", joints), _NAME), {}),
        "drivers": (_named(_constraint_union(space, "driver", drivers), _NAME), {}),
        "outputs": (_named(_output_union(space), _NAME, _output_name), {}),
        "time": (_model(f"{space}_time", "Instants from start to stop, by step or by count.", time), None),
    }
    fields = {
        "space": (Literal[space], ...),
        "bodies": (_named(_body_model(space), _NAME, _body_name), ...),
        **optional,
    }
    return _model(f"{space}_mechanism", f"A {space} mechanism.", fields)


def file_model(space: str, *, own_types: bool = True) -> type[BaseModel]:
    """Return the model of a whole file of a space, with every joint and driver registered by now.

    Without ``own_types``, with those of this package only.
    """
    types = []
    for role in ("joint", "driver"):
        found = catalogue(space, role).items()
        types.append(tuple((n, kind) for n, kind in found if own_types or kind.__module__.startswith("jounce.")))
    return _file_model(space, *types)
