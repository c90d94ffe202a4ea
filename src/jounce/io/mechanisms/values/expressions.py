"""Annotations of single values for the schema: scalars, vectors, orientations.

Each annotation checks a value of a file, converts it to a number in SI units or an expression, and describes itself in
the JSON Schema. The module is imported when a file is loaded, because the import of pydantic is slow.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import MISSING
from typing import Annotated, Any

from jounce.constraints.facts import at_coordinate, facts_of, value_fields
from jounce.errors import UNSET, JounceError, MechanismError, no_such
from jounce.io.files.located_data import shows_value
from jounce.mechanism.redundant_reactions import CHOICES, STIFFNESSES
from jounce.rigid.euler_parameters import form_of
from jounce.units.dimensions import KINDS, Dimension
from jounce.units.expression import Expression
from jounce.units.values import Value, parse_value


def problem(message: str, *location: str | int, value: object = ...) -> ValueError:
    """Return an error for pydantic to collect; `location` is relative to the validated entry.

    The error shows the value of the entry unless another value is given, and no value if that is ``UNSET``.
    """
    from pydantic_core import PydanticCustomError  # local, since its import takes a tenth of the time to the first name

    return PydanticCustomError("jounce", "{message}", {"message": message, "at": location, "value": value})


class Checked:
    """An annotation with a validating function of the value and pydantic's context, and with its own JSON schema."""

    def __init__(self, function: Callable[[Any, Any], Any], schema: dict[str, Any]) -> None:
        self.function = function
        self.schema = schema

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic_core import core_schema

        return core_schema.with_info_plain_validator_function(self.function)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return copy.deepcopy(self.schema)  # pydantic writes titles into it


def parse(
    raw: object, quantity: str, info: Any, *location: str | int, variables: dict[str, Dimension | None] | None = None
) -> Value:
    """Return a value of a kind of ``dimensions.KINDS``; `location` is relative to the validated entry."""
    quantity = at_coordinate(quantity, info.data.get("coordinate"))
    context = info.context or {}
    try:
        value = parse_value(raw, quantity, context.get("names", ()), context.get("dimensions"), variables)
    except JounceError as error:
        raise problem(error.message, *location, value=UNSET if shows_value(error) else raw) from None
    _note_use(context.get("uses", {}), value.value, quantity)
    return value


def _note_use(uses: dict[str, tuple[Dimension, ...]], value: Any, quantity: str) -> None:
    """Record the dimensions that a parameter may have if it is the whole value, up to a sign."""
    name = value.text.lstrip("+- ") if isinstance(value, Expression) else ""
    allowed = KINDS[quantity][1]
    if name in uses and allowed:
        uses[name] = tuple(d for d in uses[name] if d in allowed) if uses[name] else allowed


def _words(quantity: str) -> str:
    if quantity in KINDS:
        return KINDS[quantity][0]
    return {"of coordinate": "a length or an angle", "per angle": "a pure number or a length"}.get(quantity, "a value")


ANY_VALUE = [{"type": "number"}, {"type": "string", "minLength": 1}]
"""Forms of a value in the JSON Schema."""


definitions: dict[str, dict[str, Any]] = {}
"""Parts of the JSON Schema that are defined once, by name."""


def defined(name: str, schema: dict[str, Any]) -> dict[str, Any]:
    """Return a placeholder for a defined part of the JSON Schema, since pydantic has references of its own."""
    definitions[name] = schema
    return {"definition": name}


def scalar_schema(quantity: str, described: str = "") -> dict[str, Any]:
    """Return the JSON Schema of one value."""
    text = f"{_words(quantity)}: a number (SI), a number with a unit, or an expression of parameters{described}"
    return {"description": text, "anyOf": ANY_VALUE}


def list_schema(items: dict[str, Any], size: int) -> dict[str, Any]:
    """Return the JSON Schema of a list of given length."""
    return {"type": "array", "items": items, "minItems": size, "maxItems": size}


def object_schema(properties: dict[str, Any], required: Iterable[str] | None = None) -> dict[str, Any]:
    """Return the JSON Schema of a mapping without other keys; by default all keys are required."""
    keys = list(properties if required is None else required)
    return {"type": "object", "properties": properties, "required": keys, "additionalProperties": False}


