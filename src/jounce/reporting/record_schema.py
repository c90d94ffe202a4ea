"""The JSON Schema of what commands print with ``--json``."""

from __future__ import annotations

from typing import Any

__all__ = ["record_schema"]

TEXT: dict[str, Any] = {"type": "string"}
NUMBER: dict[str, Any] = {"type": "number"}
WHOLE: dict[str, Any] = {"type": "integer"}
FLAG: dict[str, Any] = {"type": "boolean"}


def _maybe(schema: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


def _object(keys: dict[str, Any], *optional: str, about: str = "") -> dict[str, Any]:
    required = [key for key in keys if key not in optional]
    made = {"type": "object", "properties": keys, "required": required, "additionalProperties": False}
    return made | ({"description": about} if about else {})


NUMBERS = _list(NUMBER)
NAMES = _list(TEXT)
MATRIX = {"anyOf": [NUMBER, NUMBERS, _list(NUMBERS), {"type": "null"}]}
GRID = {"start": NUMBER, "stop": NUMBER, "count": WHOLE}


def _head(command: str, keys: dict[str, Any], *optional: str, about: str) -> dict[str, Any]:
    head = {"jounce": TEXT, "record": {"const": 1}, "command": {"const": command}}
    return _object(head | keys, *optional, about=about)


def _motion() -> dict[str, Any]:
    numbers = ("minimum", "minimum_at", "maximum", "maximum_at")
    peak = {"output": TEXT, "derivative": TEXT, "unit": TEXT} | dict.fromkeys(numbers, _maybe(NUMBER))
    failure = {"index": WHOLE, "time": NUMBER, "status": TEXT, "culprit": _maybe(TEXT)}
    return {
        "file": TEXT,
        "title": TEXT,
        "space": {"enum": ["planar", "spatial"]},
        **dict.fromkeys(("bodies", "joints", "drivers", "forces"), NAMES),
        "order": WHOLE,
        "time": _object({**GRID, "solved": WHOLE}),
        "failures": _list(_object(failure)),
        "peaks": _list(_object(peak)),
        "written": _maybe(TEXT),
    }


def _mechanism() -> dict[str, Any]:
    pose = _object({"position": NUMBERS, "angle": NUMBER, "quaternion": NUMBERS}, "angle", "quaternion")
    body = {"name": TEXT, "mass": _maybe(NUMBER), "center_of_mass": _maybe(NUMBERS), "inertia": MATRIX, "guess": pose}
    body |= {"pose": _maybe(pose), "moved": _maybe(_object({"distance": NUMBER, "angle": NUMBER}))}
    element = _object(
        {"name": TEXT, "type": TEXT, "bodies": NAMES, "rows": WHOLE, "motion": TEXT, "law": TEXT},
        "rows", "motion", "law",
    )  # fmt: skip
    freedom = dict.fromkeys(
        ("coordinates", "equations", "of_drivers", "independent", "of_joints", "left", "redundant"), WHOLE
    )
    freedom |= {"redundant_among": NAMES, "moving": NAMES, "words": TEXT, "message": _maybe(TEXT)}
    assembly = {
        "status": {"enum": ["assembled", "open"]},
        "message": _maybe(TEXT),
        "at": NUMBER,
        "open": _maybe(NUMBER),
    }
    parameter = {"name": TEXT, "value": NUMBER, "unit": _maybe(TEXT), "written": _maybe(TEXT)}
    return {
        "kind": {"const": "mechanism"},
        "file": _maybe(TEXT),
        "title": TEXT,
        "space": {"enum": ["planar", "spatial"]},
        "gravity": _maybe(NUMBERS),
        "parameters": _list(_object(parameter)),
        "bodies": _list(_object(body)),
        **dict.fromkeys(("joints", "drivers", "forces", "initial"), _list(element)),
        "outputs": _list(_object({"name": TEXT, "quantity": TEXT, "unit": TEXT, "of": NAMES})),
        "time": _maybe(_object(GRID)),
        "freedom": _object(freedom),
        "assembly": _object(assembly),
        "ok": FLAG,
    }


def _robot() -> dict[str, Any]:
    link = {"name": TEXT, "moves_with": TEXT, "mass": _maybe(NUMBER), "center_of_mass": _maybe(NUMBERS)}
    limits = ("lower", "upper", "velocity", "acceleration", "jerk", "effort", "effort_rate", "deceleration")
    joint = {
        **dict.fromkeys(("name", "type", "parent", "child"), TEXT),
        "axis": _maybe(NUMBERS),
        "unit": _maybe(TEXT),
        "limits": _maybe(_object(dict.fromkeys(limits, _maybe(NUMBER)))),
        "mimic": _maybe(_object({"joint": TEXT, "multiplier": NUMBER, "offset": NUMBER})),
        **dict.fromkeys(("armature", "damping", "friction"), NUMBER),
    }
    closure = {"name": TEXT, "type": TEXT, "links": NAMES, "equations": _maybe(WHOLE), "redundant": _maybe(WHOLE)}
    freedom = {"coordinates": WHOLE, "equations": WHOLE, "left": _maybe(WHOLE), "words": TEXT}
    return {
        "kind": {"const": "robot"},
        "file": _maybe(TEXT),
        "title": TEXT,
        "gravity": NUMBERS,
        "base": TEXT,
        "mass": NUMBER,
        "links": _list(_object({**link, "inertia": MATRIX})),
        "joints": _list(_object(joint)),
        "closures": _list(_object(closure)),
        "freedom": _object(freedom),
        "assembly": _object({"status": {"enum": ["assembled", "open"]}, "message": _maybe(TEXT)}),
        "ok": FLAG,
    }


def _limits() -> dict[str, Any]:
    row = {"joint": TEXT, "quantity": TEXT, "unit": TEXT, "worst": NUMBER, "limit": _maybe(NUMBER)}
    row |= {"ratio": _maybe(NUMBER), "at": NUMBER, "broken": FLAG}
    return {
        "robot": TEXT,
        "file": TEXT,
        "trajectory": TEXT,
        "kept": FLAG,
        "broken": WHOLE,
        "time": _object(GRID),
        "held": {"type": "object", "additionalProperties": NUMBER},
        "limits": _list(_object(row)),
        "written": _maybe(TEXT),
    }


def record_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of the results of commands, and of the errors and warnings beside them.

    Examples
    --------
    >>> sorted(record_schema()["$defs"])
    ['check', 'complaint', 'inspect_mechanism', 'inspect_robot', 'new', 'new_list', 'run', 'simulate']
    """
    energy = _object({"start": _maybe(NUMBER), "largest_change": _maybe(NUMBER)})
    moved = _motion() | {"mobility": TEXT, "steps": WHOLE, "energy": energy, "drift": _maybe(NUMBER)}
    starter = _object({"name": TEXT, "about": TEXT, "command": TEXT})
    problem = _object({
        "kind": TEXT, "message": TEXT, "file": _maybe(TEXT), "line": _maybe(WHOLE), "name": _maybe(TEXT),
        "value": {}, "text": TEXT,
    })  # fmt: skip
    found = {
        "run": _head("run", _motion(), about="jounce run --json"),
        "simulate": _head("simulate", moved, about="jounce simulate --json"),
        "inspect_mechanism": _head("inspect", _mechanism(), about="jounce inspect --json of a mechanism file"),
        "inspect_robot": _head("inspect", _robot(), about="jounce inspect --json of a robot file"),
        "check": _head("check", _limits(), about="jounce check --json"),
        "new_list": _head("new", {"starters": _list(starter)}, about="jounce new --json"),
        "new": _head("new", {"name": TEXT, "written": TEXT, "next": NAMES}, about="jounce new NAME --json"),
    }
    complaint = {
        "description": "one line on standard error, beside --json",
        "oneOf": [_object({"error": problem}), _object({"warning": problem})],
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Results of jounce",
        "description": "Numbers are in SI units; null stands for a number that is not known or not finite.",
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in found],
        "$defs": {**found, "complaint": complaint},
    }
