"""Facts of a smoothed log: noise, distances, cutoff frequencies and dwells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jounce.planning.smoothing.smooth import SmoothedTrajectory
from jounce.reporting.text.tables import Table

SHOWN = 3  # largest number of dwells in the table


def smoothing_table(motion: SmoothedTrajectory) -> Table:
    """Return the table of the smoothing results of each joint."""
    rows = [
        [
            name,
            f"{joint.noise:.3g}",
            f"{joint.away:.3g}",
            f"{joint.cutoff[0]:.3g} to {joint.cutoff[1]:.3g}",
            _dwells(joint.dwells),
        ]
        for name, joint in motion.joints.items()
    ]
    heading = ("joint", "noise", "farthest", "followed below, Hz", "stands still, s")
    return Table("", heading, rows, numbers=(1, 2))


def smoothing_result(
    motion: SmoothedTrajectory, files: tuple[Path, Path], rows: int, written: tuple[Path | None, Path | None]
) -> dict[str, Any]:
    """Return the results of `jounce smooth`."""
    return {
        "file": files[0],
        "trajectory": files[1],
        "time": {"start": motion.start, "stop": motion.stop, "count": rows},
        "deviation": motion.deviation,
        "joints": [
            {
                "joint": name,
                "noise": joint.noise,
                "farthest": joint.away,
                "followed": list(joint.cutoff),
                "dwells": [list(span) for span in joint.dwells],
            }
            for name, joint in motion.joints.items()
        ],
        "follows_noise": [name for name, joint in motion.joints.items() if joint.follows_noise(motion.deviation)],
        "written": written[0],
        "figure": written[1],
    }


def _dwells(intervals: tuple[tuple[float, float], ...]) -> str:
    shown = [f"{first:.4g} to {last:.4g}" for first, last in intervals[:SHOWN]]
    return ", ".join([*shown, f"and {len(intervals) - SHOWN} more"] if len(intervals) > SHOWN else shown)
