"""Tables of facts of mechanisms, motions and robots as cells of text, for all outputs."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from jounce.dynamics.limits.limit_report import LimitReport
from jounce.reporting.peaks import Peak
from jounce.reporting.text.summaries import Facts
from jounce.units.instants import time_text


@dataclasses.dataclass(frozen=True)
class Table:
    """Cells of a table, as text.

    Parameters
    ----------
    title : str
        Title, which may be empty.
    headings : sequence of str
    rows : sequence of sequences of str
    numbers : sequence of int
        Columns aligned to the right.
    grouped : bool, default False
        Whether consecutive rows with the same first cell form a group.
    marks : sequence of sequences of int
        Columns of highlighted cells for each row; empty without highlights.
    markable : sequence of int
        Columns that may have highlighted cells.
    meaning : str
        Meaning of a highlight.
    """

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()
    grouped: bool = False
    marks: Sequence[Sequence[int]] = ()
    markable: Sequence[int] = ()
    meaning: str = ""


def table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> Table:
    """Return a table without its empty columns."""
    columns = [k for k in range(len(headings)) if any(row[k] for row in rows)] or [0]
    aligned = [k for k, column in enumerate(columns) if column in numbers]
    return Table(title, [headings[k] for k in columns], [[row[k] for k in columns] for row in rows], aligned)


def mechanism_tables(facts: Facts, bodies: Table) -> list[Table]:
    """Return parameters, bodies, elements and outputs of a mechanism."""
    parameters = [[p["name"], f"{p['value']:.9g}", p["unit"] or "", p["written"] or ""] for p in facts["parameters"]]
    tables = [table("Parameters (SI)", ("name", "value", "unit", "as written"), parameters, (1,)), bodies]
    for section, title in (("joints", "Joints"), ("drivers", "Drivers"), ("initial", "Initial conditions")):
        rows = [
            [x["name"], x["type"], ", ".join(x["bodies"]), str(x.get("rows", "")), x.get("motion", "")]
            for x in facts[section]
        ]
        tables.append(table(title, (section.rstrip("s"), "type", "bodies", "equations", "motion"), rows, (3,)))
    forces = [[x["name"], x["type"], ", ".join(x["bodies"]), x.get("law", "")] for x in facts["forces"]]
    outputs = [[x["name"], x["quantity"], ", ".join(x["of"]), x["unit"]] for x in facts["outputs"]]
    tables.append(table("Forces", ("force", "type", "bodies", "law"), forces))
    tables.append(table("Outputs", ("output", "quantity", "of", "unit"), outputs))
    return [each for each in tables if each.rows]


def bodies_table(facts: Facts) -> Table:
    """Return the bodies of an inspected mechanism."""
    angle = "angle" if facts["space"] == "planar" else "quaternion"
    rows = []
    for body in facts["bodies"]:
        pose, offset, text = body["pose"] or body["guess"], body["moved"], "-"
        rotation = [pose[angle]] if angle == "angle" else pose[angle]
        if offset is not None:
            text = f"{_rounded(offset['distance']):.3g} m, {_rounded(math.degrees(offset['angle'])):.3g} deg"
        rows.append([body["name"], number(body["mass"]), vector(pose["position"]), vector(rotation), text])
    state_words = "assembled" if facts["assembly"]["status"] == "assembled" else "as guessed"
    title = f"Bodies, {state_words}, at t = {time_text(facts['assembly']['at'])} s"
    return table(title, ("body", "mass/kg", "position/m", "angle/rad" if angle == "angle" else angle, "moved by"), rows)


def robot_tables(facts: Facts) -> list[Table]:
    """Return the joints, links and closures of a robot."""
    moving, fixed = [], []
    for joint in facts["joints"]:
        links = f"{joint['parent']} > {joint['child']}"
        if joint["limits"] is None:
            fixed.append([joint["name"], links])
            continue
        limits, mimic = joint["limits"], joint["mimic"]
        is_unlimited = limits["lower"] is None and limits["upper"] is None
        range_words = "-" if is_unlimited else f"{number(limits['lower'])} to {number(limits['upper'])} {joint['unit']}"
        follows = _followed(mimic) if mimic else ""
        maxima = [number(limits[key]) for key in ("velocity", "effort")]
        moving.append([joint["name"], joint["type"], links, range_words, *maxima, follows])
    headings = ("joint", "type", "links", "range", "velocity", "effort", "follows")
    links = []
    for link in facts["links"]:
        holder = "" if link["moves_with"] == link["name"] else link["moves_with"]
        links.append([link["name"], number(link["mass"]), vector(link["center_of_mass"]), holder])
    closures = [
        [x["name"], x["type"], ", ".join(x["links"]), *(_count(x, key) for key in ("equations", "redundant"))]
        for x in facts["closures"]
    ]
    tables = [
        table("Moving joints (rad, m, N m, N)", headings, moving, (4, 5)),
        table("Fixed joints", ("joint", "links"), fixed),
        table("Links", ("link", "mass/kg", "center of mass/m", "fixed to"), links, (1,)),
        table("Loops closed by", ("closure", "type", "links", "equations", "redundant"), closures, (3, 4)),
    ]
    return [each for each in tables if each.rows]


def _followed(mimic: Facts) -> str:
    """Return which joints one follows, and how fast."""
    leaders, multipliers = mimic["joint"], mimic["multiplier"]
    if isinstance(leaders, str):
        leaders, multipliers = [leaders], [multipliers]
    return ", ".join(f"{name} x {multiplier:g}" for name, multiplier in zip(leaders, multipliers, strict=True))


def other_reader_table(facts: Facts) -> Table:
    """Return the joints of a robot file in the numbering of another program."""
    rows = []
    for joint in facts["joints"]:
        single = joint["positions"] == ["value"]
        ranges = [
            span(joint[first], joint[several])
            for first, several in (("position", "positions"), ("velocity", "velocities"))
        ]
        coordinates = ", ".join(joint["coordinates"])
        if joint["factors"] is not None:
            sums = [" + ".join(f"{x:.6g} {name}" for name, x in row.items()) for row in joint["factors"]]
            coordinates = "; ".join(sums).replace("+ -", "- ")
            coordinates += f" + {joint['offset']:g}" if joint["offset"] else ""
        forms = "" if single else f"{' '.join(joint['positions'])} | {' '.join(joint['velocities'])}"
        rows.append([joint["joint"], *ranges, coordinates, forms, joint["note"]])
    headings = ("joint", "position", "velocity", "in ours", "holds", "note")
    return table(f"As {facts['name']} {facts['version']} has it", headings, rows, (1, 2))


def span(first: int, parts: Sequence[str]) -> str:
    """Return the range of numbers of the parts, counted from a first number."""
    last = first + len(parts) - 1
    return "-" if not parts else str(first) if last == first else f"{first}..{last}"


def _count(closure: Facts, key: str) -> str:
    value = closure.get(key, "")
    return "-" if value is None else str(value)


def peaks_table(given: Sequence[Peak]) -> Table:
    """Return peak values with their times, unless they are constant; the largest magnitudes are highlighted."""
    latest = max((abs(at) for p in given for at in (p.minimum_at, p.maximum_at) if math.isfinite(at)), default=1.0)
    decimals = max(3 - math.floor(math.log10(latest or 1.0)), 3)  # of times: enough digits for a reader
    rows = []
    for peak in given:
        early, late = (
            time_text(x if float(f"{x:.3g}") == x else round(x, decimals)) if peak.varies else "-"
            for x in (peak.minimum_at, peak.maximum_at)
        )
        low, high = map(number, peak.shown)
        rows.append([peak.output, peak.derivative, peak.unit, low, early, high, late])
    marks = [[k for k, largest in zip((3, 5), peak.largest, strict=True) if largest] for peak in given]
    headings = ("output", "derivative", "unit", "minimum", "at t/s", "maximum", "at t/s")
    return Table("", headings, rows, (3, 4, 5, 6), True, marks, (3, 5), "largest magnitude")


def limits_table(report: LimitReport) -> Table:
    """Return the worst instant of each joint and quantity with a limit; violated limits are highlighted."""
    rows = [
        [row.joint, row.quantity, row.unit, "infinite" if row.infinite else number(row.value), number(row.limit or 0.0),
         f"{row.ratio or 0.0:.4f}", time_text(row.time, 5)]
        for row in report.limited
    ]  # fmt: skip
    marks = [[5] if row.broken else [] for row in report.limited]
    headings = ("joint", "quantity", "unit", "worst", "limit", "ratio", "at t/s")
    return Table("", headings, rows, (3, 4, 5, 6), True, marks, (5,), "broken" if any(marks) else "")


def number(value: float | None) -> str:
    """Return the text of a number for readers, or a dash for a missing number."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.6g}"


def vector(values: Sequence[float] | None) -> str:
    """Return the text of the components of a vector."""
    return "-" if values is None else ", ".join(f"{_rounded(x):.5g}" for x in values)


def _rounded(value: float) -> float:
    return 0.0 if abs(value) < 5e-13 else value
