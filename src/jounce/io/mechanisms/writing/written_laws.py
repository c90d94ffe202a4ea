"""Laws of motion and force as data of a mechanism file; splines go to sample files beside it."""

from __future__ import annotations

import dataclasses
import numbers
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.errors import JounceError, MechanismError
from jounce.forces import ExpressionLaw, TimeLaw, VectorLaw
from jounce.io.mechanisms.writing.written_values import plain, plain_number
from jounce.trajectory import (
    Expression,
    ExpressionMotion,
    FollowingMotion,
    HermiteMotion,
    HermiteSplineMotion,
    IntegratedMotion,
    MeasuredMotion,
    OutputMotion,
    ParametricCurve,
    PiecewiseMotion,
    SampledCurve,
    SegmentedMotion,
    SplineMotion,
    TrapezoidalMotion,
)
from jounce.units.expression import CONSTANTS, FUNCTIONS

_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class WrittenLaws:
    """Converts laws to data of a file, and collects the samples of splines.

    Parameters
    ----------
    stem : str
        Prefix of the names of sample files.
    drivers : dict of str to driver
        Drivers of the mechanism, which other laws may follow by name.

    Attributes
    ----------
    samples : dict of str to dict of str to list
        Columns by name, for each CSV file: times, s, and values of splines, or coordinates of points, m.
    """

    def __init__(self, stem: str, drivers: Mapping[str, Any]):
        self.stem, self.drivers = stem, drivers
        self.samples: dict[str, dict[str, list[float]]] = {}

    def written(self, location: str, law: Any, element: Any) -> Any:
        """Return a law of motion or force as data of a file."""
        if isinstance(law, VectorLaw):
            law = law.parts
        if isinstance(law, (list, tuple, np.ndarray)):
            return [self.written(location, entry, element) for entry in law]
        if isinstance(law, TimeLaw):
            law = law.motion
        if isinstance(law, str | Expression | numbers.Real):
            return plain(law, location)
        if isinstance(law, OutputMotion):
            return {"output": law.output, "law": self.written(f"{location}.law", law.law, element)}
        if isinstance(law, FollowingMotion):
            return self._following(location, law, element)
        if isinstance(law, SegmentedMotion):
            return _segmented(location, law)
        if isinstance(law, PiecewiseMotion):
            return _piecewise(location, law)
        if isinstance(law, IntegratedMotion):
            return self._integrated(location, law, element)
        if isinstance(law, SplineMotion):
            return self._spline(location, law)
        if isinstance(law, ExpressionMotion) or (isinstance(law, ExpressionLaw) and _own_names(law, element)):
            return _substituted(law.expression, law.parameters)
        message = f"a {type(law).__name__} has no form in a file; give an expression, or a spline through samples"
        raise MechanismError(message, name=location)

    def _spline(self, location: str, law: SplineMotion) -> dict[str, Any]:
        """Return a spline as its samples, or as samples that determine it by its degree and breakpoints."""
        if law.degree % 2 == 0 and not isinstance(law, MeasuredMotion):
            message = f"a spline of even degree ({law.degree}) has no form in a file; use an odd degree"
            raise MechanismError(message, name=location)
        if isinstance(law, HermiteMotion | HermiteSplineMotion):
            message = "a law through derivatives has no form in a file; write its values as samples, or another law"
            raise MechanismError(message, name=location)
        name = self._file_of(location)
        times, values = law.samples.value or _samples_of(law)
        self.samples[name] = {"time": np.asarray(times).tolist(), "value": np.asarray(values).tolist()}
        beyond = "hold" if isinstance(law, TrapezoidalMotion) else law.beyond
        if beyond == "continue":
            message = "a law that goes on beyond its data has no form in a file; choose hold, or more data"
            raise MechanismError(message, name=location, value=beyond)
        entry: dict[str, Any] = {"samples": name, "degree": law.degree}
        if isinstance(law, MeasuredMotion):
            entry |= {"degree": law.degree - law.derivative, "derivative": law.derivative}
            entry["initial"] = plain(law.initial.value, f"{location}.initial")
        beyond = "advance" if beyond == "repeat" and float(law.advance) else beyond
        return entry if beyond == "refuse" else entry | {"beyond": beyond}

    def _integrated(self, location: str, law: IntegratedMotion, element: Any) -> dict[str, Any]:
        """Return a law that is given by a derivative."""
        _, given, initial, start = law.recipe.value
        if not isinstance(given, PiecewiseMotion | ExpressionMotion | SegmentedMotion | Expression | str):
            message = f"a {type(given).__name__} as a derivative has no form in a file; give expressions or segments"
            raise MechanismError(message, name=location)
        entry = self.written(location, given, element)
        entry = entry if isinstance(entry, dict) else {"expression": entry}
        values = [plain(x, f"{location}.initial") for x in initial]
        if isinstance(given, SegmentedMotion):
            values.append(entry.pop("initial", 0.0))
        ends = isinstance(given, SegmentedMotion) or (isinstance(given, PiecewiseMotion) and given.beyond != "continue")
        if ends and entry.get("start", 0.0) != plain(start, location):
            message = "a derivative that begins elsewhere than its own law has no form in a file"
            raise MechanismError(message, name=location, value=entry.get("start", 0.0))
        entry |= {"derivative": law.derivative, "initial": values}
        return entry if plain(start, location) == 0.0 else entry | {"start": plain(start, location)}

    def curve(self, location: str, given: Any) -> Any:
        """Return a curve or a surface as data of a file."""
        if isinstance(given, SampledCurve):
            name = self._file_of(location)
            self.samples[name] = {letter: x.tolist() for letter, x in zip("xyz", given.points.T, strict=False)}
            return {"samples": name, "closed": given.closed, "degree": given.degree}
        if not isinstance(given, ParametricCurve):
            return plain(given, location)
        expressions = plain(given.expressions, location)
        if given.range is None:
            return expressions
        entry = {"expressions": expressions, "range": plain(given.range, f"{location}.range")}
        return entry | {"closed": True} if given.closed else entry

    def _file_of(self, location: str) -> str:
        return f"{self.stem}_{re.sub(r'[^A-Za-z0-9_]+', '_', location)}.csv"

    def _following(self, location: str, law: FollowingMotion, element: Any) -> dict[str, Any]:
        """Return a law of the coordinate of a driver, by name, or of an expression of t."""
        followed, leader = law.recipe.value[0]
        if isinstance(followed, FollowingMotion | OutputMotion | TrapezoidalMotion):
            message = f"a {type(followed).__name__} of another coordinate has no form in a file; use segments"
            raise MechanismError(message, name=location)
        entry = self.written(location, followed, element)
        entry = entry if isinstance(entry, dict) else {"expression": entry}
        for name, driver in self.drivers.items():
            if driver is not element and _same(getattr(driver, "motion", None), leader):
                return entry | {"of": name}
        written = self.written(location, leader, element)
        if not isinstance(written, str):
            message = f"follows a {type(leader).__name__} that no driver has; give an expression of t"
            raise MechanismError(message, name=location)
        return entry | {"of": written}


