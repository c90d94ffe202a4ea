"""Common parts of the JSON results of several commands."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict


class Result(TypedDict):
    """First keys of all results."""

    jounce: str
    record: Literal[1]


class Extremes(TypedDict):
    """Extreme values, with their times."""

    derivative: str
    unit: str
    minimum: float | None
    minimum_at: float | None
    maximum: float | None
    maximum_at: float | None


class OutputPeak(Extremes):
    """Extreme values of a derivative of an output."""

    output: str


class TorquePeak(Extremes):
    """Extreme values of a torque or force of a joint, or of one of its rates, at the instants of the trajectory."""

    joint: str


class Written(TypedDict):
    """Common keys of the results of motions."""

    file: str
    peaks: list[OutputPeak]
    written: str | None
