"""Facts of a feedforward: drives, errors of the expansion in the damping, and errors of links."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jounce.dynamics.limits.limit_report import LimitRows
from jounce.planning.elastic.link_errors import LinkErrors
from jounce.planning.elastic.motor_motion import Feedforward
from jounce.reporting.text.summaries import count
from jounce.reporting.text.tables import Table, number
from jounce.units.instants import interval_text, time_text

REST = 1e-6  # fraction of the largest velocity of a motor: slower motors are at rest


def feedforward_words(motion: Feedforward, resting: Mapping[str, float]) -> str:
    """Return the summary of a feedforward: its drives, its time, and the start velocities of motors."""
    elastic = [name for name, drive in motion.drives.items() if drive.elastic]
    rigid = [name for name in motion.names if name not in elastic]
    lines = [
        f"{motion.title}: {count(len(motion.names), 'drive')}, {len(elastic)} of them elastic",
        f"t = {interval_text(motion.time[0], motion.time[-1])}, {count(len(motion.time), 'instant')}",
    ]
    if rigid:
        lines.append(f"rigid: {', '.join(rigid)}")
    if resting:
        lines.append(f"not in the trajectory, held still: {', '.join(resting)}")
    velocity, largest = motion.start[1, 1], np.abs(motion.position[:, 1]).max(axis=0)
    names = [name for name, v, peak in zip(motion.names, velocity, largest, strict=True) if abs(v) > REST * peak]
    if names:
        lines.append(f"already moving at the start, as the trajectory does not begin at rest: {', '.join(names)}")
    return "\n".join(lines)


def drives_table(report: LimitRows) -> Table:
    """Return the table of the worst instants of each quantity of each drive, with broken limits marked."""
    rows = [
        [
            row.joint,
            row.quantity,
            row.unit,
            number(row.value),
            number(row.limit),
            "-" if row.ratio is None else f"{row.ratio:.4f}",
            time_text(row.time, 5),
        ]
        for row in report.rows
    ]
    marks = [[5] if row.broken else [] for row in report.rows]
    headings = ("drive", "quantity", "unit", "worst", "limit", "ratio", "at t/s")
    return Table("", headings, rows, (3, 4, 5, 6), True, marks, (5,), "broken" if any(marks) else "")


def expansion_table(motion: Feedforward) -> Table | None:
    """Return the table of errors of the regular expansion in the damping by order; None without damping."""
    rows = [
        [name, f"{1e3 * drive.time_constant:.4g}", *(f"{x:.1e}" for x in motion.expansion_errors[:, k])]
        for k, name in enumerate(motion.names)
        if (drive := motion.drives.get(name)) is not None and drive.time_constant > 0
    ]
    if not rows:
        return None
    orders = [f"order {k}" for k in range(len(motion.expansion_errors))]
    title = "Damped springs: time constant D/K, and what the expansion in it misses of the largest deflection"
    return Table(title, ("drive", "D/K in ms", *orders), rows, tuple(range(1, 2 + len(orders))))


def drives_verdict(report: LimitRows) -> str:
    """Return the verdict on the limits of drives, with the quantity nearest to a limit or with the largest excess."""
    worst = report.worst
    if worst is None:
        return "No limits are given."
    location = f"{worst.joint} {worst.quantity}, {worst.ratio:.4g} of its limit at t = {time_text(worst.time, 5)} s"
    if report.kept:
        return f"All limits kept ({len(report.limited)}).\nClosest: {location}"
    return f"{len(report.broken)} of {count(len(report.limited), 'limit')} broken.\nWorst: {location}"


def link_error_words(errors: LinkErrors) -> str:
    """Return the errors of links in a simulation, in words."""
    lines = ["Simulated with its springs, from the start, without feedback:"]
    lines += [f"  links err by at most {_largest(errors.exact, errors)} under these torques"]
    if errors.rigid is not None:
        lines += [f"  and by {_largest(errors.rigid, errors)} without what accelerates the springs"]
    return "\n".join(lines)


def _largest(values: np.ndarray, errors: LinkErrors) -> str:
    undefined = ~np.isfinite(values).all(axis=1)
    if undefined.any():
        return f"more than can be followed beyond t = {time_text(errors.time[np.argmax(undefined)])} s"
    column = int(np.argmax(values.max(axis=0)))
    return f"{values[:, column].max():.2g} {errors.units[column]} ({errors.names[column]})"


def feedforward_result(
    motion: Feedforward, file: Path, trajectory: Path | None, errors: LinkErrors | None, written: Path | None
) -> dict[str, Any]:
    """Return the results of `jounce feedforward`, as plain data in SI units."""
    names = {"worst": "value", "at": "time"}
    keys = ("joint", "quantity", "unit", "worst", "limit", "ratio", "at", "broken")
    report = motion.report
    drives = []
    for k, name in enumerate(motion.names):
        drive = motion.drives.get(name)
        drives.append(
            {
                "name": name,
                "elastic": drive is not None and drive.elastic,
                "time_constant": 0.0 if drive is None else drive.time_constant,
                "expansion_errors": motion.expansion_errors[:, k],
                "velocity_at_start": motion.start[1, 1, k],
            }
        )
    error_facts = None
    if errors is not None:
        rigid = [None] * len(errors.names) if errors.rigid is None else errors.rigid.max(axis=0)
        error_facts = [
            {"name": name, "unit": unit, "error": exact, "error_without_springs": other}
            for name, unit, exact, other in zip(
                errors.names, errors.units, errors.exact.max(axis=0), rigid, strict=True
            )
        ]
    return {
        "system": motion.title,
        "file": file,
        "trajectory": trajectory,
        "time": {"start": motion.time[0], "stop": motion.time[-1], "count": len(motion.time)},
        "drives": drives,
        "kept": report.kept,
        "limits": [{key: getattr(row, names.get(key, key)) for key in keys} for row in report.rows],
        "simulated": error_facts,
        "written": written,
    }
