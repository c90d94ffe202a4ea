"""Types of the results that commands on robots and energies print with ``--json``."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict

from jounce.reporting.facts.mechanism.mechanism_facts import Grid
from jounce.reporting.json.schema_parts import Result, TorquePeak


class LimitRow(TypedDict):
    """The worst instant of a quantity of a joint; ratio is null without a limit, worst and ratio if infinite."""

    joint: str
    quantity: str
    unit: str
    worst: float | None
    limit: float | None
    ratio: float | None
    at: float
    broken: bool


class BrokenAtEnd(TypedDict):
    """A joint or a link, and a limited quantity of it that is infinite at an end."""

    name: str
    quantity: str


class EndFacts(TypedDict):
    """The start or stop of a trajectory: nonzero velocities and accelerations, SI, and the limits that they break."""

    end: Literal["start", "stop"]
    time: float
    at_rest: bool
    velocities: dict[str, float]
    accelerations: dict[str, float]
    breaks: list[BrokenAtEnd]


class BetweenFacts(TypedDict):
    """The assumed motion between points, and its largest distance from the straight lines between them."""

    words: str
    deviation: float
    joint: str | None
    at: float | None


class TrajectoryResult(Result):
    """The check of a robot on a trajectory; between is null if laws define the motion between points."""

    robot: str
    file: str
    trajectory: str
    time: Grid
    ends: list[EndFacts]
    between: BetweenFacts | None
    written: str | None


class LoadChangeFacts(TypedDict):
    """Effect of a load change: mass by link, kg, speed of the load, m/s, and steps of torques by joint, SI."""

    time: float
    masses: dict[str, float]
    speed: float
    steps: dict[str, float]


class CheckResult(TrajectoryResult):
    """jounce check --json."""

    command: Literal["check"]
    kept: bool
    broken: int
    held: dict[str, float]
    drives: bool
    limits: list[LimitRow]
    hand_over: bool
    loads: list[LoadChangeFacts]


class TorquesResult(TrajectoryResult):
    """jounce torques --json."""

    command: Literal["torques"]
    rates: int
    held: list[str]
    drives: bool
    peaks: list[TorquePeak]


class EnergyPeak(TypedDict):
    """Extreme values of a rate of the energy of a body, or of all bodies if the body is null, with their times."""

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
    """A drive: time constant of its spring, s, errors of the expansion in it, and start velocity of its motor."""

    name: str
    elastic: bool
    time_constant: float
    expansion_errors: list[float]
    velocity_at_start: float


class SimulatedLink(TypedDict):
    """Error of a link in a simulation under the full torques, and without those that accelerate the deflections."""

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
    """A limit that binds on a part of the motion, for how long, and its price."""

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
    loads: list[LoadChangeFacts]
    binding: list[BindingLimit]
    figure: str | None


class SmoothedJointFacts(TypedDict):
    """Result of smoothing the samples of a joint, SI; `followed` are the lowest and highest cutoff frequency, Hz."""

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
