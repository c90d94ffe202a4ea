"""Motion laws of segments and of pieces in files, and laws of the coordinate of another driver."""

from __future__ import annotations

import dataclasses
from typing import Any

from jounce.constraints.facts import at_coordinate
from jounce.errors import UNSET, TrajectoryError, no_such, show_value, unknown
from jounce.io.mechanisms.values.expressions import ANY_VALUE, defined, list_schema, object_schema, parse, problem
from jounce.trajectory import (
    AbstractMotion,
    Expression,
    FollowingMotion,
    IntegratedMotion,
    PiecewiseMotion,
    Segment,
    SegmentedMotion,
)
from jounce.trajectory.laws.integrated import HIGHEST
from jounce.trajectory.laws.piecewise import BEYOND as BEYOND_PIECES
from jounce.trajectory.laws.segment_pieces import SEGMENT_PROFILES
from jounce.trajectory.laws.segments import BEYOND, MOST_CONDITIONS
from jounce.units.dimensions import ANGLE, LENGTH, TIME, Dimension, is_rate, per_power

EXPRESSION_KEYS = ("expression", "of", "derivative", "initial", "start")
PROFILE_KEYS = ("profile", "initial", "start", "beyond", "of", "derivative")
SEGMENT_KEYS = tuple(field.name for field in dataclasses.fields(Segment))
PIECEWISE_KEYS = ("piecewise", "start", "beyond", "of", "derivative", "initial")
LAPSES = {"time": "s", "angle": "rad", "length": "m"}
"""Kinds of the variable of a law, and their units."""
LEADER_SCHEMA = {
    "description": "name of a driver, or an expression of t: its coordinate takes the place of the time",
    "type": "string",
    "minLength": 1,
}
DERIVATIVE_SCHEMA = {
    "description": "which derivative of the driven quantity is given: 1 velocity, 2 acceleration",
    "type": "integer",
    "minimum": 0,
    "maximum": HIGHEST,
}
INITIAL_SCHEMA = {"type": "array", "items": {"anyOf": ANY_VALUE}, "maxItems": HIGHEST + 1}
_DIMENSIONS = {"time": TIME, "angle": ANGLE, "length": LENGTH}


@dataclasses.dataclass(frozen=True)
class UnresolvedFollower:
    """A law of the coordinate of another driver, known by name until all drivers are read."""

    law: Any
    driver: str


def leader(raw: dict[str, Any], info: Any) -> str | Expression | None:
    """Return the name of a driver, or an expression, whose value replaces the time in a law; None for a law of time."""
    given = raw.get("of")
    if given is None:
        return None
    if not isinstance(given, str):
        raise problem("must be the name of a driver, or an expression of t", "of", value=given)
    context = info.context or {}
    names = context.get("drivers", ())
    if given in names:
        return given
    if names is context.get("leaders", ...):
        message = no_such("leader", given, names, "coordinate")
        raise problem(f"must be the name of a driver, a joint, or an output; {message}", "of", value=given)
    if given in context.get("leaders", ()) and given not in context.get("names", ()):
        message = (
            "is not a driver, and only a cam, which is a joint, follows what is not driven: write the law of a driver "
            "under joints, and that of a force with x, its displacement"
        )
        raise problem(message, "of", value=given)
    value = parse(given, "any", info, "of", variables={"t": None}).value
    if not isinstance(value, Expression):
        raise problem("must be the name of a driver, or an expression of t", "of", value=given)
    return value


def followed_law(law: Any, by: str | Expression | None) -> Any:
    """Return a law of time, of the coordinate of a driver, or of an expression."""
    if by is None:
        return law
    law = law if isinstance(law, AbstractMotion | Expression) else Expression(repr(law))
    return UnresolvedFollower(law, by) if isinstance(by, str) else FollowingMotion(law, by)


