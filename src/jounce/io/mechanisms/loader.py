"""Reading of mechanism files."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from typing import Any

import numpy as np

from jounce.base import importing
from jounce.constraints import catalogue
from jounce.constraints.facts import at_coordinate
from jounce.errors import JounceError, MechanismFileError, unknown
from jounce.io.files.located_data import Location, Source
from jounce.io.files.source import read_source
from jounce.io.mechanisms.file_cams import CamEntry, coordinates_by_name, with_leaders
from jounce.io.mechanisms.file_laws import FileLaws
from jounce.io.mechanisms.schema.key_check import ROLES
from jounce.io.mechanisms.schema.keys import FileKey, file_keys, location_of
from jounce.io.mechanisms.schema.unit_hints import warn_of_units
from jounce.mechanism import Body, Mechanism, TimeGrid, time_grid, with_output_drivers
from jounce.mechanism.building.starting_guess import starting_guess
from jounce.mechanism.masses import body_mass
from jounce.mechanism.redundant_reactions import resolved_reactions
from jounce.mechanism.resolve import resolve, resolve_element
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.mechanism.transmissions.gear_frames import check_distances
from jounce.rigid.euler_parameters import euler_parameters
from jounce.settings import under_own_settings
from jounce.trajectory import Expression
from jounce.units.values import stated_dimensions

_Locations = dict[str, tuple[Location, tuple[FileKey, ...]]]
"""Locations in the file, and keys, of the elements of a mechanism, by dotted name."""


@under_own_settings
def load(path: str | PathLike[str], *, allow: Iterable[str | PathLike[str]] = ()) -> Mechanism:
    """Read a mechanism from a YAML, TOML or JSON file.

    Parameters
    ----------
    path
        File ending in .yaml, .yml, .toml or .json. Its values are in SI units unless they state others.
    allow
        Folders besides that of the file below which sample files may lie.

    Returns
    -------
    Mechanism
        Mechanism, with the instants of the time grid of the file, if any.

    Raises
    ------
    MechanismFileError
        If the file cannot be read or contains an error: the message names the file, the line, the entry and the value,
        and the nearest valid name instead of an unknown one.

    Warns
    -----
    UnitWarning
        If a number without a unit is likely in degrees or millimeters.

    Examples
    --------
    >>> import jounce as jn
    >>> mechanism = jn.load("examples/four_bar.yaml")
    >>> list(mechanism.bodies)
    ['crank', 'rocker']
    """
    source = read_source(path, allow)
    space = _space(source)
    model = _validate(source, space)
    locations: _Locations = {}
    try:
        mechanism = _build(source, space, model, locations)
        _check_values(mechanism)
    except MechanismFileError:
        raise
    except JounceError as error:
        location = _find(error.name, locations)
        located = location if source.line(location) is not None else ()
        raise source.error(error.message, located or location, value=error.value) from None
    warn_of_units(source, mechanism)
    return mechanism


def _space(source: Source) -> str:
    """Return the space of a file, which decides how its other keys are read."""
    if not isinstance(source.data, dict):
        raise source.error("a mechanism file is a mapping with the keys space, bodies, joints, ...", value=source.data)
    source.data = {key: value for key, value in source.data.items() if value is not None or key == "space"}
    if "space" not in source.data:
        raise source.error("is missing; valid: planar, spatial", ("space",))
    space = source.data["space"]
    if not isinstance(space, str) or space not in POSITION_COMPONENTS:
        raise source.error(unknown("space", space, POSITION_COMPONENTS), ("space",), value=space)
    return space


def _validate(source: Source, space: str) -> dict[str, Any]:
    """Return the values of a file by key, checked against the schema, with numbers and expressions for text."""
    with importing.lock:  # the schema imports all subpackages that define outputs
        from pydantic import ValidationError

        from jounce.io.mechanisms.schema.models import file_model
        from jounce.io.mechanisms.schema.schema_errors import first_problem

    parameters = source.data.get("parameters")
    names = dict.fromkeys(parameters if isinstance(parameters, dict) else ())  # a dictionary for fast look-up
    bodies = source.data.get("bodies", {})
    if not bodies:
        raise source.error("a mechanism needs at least one moving body", ("bodies",), value=bodies)
    context = {
        "names": names,
        "bodies": dict.fromkeys(("ground", *(bodies if isinstance(bodies, dict) else ()))),
        "dimensions": stated_dimensions(parameters) if isinstance(parameters, dict) else {},
        "uses": dict.fromkeys(names, ()),
        "drivers": _driven_quantities(source.data.get("drivers"), space),
        "outputs": outputs if isinstance(outputs := source.data.get("outputs"), dict) else {},
    }
    driven = _driven_quantities(source.data.get("initial"), space) | context["drivers"]
    context["leaders"] = coordinates_by_name(source.data, space, driven)
    try:
        model = file_model(space).model_validate(source.data, context=context)
    except ValidationError as error:
        raise first_problem(source, space, error.errors(include_url=False)) from None
    uses = {name: allowed for name, allowed in context["uses"].items() if allowed}
    dimensions = uses | {name: (dimension,) for name, dimension in context["dimensions"].items()}
    return _plain(model) | {"dimensions": dimensions, "stated": frozenset(context["dimensions"])}


def _driven_quantities(drivers: object, space: str) -> dict[str, str]:
    """Return the kinds of the coordinates of drivers by name: an angle, a length, or any if not known yet."""
    kinds, quantities = dict(catalogue(space, "driver")), {}
    for name, raw in drivers.items() if isinstance(drivers, dict) else ():
        given = raw if isinstance(raw, dict) else {}
        kind = kinds.get(str(given.get("type")))
        quantity = next((key.quantity for key in file_keys(kind) if key.kind == "motion"), "any") if kind else "any"
        quantities[name] = at_coordinate(quantity, given.get("coordinate"))
    return quantities


def _plain(model: Any) -> dict[str, Any]:
    """Return the values of a model by the keys of the file, without converting nested models."""
    return {field.alias: getattr(model, name) for name, field in type(model).model_fields.items()}


def _build(source: Source, space: str, model: dict[str, Any], locations: _Locations) -> Mechanism:
    parameters = model["parameters"]
    skeleton = Mechanism(
        space=space, bodies={"any": Body([0.0] * POSITION_COMPONENTS[space])}, joints={}, parameters=parameters
    )
    try:
        values = skeleton.parameter_values
    except JounceError as error:
        raise error.located(name="parameters") from None
    laws = FileLaws(source, {name: _plain(driver) for name, driver in model["drivers"].items()})
    elements = {kind: _elements(laws, space, kind, model[kind], locations) for kind in (*ROLES, "outputs")}
    return Mechanism(
        space=space,
        bodies={name: _body(source, space, name, _plain(body), values) for name, body in model["bodies"].items()},
        **with_leaders(source, space, elements),
        parameters=parameters,
        gravity=model["gravity"],
        time=TimeGrid(**_plain(model["time"])) if model["time"] is not None else None,
        redundant_reactions=model["redundant_reactions"],
        title=model["title"],
        units=model["units"],
        assembly=model["assembly"],
        dimensions=model["dimensions"],
        stated=model["stated"],
    )


def _body(source: Source, space: str, name: str, given: dict[str, Any], parameters: dict[str, Any]) -> Body:
    """Return a body; values that depend on parameters remain expressions."""
    if isinstance(given["inertia"], dict):
        from jounce.io.mechanisms.values.inertia_forms import expanded

        try:
            given |= expanded(given, parameters, planar=space == "planar")
        except JounceError as error:
            key = ("mass",) if error.name == "mass" else ("inertia", *([error.name] if error.name else []))
            raise source.error(error.message, ("bodies", name, *key), value=error.value) from None
    form = given.get("orientation")
    if form is not None and not any(isinstance(x, Expression) for v in form.values() for x in np.ravel(v)):
        try:
            given["orientation"] = euler_parameters(form)
        except JounceError as error:
            raise source.error(error.message, ("bodies", name, "orientation"), value=error.value) from None
    return Body(**given)


def _arguments(keys: tuple[FileKey, ...], given: dict[str, Any]) -> dict[str, Any]:
    """Return values by field, given those by key, without the keys that are not given."""
    arguments = {}
    for key in keys:
        value = given[key.key]
        if value is not None:
            arguments |= dict(zip(key.fields, value if len(key.fields) > 1 else (value,), strict=True))
    return arguments


def _elements(
    laws: FileLaws, space: str, section: str, models: dict[str, Any], locations: _Locations
) -> dict[str, Any]:
    """Return joints, drivers, forces or outputs by name, and record the locations of their fields."""
    from jounce.io.mechanisms.schema.output_types import output_types  # the schema is imported by now

    outputs = {f"{space}_{tag.replace(' ', '_')}": kind for tag, (_, kind) in output_types(space).items()}
    elements = {}
    for name, model in models.items():
        given, name_in_file = _plain(model), f"{section}.{name}"
        cam = type(model).__name__.endswith("_cam") and section == "joints"
        if section == "outputs":
            kind: Any = outputs[type(model).__name__]
        else:
            kind = catalogue(space, "driver" if cam else ROLES[section])[given["type"]]
        locations[name_in_file] = ((section, name), file_keys(kind))
        arguments = _arguments(locations[name_in_file][1], given)
        leader = ""
        if cam:
            arguments["motion"], leader = laws.of_cam((section, name, "motion"), arguments["motion"])
        arguments = {field: laws.law((section, name, field), x) for field, x in arguments.items()}
        if kind.body_count:
            arguments["bodies"] = given["bodies"] if kind.body_count > 1 else (given["body"],)
        try:
            elements[name] = CamEntry(kind(**arguments), leader) if cam else kind(**arguments)
        except JounceError as error:  # a constructor names its field only
            error.name = f"{name_in_file}.{error.name}" if error.name else name_in_file
            raise
    return elements


def _check_values(mechanism: Mechanism) -> None:
    """Raise an error for values that the parameters make invalid: not finite, lengths not positive, zero axes."""
    mechanism = with_output_drivers(mechanism)
    parameters, components = mechanism.parameter_values, POSITION_COMPONENTS[mechanism.space]
    for kind, elements in mechanism.elements.items():
        for name, element in elements.items():
            resolve_element(element, parameters, components, f"{kind}.{name}")
    check_distances(mechanism)
    starting_guess(mechanism, parameters, components)
    for name, body in mechanism.rigid_bodies.items():
        body_mass(name, body, parameters, components)
    try:
        resolve(mechanism.gravity, parameters)
    except JounceError as error:
        raise error.located(name="gravity") from None
    resolved_reactions(mechanism.redundant_reactions, parameters)
    if mechanism.time is not None:
        time_grid(mechanism.time, parameters)


def _find(name: str | None, locations: _Locations) -> Location:
    """Return the location in the file of a dotted name of the mechanism."""
    if not name:
        return ()
    for owner, (location, keys) in locations.items():
        if name.startswith(f"{owner}."):
            return (*location, *location_of(keys, name.removeprefix(f"{owner}.")))
        if name == owner:
            return location
    return tuple(name.split("."))
