"""Facts of a plate cam, as plain data in SI units, and in words."""

from __future__ import annotations

from typing import Any

from typing_extensions import TypedDict

from jounce.kinematics import Extreme, PlateCam
from jounce.reporting.text.law_facts import JumpFacts, jump_facts, law_words
from jounce.units.shown_units import ShownUnits

ROUNDING = 1e-12  # rad


class ExtremeFacts(TypedDict):
    """A value, m or rad, and its cam angle, rad."""

    value: float
    angle: float


class UndercutFacts(TypedDict):
    """A range of cam angles in which lift is lost, with the largest loss and its angle."""

    start: float
    stop: float
    angle: float
    lost: float


class CamFacts(TypedDict):
    """A plate cam."""

    title: str
    follower: str
    shape: str
    base_radius: float
    sense: str
    rise: float
    count: int
    pressure_angle: ExtremeFacts
    least_radius: ExtremeFacts | None
    least_concave_radius: ExtremeFacts | None
    face: list[ExtremeFacts] | None
    undercut: bool
    undercuts: list[UndercutFacts]
    continuous_to: int | None
    derivatives: list[JumpFacts]
    remark: str


def cam_facts(cam: PlateCam) -> dict[str, Any]:
    """Return the facts of a cam: CamFacts.

    Examples
    --------
    >>> import jounce as jn
    >>> facts = cam_facts(jn.cams.load_cam("examples/cams/intake.yaml"))
    >>> facts["undercut"], facts["continuous_to"]
    (False, 3)
    """
    continuity_facts = cam.continuity
    return {
        "title": cam.title,
        "follower": "oscillating" if cam.follower.turning else "translating",
        "shape": cam.follower.shape,
        "base_radius": cam.base_radius,
        "sense": cam.sense,
        "rise": float(cam.table.lift.max() - cam.table.lift.min()),
        "count": len(cam.angle),
        "pressure_angle": _extreme(cam.largest_pressure_angle),
        "least_radius": _extreme(cam.least_radius),
        "least_concave_radius": _extreme(cam.least_concave_radius),
        "face": None if cam.face is None else [_extreme(end) for end in cam.face],
        "undercut": cam.is_undercut,
        "undercuts": [{"start": x.start, "stop": x.stop, "angle": x.angle, "lost": x.lost} for x in cam.undercuts],
        "continuous_to": continuity_facts.smoothness,
        "derivatives": jump_facts(continuity_facts),
        "remark": continuity_facts.unknown,
    }


def _extreme(extreme: Extreme | None) -> dict[str, float] | None:
    return None if extreme is None else {"value": extreme.value, "angle": extreme.angle}


def cam_words(facts: dict[str, Any], units: ShownUnits) -> str:
    """Return the facts of a cam in words, in the shown units."""

    def worded(value: float, unit: str, name: str = "") -> str:
        label, factor = units.of(unit, name)
        return f"{value * factor:.6g} {label}"

    def extreme_words(extreme: dict[str, float], unit: str, name: str = "") -> str:
        return f"{worded(extreme['value'], unit, name)} at {worded(extreme['angle'], 'rad', 'angle')}"

    lift = "rad" if facts["follower"] == "oscillating" else "m"
    lines = [
        facts["title"] or "plate cam",
        f"{facts['follower']} follower, {facts['shape'].replace('_', ' ')}; base radius "
        f"{worded(facts['base_radius'], 'm')}, turning {facts['sense']}",
        f"rise: {worded(facts['rise'], lift, 'lift')}",
    ]
    pressed = abs(facts["pressure_angle"]["value"]) > ROUNDING
    pressure = extreme_words(facts["pressure_angle"], "rad", "pressure_angle") if pressed else "zero throughout"
    lines.append(f"largest pressure angle: {pressure}")
    for key, word in (("least_radius", "convex"), ("least_concave_radius", "concave")):
        if facts[key] is not None:
            lines.append(f"least radius of curvature, {word}: {extreme_words(facts[key], 'm')}")
    if facts["face"] is not None:
        low, high = facts["face"]
        width = worded(high["value"] - low["value"], "m")
        lines.append(f"face: at least {width} wide, from {extreme_words(low, 'm')} to {extreme_words(high, 'm')}")
    unit, factor = (lift, 1.0) if lift == "rad" else units.of(lift, "lift")  # never per degree
    jumps = [{**x, "largest": x["largest"] and x["largest"] * factor} for x in facts["derivatives"]]
    law = {
        "of": "the follower",
        "unit": unit,
        "derivatives": jumps,
        **{k: facts[k] for k in ("continuous_to", "remark")},
    }
    lines += law_words([law], by="rad", shown=units.of("rad", "angle"))
    if not facts["undercut"]:
        lines.append("not undercut: the profile gives the follower its law")
    for part in facts["undercuts"]:
        range_words = f"from {worded(part['start'], 'rad', 'angle')} to {worded(part['stop'], 'rad', 'angle')}"
        largest = f"{worded(part['lost'], lift, 'lift')} at {worded(part['angle'], 'rad', 'angle')}"
        lines.append(f"UNDERCUT {range_words}: the follower loses up to {largest}")
    if facts["undercut"]:
        lines.append("make the base circle larger, the roller smaller, or the law gentler")
    return "\n".join(lines)