def segmented(raw: dict[str, Any], quantity: str, info: Any) -> AbstractMotion | UnresolvedFollower:
    """Return the law of a profile of segments."""
    entries, leader_value = raw["profile"], leader(raw, info)
    if not isinstance(entries, list | tuple) or not entries:
        raise problem("must be a list of segments, such as {profile: cycloidal, duration: 1 s, to: 20 mm}", "profile")
    lapse, level = _independent_variable(leader_value, info), order_of(raw)
    segments = [_segment(entry, k, quantity, lapse, level, info) for k, entry in enumerate(entries)]
    initials = initial_values(raw, level + 1, quantity, lapse, info) if level else []
    if level:
        initial = initials.pop() if len(initials) > level else 0.0
    else:
        initial = parse(raw.get("initial", 0.0), quantity, info, "initial").value
    start = parse(raw.get("start", 0.0), lapse, info, "start").value
    beyond = raw.get("beyond", BEYOND[0])
    if beyond not in BEYOND:
        raise problem(unknown("way", beyond, BEYOND), "beyond", value=beyond)
    try:
        law: AbstractMotion = SegmentedMotion(segments, initial, start, beyond)
        return followed_law(IntegratedMotion(law, level, initials, start) if level else law, leader_value)
    except TrajectoryError as error:
        raise problem(error.message, *_place(error.name), value=UNSET if error.value is None else error.value) from None


def order_of(raw: dict[str, Any]) -> int:
    """Return the order of the derivative that a law gives; 0 for the law itself."""
    level = raw.get("derivative", 0)
    if isinstance(level, bool) or not isinstance(level, int) or not 0 <= level <= HIGHEST:
        message = f"must be a whole number from 0 to {HIGHEST}; 0 is the value itself, 1 the velocity"
        raise problem(message, "derivative", value=level)
    return level


def initial_values(raw: dict[str, Any], limit: int, quantity: str, lapse: str, info: Any) -> list[Any]:
    """Return the initial values of a law that is given by a derivative, lowest order first."""
    given = raw.get("initial", [])
    if not isinstance(given, list | tuple) or len(given) > limit:
        message = f"must be a list of at most {limit} values: the law and its derivatives below the one that is given"
        raise problem(message, "initial", value=given)
    return [rate(x, order, quantity, info, "initial", order, by=lapse) for order, x in enumerate(given)]


def _integrated(law: Any, raw: dict[str, Any], quantity: str, lapse: str, info: Any, start: Any = None) -> Any:
    """Return the integral of a law that an entry gives by a derivative; the law itself if it gives none."""
    level = order_of(raw)
    if not level:
        for key in ("initial", *(("start",) if start is None else ())):
            if key in raw:
                raise problem("is only for a law that is given by a derivative", key, value=UNSET)
        return law
    values = initial_values(raw, level, quantity, lapse, info)
    if start is None:
        start = parse(raw.get("start", 0.0), lapse, info, "start").value
    law = law if isinstance(law, AbstractMotion | Expression) else Expression(repr(law))
    try:
        return IntegratedMotion(law, level, values, start)
    except TrajectoryError as error:
        raise problem(error.message, *_place(error.name), value=UNSET if error.value is None else error.value) from None


def expressed(raw: dict[str, Any], quantity: str, info: Any, variables: dict[str, Dimension | None]) -> Any:
    """Return the law of an expression, of time or the coordinate of a driver, integrated if it is a derivative."""
    for key in ("beyond", "until"):
        if key in raw:
            message = "an expression has no end; write it as a piece: piecewise: [{until: ..., expression: ...}]"
            raise problem(message, key, value=UNSET)
    leader_value = leader(raw, info)
    lapse = _independent_variable(leader_value, info)
    if leader_value is not None:
        variables = {**variables, "t": _DIMENSIONS.get(lapse)}
    law = _rate_law(raw["expression"], order_of(raw), quantity, info, "expression", by=lapse, variables=variables)
    if len(raw) > 1:
        _check_of_time(law, variables, "expression")
    return followed_law(_integrated(law, raw, quantity, lapse, info), leader_value)


