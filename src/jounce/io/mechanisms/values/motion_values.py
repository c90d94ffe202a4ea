"""Annotations of laws for the schema: laws of motion and of force, by expression, samples, segments or pieces."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr
from pydantic_core import PydanticCustomError

from jounce.errors import UNSET, no_such, show_value, unknown
from jounce.io.files.samples import rates
from jounce.io.mechanisms.values.expressions import (
    ANY_VALUE,
    Checked,
    defined,
    list_schema,
    object_schema,
    parse,
    problem,
    scalar_schema,
)
from jounce.io.mechanisms.values.segment_values import (
    EXPRESSION_KEYS,
    LEADER_SCHEMA,
    PIECEWISE_KEYS,
    PROFILE_KEYS,
    bases,
    expressed,
    expression_schema,
    leader,
    piecewise,
    piecewise_schema,
    rate,
    segmented,
    segmented_schema,
)
from jounce.trajectory.sampled.measured import HIGHEST as MOST
from jounce.trajectory.splines import HIGHEST_DEGREE
from jounce.units.dimensions import TIME, Dimension

WAYS = ("refuse", "hold", "repeat", "advance")


class Samples(BaseModel):
    """A motion law through samples: a CSV file, the degree of the spline, and the columns of time and value.

    Beyond the samples, the law is refused, holds the value at the end, repeats the samples as one period, or advances:
    it repeats them from the value at their end. If the samples are a derivative, such as 2, the acceleration, initial
    holds the value, the velocity and so on at the first sample, zero by default. If the law is a function of another
    coordinate, `of` is the name of its driver or an expression of t, and the column of time is that of the coordinate.
    """

    model_config = ConfigDict(extra="forbid", strict=True)
    samples: str
    degree: int = Field(default=5, ge=1, le=11)
    time: str | None = None
    value: str | None = None
    beyond: Literal["refuse", "hold", "repeat", "advance"] = "refuse"
    derivative: int = Field(default=0, ge=0, le=MOST)
    initial: tuple[Any, ...] = ()
    of: Any = None
    _bases: tuple[str, ...] = PrivateAttr(default=())
    _free: bool = PrivateAttr(default=False)  # whether a user's class calls the law with an unknown quantity

    @property
    def dimensions(self) -> tuple[tuple[Dimension, ...], tuple[Dimension, ...]]:
        """Dimensions that the units of the columns of time and value may have; any dimension if empty."""
        if self.of is not None or self._free:
            return rates(("angle", "length"), 0), () if self.derivative else rates(self._bases, 0)
        return (TIME,), rates(self._bases, self.derivative)


@dataclasses.dataclass(frozen=True)
class OutputLaw:
    """The law of an output that a driver follows; its samples are not yet read."""

    output: str
    held: Any


FORMS = {
    "expression": EXPRESSION_KEYS,
    "samples": tuple(Samples.model_fields),
    "profile": PROFILE_KEYS,
    "piecewise": PIECEWISE_KEYS,
    "output": ("output", "law"),
}
"""Keys of a law, by the key that determines its form."""


def cam_motion(quantity: str) -> Any:
    """Return the annotation of the law of a cam, a function of the coordinate of a driver, a joint or an output."""
    single: Checked = motion(quantity).__metadata__[0]

    def check(raw: object, info: Any) -> Any:
        if not isinstance(raw, dict) or raw.get("of") is None:
            raise problem(
                "a law under joints is a cam, a function of another coordinate; give of, the name of its leader", "of"
            )
        if "output" in raw:
            raise problem("a cam states its own law; only a driver may follow from an output", "output", value=UNSET)
        context = info.context or {}
        return single.function(raw, SimpleNamespace(context={**context, "drivers": context["leaders"]}, data=info.data))

    return Annotated[Any, Checked(check, single.schema)]


def motion(quantity: str, variables: dict[str, Dimension | None] | None = None, *, free: bool = False) -> Any:
    """Return the annotation of a law of motion or force as a function of time and of other variables, if any.

    A free law is a function of whatever a user's class calls it with, in any unit.
    """
    variables = ({"t": None} if free else {"t": TIME}) if variables is None else variables

    def check(raw: object, info: Any) -> Any:
        if free:
            info = SimpleNamespace(context={**(info.context or {}), "lapse": "any"}, data=info.data)
        if not isinstance(raw, dict):
            return parse(raw, quantity, info, variables=variables).value
        form = next((key for key in FORMS if key in raw), None)
        valid = list(FORMS[form]) if form else sorted({key for keys in FORMS.values() for key in keys})
        allowed = {*valid, "beyond", "until"} if form == "expression" else set(valid)
        for key in raw.keys() - allowed:
            raise problem(unknown(f"key {show_value(key)}", key, valid), key, value=UNSET)
        if form == "expression":
            return expressed(raw, quantity, info, variables)
        if form == "profile":
            return segmented(raw, quantity, info)
        if form == "piecewise":
            return piecewise(raw, quantity, info, variables)
        if form == "output":
            return _output_law(raw, info, variables)
        if form != "samples":
            raise problem(
                "must be an expression, samples (the name of a CSV file), a profile of segments, piecewise, or the law "
                "of an output"
            )
        return _samples(raw, quantity, info)

    other_variables = [name for name in variables if name != "t"]
    named = f", {', '.join(other_variables[:-1])} and {other_variables[-1]}" if len(other_variables) > 1 else ""
    law = scalar_schema(quantity, f" and of t, the time in s{named}")
    spline = Samples.model_json_schema()
    spline["properties"]["initial"] = {"type": "array", "items": {"anyOf": ANY_VALUE}, "maxItems": MOST}
    words = "name of a column; by default time, and the only other one"
    spline["properties"]["of"] = LEADER_SCHEMA
    for key in ("time", "value"):
        title = spline["properties"][key]["title"]
        spline["properties"][key] = {"title": title, "type": "string", "description": words}
    forms = [
        expression_schema(law),
        defined("samples_law", spline),
        segmented_schema(),
        piecewise_schema(law),
    ]
    if not other_variables:
        either = {"anyOf": [{"definition": f"{word}_law"} for word in ("length", "angle")]}
        forms.append(object_schema({"output": {"type": "string", "minLength": 1}, "law": either}))
    schema = {"description": law["description"], "anyOf": [*ANY_VALUE, *forms]}
    words = "_".join([*quantity.split(), "law", *(["of", *other_variables] if other_variables else [])])
    return Annotated[Any, Checked(check, defined(words, schema))]


def _output_law(raw: dict[str, Any], info: Any, variables: dict[str, Dimension | None]) -> OutputLaw:
    """Return the law of an output that a driver follows."""
    if set(variables) != {"t"}:
        raise problem("a force cannot have the law of an output; a driver can", "output", value=UNSET)
    for key in ("output", "law"):
        if key not in raw:
            raise problem("is missing", key, value=UNSET)
    outputs = (info.context or {}).get("outputs", {})
    name, labels = raw["output"], ("x", "y", "z")
    if not isinstance(name, str):
        raise problem("must be the name of an output", "output", value=name)
    stem, _, label = name.rpartition("_")
    if name not in outputs and not (stem in outputs and label in labels):
        raise problem(no_such("output", name, outputs), "output", value=name)
    output = outputs.get(name)
    turning = isinstance(output, dict) and output.get("quantity") == "angle"
    single: Checked = motion("angle" if turning else "length").__metadata__[0]
    return OutputLaw(name, _below(single, raw["law"], info, "law"))


def _below(single: Checked, raw: object, info: Any, location: str | int) -> Any:
    """Return the checked value of a nested entry; errors are located at `location`."""
    try:
        return single.function(raw, info)
    except PydanticCustomError as error:
        context = error.context or {}
        value = raw if context["value"] is ... else context["value"]
        raise problem(context["message"], location, *context["at"], value=value) from None


def _samples(raw: dict[str, Any], quantity: str, info: Any) -> Samples:
    """Return the description of a law through samples, with initial values in SI units or as expressions."""
    for key in ("samples", "time", "value"):
        if key in raw and not isinstance(raw[key], str):
            raise problem("must be a name", key, value=raw[key])
    whole_numbers = {"degree": "the degree of a spline", "derivative": "0 is the value itself, 2 the acceleration"}
    for (key, phrase), (low, high) in zip(whole_numbers.items(), ((1, HIGHEST_DEGREE), (0, MOST)), strict=True):
        value = raw.get(key, low)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise problem(f"must be a whole number from {low} to {high}; {phrase}", key, value=value)
    derivative, initial, beyond = raw.get("derivative", 0), raw.get("initial", []), raw.get("beyond", WAYS[0])
    if beyond not in WAYS:
        raise problem(unknown("way", beyond, WAYS), "beyond", value=beyond)
    if not isinstance(initial, list | tuple) or len(initial) > derivative:
        message = f"must be a list of at most {derivative} values: the law and its derivatives below the measured one"
        raise problem(message, "initial", value=initial)
    lapse = (info.context or {}).get("lapse", "time")
    orders = enumerate(initial)
    initial_values = tuple(rate(entry, order, quantity, info, "initial", order, by=lapse) for order, entry in orders)
    samples = Samples.model_validate(raw | {"initial": initial_values, "of": leader(raw, info)})
    samples._bases, samples._free = tuple(bases(quantity, info)), lapse == "any"
    return samples


def laws(size: int, quantity: str, variables: dict[str, Dimension | None]) -> Any:
    """Return the annotation of a list of laws, one for each component of a force."""
    element = motion(quantity, variables)
    single: Checked = element.__metadata__[0]

    def check(raw: object, info: Any) -> tuple[Any, ...]:
        if not isinstance(raw, (list, tuple)) or len(raw) != size:
            raise problem(f"must be a list of {size} laws, one for each component")
        return tuple(_below(single, entry, info, index) for index, entry in enumerate(raw))

    return Annotated[Any, Checked(check, list_schema(single.schema, size))]
