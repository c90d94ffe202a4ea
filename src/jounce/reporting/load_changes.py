"""Effects of load changes on a robot in motion, in words and as data."""

from __future__ import annotations

from typing import Any

from jounce.dynamics.limits.limit_report import LimitReport
from jounce.units.instants import time_text

STILL = 1e-6  # m/s: lower speeds count as zero, as instants and rows of files have about six digits


def load_words(report: LimitReport) -> list[str]:
    """Return the load changes in words: masses, speeds, and the largest steps of torques."""
    units = {row.joint: row.unit for row in report.rows if row.unit in ("N", "N m")}
    lines = []
    for change in report.loads:
        masses = " and ".join(f"{name} by {mass:+.6g} kg" for name, mass in change.masses.items())
        moves = f"moving at {change.speed:.3g} m/s" if change.speed > STILL else "at rest"
        line = f"load: {masses} at t = {time_text(change.time)} s, {moves}"
        if change.steps:
            name = max(change.steps, key=lambda name: abs(change.steps[name]))
            step = f"{change.steps[name]:.3g} {units.get(name, 'N m')}"
            line += f"; torques step there, by {step} at most, of {name}, which no limit of their rate covers"
        lines.append(line)
    return lines


def load_facts(report: LimitReport) -> list[dict[str, Any]]:
    """Return the load changes as plain data."""
    return [
        {"time": change.time, "masses": dict(change.masses), "speed": change.speed, "steps": dict(change.steps)}
        for change in report.loads
    ]
