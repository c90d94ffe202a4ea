"""What the JSON results of several commands have in common."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict


class Result(TypedDict):
    """What all results begin with."""

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
    """Extreme values, at the instants of the trajectory, of a torque or force of a joint, or of one of its rates."""

    joint: str


class Written(TypedDict):
    """What a result of a motion has in common with others."""

    file: str
    peaks: list[OutputPeak]
    written: str | None
