"""What ``jounce inspect`` says: tables of bodies, joints and robots, and what was counted."""

from __future__ import annotations

import math
from typing import Any

from jounce.reporting.summaries import count
from jounce.reporting.terminal import say, show_rows

__all__ = ["brief", "brief_robot"]


def brief(facts: dict[str, Any]) -> None:
    """Print what was found in a mechanism."""
    bodies = facts["bodies"]
    say(f"{facts['title'] or facts['file']}\n{facts['space']} mechanism: {facts['freedom']['words']}")
    rows = [
        [p["name"], f"{p['value']:.9g}", p["unit"] or "", p["written"] or ""] for p in facts["parameters"]
    ]  # fmt: skip
    if rows:
        show_rows("Parameters", ("name", "value", "unit", "as written"), rows, (1,))
    angle = "angle" if facts["space"] == "planar" else "quaternion"
    rows = []
    for body in bodies:
        pose = body["pose"] or body["guess"]
        turned = [pose[angle]] if angle == "angle" else pose[angle]
        moved = body["moved"]
        by = "-"
        if moved is not None:
            by = f"{_rounded(moved['distance']):.3g} m, {_rounded(math.degrees(moved['angle'])):.3g} deg"
        rows.append([body["name"], _maybe(body["mass"]), _vector(pose["position"]), _vector(turned), by])
    assembled = facts["assembly"]["status"] == "assembled"
    title = f"Bodies, {'put together' if assembled else 'as guessed'}, at t = {facts['assembly']['at']:g} s"
    show_rows(title, ("body", "mass/kg", "position/m", f"{angle}/rad" if angle == "angle" else angle, "moved by"), rows)
    for section in ("joints", "drivers", "initial"):
        rows = [
            [x["name"], x["type"], ", ".join(x["bodies"]), str(x.get("rows", "")), x.get("motion", "")]
            for x in facts[section]
        ]
        if rows:
            title = {"initial": "Initial conditions"}.get(section, section.capitalize())
            show_rows(title, (section.rstrip("s"), "type", "bodies", "equations", "motion"), rows, (3,))
    if facts["forces"]:
        rows = [[x["name"], x["type"], ", ".join(x["bodies"]), x.get("law", "")] for x in facts["forces"]]
        show_rows("Forces", ("force", "type", "bodies", "law"), rows)
    if facts["outputs"]:
        rows = [[x["name"], x["quantity"], ", ".join(x["of"]), x["unit"]] for x in facts["outputs"]]
        show_rows("Outputs", ("output", "quantity", "of", "unit"), rows)
    say("\n" + "\n".join(_counted(facts)))


def _counted(facts: dict[str, Any]) -> list[str]:
    freedom, assembly, time = facts["freedom"], facts["assembly"], facts["time"]
    bodies = count(len(facts["bodies"]), "moving body", "moving bodies")
    lines = [
        "Degrees of freedom",
        f"  {bodies}: {count(freedom['coordinates'], 'coordinate')}",
        f"  joints: {count(freedom['equations'] - freedom['of_drivers'], 'equation')}"
        f"; drivers: {count(freedom['of_drivers'], 'equation')}; independent: {freedom['independent']}",
    ]
    if freedom["redundant"]:
        among = ", ".join(freedom["redundant_among"])
        lines.append(f"  {count(freedom['redundant'], 'equation')} too many, among {among}")
    if freedom["left"]:
        lines.append(f"  left to move: {freedom['left']}, with which {', '.join(freedom['moving'])} can move")
    lines += ["", "Start"]
    if assembly["status"] == "assembled":
        lines.append(f"  put together at t = {assembly['at']:g} s")
    else:
        lines.append(f"  {assembly['message']}")
    if time is not None:
        lines.append(f"  time: {count(time['count'], 'instant')} from {time['start']:g} s to {time['stop']:g} s")
    else:
        lines.append("  no time grid is given")
    if freedom["message"] and facts["ok"] and freedom["left"]:
        lines.append("  it has degrees of freedom left: jounce simulate moves it by its forces")
    elif freedom["message"]:
        lines.append(f"  {freedom['message']}")
    elif facts["ok"]:
        lines.append("  all motion is prescribed: jounce run solves it")
    return lines


def brief_robot(facts: dict[str, Any]) -> None:
    """Print what was found in a robot."""
    say(f"{facts['title']}\nrobot on {facts['base']}: {facts['freedom']['words']}, {facts['mass']:.6g} kg")
    rows = []
    for joint in facts["joints"]:
        limits = joint["limits"] or {}
        mimic = joint["mimic"]
        follows = f"{mimic['joint']} x {mimic['multiplier']:g}" if mimic else ""
        span = [_maybe(limits.get(key)) for key in ("lower", "upper", "velocity", "effort")]
        rows.append([joint["name"], joint["type"], f"{joint['parent']} > {joint['child']}", *span, follows])
    headings = ("joint", "type", "links", "lower", "upper", "velocity", "effort", "follows")
    show_rows("Joints (rad, m, N m, N)", headings, rows, (3, 4, 5, 6))
    rows = [
        [x["name"], _maybe(x["mass"]), _vector(x["center_of_mass"]), _other(x["moves_with"], x["name"])]
        for x in facts["links"]
    ]
    show_rows("Links", ("link", "mass/kg", "centre of mass/m", "fixed to"), rows, (1,))
    if facts["closures"]:
        rows = [
            [x["name"], x["type"], ", ".join(x["links"]), _whole(x["equations"]), _whole(x["redundant"])]
            for x in facts["closures"]
        ]
        show_rows("Loops closed by", ("closure", "type", "links", "equations", "redundant"), rows, (3, 4))
    freedom = facts["freedom"]
    lines = ["", "Degrees of freedom"]
    lines.append(f"  {count(freedom['coordinates'], 'moving joint')} that follow no other")
    if facts["closures"] and facts["ok"]:
        lines.append(f"  loops: {count(freedom['equations'], 'independent equation')}; left: {freedom['left']}")
    if facts["assembly"]["message"]:
        lines.append(f"  {facts['assembly']['message']}")
    say("\n".join(lines))


def _maybe(number: float | None) -> str:
    return "-" if number is None else f"{number:.6g}"


def _other(name: str, own: str) -> str:
    return "" if name == own else name


def _whole(number: int | None) -> str:
    return "-" if number is None else str(number)


def _vector(numbers: Any) -> str:
    if numbers is None:
        return "-"
    return ", ".join(f"{_rounded(x):.5g}" for x in numbers)


def _rounded(number: float) -> float:
    return 0.0 if abs(number) < 5e-13 else number