def scalar(quantity: str) -> Any:
    """Return the annotation of a value of a kind of ``units.KINDS``."""
    return Annotated[Any, Checked(lambda raw, info: parse(raw, quantity, info).value, scalar_schema(quantity))]


def scalars(count: int, quantity: str) -> Any:
    """Return the annotation of a list of values of one kind, one for each body."""

    def check(raw: object, info: Any) -> tuple[float | Expression, ...]:
        if not isinstance(raw, (list, tuple)) or len(raw) != count:
            raise problem(f"must be a list of {count} values, one of each body")
        return tuple(parse(item, quantity, info, index).value for index, item in enumerate(raw))

    schema = {"description": _words(quantity)} | list_schema({"anyOf": ANY_VALUE}, count)
    return Annotated[Any, Checked(check, schema)]


def vector_value(
    raw: object, size: int, quantity: str, info: Any, *location: str | int
) -> tuple[float | Expression, ...]:
    """Return a list of values of one kind, after a check."""
    if not isinstance(raw, (list, tuple)) or len(raw) != size:
        raise problem(f"must be a list of {size} values", *location, value=raw)
    kind = "any" if quantity == "direction" else quantity
    parsed = [parse(item, kind, info, *location, index) for index, item in enumerate(raw)]
    if quantity == "direction":
        dimensions = {item.dimension for item in parsed if item.value != 0 and isinstance(item.value, float)}
        stated = {item.dimension for item in parsed} - {None}
        if len(dimensions) > 1 or len(stated) > 1:
            raise problem("the components of a direction must all have the same unit, or none", *location, value=raw)
    return tuple(item.value for item in parsed)


def vector_schema(size: int, quantity: str) -> dict[str, Any]:
    """Return the JSON Schema of a list of values of one kind."""
    description = "a direction, of any length but zero" if quantity == "direction" else _words(quantity)
    return {"description": description} | list_schema({"anyOf": ANY_VALUE}, size)


def vector(size: int, quantity: str) -> Any:
    """Return the annotation of a list of values of one kind."""
    check = Checked(lambda raw, info: vector_value(raw, size, quantity, info), vector_schema(size, quantity))
    return Annotated[Any, check]


def vectors(count: int, size: int, quantity: str) -> Any:
    """Return the annotation of a list of vectors, one for each body."""

    def check(raw: object, info: Any) -> tuple[Any, ...]:
        if not isinstance(raw, (list, tuple)) or len(raw) != count:
            raise problem(f"must be a list of {count} vectors, one on each body")
        return tuple(vector_value(item, size, quantity, info, index) for index, item in enumerate(raw))

    return Annotated[Any, Checked(check, list_schema(vector_schema(size, quantity), count))]


def parts(kinds: dict[str, str], size: int) -> Any:
    """Return the annotation of a mapping of vectors; `kinds` are their kinds by name."""

    def check(raw: object, info: Any) -> tuple[Any, ...]:
        if not isinstance(raw, dict) or set(raw) != set(kinds):
            raise problem(f"must have {' and '.join(kinds)}, as {{{', '.join(f'{name}: [...]' for name in kinds)}}}")
        return tuple(vector_value(raw[name], size, quantity, info, name) for name, quantity in kinds.items())

    schema = {
        "type": "object",
        "properties": {name: vector_schema(size, quantity) for name, quantity in kinds.items()},
        "required": list(kinds),
        "additionalProperties": False,
    }
    return Annotated[Any, Checked(check, schema)]


def nested(kind: type[Any]) -> Any:
    """Return the annotation of a mapping of the scalar fields of a class, which is converted to an instance."""
    fields, quantities = value_fields(kind), facts_of(kind).dimensions
    required = [name for name, field in fields.items() if field.default is MISSING]
    example = f"{{{', '.join(f'{name}: ...' for name in required)}}}"

    def check(raw: object, info: Any) -> Any:
        if not isinstance(raw, dict):
            raise problem(f"must be a mapping, as {example}")
        for name in raw:
            if name not in fields:
                raise problem(no_such("key", name, fields), value=name)
        for name in required:
            if raw.get(name) is None:
                raise problem(f"is missing: give {example}", name, value=UNSET)
        given = {name: x for name, x in raw.items() if x is not None}
        parsed = {name: parse(x, quantities[name], info, name).value for name, x in given.items()}
        try:
            return kind(**parsed)
        except MechanismError as error:
            raise problem(error.message, error.name or "", value=UNSET) from None

    return Annotated[Any, Checked(check, object_schema({n: scalar_schema(quantities[n]) for n in fields}, required))]


