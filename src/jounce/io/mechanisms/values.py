"""Annotations of single values for the schema: scalars, vectors, motion laws, orientations.

Each checks a value as a file holds it, turns it into a number in SI units or an expression, and describes itself in the
JSON Schema. Imported only when a file is loaded, since pydantic takes a while.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError, core_schema

from jounce.errors import UNSET, JounceError, MechanismError, did_you_mean, show_value
from jounce.io.files.entries import shows_value
from jounce.rigid.euler_parameters import form_of
from jounce.trajectory.dimensions import KINDS, TIME, Dimension, is_rate, per_seconds
from jounce.trajectory.expression import Expression
from jounce.trajectory.measured import HIGHEST as MOST
from jounce.trajectory.units import Value, parse_value

__all__ = [
    "Checked",
    "Samples",
    "below",
    "laws",
    "motion",
    "orientation",
    "problem",
    "scalar",
    "vector",
    "vectors",
    "wrenches",
]

WAYS = ("refuse", "hold", "repeat")


def problem(message: str, *at: str | int, value: object = ...) -> PydanticCustomError:
    """Return an error for pydantic to collect; ``at`` leads on from the entry being validated.

    The value shown is that of the entry unless another is given, and none when it is ``UNSET``.
    """
    return PydanticCustomError("jounce", "{message}", {"message": message, "at": at, "value": value})


def below(error: PydanticCustomError, *at: str | int, value: object = ...) -> PydanticCustomError:
    """Return the same error one or more steps further down, with the value there unless it has one already."""
    context = error.context or {}
    shown = value if context["value"] is ... else context["value"]
    return problem(context["message"], *at, *context["at"], value=shown)


class Checked:
    """An annotation: validated by a function of the value and pydantic's context, with a JSON schema of its own."""

    def __init__(self, function: Callable[[Any, Any], Any], schema: dict[str, Any]) -> None:
        self.function = function
        self.schema = schema

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(self.function)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return self.schema


def parse(raw: Any, quantity: str, info: Any, variables: dict[str, Dimension | None] | None = None) -> Value:
    if quantity in ("of coordinate", "per angle"):
        turning = info.data.get("coordinate") == "angle"
        by_coordinate = {"of coordinate": ("length", "angle"), "per angle": ("length per angle", "ratio")}
        quantity = by_coordinate[quantity][turning]
    context = info.context or {}
    try:
        value = parse_value(raw, quantity, context.get("names", ()), context.get("dimensions"), variables)
        _note_use(context.get("uses", {}), value.value, quantity)
        return value
    except JounceError as error:
        raise problem(error.message, value=UNSET if shows_value(error) else raw) from None


def _note_use(uses: dict[str, tuple[Dimension, ...]], value: Any, quantity: str) -> None:
    """Note the dimensions that a parameter may have where it stands alone, or with a sign before it."""
    name = value.text.lstrip("+- ") if isinstance(value, Expression) else ""
    allowed = KINDS[quantity][1]
    if name in uses and allowed:
        uses[name] = tuple(d for d in uses[name] if d in allowed) if uses[name] else allowed


def _words(quantity: str) -> str:
    if quantity in KINDS:
        return KINDS[quantity][0]
    return {"of coordinate": "a length or an angle", "per angle": "a pure number or a length"}.get(quantity, "a value")


def scalar_schema(quantity: str, described: str = "") -> dict[str, Any]:
    text = f"{_words(quantity)}: a number (SI), a number with a unit, or an expression of parameters{described}"
    return {"description": text, "anyOf": [{"type": "number"}, {"type": "string", "minLength": 1}]}


def scalar(quantity: str) -> Any:
    """Return the annotation of one value of a kind of ``units.KINDS``."""
    return Annotated[Any, Checked(lambda raw, info: parse(raw, quantity, info).value, scalar_schema(quantity))]


def vector_value(raw: Any, size: int, quantity: str, info: Any, *at: str | int) -> tuple[Any, ...]:
    if not isinstance(raw, (list, tuple)) or len(raw) != size:
        raise problem(f"must be a list of {size} values", *at, value=raw)
    parsed = []
    for index, item in enumerate(raw):
        try:
            parsed.append(parse(item, "any" if quantity == "direction" else quantity, info))
        except PydanticCustomError as error:
            raise below(error, *at, index) from None
    if quantity == "direction":
        used = {item.dimension for item in parsed if item.value != 0 and isinstance(item.value, float)}
        stated = {item.dimension for item in parsed} - {None}
        if len(used) > 1 or len(stated) > 1:
            raise problem("the components of a direction must all have the same unit, or none", *at, value=raw)
    return tuple(item.value for item in parsed)