def _rate_law(
    raw: object,
    order: int,
    quantity: str,
    info: Any,
    *location: str | int,
    by: str,
    variables: dict[str, Dimension | None],
) -> Any:
    """Return an expression of t for a driven quantity, or for its derivative of some order."""
    if not order:
        return parse(raw, quantity, info, *location, variables=variables).value
    return rate(raw, order, quantity, info, *location, by=by, variables=variables)


def _check_of_time(law: Any, variables: dict[str, Dimension | None], *location: str | int) -> None:
    """Refuse a piece of a law, or one with a leader or a derivative, that depends on the motion, as a force may."""
    others = sorted(law.names & variables.keys() - {"t"}) if isinstance(law, Expression) else ()
    if others:
        message = f"depends on {others[0]}; a piece, and a law with of or derivative, is a function of t alone"
        raise problem(f"{message}: write one expression", *location, value=law.text)


def _place(name: str | None) -> tuple[str | int, ...]:
    """Return the location in the entry of a name such as ``segments[2].to``."""
    if not name or not name.startswith("segments"):
        return (name,) if name else ()
    index, _, key = name.removeprefix("segments").partition("].")
    number = index.strip("[]")
    return ("profile", *([int(number)] if number else []), *([key] if key else []))


def _independent_variable(leader_value: str | Expression | None, info: Any) -> str:
    """Return the kind of the variable of a law: time, or that of a cam or of the coordinate of a driver."""
    context = info.context or {}
    if leader_value is None:
        return context.get("lapse", "time")
    return context["drivers"][leader_value] if isinstance(leader_value, str) else "any"


def _segment(entry: object, k: int, quantity: str, lapse: str, level: int, info: Any) -> Segment:
    if not isinstance(entry, dict):
        raise problem("must be a segment, such as {profile: dwell, duration: 1 s}", "profile", k, value=entry)
    for key in entry.keys() - set(SEGMENT_KEYS):
        message = unknown(f"key {show_value(key)}", key, SEGMENT_KEYS)
        raise problem(message, "profile", k, key, value=UNSET)
    profile = entry.get("profile")
    if not isinstance(profile, str) or profile not in SEGMENT_PROFILES:
        message = unknown("profile", profile, SEGMENT_PROFILES) if isinstance(profile, str) else "is missing"
        raise problem(message, "profile", k, "profile", value=UNSET if profile is None else profile)
    values: dict[str, Any] = {"profile": profile}
    if "duration" in entry:
        values["duration"] = parse(entry["duration"], lapse, info, "profile", k, "duration").value
    for key in ("to", "by"):
        if key in entry:
            values[key] = rate(entry[key], level, quantity, info, "profile", k, key, by=lapse)
    for key in ("begin", "end", "limits"):
        if key in entry:
            if not isinstance(entry[key], list | tuple):
                raise problem("must be a list of values", "profile", k, key, value=entry[key])
            orders = enumerate(entry[key])
            values[key] = [rate(x, level + n + 1, quantity, info, "profile", k, key, n, by=lapse) for n, x in orders]
    return Segment(**values)


