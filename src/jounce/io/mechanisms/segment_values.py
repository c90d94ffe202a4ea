"""Motion laws of segments and of pieces as files hold them, and laws of the coordinate of another driver."""

from __future__ import annotations

import dataclasses
from typing import Any

from jounce.constraints.facts import at_coordinate
from jounce.errors import UNSET, TrajectoryError, show_value, unknown
from jounce.io.mechanisms.values import ANY_VALUE, defined, list_schema, object_schema, parse, problem, scalar_schema
from jounce.trajectory import AbstractMotion, Expression, FollowingMotion, PiecewiseMotion, Segment, SegmentedMotion
from jounce.trajectory.segment_pieces import SEGMENT_PROFILES
from jounce.trajectory.segments import BEYOND, MOST_CONDITIONS
from jounce.units.dimensions import Dimension, is_rate, per_power

PROFILE_KEYS = ("profile", "initial", "start", "beyond", "of")
SEGMENT_KEYS = tuple(field.name for field in dataclasses.fields(Segment))
PIECEWISE_KEYS = ("piecewise",)
LAPSES = {"time": "s", "angle": "rad", "length": "m"}
"""What a law may be of, and its unit."""
LEADER_SCHEMA = {
    "description": "name of a driver, or an expression of t: its coordinate takes the place of the time",
    "type": "string",
    "minLength": 1,
}


@dataclasses.dataclass(frozen=True)
class LedMotion:
    """A law of the coordinate of another driver, which has a name only until all drivers are read."""

    law: Any
    driver: str


def leader(raw: dict[str, Any], info: Any) -> str | Expression | None:
    """Return the name of a driver, or an expression, whose value takes the place of the time, or None."""
    given = raw.get("of")
    if given is None:
        return None
    if not isinstance(given, str):
        raise problem("must be the name of a driver, or an expression of t", "of", value=given)
    if given in (info.context or {}).get("drivers", ()):
        return given
    value = parse(given, "any", info, "of", variables={"t": None}).value
    if not isinstance(value, Expression):
        raise problem("must be the name of a driver, or an expression of t", "of", value=given)
    return value


def led(law: AbstractMotion, by: str | Expression | None) -> AbstractMotion | LedMotion:
    """Return a law as one of the coordinate of a driver, of an expression, or of the time."""
    if by is None:
        return law
    return LedMotion(law, by) if isinstance(by, str) else FollowingMotion(law, by)


def segmented(raw: dict[str, Any], quantity: str, info: Any) -> AbstractMotion | LedMotion:
    """Return the law of a profile of segments."""
    entries, by = raw["profile"], leader(raw, info)
    if not isinstance(entries, list | tuple) or not entries:
        raise problem("must be a list of segments, such as {profile: cycloidal, duration: 1 s, to: 20 mm}", "profile")
    lapse = _lapse(by, info)
    segments = [_segment(entry, k, quantity, lapse, info) for k, entry in enumerate(entries)]
    initial = parse(raw.get("initial", 0.0), quantity, info, "initial").value
    start = parse(raw.get("start", 0.0), lapse, info, "start").value
    beyond = raw.get("beyond", BEYOND[0])
    if beyond not in BEYOND:
        raise problem(unknown("way", beyond, BEYOND), "beyond", value=beyond)
    try:
        return led(SegmentedMotion(segments, initial, start, beyond), by)
    except TrajectoryError as error:
        raise problem(error.message, *_place(error.name), value=UNSET if error.value is None else error.value) from None


def _place(name: str | None) -> tuple[str | int, ...]:
    """Return where in the entry a name such as ``segments[2].to`` stands."""
    if not name or not name.startswith("segments"):
        return (name,) if name else ()
    index, _, key = name.removeprefix("segments").partition("].")
    number = index.strip("[]")
    return ("profile", *([int(number)] if number else []), *([key] if key else []))


def _lapse(by: str | Expression | None, info: Any) -> str:
    """Return what a law is of: the time, unless it is that of a cam or of the coordinate of a driver."""
    context = info.context or {}
    if by is None:
        return context.get("lapse", "time")
    return context["drivers"][by] if isinstance(by, str) else "any"