def points(size: int, quantity: str) -> Any:
    """Return the annotation of a list of points of any length, one on each body."""

    def check(raw: object, info: Any) -> tuple[Any, ...]:
        count = len(info.data.get("key_bodies") or ())
        if not isinstance(raw, (list, tuple)) or (count and len(raw) != count):
            raise problem(f"must be a list of {count or 'several'} points, one for each body in the order of bodies")
        return tuple(vector_value(item, size, quantity, info, index) for index, item in enumerate(raw))

    return Annotated[Any, Checked(check, {"type": "array", "items": vector_schema(size, quantity), "minItems": 2})]


def wrenches() -> Any:
    """Return the annotation of rows of six values: a force and a moment."""

    def check(raw: object, info: Any) -> tuple[Any, ...]:
        if not isinstance(raw, (list, tuple)) or not raw:
            raise problem("must be rows of six values, a force and a moment")
        return tuple(vector_value(row, 6, "any", info, index) for index, row in enumerate(raw))

    return Annotated[Any, Checked(check, {"type": "array", "items": vector_schema(6, "any"), "minItems": 1})]


def _orientation(raw: object, info: Any) -> dict[str, Any]:
    """Return an orientation in one of its three forms, with numbers or expressions."""
    if not isinstance(raw, dict):
        raise problem("must be {quaternion: [e0, e1, e2, e3]}, {axis, angle} or {euler: zxz, angles}")
    try:
        form = form_of(raw)
    except MechanismError as error:
        raise problem(error.message, error.name or "", value=UNSET) from None
    if form == "quaternion":
        return {"quaternion": vector_value(raw["quaternion"], 4, "ratio", info, "quaternion")}
    if form == "euler":
        if not isinstance(raw["euler"], str):
            raise problem("must be three letters, such as zxz", "euler", value=raw["euler"])
        return {"euler": raw["euler"], "angles": vector_value(raw["angles"], 3, "angle", info, "angles")}
    angle = parse(raw["angle"], "angle", info, "angle").value
    return {"axis": vector_value(raw["axis"], 3, "direction", info, "axis"), "angle": angle}


def orientation() -> Any:
    """Return the annotation of an orientation in space."""
    forms = [
        {"quaternion": vector_schema(4, "ratio")},
        {"axis": vector_schema(3, "direction"), "angle": scalar_schema("angle")},
        {"euler": {"type": "string", "pattern": "^([xyz]{3}|[XYZ]{3})$"}, "angles": vector_schema(3, "angle")},
    ]
    text = "lower-case Euler letters turn about fixed axes, upper-case ones about the moving axes of the body"
    schema = {"description": text, "oneOf": [object_schema(form) for form in forms]}
    return Annotated[Any, Checked(_orientation, schema)]


def redundant_reactions() -> Any:
    """Return the annotation of the choice of reactions for redundant constraints."""

    def check(raw: object, info: Any) -> Any:
        if not isinstance(raw, dict):
            if raw not in CHOICES:
                raise problem(f"must be one of {', '.join(CHOICES)}, or stiffnesses by the names of joints")
            return raw
        stiffnesses: dict[Any, dict[str, Any]] = {}
        for name, given in raw.items():
            if not isinstance(given, dict) or not given or not set(given) <= set(STIFFNESSES):
                raise problem("must be the stiffness of the joint: force, torque, or both", name, value=given)
            stiffnesses[name] = {key: parse(x, STIFFNESSES[key], info, name, key).value for key, x in given.items()}
        return stiffnesses

    by_joint = object_schema({key: scalar_schema(kind) for key, kind in STIFFNESSES.items()}, ())
    forms = [{"enum": list(CHOICES)}, {"type": "object", "additionalProperties": by_joint, "minProperties": 1}]
    return Annotated[Any, Checked(check, {"anyOf": forms})]
