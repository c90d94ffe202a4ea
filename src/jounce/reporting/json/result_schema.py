"""The JSON Schema of what commands print with ``--json``, made from the types of the facts."""

from __future__ import annotations

from typing import Any, Literal, NotRequired

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from typing_extensions import TypedDict

from jounce.reporting.facts.cam_facts import CamFacts
from jounce.reporting.facts.curve_facts import CurveFacts
from jounce.reporting.facts.design_facts import DesignFacts
from jounce.reporting.facts.mechanism_facts import Grid, InspectedMechanism
from jounce.reporting.facts.modes_facts import ModesFacts
from jounce.reporting.facts.motion_facts import MotionFacts, SimulationFacts
from jounce.reporting.facts.robot_facts import InspectedRobot
from jounce.reporting.json.schema_parts import Extremes, Result, TorquePeak, Written
from jounce.reporting.text.law_facts import LawFacts


class RunResult(Result, MotionFacts, Written):
    """jounce run --json."""

    command: Literal["run"]


class SimulateResult(Result, SimulationFacts, Written):
    """jounce simulate --json."""

    command: Literal["simulate"]


class SimulateRobotResult(Result):
    """jounce simulate --json of a robot file; energies in J, null where the motion was not followed."""

    command: Literal["simulate"]
    robot: str
    file: str
    order: int
    time: Grid
    followed_to: float
    energy_at_start: float | None
    energy_at_stop: float | None
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
    """Extreme values, at the rows of a drive, of a derivative of the coordinate of a driver."""

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


class LimitRow(TypedDict):
    """The worst instant of a joint and quantity; without a limit, its ratio is null, and both where it is infinite."""

    joint: str
    quantity: str
    unit: str
    worst: float | None
    limit: float | None
    ratio: float | None
    at: float
    broken: bool


class BrokenAtEnd(TypedDict):
    """A joint or a link, and a quantity of it that has a limit and is infinite at an end."""

    name: str
    quantity: str


class EndFacts(TypedDict):
    """What is met at the start or the stop of a trajectory: what does not rest, SI, and the limits that this breaks."""

    end: Literal["start", "stop"]
    time: float
    at_rest: bool
    velocities: dict[str, float]
    accelerations: dict[str, float]
    breaks: list[BrokenAtEnd]


class BetweenFacts(TypedDict):
    """What was taken to happen between points, and how far, where, that leads from the straight lines between them."""

    words: str
    deviation: float
    joint: str | None
    at: float | None


class TrajectoryResult(Result):
    """What is told of a robot on a trajectory; between is null where its laws say what happens between points."""

    robot: str
    file: str
    trajectory: str
    time: Grid
    ends: list[EndFacts]
    between: BetweenFacts | None
    written: str | None


class CheckResult(TrajectoryResult):
    """jounce check --json."""

    command: Literal["check"]
    kept: bool
    broken: int
    held: dict[str, float]
    drives: bool
    limits: list[LimitRow]
    hand_over: bool


class TorquesResult(TrajectoryResult):
    """jounce torques --json."""

    command: Literal["torques"]
    rates: int
    held: list[str]
    drives: bool
    peaks: list[TorquePeak]


class EnergyPeak(TypedDict):
    """Extreme values of a rate of an energy of all bodies, where the body is null, or of one, with their times."""

    body: str | None
    rate: int
    unit: str
    minimum: float | None
    minimum_at: float | None
    maximum: float | None
    maximum_at: float | None


class EnergiesResult(Result):
    """jounce energies --json; the trajectory is null for a mechanism."""

    command: Literal["energies"]
    file: str
    trajectory: str | None
    order: int
    rates: int
    time: Grid
    peaks: list[EnergyPeak]
    written: str | None


class DriveFacts(TypedDict):
    """A drive: time constant of its spring, s, what the expansion in it misses, and how its motor begins."""

    name: str
    elastic: bool
    time_constant: float
    expansion_errors: list[float]
    velocity_at_start: float


class SimulatedLink(TypedDict):
    """By how much a link errs in a simulation, under all of the torques, and without what accelerates the springs."""

    name: str
    unit: str
    error: float | None
    error_without_springs: float | None


class FeedforwardResult(Result):
    """jounce feedforward --json."""

    command: Literal["feedforward"]
    system: str
    file: str
    trajectory: str | None
    time: Grid
    drives: list[DriveFacts]
    kept: bool
    limits: list[LimitRow]
    simulated: list[SimulatedLink] | None
    written: str | None


class BindingLimit(TypedDict):
    """A limit that binds somewhere, for how long, and what it costs."""

    limit: str
    unit: str
    seconds: float
    price: float


class RetimeResult(Result):
    """jounce retime --json; the trajectory is the file of the path, null for a mechanism."""

    command: Literal["retime"]
    robot: str
    file: str
    trajectory: str | None
    time: Grid
    written: str | None
    duration: float
    before: float | None
    path: str | None
    deviation: float
    deviation_allowed: float | None
    kept: bool
    drives: bool
    limits: list[LimitRow]
    ends: list[EndFacts]
    hand_over: bool
    binding: list[BindingLimit]
    figure: str | None


class SmoothedJointFacts(TypedDict):
    """What smoothing made of the samples of a joint, SI; followed are frequencies, Hz, from which on nothing is."""

    joint: str
    noise: float
    farthest: float
    followed: list[float]
    dwells: list[list[float]]


class SmoothResult(Result):
    """jounce smooth --json."""

    command: Literal["smooth"]
    file: str
    trajectory: str
    time: Grid
    deviation: float
    joints: list[SmoothedJointFacts]
    follows_noise: list[str]
    written: str | None
    figure: str | None


class SweptPeak(TypedDict):
    """The least and the largest peak that a derivative of an output has among designs, and the designs."""

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
    """How far a derivative of an output spreads, at the instant at which it spreads most, and its peak."""

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
    """A mechanism to begin from, and the command that writes it."""

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
    """An error or a warning, taken apart."""

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
    """No keys but the known ones."""

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
    """Return the schema of a type, whole: each part in its place."""
    json_schema = TypeAdapter(kind).json_schema(mode="serialization", schema_generator=_Closed)
    parts = json_schema.pop("$defs", {})

    def whole(schema: Any) -> Any:
        if isinstance(schema, dict):
            part = schema.get("$ref", "").removeprefix("#/$defs/")
            return whole(parts[part]) if part else {key: whole(entry) for key, entry in schema.items()}
        return [whole(entry) for entry in schema] if isinstance(schema, list) else schema

    return whole(json_schema)
