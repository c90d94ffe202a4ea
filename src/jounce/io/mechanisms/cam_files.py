"""Plate cams from files: the follower, its law, and the base circle."""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Iterable
from os import PathLike
from types import SimpleNamespace
from typing import Any

from pydantic_core import PydanticCustomError

from jounce.errors import (
    JounceError,
    MechanismFileError,
    UnitWarning,
    check_choice,
    check_name,
    did_you_mean,
    warn_caller,
)
from jounce.io.files.located_data import Source
from jounce.io.files.samples import rates, read_samples
from jounce.io.files.source import read_source
from jounce.io.mechanisms.schema.unit_hints import is_thousandfold
from jounce.io.mechanisms.values.motion_values import Samples, motion
from jounce.kinematics import OscillatingFollower, PlateCam, TranslatingFollower, plate_cam
from jounce.kinematics.cams.plate_cams import SIGNS
from jounce.mechanism.laws.angle_laws import IN_SI
from jounce.mechanism.resolve import resolve_motion
from jounce.settings import under_own_settings
from jounce.trajectory import AbstractMotion, Expression, SplineMotion
from jounce.trajectory.law_checks.unit_doubts import values_of
from jounce.units.assignments import assignments
from jounce.units.dimensions import Dimension
from jounce.units.expression import check_parameter_name

FAR_OFF = 20.0  # ratio to the other lengths of a cam, which are more alike than those of a mechanism
KEYS = ("title", "parameters", "units", "cam", "follower", "law")
CAM_KEYS = ("base_radius", "sense", "count")
FOLLOWERS = {
    "translating": (TranslatingFollower, ("radius", "offset")),
    "oscillating": (OscillatingFollower, ("center_distance", "arm", "radius", "face_offset")),
}


@under_own_settings
def load_cam(
    path: str | PathLike[str],
    *,
    allow: Iterable[str | PathLike[str]] = (),
    set_: Iterable[str] = (),
    count: int | None = None,
) -> PlateCam:
    """Read a plate cam from a YAML, TOML or JSON file.

    Parameters
    ----------
    path
        A file with the keys ``cam`` (``base_radius``, ``sense``, ``count``), ``follower`` (``type`` translating or
        oscillating, ``shape``, and its lengths), ``law``, and optional ``title``, ``parameters`` and ``units``.
    allow
        Folders besides that of the file below which sample files may lie.
    set_
        Parameters as ``NAME=VALUE``, instead of those of the file.
    count : int, optional
        Number of points of the table, instead of that of the file.

    Returns
    -------
    PlateCam
        Cam with the units of the file.

    Raises
    ------
    MechanismFileError
        If the file cannot be read or contains an error: the message names the file, the line, the entry and the value.

    Examples
    --------
    >>> import jounce as jn
    >>> cam = jn.cams.load_cam("examples/cams/intake.yaml")
    >>> cam.follower.shape, cam.units["length"]
    ('roller', 'mm')
    """
    return _CamFile(read_source(path, allow, kind="cam"), set_).cam(count)


