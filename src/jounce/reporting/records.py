"""Results of commands as JSON: SI units, null for what is not a number, keys that stay."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from jounce.errors import UNSET, JounceError, show_value

if TYPE_CHECKING:
    from jounce.dynamics.limits import LimitReport
    from jounce.kinematics import Motion

__all__ = ["complaint", "limits_record", "motion_record", "plain", "record"]

VERSION = 1
"""Number of the form of the records; it grows where a key changes or goes."""


def plain(value: Any) -> Any:
    """Return a value as JSON has it: None for numbers that are not finite, lists for arrays, text for paths.

    Examples
    --------
    >>> import numpy as np
    >>> plain({"peak": np.float64("nan"), "at": np.array([1.0, 2.0])})
    {'peak': None, 'at': [1.0, 2.0]}
    """
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, bool) or value is None or isinstance(value, int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, PurePath) else show_value(value, 200)


def record(command: str, data: Mapping[str, Any]) -> str:
    """Return the JSON text of the result of a command."""
    from jounce import __version__

    whole = {"jounce": __version__, "record": VERSION, "command": command, **plain(data)}
    return json.dumps(whole, indent=1, allow_nan=False)


def complaint(kind: str, problem: object) -> str:
    """Return an error or a warning as JSON in one line: its kind, message, file, line, name and value."""
    told: dict[str, Any] = {"kind": type(problem).__name__ if isinstance(problem, Exception) else "Error"}
    cause = problem.args[0] if isinstance(problem, Exception) and problem.args else None
    found = cause if isinstance(cause, JounceError) else problem
    if isinstance(found, JounceError):
        told["kind"] = type(found).__name__
        value = None if found.value is UNSET else plain(found.value)
        place = None if found.path is None else str(found.path)
        told |= {"message": found.message, "file": place, "line": found.line, "name": found.name, "value": value}
    else:
        told |= {"message": str(found), "file": None, "line": None, "name": None, "value": None}
    told["text"] = " ".join(str(found).split())
    return json.dumps({kind: told}, allow_nan=False)


def motion_record(motion: Motion, file: Any, written: Any) -> dict[str, Any]:
    """Return what `jounce run` and `jounce simulate` tell of a motion."""
    import numpy as np

    from jounce.kinematics import Status
    from jounce.reporting.peaks import peaks

    mechanism, times = motion.mechanism, motion.time
    failed = np.flatnonzero(motion.status != Status.OK)
    found: dict[str, Any] = {
        "file": file,
        "title": mechanism.title,
        "space": mechanism.space,
        "bodies": list(mechanism.bodies),
        "joints": list(mechanism.joints),
        "drivers": list(mechanism.drivers),
        "forces": list(mechanism.forces),
        "order": motion.order,
        "time": {"start": times[0], "stop": times[-1], "count": len(times), "solved": len(times) - len(failed)},
        "failures": [
            {"index": k, "time": times[k], "status": Status(motion.status[k]).name, "culprit": motion.culprits.get(k)}
            for k in failed.tolist()
        ],
        "peaks": [_peak(peak) for peak in peaks(motion)],
        "written": written,
    }
    if hasattr(motion, "energy"):
        reached: Any = motion.status == Status.OK
        energy = motion.energy[reached]  # type: ignore[attr-defined]
        drift = motion.drift[reached]  # type: ignore[attr-defined]
        some = bool(reached.any())
        found |= {
            "mobility": motion.mobility,  # type: ignore[attr-defined]
            "steps": motion.steps,  # type: ignore[attr-defined]
            "energy": {
                "start": energy[0] if some else None,
                "largest_change": np.max(np.abs(energy - energy[0])) if some else None,
            },
            "drift": np.max(drift) if some else None,
        }
    return found


def _peak(peak: Any) -> dict[str, Any]:
    return {
        "output": peak.output,
        "derivative": peak.derivative,
        "unit": peak.unit,
        "minimum": peak.minimum,
        "minimum_at": peak.minimum_at,
        "maximum": peak.maximum,
        "maximum_at": peak.maximum_at,
    }


def limits_record(report: LimitReport, robot: Any, trajectory: Any, written: Any) -> dict[str, Any]:
    """Return what `jounce check` tells of a trajectory and the limits of a robot."""
    rows = [
        {
            "joint": row.joint,
            "quantity": row.quantity,
            "unit": row.unit,
            "worst": row.value,
            "limit": row.limit,
            "ratio": row.ratio,
            "at": row.time,
            "broken": row.broken,
        }
        for row in report.rows
    ]
    return {
        "robot": report.robot,
        "file": robot,
        "trajectory": trajectory,
        "kept": report.kept,
        "broken": len(report.broken),
        "time": {"start": report.times[0], "stop": report.times[-1], "count": len(report.times)},
        "held": dict(report.held),
        "limits": rows,
        "written": written,
    }
