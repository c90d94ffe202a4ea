"""The JSON Schema of the results that commands print with ``--json``, generated from the types of the facts."""

from __future__ import annotations

from typing import Any, Literal, NotRequired

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from typing_extensions import TypedDict

from jounce.reporting.facts.cam_facts import CamFacts
from jounce.reporting.facts.curve_facts import CurveFacts
from jounce.reporting.facts.design_facts import DesignFacts
from jounce.reporting.facts.holding_facts import HoldingFacts
from jounce.reporting.facts.mechanism.mechanism_facts import Grid, InspectedMechanism
from jounce.reporting.facts.modes_facts import ModesFacts
from jounce.reporting.facts.motion_facts import MotionFacts, SimulationFacts
from jounce.reporting.facts.robot_facts import InspectedRobot
from jounce.reporting.json.robot_results import (
    CheckResult,
    EnergiesResult,
    FeedforwardResult,
    RetimeResult,
    SmoothResult,
    TorquesResult,
)
from jounce.reporting.json.schema_parts import Extremes, Result, TorquePeak, Written
from jounce.reporting.text.law_facts import LawFacts


class RunResult(Result, MotionFacts, Written):
    """jounce run --json."""

    command: Literal["run"]
    holding: NotRequired[list[HoldingFacts]]


class SimulateResult(Result, SimulationFacts, Written):
    """jounce simulate --json."""

    command: Literal["simulate"]


class SimulateRobotResult(Result):
    """jounce simulate --json of a robot file; energies in J, null if the motion did not reach the instant."""

    command: Literal["simulate"]
    robot: str
    file: str
    order: int
    time: Grid
    followed_to: float
    energy_at_start: float | None
    energy_at_stop: float | None
    backend: str
    peaks: list[TorquePeak]
    ok: bool
    written: str | None


class InspectMechanismResult(Result, InspectedMechanism):
    """jounce inspect --json of a mechanism file."""

    command: Literal["inspect"]


class InspectRobotResult(Result, InspectedRobot):
    """jounce inspect --json of a robot file."""

    command: Literal["inspect"]


class TraceResult(Result):
    """jounce trace --json."""

    command: Literal["trace"]
    file: str
    curves: list[CurveFacts]
    written: str | None


class ServoPeak(Extremes):
    """Extreme values of a derivative of the coordinate of a driver, at the rows of the servo file."""

    output: str


class ServoResult(Result):
    """jounce servo --json: SI, whatever the units of the file."""

    command: Literal["servo"]
    file: str
    rate: float
    drivers: list[str]
    laws: list[LawFacts]
    peaks: list[ServoPeak]
    written: str | None


class CamResult(Result, CamFacts):
    """jounce cam --json: SI, whatever the units of the file."""

    command: Literal["cam"]
    file: str
    written: str | None


class SweptPeak(TypedDict):
    """The least and the largest peak of a derivative of an output among all designs, with their designs."""

    output: str
    derivative: int
    unit: str
    least: float | None
    least_at: dict[str, float] | None
    largest: float | None
    largest_at: dict[str, float] | None


class SweepResult(Result):
    """jounce sweep --json."""

    command: Literal["sweep"]
    file: str
    designs: int
    instants: int
    remark: NotRequired[str]
    vary: list[str]
    failed: dict[str, int]
    peaks: list[SweptPeak]
    checksum: str
    written: str


class Spread(TypedDict):
    """Spread of a derivative of an output at the instant of its largest spread, and spread of its peak."""

    output: str
    derivative: int
    unit: str
    at: float
    nominal: float | None
    linear_std: float | None
    std: float | None
    low: float | None
    high: float | None
    peak: float | None
    peak_mean: float | None
    peak_std: float | None
    peak_low: float | None
    peak_high: float | None
    share: dict[str, float | None] | None
    peak_first_order: dict[str, float | None] | None
    peak_total_order: dict[str, float | None] | None


class ToleranceResult(Result):
    """jounce tolerance --json."""

    command: Literal["tolerance"]
    file: str
    samples: int
    deviations: dict[str, float]
    solved: int | None
    spread: list[Spread]
    written: str | None


class ModesResult(Result, ModesFacts):
    """jounce modes --json."""

    command: Literal["modes"]
    written: str | None


class OptimizeResult(Result, DesignFacts):
    """jounce optimize --json."""

    command: Literal["optimize"]
    written: str | None


class Starter(TypedDict):
    """A starter mechanism, and the command that writes it."""

    name: str
    about: str
    command: str


class NewListResult(Result):
    """jounce new --json."""

    command: Literal["new"]
    starters: list[Starter]


class NewResult(Result):
    """jounce new NAME --json."""

    command: Literal["new"]
    name: str
    written: str
    next: list[str]


class Problem(TypedDict):
    """The parts of an error or a warning."""

    kind: str
    message: str
    file: str | None
    line: int | None
    name: str | None
    value: Any
    text: str


class ErrorLine(TypedDict):
    """One line on standard error."""

    error: Problem


class WarningLine(TypedDict):
    """One line on standard error."""

    warning: Problem


RESULTS: dict[str, Any] = {
    "run": RunResult,
    "simulate": SimulateResult,
    "simulate_robot": SimulateRobotResult,
    "inspect_mechanism": InspectMechanismResult,
    "inspect_robot": InspectRobotResult,
    "check": CheckResult,
    "torques": TorquesResult,
    "energies": EnergiesResult,
    "feedforward": FeedforwardResult,
    "retime": RetimeResult,
    "smooth": SmoothResult,
    "servo": ServoResult,
    "cam": CamResult,
    "modes": ModesResult,
    "sweep": SweepResult,
    "tolerance": ToleranceResult,
    "trace": TraceResult,
    "optimize": OptimizeResult,
    "new_list": NewListResult,
    "new": NewResult,
}


class _Closed(GenerateJsonSchema):
    """Schema generator that allows only known keys."""

    def typed_dict_schema(self, schema: Any) -> dict[str, Any]:
        return super().typed_dict_schema(schema) | {"additionalProperties": False}


def result_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of the results of commands, and of the errors and warnings beside them.

    Examples
    --------
    >>> sorted(result_schema()["$defs"])[:6]
    ['cam', 'check', 'complaint', 'energies', 'feedforward', 'inspect_mechanism']
    """
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Results of jounce",
        "description": "Numbers are in SI units; null stands for a number that is not known or not finite.",
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in RESULTS],
        "$defs": {name: _schema(kind) for name, kind in (RESULTS | {"complaint": ErrorLine | WarningLine}).items()},
    }


def _schema(kind: Any) -> dict[str, Any]:
    """Return the schema of a type with all references replaced by their definitions."""
    json_schema = TypeAdapter(kind).json_schema(mode="serialization", schema_generator=_Closed)
    parts = json_schema.pop("$defs", {})

    def whole(schema: Any) -> Any:
        if isinstance(schema, dict):
            part = schema.get("$ref", "").removeprefix("#/$defs/")
            return whole(parts[part]) if part else {key: whole(entry) for key, entry in schema.items()}
        return [whole(entry) for entry in schema] if isinstance(schema, list) else schema

    return whole(json_schema)