class _CamFile:
    """Reads the parts of a cam from the data of a file; every error names the file, the line and the entry."""

    def __init__(self, source: Source, given: Iterable[str]):
        self.source, self.data = source, source.mapping((), KEYS)
        self.parameters: dict[str, float] = {}
        self.dimensions: dict[str, Dimension] = {}
        assigned = assignments(
            given, "--set", "a parameter is set by NAME=VALUE, such as 'lift=12 mm'", MechanismFileError
        )
        parameters = source.mapping(("parameters",)) if "parameters" in self.data else {}
        for name in assigned:
            check_name("parameter", name, parameters, MechanismFileError, name="--set")
        for name, raw in parameters.items():
            location = ("parameters", name)
            check_parameter_name(name, source.error_type, **source.error_fields(location))
            value = source.value(location, assigned.get(name, raw), "any", self.parameters, self.dimensions)
            if value.dimension is not None:
                self.dimensions[name] = value.dimension
            number = value.value
            self.parameters[name] = float(
                number.evaluate(self.parameters) if isinstance(number, Expression) else number
            )

    def cam(self, count: int | None) -> PlateCam:
        """Return the cam."""
        for key in ("cam", "follower", "law"):
            if key not in self.data:
                raise self.source.error("is missing", (key,))
        body = self.source.mapping(("cam",), CAM_KEYS)
        base = self._length(("cam", "base_radius"), body)
        sense = body.get("sense", "counterclockwise")
        check_choice("sense", sense, SIGNS, self.source.error_type, **self.source.error_fields(("cam", "sense")))
        follower = self._follower()
        law = self._law("angle" if follower.turning else "length")
        self._warn_of_lengths(base, follower, law)
        title = self.data.get("title", "")
        points = body.get("count", 721) if count is None else count
        try:
            profile = plate_cam(law, follower, base, sense=sense, count=points, title=str(title))
        except JounceError as error:
            place = {"law": ("law",), "count": ("cam", "count"), "base_radius": ("cam", "base_radius")}
            location = place.get(str(error.name), ("follower", str(error.name)))
            raise self.source.error(error.message, location, value=error.value) from None
        try:
            profile = dataclasses.replace(profile, units=self.data.get("units") or {})
            _ = profile.shown_units
        except JounceError as error:
            raise self.source.error(error.message, tuple(str(error.name).split(".")), value=error.value) from None
        return profile

    def _warn_of_lengths(
        self, base: float, follower: TranslatingFollower | OscillatingFollower, law: AbstractMotion
    ) -> None:
        """Warn of a lift, or of a length without a unit, that resembles the others only in millimeters."""
        fields = {("follower", field.name): getattr(follower, field.name) for field in dataclasses.fields(follower)}
        lengths: dict[tuple[str, ...], float] = {("cam", "base_radius"): base}
        lengths |= {location: abs(x) for location, x in fields.items() if isinstance(x, int | float) and x}
        if not follower.turning and (values := values_of(law, 0.0, 2 * math.pi)) is not None and values.any():
            lengths["law",] = float(abs(values).max())
        for location, length in lengths.items():
            other_lengths = [x for place, x in lengths.items() if place != location]
            if not other_lengths or (location != ("law",) and not self._is_plain(self.source.at(location))):
                continue
            if is_thousandfold(length, typical := statistics.median(other_lengths), FAR_OFF):
                times, prefix = float(f"{length / typical:.1g}"), "goes to " if location == ("law",) else ""
                phrase = f"{prefix}{length:.4g} m, {times:g} times the other lengths: {length:.4g} mm? {IN_SI}"
                fault = self.source.error(phrase, location)
                warn_caller(UnitWarning(str(fault)))

    def _is_plain(self, raw: Any) -> bool:
        """Return whether a length is a number without a unit, or a parameter with such a value."""
        return isinstance(
            (self.data.get("parameters") or {}).get(raw, raw) if isinstance(raw, str) else raw, int | float
        )

    def _length(self, location: tuple[str, ...], data: dict[str, Any]) -> float:
        if location[-1] not in data:
            raise self.source.error("is missing", location)
        value = self.source.value(location, data[location[-1]], "length", self.parameters, self.dimensions).value
        return float(value.evaluate(self.parameters) if isinstance(value, Expression) else value)

    def _follower(self) -> TranslatingFollower | OscillatingFollower:
        data = self.source.mapping(("follower",))
        kind = data.get("type")
        if kind not in FOLLOWERS:
            hint = did_you_mean(kind, FOLLOWERS)
            raise self.source.error(f"must be the type of a follower; {hint}", ("follower", "type"), value=kind)
        follower_class, keys = FOLLOWERS[kind]
        self.source.mapping(("follower",), ("type", "shape", *keys))
        if "shape" not in data:
            raise self.source.error("is missing; valid: knife_edge, roller, flat_face", ("follower", "shape"))
        lengths = {key: self._length(("follower", key), data) for key in keys if key in data}
        if kind == "oscillating" and "center_distance" not in data:
            raise self.source.error("is missing", ("follower", "center_distance"))
        try:
            return follower_class(data["shape"], **lengths)
        except JounceError as error:
            raise self.source.error(error.message, ("follower", str(error.name)), value=error.value) from None

    def _law(self, quantity: str) -> AbstractMotion:
        """Return the law as a function of the cam angle, with numbers in the place of parameters."""
        context = {"names": self.parameters, "dimensions": self.dimensions, "uses": {}, "lapse": "angle"}
        check = motion(quantity, {"t": (("angle", 1),)}).__metadata__[0].function
        try:
            law = check(self.data["law"], SimpleNamespace(context=context, data={}))
        except PydanticCustomError as error:
            details = error.context or {}
            value = self.data["law"] if details["value"] is ... else details["value"]
            raise self.source.error(details["message"], ("law", *details["at"]), value=value) from None
        if isinstance(law, Samples):
            law = self._spline(law, quantity)
        if not isinstance(law, AbstractMotion | Expression | float | int):
            raise self.source.error("a cam has a law of its own angle: an expression, samples, or segments", ("law",))
        try:
            return resolve_motion(law, self.parameters)
        except JounceError as error:
            raise self.source.error(error.message, ("law",), value=error.value) from None

    def _spline(self, samples: Any, quantity: str) -> AbstractMotion:
        if samples.derivative or samples.of is not None:
            key = "derivative" if samples.derivative else "of"
            raise self.source.error("a cam takes samples of the lift by its own angle", ("law", key))

        def law(path: str) -> SplineMotion:
            allowed = (rates(("angle",), 0), rates((quantity,), 0))
            table = read_samples(path, samples.time, samples.value, allowed=allowed)
            return SplineMotion(*table, degree=samples.degree, beyond="repeat")

        return self.source.read_named(samples.samples, ("law",), law)