def vector_schema(size: int, quantity: str) -> dict[str, Any]:
    words = "a direction, of any length but zero" if quantity == "direction" else _words(quantity)
    items = {"anyOf": [{"type": "number"}, {"type": "string", "minLength": 1}]}
    return {"type": "array", "description": words, "items": items, "minItems": size, "maxItems": size}


def vector(size: int, quantity: str) -> Any:
    """Return the annotation of a list of values of one kind."""
    return Annotated[
        Any, Checked(lambda raw, info: vector_value(raw, size, quantity, info), vector_schema(size, quantity))
    ]


def vectors(count: int, size: int, quantity: str) -> Any:
    """Return the annotation of a list of vectors, one on each body."""

    def check(raw: Any, info: Any) -> tuple[Any, ...]:
        if not isinstance(raw, (list, tuple)) or len(raw) != count:
            raise problem(f"must be a list of {count} vectors, one on each body")
        return tuple(vector_value(item, size, quantity, info, index) for index, item in enumerate(raw))

    schema = {"type": "array", "items": vector_schema(size, quantity), "minItems": count, "maxItems": count}
    return Annotated[Any, Checked(check, schema)]


def wrenches() -> Any:
    """Return the annotation of rows of six values: a force and a moment."""

    def check(raw: Any, info: Any) -> tuple[Any, ...]:
        if not isinstance(raw, (list, tuple)) or not raw:
            raise problem("must be rows of six values, a force and a moment")
        return tuple(vector_value(row, 6, "any", info, index) for index, row in enumerate(raw))

    return Annotated[Any, Checked(check, {"type": "array", "items": vector_schema(6, "any"), "minItems": 1})]


class Samples(BaseModel):
    """A motion law through samples: a CSV file, the degree of the spline, and the columns of time and value.

    Beyond the samples there is no law, unless it is to hold the value at the end, or to repeat them as one period. Of a
    law whose derivative was measured, such as 2, the acceleration, initial holds the value, the velocity and so on at
    the first sample, zero unless given.
    """

    model_config = ConfigDict(extra="forbid", strict=True)
    samples: str
    degree: int = Field(default=5, ge=1, le=11)
    time: str | None = None
    value: str | None = None
    beyond: Literal["refuse", "hold", "repeat"] = "refuse"
    derivative: int = Field(default=0, ge=0, le=MOST)
    initial: tuple[Any, ...] = ()


def motion(quantity: str, variables: dict[str, Dimension | None] | None = None) -> Any:
    """Return the annotation of a law of time, and of other variables where there are some: of motion, or of a force."""
    variables = {"t": TIME} if variables is None else variables

    def check(raw: Any, info: Any) -> Any:
        if not isinstance(raw, dict):
            return parse(raw, quantity, info, variables).value
        if raw.keys() == {"expression"}:
            try:
                return parse(raw["expression"], quantity, info, variables).value
            except PydanticCustomError as error:
                raise below(error, "expression") from None
        valid = ["expression"] if "expression" in raw else list(Samples.model_fields)
        valid += [] if {"expression", "samples"} & raw.keys() else ["expression"]
        for key in raw.keys() - set(valid):
            raise problem(f"unknown key {show_value(key)}; {did_you_mean(key, valid)}", key, value=UNSET)
        if "samples" not in raw:
            raise problem("must be an expression, or samples: the name of a CSV file")
        for key, kind in (("samples", str), ("degree", int), ("time", str), ("value", str)):
            if key in raw and (not isinstance(raw[key], kind) or isinstance(raw[key], bool)):
                raise problem("must be a whole number" if kind is int else "must be a name", key, value=raw[key])
        if raw.get("beyond", "refuse") not in WAYS:
            raise problem(f"no such way; {did_you_mean(raw['beyond'], WAYS)}", "beyond", value=raw["beyond"])
        if not 1 <= raw.get("degree", 5) <= 11:
            raise problem("the degree of a spline is from 1 to 11", "degree", value=raw["degree"])
        return Samples(**raw | _measured(raw, quantity, info))

    others = [name for name in variables if name != "t"]
    named = f", {', '.join(others[:-1])} and {others[-1]}" if len(others) > 1 else ""
    described = f" and of t, the time in s{named}"
    law = scalar_schema(quantity, described)
    formula = {"type": "object", "properties": {"expression": law}, "required": ["expression"]}
    spline = Samples.model_json_schema()
    values = {"anyOf": [{"type": "number"}, {"type": "string", "minLength": 1}]}
    spline["properties"]["initial"] = {"type": "array", "items": values, "maxItems": MOST}
    for entry in (spline["properties"]["time"], spline["properties"]["value"]):
        entry.pop("anyOf")
        entry |= {"type": "string", "description": "name of a column; by default time, and the only other one"}
        entry.pop("default")
    schema = {
        "description": law["description"],
        "anyOf": [*law["anyOf"], formula | {"additionalProperties": False}, spline],
    }
    return Annotated[Any, Checked(check, schema)]