def _same(law: Any, leader: Any) -> bool:
    """Return whether the law of a driver is the leader: the same object, or the same expression."""
    texts = [x.text if isinstance(x, Expression) else x for x in (law, leader)]
    return law is leader or (isinstance(texts[0], str) and texts[0] == texts[1])


def _segmented(location: str, law: SegmentedMotion) -> dict[str, Any]:
    """Return a law of segments as it was given."""
    segments, initial, start, beyond = law.recipe.value
    entries = []
    for segment in segments:
        given = {field.name: getattr(segment, field.name) for field in dataclasses.fields(segment)}
        entries.append({key: plain(x, location) for key, x in given.items() if x is not None})
    options = {"initial": (initial, 0.0), "start": (start, 0.0), "beyond": (beyond, "hold")}
    return {"profile": entries} | {key: plain(x, location) for key, (x, default) in options.items() if x != default}


def _piecewise(location: str, law: PiecewiseMotion) -> dict[str, Any]:
    """Return a law of consecutive expressions."""
    (parts, ends, start, beyond), entries = law.recipe.value, []
    for k, part in enumerate(parts):
        if isinstance(part, ExpressionMotion):
            text = _substituted(part.expression, part.parameters)
        elif isinstance(part, Expression):
            text = part.text
        else:
            message = f"a {type(part).__name__} within a piecewise law has no form in a file; give expressions"
            raise MechanismError(message, name=location)
        entries.append({"expression": text} | ({"until": plain(ends[k], location)} if k < len(ends) else {}))
    entry: dict[str, Any] = {"piecewise": entries}
    if start is not None:
        entry["start"] = plain(start, location)
    return entry if beyond == "refuse" else entry | {"beyond": beyond}


def _samples_of(law: SplineMotion) -> tuple[Any, Any]:
    """Return samples that determine the spline of a law by its degree and breakpoints."""
    ends = np.asarray(law.breakpoints, float)
    pieces = np.asarray(law.coefficients, float)
    inside = (law.degree - 1) // 2  # samples within each end interval, which are no breakpoints
    last = float(law.stop)
    if last <= ends[-1]:  # the last piece is at rest, without an end
        last = ends[-1] + ((inside + 1) * (ends[-1] - ends[0]) / (len(ends) + inside) if len(ends) > 1 else 1.0)
    times = np.unique(np.concatenate([
        np.linspace(ends[0], ends[1] if len(ends) > 1 else last, inside + 2),
        ends, np.linspace(ends[-1], last, inside + 2),
    ]))  # fmt: skip
    if len(ends) == 1:
        times = np.linspace(ends[0], last, law.degree + 1)
    piece = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(ends) - 1)
    local = times - ends[piece]
    return times, sum(c[piece] * local**k for k, c in enumerate(pieces))


def _own_names(law: ExpressionLaw, element: Any) -> bool:
    names = (tuple(element.displacement_names), tuple(element.velocity_names))
    return (law.displacements, law.velocities) == names


def _substituted(expression: Expression, parameters: Mapping[str, Any]) -> Any:
    """Return the text of an expression with the values of its own parameters inserted."""

    def value_of(match: re.Match[str]) -> str:
        name = match.group()
        is_parameter = name in parameters and name not in CONSTANTS and name not in FUNCTIONS
        return f"({float(parameters[name])!r})" if is_parameter else name

    text = re.sub(rf"(?<![0-9.]){_WORD.pattern}", value_of, expression.text)
    try:
        return plain_number(Expression(text).evaluate({}), "") if not Expression(text).names else text
    except JounceError:
        return text
