"""Mechanisms as the data of a mechanism file, with every joint, driver, force, output and mass known to files."""

from __future__ import annotations

import dataclasses
import numbers
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from jounce.base.shapes import seconds
from jounce.constraints import Cam, catalogue
from jounce.constraints.base import value_fields
from jounce.errors import MechanismError
from jounce.io.mechanisms.schema.key_check import ROLES
from jounce.io.mechanisms.schema.keys import file_keys
from jounce.io.mechanisms.schema.output_types import OUTPUTS, output_holder
from jounce.io.mechanisms.writing.written_laws import WrittenLaws
from jounce.io.mechanisms.writing.written_values import plain, plain_number
from jounce.mechanism import Body, Mechanism, TimeGrid, time_grid
from jounce.mechanism.building.preconditions import concrete
from jounce.mechanism.laws.cam_laws import leader_name
from jounce.mechanism.mechanism import check_mechanism
from jounce.mechanism.outputs.derivative_outputs import form_of
from jounce.settings import under_own_settings
from jounce.units.dimensions import si_unit


@under_own_settings
@concrete
def write_mechanism(mechanism: Mechanism, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write a mechanism to a YAML, TOML or JSON file that `load` reads.

    Values are written in SI units, expressions unchanged; parameters that were given with a unit have one. Splines
    through samples go to CSV files beside the file.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism built in Python, read from a file, or derived from a robot (`Robot.mechanism`).
    path
        File ending in .yaml, .yml, .toml or .json; an existing file is replaced.
    overwrite
        Whether a written file may be one that this process has read as an input.

    Raises
    ------
    MechanismError
        If a part of the mechanism cannot be written to a file, such as a Python function.
    OutputError
        If the file cannot be written, or is an input; then nothing is written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import jounce as jn
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "four_bar.toml"
    ...     jn.write_mechanism(jn.load("examples/four_bar.yaml"), path)
    ...     jn.load(path) == jn.load("examples/four_bar.yaml")
    True
    """
    from jounce.io.files import DATA_FILES
    from jounce.io.files.dumping import dumped
    from jounce.io.files.writing import check_target, replacing

    check_mechanism(mechanism)
    check_target(path, DATA_FILES, "mechanism file", overwrite=overwrite)
    data, samples = mechanism_data(mechanism, Path(path).stem)
    text = dumped(data, Path(path).suffix.lower(), str(path))
    tables = {Path(path).parent / name: columns for name, columns in samples.items()}
    for table_file in tables:  # all checks before the first replacement
        check_target(table_file, overwrite=overwrite)
    for table_file, columns in tables.items():
        rows = "".join(f"{','.join(map(repr, row))}\n" for row in zip(*columns.values(), strict=True))
        with replacing(table_file, overwrite=overwrite) as scratch:
            scratch.write_text(f"{','.join(columns)}\n{rows}", encoding="utf-8")
    with replacing(path, overwrite=overwrite) as scratch:
        scratch.write_text(text, encoding="utf-8")


def mechanism_data(mechanism: Mechanism, stem: str = "mechanism") -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the data of a mechanism file, and the samples of its splines.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism to be written.
    stem : str
        Prefix of the names of sample files.

    Returns
    -------
    data : dict
        Mappings, lists, numbers and text by the keys of the schema.
    samples : dict of str to dict of str to list
        Columns by name, for each CSV file: times, s, and values of splines, or coordinates of points, m.

    Raises
    ------
    MechanismError
        If a part of the mechanism cannot be written to a file.

    Examples
    --------
    >>> import jounce as jn
    >>> data, _ = mechanism_data(jn.load("examples/four_bar.yaml"))
    >>> data["joints"]["BC"]
    {'type': 'double_revolute', 'bodies': ['crank', 'rocker'], 'points': [['AB', 0], ['CD', 0]], 'length': 'BC'}
    """
    return _Writer(mechanism, stem).data()


class _Writer:
    def __init__(self, mechanism: Mechanism, stem: str):
        self.mechanism = mechanism
        self.laws = WrittenLaws(stem, mechanism.drivers)

    def data(self) -> tuple[dict[str, Any], dict[str, Any]]:
        mechanism = self.mechanism
        data: dict[str, Any] = {"title": mechanism.title} if mechanism.title else {}
        data["space"] = mechanism.space
        if mechanism.units:
            data["units"] = dict(mechanism.units)
        if mechanism.gravity is not None:
            data["gravity"] = plain(mechanism.gravity, "gravity")
        if mechanism.parameters:
            data["parameters"] = {name: self._parameter(name, x) for name, x in mechanism.parameters.items()}
        data["bodies"] = {name: self._body(name, body) for name, body in mechanism.rigid_bodies.items()}
        if mechanism.assembly is not None:
            data["assembly"] = mechanism.assembly
        for section in ROLES:
            elements = getattr(mechanism, section)
            if elements:
                data[section] = {name: self._element(section, name, x) for name, x in elements.items()}
        if mechanism.outputs:
            data["outputs"] = {name: self._output(name, x) for name, x in mechanism.outputs.items()}
        if mechanism.redundant_reactions != "unique":
            data["redundant_reactions"] = plain(mechanism.redundant_reactions, "redundant_reactions")
        if mechanism.time is not None:
            data["time"] = _time(mechanism.time)
        return data, self.laws.samples

    def _parameter(self, name: str, value: Any) -> Any:
        """Return the value of a parameter, with its unit if it was given with one."""
        written = plain(value, f"parameters.{name}")
        allowed = self.mechanism.dimensions.get(name, ()) if name in self.mechanism.stated else ()
        return written if len(allowed) != 1 or isinstance(written, str) else f"{written!r} {si_unit(allowed[0])}"

    def _body(self, name: str, body: Body) -> dict[str, Any]:
        location = f"bodies.{name}"
        entries = {"position": plain(body.position, f"{location}.position")}
        if self.mechanism.space == "planar":
            entries["angle"] = plain(body.angle, f"{location}.angle")
        elif body.orientation is not None:
            given = body.orientation
            form = given if isinstance(given, Mapping) else {"quaternion": given}
            entries["orientation"] = plain(form, f"{location}.orientation")
        for key in ("mass", "inertia", "center_of_mass"):
            value = getattr(body, key)
            if value is not None:
                entries[key] = plain(_tensor(value) if key == "inertia" else value, f"{location}.{key}")
        return entries

    def _element(self, section: str, name: str, element: Any) -> dict[str, Any]:
        if isinstance(element, Cam):
            return self._cam(f"{section}.{name}", element)
        location, kind = f"{section}.{name}", type(element)
        class_of_type = catalogue(self.mechanism.space, ROLES[section]).get(kind.type_name)
        if class_of_type is not kind:
            message = f"the class {kind.__name__} has no type by which a file could name it"
            if class_of_type is not None:
                other = f"{class_of_type.__qualname__} of {class_of_type.__module__}"
                message = f"the type {kind.type_name!r} names another class, {other}; give that one another type"
            raise MechanismError(message, name=location)
        entries: dict[str, Any] = {"type": kind.type_name}
        single = kind.body_count == 1
        entries |= {"body": element.bodies[0]} if single else {"bodies": list(element.bodies)}
        return entries | self._values(location, element)

    def _cam(self, location: str, cam: Cam) -> dict[str, Any]:
        """Return the entry of a cam: the driver with its coordinate, and its law of the leader."""
        driver, leader = cam.follower, leader_name(self.mechanism, cam)
        if leader is None:
            message = (
                "nothing in this mechanism has the coordinate that leads this cam; add a driver or an output of it"
            )
            raise MechanismError(message, name=location)
        entry = {"type": driver.type_name, "bodies": list(driver.bodies), **self._values(location, driver)}
        law = self.laws.written(f"{location}.motion", cam.motion, driver)
        return entry | {"motion": (law if isinstance(law, dict) else {"expression": law}) | {"of": leader}}

    def _output(self, name: str, output: Any) -> dict[str, Any]:
        location, kind = f"outputs.{name}", form_of(output)
        names = [word for word, output_class in OUTPUTS if output_class is kind]
        if not names:
            raise MechanismError(f"the output {kind.__name__} has no form in a file", name=location)
        holder = output_holder(kind)
        entries: dict[str, Any] = {}
        if kind.body_count:
            entries[holder] = output.bodies[0] if holder == "body" else list(output.bodies)
        elif holder == "mechanism":
            entries["mechanism"] = True
        values = self._values(location, output, kind)
        if holder in values:
            entries[holder] = values.pop(holder)
        if names[-1] is not None:  # a joint has two words; reaction rather than force
            entries["quantity"] = names[-1]
        return entries | values

    def _values(self, location: str, element: Any, kind: type[Any] | None = None) -> dict[str, Any]:
        """Return the values of an element by key, without defaults."""
        kind = kind or type(element)
        entries: dict[str, Any] = {}
        fields = value_fields(kind)
        for key in file_keys(kind):
            values = [getattr(element, field) for field in key.fields]
            if not key.required and all(_is_default(x, fields[f]) for x, f in zip(values, key.fields, strict=True)):
                continue
            place = f"{location}.{key.key}"
            if key.kind in ("motion", "law", "laws"):
                written: list[Any] = [self.laws.written(place, x, element) for x in values]
            elif key.kind == "curve":
                written = [self.laws.curve(place, x) for x in values]
            elif key.kind == "nested":
                written = [self._values(place, x) for x in values]
            else:
                written = [plain(value, place) for value in values]
            result = dict(zip(key.names, written, strict=True)) if key.names else written
            entries[key.key] = written[0] if len(written) == 1 else result
        return entries


def _is_default(value: Any, field: Any) -> bool:
    if field.default is dataclasses.MISSING:
        return False
    return value is field.default or (isinstance(value, str | numbers.Real) and value == field.default)


def _tensor(value: Any) -> Any:
    """Return a diagonal matrix of inertia as its principal moments; other matrices exactly symmetric."""
    if not isinstance(value, np.ndarray) or value.shape != (3, 3):
        return value
    upper = np.triu(value)
    return np.diag(value) if not np.triu(value, 1).any() else upper + np.triu(value, 1).T


def _time(time: Any) -> dict[str, Any]:
    if isinstance(time, TimeGrid):
        given = {key: getattr(time, key) for key in ("start", "stop", "step", "count")}
        return {key: plain(value, f"time.{key}") for key, value in given.items() if value is not None}
    instants = seconds("time", time, MechanismError)
    start, stop, count = float(instants[0]), float(instants[-1]), len(instants)
    ends, slack = {"start": plain_number(start, "time"), "stop": plain_number(stop, "time")}, max(abs(start), abs(stop))
    if np.allclose(instants, np.linspace(start, stop, count), rtol=0, atol=1e-12 * slack):
        return ends | {"count": count}
    step = float(instants[1] - start)
    spaced = time_grid(TimeGrid(start, stop, step), {})
    if len(spaced) != count or not np.allclose(instants, spaced, rtol=0, atol=1e-12 * slack):
        raise MechanismError("instants that are not evenly spaced have no form in a file", name="time")
    return ends | {"step": plain_number(step, "time")}