def _measured(raw: dict[str, Any], quantity: str, info: Any) -> dict[str, Any]:
    """Return which derivative of a law was measured, and the numbers that it begins with, in SI units."""
    derivative, initial = raw.get("derivative", 0), raw.get("initial", [])
    if isinstance(derivative, bool) or not isinstance(derivative, int) or not 0 <= derivative <= MOST:
        message = f"must be a whole number from 0 to {MOST}: 0 the value itself, 2 the acceleration"
        raise problem(message, "derivative", value=derivative)
    if derivative and raw.get("beyond") == "repeat":
        raise problem("samples of a derivative cannot repeat; valid: refuse, hold", "beyond", value=raw["beyond"])
    if not isinstance(initial, list | tuple) or len(initial) > derivative:
        message = f"must be a list of at most {derivative} values: the law and its derivatives below the measured one"
        raise problem(message, "initial", value=initial)
    found = [_initial(entry, order, quantity, info) for order, entry in enumerate(initial)]
    return {"derivative": derivative, "initial": tuple(found)}


def _initial(raw: Any, order: int, quantity: str, info: Any) -> float | Expression:
    """Return a value of a driven quantity, in SI units per s to the power of an order."""
    try:
        value = parse(raw, quantity if order == 0 else "any", info)
    except PydanticCustomError as error:
        raise below(error, "initial", order) from None
    if order and value.dimension:
        bases = _bases(quantity, info)
        if not is_rate(value.dimension, bases, order):
            words = f"must be {' or '.join(bases) or 'a number'}{per_seconds(order)}"
            raise problem(words, "initial", order, value=raw)
    return value.value


def _bases(quantity: str, info: Any) -> list[str]:
    """Return the dimensions that a driven quantity may have; none of what is no coordinate, such as a force."""
    if quantity == "of coordinate":
        return ["angle" if info.data.get("coordinate") == "angle" else "length"]
    return [quantity] if quantity in ("length", "angle") else ["angle", "length"] if quantity == "any" else []


def laws(size: int, quantity: str, variables: dict[str, Dimension | None]) -> Any:
    """Return the annotation of a list of laws, one for each component of a force."""
    one = motion(quantity, variables)
    single: Checked = one.__metadata__[0]

    def check(raw: Any, info: Any) -> tuple[Any, ...]:
        if not isinstance(raw, (list, tuple)) or len(raw) != size:
            raise problem(f"must be a list of {size} laws, one for each component")
        found = []
        for index, entry in enumerate(raw):
            try:
                found.append(single.function(entry, info))
            except PydanticCustomError as error:
                raise below(error, index, value=entry) from None
        return tuple(found)

    return Annotated[Any, Checked(check, {"type": "array", "items": single.schema, "minItems": size, "maxItems": size})]


def _orientation(raw: Any, info: Any) -> dict[str, Any]:
    """Read one of the three forms of an orientation; the values stay numbers or expressions."""
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
    try:
        angle = parse(raw["angle"], "angle", info).value
    except PydanticCustomError as error:
        raise below(error, "angle") from None
    return {"axis": vector_value(raw["axis"], 3, "direction", info, "axis"), "angle": angle}


def orientation() -> Any:
    """Return the annotation of an orientation in space."""
    forms = [
        {"quaternion": vector_schema(4, "ratio")},
        {"axis": vector_schema(3, "direction"), "angle": scalar_schema("angle")},
        {
            "euler": {"type": "string", "pattern": "^([xyz]{3}|[XYZ]{3})$"},
            "angles": vector_schema(3, "angle"),
        },
    ]
    closed = {"type": "object", "additionalProperties": False}
    text = "lower-case Euler letters turn about fixed axes, upper-case ones about the moving axes of the body"
    schema = {"description": text, "oneOf": [closed | {"properties": f, "required": list(f)} for f in forms]}
    return Annotated[Any, Checked(_orientation, schema)]
