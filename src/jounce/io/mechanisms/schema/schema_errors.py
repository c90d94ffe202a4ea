"""Errors of pydantic as one sentence with file, line, dotted name and value."""

from __future__ import annotations

from typing import Any

from jounce.constraints import catalogue
from jounce.errors import JounceError, did_you_mean, no_such
from jounce.io.files.located_data import Location, Source
from jounce.io.mechanisms.schema.key_check import ROLES, unknown_key, unknown_type
from jounce.io.mechanisms.schema.keys import file_keys, is_cam
from jounce.io.mechanisms.schema.models import file_model, output_form
from jounce.io.mechanisms.schema.output_types import output_holder, output_types


def first_problem(source: Source, space: str, problems: list[Any]) -> JounceError:
    """Return the error for the first problem in a file; an unknown key precedes the missing one that it misspells.

    Parameters
    ----------
    source : Source
        Source of the file.
    space : str
        planar or spatial.
    problems : list of dict
        Problems from ``pydantic.ValidationError.errors()``.
    """
    ranks = {"extra_forbidden": 0, "missing": 2}

    def rank(problem: Any) -> tuple[int, int]:
        return ranks.get(problem["type"], 1), source.line(_location(problem)) or 0

    return _word(source, space, min(problems, key=rank))


def _location(problem: Any) -> Location:
    """Return the location of a problem in the file: without the tags of pydantic, and with the entry within a value."""
    location: Location = problem["loc"]
    if location and location[-1] == "[key]":
        location = location[:-1]
    if len(location) > 2 and location[0] in (*ROLES, "outputs"):
        location = (*location[:2], *location[3:])
    return (*location, *problem.get("ctx", {}).get("at", ()))


def _word(source: Source, space: str, problem: Any) -> JounceError:
    location, value, context = _location(problem), problem["input"], problem.get("ctx", {})
    match problem["type"]:
        case "jounce":
            message = context["value"]
            return source.error(context["message"], location, value=value if message is ... else message)
        case "extra_forbidden":
            return unknown_key(source, space, location, _valid_keys(source, space, location[:-1]))
        case "missing":
            return source.error("is missing", location)
        case "union_tag_not_found" | "union_tag_invalid" if not isinstance(value, dict):
            return source.error("must be a mapping", location, value=value)
        case "union_tag_not_found" | "union_tag_invalid":
            return _unknown_type(source, space, location, value)
        case "dict_type" | "model_type" | "model_attributes_type":
            return source.error("must be a mapping", location, value=value)
        case "literal_error":
            return source.error(f"must be {context['expected']}", location, value=value)
    return source.error(f"is not valid: {problem['msg']}", location, value=value)


def _valid_keys(source: Source, space: str, parent: Location) -> list[str]:
    """Return the valid keys of the mapping at a location."""
    if not parent:
        return [field.alias for field in file_model(space).model_fields.values()]  # type: ignore[misc]
    kind = parent[0]
    if kind == "time":
        return ["start", "stop", "step", "count"]
    if kind == "bodies":
        attitude = "angle" if space == "planar" else "orientation"
        return ["position", attitude, "mass", "inertia", "center_of_mass"]
    entry = source.data[parent[0]][parent[1]]
    if kind == "outputs":
        quantity, output = output_types(space)[output_form(entry)]
        keys = dict.fromkeys([output_holder(output), *(["quantity"] if quantity else [])])
        return list(keys | dict.fromkeys(key.key for key in file_keys(output)))
    role = "driver" if kind == "joints" and is_cam(space, entry) else ROLES[str(kind)]
    constraint = catalogue(space, role)[entry["type"]]
    return ["type", "body" if constraint.body_count == 1 else "bodies", *(key.key for key in file_keys(constraint))]


def _unknown_type(source: Source, space: str, location: Location, entry: dict[str, Any]) -> JounceError:
    """Return the error for a joint, driver, force or output of an unknown type."""
    if location[0] == "outputs":
        return _unknown_output(source, space, location, entry)
    return unknown_type(source, space, location, entry, catalogue)


def _unknown_output(source: Source, space: str, place: Location, entry: dict[str, Any]) -> JounceError:
    quantity, forms = entry.get("quantity"), output_types(space)
    quantities = {word for word, _ in forms.values() if word}
    location = (*place, "quantity")
    for holder in ("driver", "joint", "force"):
        if holder in entry:
            valid = [word for word, kind in forms.values() if word and output_holder(kind) == holder]
            if quantity is None:
                return source.error(f"is missing; valid: {', '.join(sorted(set(valid)))}", location)
            message = f"a {holder} has no such quantity; {did_you_mean(quantity, valid)}"
            return source.error(message, location, value=quantity)
    if quantity in ("force", "torque", "reaction"):
        message = "name a driver, joint or force, as in {driver: theta, quantity: torque}"
        return source.error(message, location, value=quantity)
    if isinstance(quantity, str) and quantity in quantities:
        body = "bodies: [i, j]" if "bodies" not in entry else "body"
        return source.error(f"in {space} space the quantity '{quantity}' takes {body}", place, value=entry)
    if quantity is None:
        message = "give a point of one body, or a quantity"
        return source.error(f"{message}; {did_you_mean('', quantities)}", place, value=entry)
    return source.error(no_such("output", quantity, quantities, "quantity"), location, value=quantity)