def piecewise(raw: dict[str, Any], quantity: str, info: Any, variables: dict[str, Dimension | None]) -> Any:
    """Return the law of consecutive expressions."""
    entries, leader_value, level = raw["piecewise"], leader(raw, info), order_of(raw)
    if not isinstance(entries, list | tuple) or not entries:
        raise problem("must be a list such as [{until: 1 s, expression: t**2}, {expression: 1}]", "piecewise")
    lapse = _independent_variable(leader_value, info)
    if leader_value is not None:
        variables = {**variables, "t": _DIMENSIONS.get(lapse)}
    laws, ends = [], []
    for k, entry in enumerate(entries):
        last = k + 1 == len(entries)
        valid = ({"expression", "until"}, {"expression"}) if last else ({"expression", "until"},)
        if not isinstance(entry, dict) or entry.keys() not in valid:
            message = "must have the keys expression and until" if not last else "must have the key expression"
            advice = "; where the last piece ends may be left out" if not last else ", and may say until when it goes"
            raise problem(message + advice, "piecewise", k, value=entry)
        location = ("piecewise", k, "expression")
        law = _rate_law(entry["expression"], level, quantity, info, *location, by=lapse, variables=variables)
        _check_of_time(law, variables, *location)
        laws.append(law if isinstance(law, Expression) else Expression(repr(law)))
        if "until" in entry:
            ends.append(parse(entry["until"], lapse, info, "piecewise", k, "until").value)
    start = parse(raw["start"], lapse, info, "start").value if "start" in raw else None
    beyond = raw.get("beyond", BEYOND_PIECES[0])
    if beyond not in BEYOND_PIECES:
        raise problem(unknown("way", beyond, BEYOND_PIECES), "beyond", value=beyond)
    if len(ends) < len(laws):
        for key in ("beyond", "start"):
            if key in raw and not (key == "start" and level):
                message = "the last piece has no end, so that nothing lies beyond it; give until when it is valid"
                raise problem(message, key, value=UNSET)
    try:
        law = PiecewiseMotion(laws, ends, start if len(ends) == len(laws) else None, beyond)
    except TrajectoryError as error:
        key = str(error.name).partition("[")[0]
        number = str(error.name)[len(key) + 1 : -1]
        location = ("piecewise", int(number), key) if number else ("start",) if key == "start" else ("piecewise",)
        raise problem(error.message, *location, value=UNSET if error.value is None else error.value) from None
    return followed_law(_integrated(law, raw, quantity, lapse, info, 0.0 if start is None else start), leader_value)


def rate(
    raw: object,
    order: int,
    quantity: str,
    info: Any,
    *location: str | int,
    by: str = "time",
    variables: dict[str, Dimension | None] | None = None,
) -> float | Expression:
    """Return a derivative of a driven quantity with respect to the variable of its law, in SI units."""
    value = parse(raw, quantity if order == 0 else "any", info, *location, variables=variables)
    if order and value.dimension:
        quantities, lapses = bases(quantity, info), [by] if by in LAPSES else LAPSES
        if not any(is_rate(value.dimension, quantities, order, lapse) for lapse in lapses):
            per = " or".join(per_power(order, LAPSES[lapse]) for lapse in lapses)
            raise problem(f"must be {' or '.join(quantities)}{per}", *location, value=raw)
    return value.value


def bases(quantity: str, info: Any) -> list[str]:
    """Return the kinds of value that a law may have."""
    quantity = at_coordinate(quantity, info.data.get("coordinate"))
    return ["angle", "length"] if quantity == "any" else [quantity]


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
    schema = {
        "profile": {"type": "array", "items": object_schema(segment, ["profile"]), "minItems": 1},
        "initial": value,
        "start": value,
        "beyond": {"enum": list(BEYOND)},
        "of": LEADER_SCHEMA,
        "derivative": DERIVATIVE_SCHEMA,
    }
    schema["initial"] = {"anyOf": [*ANY_VALUE, INITIAL_SCHEMA]}
    return defined("segmented_law", object_schema(schema, ["profile"]))


def piecewise_schema(law: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of consecutive expressions; `law` is that of one expression."""
    value = {"anyOf": ANY_VALUE}
    piece = object_schema({"expression": law, "until": value}, ["expression"])
    schema = {
        "piecewise": {"type": "array", "items": piece, "minItems": 1},
        "start": value,
        "beyond": {"enum": list(BEYOND_PIECES)},
        "of": LEADER_SCHEMA,
        "derivative": DERIVATIVE_SCHEMA,
        "initial": INITIAL_SCHEMA,
    }
    return object_schema(schema, ["piecewise"])


def expression_schema(law: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of a law by one expression; `law` is that of the expression."""
    options = {"of": LEADER_SCHEMA, "derivative": DERIVATIVE_SCHEMA, "initial": INITIAL_SCHEMA}
    return object_schema({"expression": law, **options, "start": {"anyOf": ANY_VALUE}}, ["expression"])
