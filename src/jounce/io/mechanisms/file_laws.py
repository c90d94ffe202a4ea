"""Laws of a mechanism file: samples are read from their files, and names of drivers resolved to their laws."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jounce.io.files.located_data import Location
from jounce.io.files.source import Source
from jounce.io.mechanisms.values.curve_values import CurveOfCam
from jounce.trajectory import (
    AbstractMotion,
    Expression,
    FollowingMotion,
    MeasuredMotion,
    OutputMotion,
    SampledCurve,
    SplineMotion,
)


class FileLaws:
    """Resolves the laws of a file.

    Parameters
    ----------
    source : Source
        Source of the file.
    drivers : dict of str to dict
        Values of the drivers by key, as the schema gives them; other laws may follow their laws.
    """

    def __init__(self, source: Source, drivers: Mapping[str, Any]):
        self.source, self.drivers = source, drivers

    def law(self, location: Location, value: Any, chain: tuple[str, ...] = ()) -> Any:
        """Return a value with samples and followed drivers resolved to laws, also within a list of laws.

        Parameters
        ----------
        location : tuple
            Location of the value in the file.
        value : object
            Value as the schema gives it.
        chain : tuple of str, optional
            Drivers that depend on the law.
        """
        if isinstance(value, tuple):
            return tuple(self.law((*location, index), entry, chain) for index, entry in enumerate(value))
        if isinstance(value, AbstractMotion):
            return value
        if hasattr(value, "file"):
            return self._curve(location, value)
        if isinstance(value, CurveOfCam):
            return self._curve_of_cam(location, value)
        if hasattr(value, "held"):
            fixed = self.law((*location, "law"), value.held, chain)
            return OutputMotion(value.output, fixed if isinstance(fixed, AbstractMotion | Expression) else repr(fixed))
        if hasattr(value, "samples"):
            law, leader = self._spline(location, value), value.of
        elif hasattr(value, "driver"):
            law, leader = value.law, value.driver
        else:
            return value
        if leader is None:
            return law
        return FollowingMotion(law, self._leader(location, leader, chain) if isinstance(leader, str) else leader)

    def _curve(self, location: Location, given: Any) -> SampledCurve:
        from jounce.io.files.samples import read_points

        def through(path: str) -> SampledCurve:
            return SampledCurve(read_points(path)[1], given.closed, given.degree)

        return self.source.read_named(given.file, location, through)

    def _curve_of_cam(self, location: Location, given: CurveOfCam) -> SampledCurve:
        from jounce.io.mechanisms.cam_files import load_cam

        def path_of(file: str) -> SampledCurve:
            profile = load_cam(file)
            if profile.follower.is_flat:
                message = (
                    "the contact point moves along a flat face, and is not a fixed point on a curve: give the law of "
                    "the follower with of: under joints"
                )
                raise self.source.error(message, (*location, "cam"), value=given.cam)
            return SampledCurve(profile.table.pitch.T[:-1], closed=True)

        return self.source.read_named(given.cam, (*location, "cam"), path_of)

    def of_cam(self, location: Location, value: Any) -> tuple[Any, str]:
        """Return the law of a cam as a function of its leader, and the name of the leader."""
        if hasattr(value, "samples"):
            return self._spline(location, value), value.of
        return value.law, value.driver

    def _leader(self, location: Location, name: str, chain: tuple[str, ...]) -> AbstractMotion | Expression:
        """Return the law of a driver by its name."""
        names = (str(location[1]),) if location[0] == "drivers" and not chain else chain
        circle = (*names, name)
        if name in names:
            message = f"drivers follow each other in a circle: {' -> '.join(circle)}"
            raise self.source.error(message, (*location, "of"), value=name)
        given = self.law(("drivers", name, "motion"), self.drivers[name]["motion"], circle)
        if isinstance(given, OutputMotion):
            message = (
                f"has the law of the output {given.output}, and none of its own; solve the mechanism "
                f'without this driver, and give {name} the law that is found, motion.driver_law("{name}")'
            )
            raise self.source.error(message, (*location, "of"), value=name)
        return given if isinstance(given, AbstractMotion | Expression) else Expression(repr(float(given)))

    def _spline(self, location: Location, samples: Any) -> SplineMotion:
        from jounce.io.files.samples import read_samples

        def law(path: str) -> SplineMotion:
            table = read_samples(path, samples.time, samples.value, allowed=samples.dimensions)
            given = {"degree": samples.degree, "beyond": samples.beyond}
            if samples.derivative:
                return MeasuredMotion(*table, samples.derivative, samples.initial, **given)
            return SplineMotion(*table, **given)

        return self.source.read_named(samples.samples, location, law)
