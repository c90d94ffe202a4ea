"""Annotation of curves and surfaces for the schema: expressions of their parameters, or points in a CSV file."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

from jounce.errors import UNSET, JounceError, show_value, unknown
from jounce.io.mechanisms.values.expressions import (
    ANY_VALUE,
    Checked,
    defined,
    list_schema,
    object_schema,
    parse,
    problem,
)
from jounce.trajectory import ParametricCurve

EXPRESSION_KEYS, SAMPLE_KEYS = ("expressions", "range", "closed"), ("samples", "closed", "degree")
CAM_KEYS = ("cam",)


@dataclasses.dataclass(frozen=True)
class CurvePoints:
    """A curve through the points of a file that is not yet read."""

    file: str
    closed: bool
    degree: int


@dataclasses.dataclass(frozen=True)
class CurveOfCam:
    """The path of the roller center, or of the knife edge, around a plate cam from a file that is not yet read."""

    cam: str


class _Reader:
    """Reads a curve or a surface with given parameter names, in the plane or in space."""

    def __init__(self, names: tuple[str, ...], size: int):
        self.names, self.size = names, size

    def __call__(self, raw: object, info: Any) -> Any:
        """Return a curve, or the description of one that is in a file."""
        if not isinstance(raw, dict):
            return ParametricCurve(self._expressions(raw, info))
        if "cam" in raw and self.size == 2:
            return self._of_cam(raw)
        sampled = "samples" in raw and len(self.names) == 1
        valid = SAMPLE_KEYS if sampled else EXPRESSION_KEYS
        for key in raw.keys() - set(valid):
            raise problem(unknown(f"key {show_value(key)}", key, valid), key, value=UNSET)
        closed = raw.get("closed", False)
        if not isinstance(closed, bool):
            raise problem("must be true or false", "closed", value=closed)
        return _points(raw, closed) if sampled else self._formula(raw, closed, info)

    def _of_cam(self, raw: dict[str, Any]) -> CurveOfCam:
        for key in raw.keys() - set(CAM_KEYS):
            raise problem(unknown(f"key {show_value(key)}", key, CAM_KEYS), key, value=UNSET)
        if not isinstance(raw["cam"], str):
            raise problem("must be the name of a file of a cam", "cam", value=raw["cam"])
        return CurveOfCam(raw["cam"])

    def _formula(self, raw: dict[str, Any], closed: bool, info: Any) -> ParametricCurve:
        if "expressions" not in raw:
            raise problem("is missing", "expressions", value=UNSET)
        given, limits = raw.get("range"), None
        if given is not None and len(self.names) == 1:
            limits = _limits(given, info, "range")
        elif given is not None:
            if not isinstance(given, list | tuple) or len(given) != len(self.names):
                raise problem("must be [[first, last], [first, last]], of u and of v", "range", value=given)
            limits = tuple(_limits(pair, info, "range", k) for k, pair in enumerate(given))
        try:
            return ParametricCurve(self._expressions(raw["expressions"], info, "expressions"), limits, closed)
        except JounceError as error:
            raise problem(error.message, *([error.name] if error.name else []), value=UNSET) from None

    def _expressions(self, raw: object, info: Any, *location: str) -> tuple[Any, ...]:
        if not isinstance(raw, list | tuple) or len(raw) != self.size:
            expectation = f"must be {self.size} expressions of {' and '.join(self.names)}, one for each coordinate"
            raise problem(expectation, *location, value=raw)
        variables = dict.fromkeys(self.names)
        return tuple(parse(x, "length", info, *location, k, variables=variables).value for k, x in enumerate(raw))


def _limits(raw: object, info: Any, *location: str | int) -> tuple[Any, ...]:
    if not isinstance(raw, list | tuple) or len(raw) != 2:
        raise problem("must be [first, last]", *location, value=raw)
    return tuple(parse(x, "any", info, *location, k).value for k, x in enumerate(raw))


def _points(raw: dict[str, Any], closed: bool) -> CurvePoints:
    degree = raw.get("degree", 5)
    if isinstance(degree, bool) or not isinstance(degree, int):
        raise problem("must be a whole number", "degree", value=degree)
    if not isinstance(raw["samples"], str):
        raise problem("must be the name of a file", "samples", value=raw["samples"])
    return CurvePoints(raw["samples"], closed, degree)


def curve(names: tuple[str, ...], size: int) -> Any:
    """Return the annotation of a curve or a surface with given parameter names, in the plane or in space."""
    description = f"expressions of {' and '.join(names)}, m, one for each coordinate in the frame of the first body"
    schema = {"description": description, **list_schema({"anyOf": ANY_VALUE}, size)}
    pair = list_schema({"anyOf": ANY_VALUE}, 2)
    flag = {"type": "boolean"}
    if len(names) > 1:
        ranged = object_schema({"expressions": schema, "range": list_schema(pair, len(names))}, ("expressions",))
        return Annotated[Any, Checked(_Reader(names, size), defined("surface", {"anyOf": [schema, ranged]}))]
    ranged = object_schema({"expressions": schema, "range": pair, "closed": flag}, ("expressions",))
    degree = {"type": "integer", "minimum": 1, "maximum": 11}
    points = object_schema({"samples": {"type": "string"}, "closed": flag, "degree": degree}, ("samples",))
    of_cam = [object_schema({"cam": {"type": "string"}}, CAM_KEYS)] if size == 2 else []
    word = f"curve_of_{size}_coordinates"
    return Annotated[Any, Checked(_Reader(names, size), defined(word, {"anyOf": [schema, ranged, points, *of_cam]}))]