def _segment(entry: object, k: int, quantity: str, lapse: str, info: Any) -> Segment:
    if not isinstance(entry, dict):
        raise problem("must be a segment, such as {profile: dwell, duration: 1 s}", "profile", k, value=entry)
    for key in entry.keys() - set(SEGMENT_KEYS):
        words = unknown(f"key {show_value(key)}", key, SEGMENT_KEYS)
        raise problem(words, "profile", k, key, value=UNSET)
    profile = entry.get("profile")
    if not isinstance(profile, str) or profile not in SEGMENT_PROFILES:
        words = unknown("profile", profile, SEGMENT_PROFILES) if isinstance(profile, str) else "is missing"
        raise problem(words, "profile", k, "profile", value=UNSET if profile is None else profile)
    found: dict[str, Any] = {"profile": profile}
    for key, kind in (("duration", lapse), ("to", quantity), ("by", quantity)):
        if key in entry:
            found[key] = parse(entry[key], kind, info, "profile", k, key).value
    for key in ("begin", "end", "limits"):
        if key in entry:
            if not isinstance(entry[key], list | tuple):
                raise problem("must be a list of values", "profile", k, key, value=entry[key])
            orders = enumerate(entry[key])
            found[key] = [rate(x, n + 1, quantity, info, "profile", k, key, n, by=lapse) for n, x in orders]
    return Segment(**found)


def piecewise(raw: dict[str, Any], quantity: str, info: Any, variables: dict[str, Dimension | None]) -> PiecewiseMotion:
    """Return the law of expressions that follow each other."""
    entries = raw["piecewise"]
    if not isinstance(entries, list | tuple) or not entries:
        raise problem("must be a list such as [{until: 1 s, expression: t**2}, {expression: 1}]", "piecewise")
    if set(variables) != {"t"}:
        raise problem("a law of other variables than t is given by one expression", "piecewise", value=UNSET)
    laws, ends = [], []
    for k, entry in enumerate(entries):
        keys = {"expression"} if k + 1 == len(entries) else {"expression", "until"}
        if not isinstance(entry, dict) or entry.keys() != keys:
            words = f"must have the keys {' and '.join(sorted(keys))}"
            raise problem(f"{words}; the last piece has no end", "piecewise", k, value=entry)
        law = parse(entry["expression"], quantity, info, "piecewise", k, "expression", variables=variables).value
        laws.append(law if isinstance(law, Expression) else Expression(repr(law)))
        if "until" in entry:
            end = parse(entry["until"], _lapse(None, info), info, "piecewise", k, "until").value
            if isinstance(end, Expression):
                raise problem("must be a number: it cannot depend on parameters", "piecewise", k, "until")
            ends.append(end)
    try:
        return PiecewiseMotion(laws, ends)
    except TrajectoryError as error:
        raise problem(error.message, "piecewise", value=UNSET if error.value is None else error.value) from None


def rate(raw: object, order: int, quantity: str, info: Any, *at: str | int, by: str = "time") -> float | Expression:
    """Return a derivative of a driven quantity by the time or another one, in SI units."""
    value = parse(raw, quantity if order == 0 else "any", info, *at)
    if order and value.dimension:
        known, lapses = bases(quantity, info), [by] if by in LAPSES else LAPSES
        if not any(is_rate(value.dimension, known, order, lapse) for lapse in lapses):
            per = " or".join(per_power(order, LAPSES[lapse]) for lapse in lapses)
            raise problem(f"must be {' or '.join(known) or 'a number'}{per}", *at, value=raw)
    return value.value


def bases(quantity: str, info: Any) -> list[str]:
    """Return the dimensions that a driven quantity may have; none of what is no coordinate, such as a force."""
    quantity = at_coordinate(quantity, info.data.get("coordinate"))
    return [quantity] if quantity in ("length", "angle") else ["angle", "length"] if quantity == "any" else []


def segmented_schema() -> dict[str, Any]:
    """Return the JSON Schema of a profile of segments."""
    value = {"anyOf": ANY_VALUE}
    rates = {"type": "array", "items": value, "maxItems": MOST_CONDITIONS}
    segment = {
        "profile": {"enum": list(SEGMENT_PROFILES)},
        **dict.fromkeys(("duration", "to", "by"), value),
        "begin": rates,
        "end": rates,
        "limits": list_schema(value, 3),
    }
    whole = {
        "profile": {"type": "array", "items": object_schema(segment, ["profile"]), "minItems": 1},
        "initial": value,
        "start": value,
        "beyond": {"enum": list(BEYOND)},
        "of": LEADER_SCHEMA,
    }
    return defined("segmented_law", object_schema(whole, ["profile"]))


def piecewise_schema(law: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of expressions that follow each other; of the law itself, `law`."""
    piece = object_schema({"expression": law, "until": scalar_schema("time")}, ["expression"])
    return object_schema({"piecewise": {"type": "array", "items": piece, "minItems": 1}})
