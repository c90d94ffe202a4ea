"""Continuity of the laws of drivers, as plain data and in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from typing_extensions import TypedDict

from jounce.mechanism import Mechanism
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.laws.output_drivers import output_laws, with_output_drivers
from jounce.mechanism.resolve import resolve_motion
from jounce.reporting.peaks import derivative_name
from jounce.settings import under_own_settings
from jounce.trajectory import (
    AbstractMotion,
    Continuity,
    ExpressionMotion,
    FollowingMotion,
    SplineMotion,
    continuity,
)
from jounce.units.shown_units import derivative_unit

TURN = 2 * math.pi
WHOLE = 1e-6  # of turns


class JumpFacts(TypedDict):
    """The jumps of a derivative of a law within the time of the file: their number, and the largest one."""

    order: int
    jumps: int
    largest: float | None
    at: float | None


class LawFacts(TypedDict):
    """The highest continuous derivative of a law; ``of`` is the driver, or the output that follows the law."""

    driver: str
    of: str
    unit: str
    continuous_to: int | None
    derivatives: list[JumpFacts]
    remark: str


@under_own_settings
def law_facts(mechanism: Mechanism, first: float, last: float) -> list[dict[str, Any]]:
    """Return the continuity of the law of each driver between two instants: LawFacts.

    Examples
    --------
    >>> import jounce as jn
    >>> facts, = law_facts(jn.load("examples/servo_press.yaml"), 0.0, 1.2)
    >>> facts["of"], facts["continuous_to"], facts["derivatives"][4]["jumps"]
    ('ram_y', 3, 6)
    """
    held_outputs, fixed, facts = output_laws(mechanism), with_output_drivers(mechanism), []
    for name, driver in fixed.drivers.items():
        motion = getattr(driver, "motion", None)
        if motion is None:
            continue
        law = resolve_motion(motion, mechanism.parameter_values)
        smoothness = continuity(law, first, last)
        facts.append({
            "driver": name,
            "of": held_outputs[name].output if name in held_outputs else name,
            "unit": "rad" if is_turning(driver) else "m",
            "continuous_to": smoothness.smoothness,
            "derivatives": jump_facts(smoothness),
            "remark": "; ".join(filter(None, (smoothness.unknown, _uneven_repeat(law, fixed)))),
        })  # fmt: skip
    return facts


def _uneven_repeat(law: AbstractMotion, mechanism: Mechanism) -> str:
    """Return a remark if the period of a law is not a whole fraction or multiple of a turn of a shaft, else nothing."""
    profile, leader = law.parts if isinstance(law, FollowingMotion) and law.parts else (None, None)
    if not isinstance(profile, SplineMotion) or profile.beyond != "repeat":
        return ""
    period = float(profile.stop) - float(profile.breakpoints[0])
    turns = max(period, TURN) / min(period, TURN)
    if abs(turns - round(turns)) <= WHOLE * turns:
        return ""
    for name, driver in mechanism.drivers.items():
        motion = getattr(driver, "motion", None)
        if motion is not None and is_turning(driver) and _same(motion, leader, mechanism.parameter_values):
            return f"repeats every {math.degrees(period):.6g} deg of {name}, and so moves on it from turn to turn"
    return ""


def _same(motion: Any, law: AbstractMotion | None, parameters: Mapping[str, Any]) -> bool:
    """Return whether the motion of a driver equals a law."""
    resolved = resolve_motion(motion, parameters)
    if isinstance(resolved, ExpressionMotion) and isinstance(law, ExpressionMotion):
        return resolved.expression == law.expression
    return resolved is law or resolved == law


def jump_facts(smoothness: Continuity) -> list[dict[str, Any]]:
    """Return the jumps of each derivative of a law: JumpFacts."""
    return [
        {"order": x.order, "jumps": x.count, "largest": _number(x.size), "at": _number(x.instant)}
        for x in smoothness.derivatives
    ]


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def law_words(laws: Sequence[Mapping[str, Any]], by: str = "s", shown: tuple[str, float] | None = None) -> list[str]:
    """Return the continuity of laws, of time or of an angle, in words, one line for each.

    Parameters
    ----------
    laws : sequence of mapping
        `LawFacts` of each law.
    by : str
        Unit of the argument of the laws.
    shown : tuple of str and float, optional
        Another unit in which positions are shown, and the factor to it.

    Examples
    --------
    >>> jumps = {"order": 3, "jumps": 2, "largest": -120.0, "at": 0.5}
    >>> law_words([{"of": "theta", "unit": "rad", "continuous_to": 2, "derivatives": [jumps], "remark": ""}])
    ['law of theta: continuous to acceleration; jerk jumps by -120 rad/s^3 at 0.5 s (2 jumps)']
    """
    lines = []
    at, factor = shown or (by, 1.0)
    for law in laws:
        broken = [x for x in law["derivatives"] if x["jumps"]]
        if law["continuous_to"] is None:
            phrase = f"no derivative up to the {derivative_name(10)} jumps" if not law["remark"] else "no jump is known"
        elif law["continuous_to"] < 0:
            phrase = "not continuous"
        else:
            phrase = f"continuous to {derivative_name(law['continuous_to'])}"
        for x in broken:
            jump_count = f" ({x['jumps']} jumps)" if x["jumps"] > 1 else ""
            unit = derivative_unit(law["unit"], x["order"]) if by == "s" else f"{law['unit']}/{by}^{x['order']}"
            jump = "has no finite value" if x["largest"] is None else f"jumps by {x['largest']:.6g} {unit}"
            phrase += f"; {derivative_name(x['order'])} {jump} at {x['at'] * factor:.6g} {at}{jump_count}"
        lines.append(f"law of {law['of']}: {phrase}{'; ' if law['remark'] else ''}{law['remark']}")
    return lines
