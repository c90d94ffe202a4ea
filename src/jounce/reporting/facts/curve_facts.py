"""Facts of a curve of configurations, as plain data in SI units, in tables and in words."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from typing_extensions import TypedDict

from jounce.kinematics import Curve
from jounce.reporting.text.summaries import Facts, count
from jounce.reporting.text.tables import Table, table

SMALL = 1e-6  # fraction of a unit of arc length: smaller motions of a body count as zero


class LimitFacts(TypedDict):
    """A limit position of the driver."""

    arc_length: float
    value: float
    kind: Literal["maximum", "minimum", "stationary"]


class BranchFacts(TypedDict):
    """A branch between limit positions; without bounds, the driver makes whole turns."""

    start: float
    stop: float
    low: float | None
    high: float | None


class BodyDirection(TypedDict):
    """Motion of a body along a branch per unit of arc length: m and rad."""

    body: str
    shift: list[float]
    turn: list[float]


class ChangePointFacts(TypedDict):
    """A crossing of branches: the direction of each branch, that of the curve itself first."""

    arc_length: float
    value: float | None
    dimension: int
    decided: bool
    branches: list[list[BodyDirection]]


class CurveFacts(TypedDict):
    """A curve of configurations."""

    title: str
    driver: str | None
    unit: str
    closed: bool
    turns: int
    start: float
    stop: float
    size: float
    ends: list[str]
    limits: list[LimitFacts]
    branches: list[BranchFacts]
    change_points: list[ChangePointFacts]


def curve_facts(curve: Curve) -> dict[str, Any]:
    """Return the facts of a curve: CurveFacts.

    Examples
    --------
    >>> import jounce as jn
    >>> facts = curve_facts(jn.trace(jn.load("examples/four_bar.yaml")))
    >>> facts["driver"], facts["closed"], facts["turns"]
    ('theta', True, 1)
    """
    full_turn = bool(curve.turns) and not curve.turning_points
    driven = curve.driver is not None
    return {
        "title": curve.mechanism.title,
        "driver": curve.driver,
        "unit": curve.unit,
        "closed": curve.closed,
        "turns": curve.turns,
        "start": curve.start,
        "stop": curve.stop,
        "size": curve.size,
        "ends": list(curve.ends),
        "limits": [{"arc_length": x.arc_length, "value": x.value, "kind": x.kind} for x in curve.limits],
        "branches": [
            {
                "start": b.start,
                "stop": b.stop,
                "low": None if full_turn else b.low,
                "high": None if full_turn else b.high,
            }
            for b in curve.branches
        ],
        "change_points": [
            {
                "arc_length": point.arc_length,
                "value": curve.value(point.arc_length) if driven else None,
                "dimension": point.dimension,
                "decided": point.decided,
                "branches": [
                    [
                        {"body": name, "shift": shift.tolist(), "turn": turn.tolist()}
                        for name, (shift, turn) in direction.items()
                    ]
                    for direction in curve.directions(number)
                ],
            }
            for number, point in enumerate(curve.change_points)
        ],
    }


def curve_summary(facts: Facts, file: str) -> str:
    """Return the summary of a curve: whether it is closed, and the range of the driver."""
    shape = "closed" if facts["closed"] else "open"
    lines = [
        facts["title"] or file,
        f"{shape} curve of configurations, arc length {facts['stop'] - facts['start']:.9g}",
    ]
    if not facts["closed"]:
        lines += [f"{end_name}: {reason}" for end_name, reason in zip(("start", "end"), facts["ends"], strict=True)]
    if facts["driver"] is None:
        lines.append("nothing is driven: no limit positions")
    elif facts["branches"][0]["low"] is None:
        lines.append(f"{facts['driver']} makes {count(abs(facts['turns']), 'whole turn')} once around")
    else:
        first = facts["branches"][0]
        low, high = (value_words(first[end], facts["unit"]) for end in ("low", "high"))
        lines.append(f"{facts['driver']} goes from {low} to {high} on the branch of the start")
    return "\n".join(lines)


def curve_tables(facts: Facts) -> list[Table]:
    """Return the tables of limit positions, branches and change points of a curve."""
    unit = facts["unit"]
    limits = [[f"{x['arc_length']:.9g}", value_words(x["value"], unit), x["kind"]] for x in facts["limits"]]
    branches = [
        [str(k), f"{b['start']:.9g}", f"{b['stop']:.9g}", value_words(b["low"], unit), value_words(b["high"], unit)]
        for k, b in enumerate(facts["branches"], start=1)
    ]
    points = []
    for number, point in enumerate(facts["change_points"]):
        for k, direction in enumerate(point["branches"]):
            location = (
                [str(number), f"{point['arc_length']:.9g}", value_words(point["value"], unit)] if k == 0 else [""] * 3
            )
            points.append([*location, "this curve" if k == 0 else str(k), _direction_words(direction)])
        if not point["decided"]:
            points.append([""] * 3 + ["?", "there may be others: the second order does not distinguish them"])
    value = facts["driver"] or ""
    tables = [
        table("Limit positions", ("arc length", value, "kind"), limits, (0, 1)),
        table("Branches", ("branch", "from", "to", f"least {value}", f"largest {value}"), branches, (1, 2, 3, 4)),
        table("Change points", ("point", "arc length", value, "branch", "direction"), points, (1, 2)),
    ]
    return [each for each in tables if each.rows]


def value_words(value: float | None, unit: str) -> str:
    """Return the value of a driver as text, with an angle in degrees as well."""
    if value is None:
        return ""
    if unit == "rad":
        return f"{value:.12g} rad ({math.degrees(value):.6g} deg)"
    return f"{value:.12g} {unit}".rstrip()


def _direction_words(direction: list[BodyDirection]) -> str:
    """Return the motion of bodies along a branch in words: the rotations of turning bodies, else the shifts."""
    parts = []
    for body in direction:
        turn = np.array(body["turn"])
        if np.linalg.norm(turn) > SMALL:
            size = turn[0] if len(turn) == 1 else np.linalg.norm(turn)
            parts.append(f"{body['body']} turns {size:.4g}")
        elif np.linalg.norm(body["shift"]) > SMALL:
            parts.append(f"{body['body']} moves {np.linalg.norm(body['shift']):.4g} m")
    return ", ".join(parts)
