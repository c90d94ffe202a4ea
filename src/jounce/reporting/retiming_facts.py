"""Facts of a retimed trajectory: its duration, and the limits that bind it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jounce.dynamics.limits.limit_report import LimitReport
from jounce.dynamics.limits.trajectories import drives_note
from jounce.planning import RetimedTrajectory
from jounce.planning.paths.path import Path as JointPath
from jounce.reporting.json.results import limits_result
from jounce.reporting.load_changes import load_words
from jounce.reporting.motion_ends import ends_words
from jounce.reporting.text.summaries import count
from jounce.reporting.text.tables import Table, number
from jounce.units.instants import time_text

NEGLIGIBLE = 1e-9  # rad or m: smaller distances of a path from a trajectory are rounding, and are not shown


def binding_facts(retimed: RetimedTrajectory) -> list[dict[str, Any]]:
    """Return the limits that bind, by decreasing price, with the time for which they bind, s.

    The price is the decrease of the duration per relative increase of the limit, s; an increase by a percent gains a
    hundredth of it.
    """
    active = retimed.active
    times = active["time"].values
    weights = np.gradient(times)
    rows = [
        {
            "limit": str(name),
            "unit": str(active["unit"].values[k]),
            "seconds": float(weights @ active["binds"].values[:, k]),
            "price": float(active["price"].values[:, k].sum()),
        }
        for k, name in enumerate(active["limit"].values)
    ]
    return sorted((row for row in rows if row["seconds"] > 0), key=lambda row: -row["price"])


def binding_table(retimed: RetimedTrajectory) -> Table:
    """Return the limits that bind as a table."""
    rows = [
        [
            row["limit"],
            row["unit"],
            number(row["seconds"]),
            f"{100 * row['seconds'] / retimed.stop:.1f}",
            f"{10 * row['price']:.4g}",
        ]
        for row in binding_facts(retimed)
    ]
    headings = ("limit that binds", "unit", "for s", "% of time", "ms saved if 1 % higher")
    return Table("", headings, rows, (2, 3, 4))


def retimed_words(
    retimed: RetimedTrajectory, before: float | None, free: float, files: list[str], read: LimitReport | None
) -> str:
    """Return the summary of a retimed trajectory: its duration, and that it keeps its limits."""
    change = "" if before is None else f", {before:.6g} s before"
    noun = "joint" if retimed.report.held or len(retimed.report.values[0, 0]) else "driver"
    lines = [f"{retimed.report.robot}: {count(len(retimed.names), noun)} ({', '.join(files)})", f"{free:.6g} s{change}"]
    if read is not None:
        lines.append(
            f"written: {retimed.stop:.6g} s in {len(retimed.times)} rows; splines through them keep the limits too "
            f"({100 * (retimed.stop / free - 1):.2f} % slower)"
        )
    if noun == "joint" and any(row.unit.startswith("N") for row in retimed.report.limited):
        lines.append(f"torques: {drives_note(retimed.report.drives)}")
    lines += [*path_words(retimed.path), *ends_words(retimed.report.ends)]
    lines += load_words(retimed.report)
    worst = retimed.report.worst
    if worst is not None and worst.ratio is not None:
        verdict = f"all {len(retimed.report.limited)} limits kept, between rows too; nearest"
        lines.append(
            f"{verdict if retimed.report.kept else 'NOT all limits kept; worst'}: {worst.joint} {worst.quantity}, "
            f"{worst.ratio:.6f} of its limit at t = {time_text(worst.time, 5)} s"
        )
    return "\n".join(lines)


def path_words(path: JointPath) -> list[str]:
    """Return the path between given points in words, with its distance from the straight lines between them."""
    if path.words.startswith("within"):
        return [f"path: {path.words}; at most {path.deviation:.2g} from them"]
    if path.words:
        bound = "" if path.allowed is None else f" ({path.allowed:.3g} allowed)"
        deviation = f"at most {path.deviation:.2g} rad or m{bound}"
        return [f"path: {path.words}; {deviation} from the straight lines between them"]
    if path.deviation > NEGLIGIBLE:
        return [f"path: within {path.deviation:.1e} rad or m of the given trajectory"]
    return []


def retiming_result(
    retimed: RetimedTrajectory,
    before: float | None,
    free: float,
    files: tuple[Path, Path | None],
    written: tuple[Path | None, Path | None],
) -> dict[str, Any]:
    """Return the results of `jounce retime`."""
    facts = limits_result(retimed.report, files[0], files[1] or files[0], written[0])
    del facts["held"], facts["broken"], facts["between"]
    return {
        **facts,
        "trajectory": files[1],
        "duration": free,
        "before": before,
        "path": retimed.path.words or None,
        "deviation": retimed.path.deviation,
        "deviation_allowed": retimed.path.allowed,
        "binding": binding_facts(retimed),
        "figure": written[1],
    }
