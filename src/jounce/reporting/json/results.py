"""Results of commands as JSON: SI units, null for values that are not finite, stable keys."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from jounce.dynamics.limits.limit_report import LimitReport
from jounce.dynamics.limits.motion_ends import TrajectoryEnd
from jounce.dynamics.limits.trajectories import drives_note
from jounce.errors import UNSET, JounceError, show_value
from jounce.kinematics import ChunkedMotion, Motion
from jounce.reporting.facts.mechanism.mechanism_facts import grid_facts
from jounce.reporting.facts.motion_facts import motion_facts
from jounce.reporting.load_changes import load_facts
from jounce.reporting.motion_ends import between_facts, ends_facts
from jounce.reporting.peaks import Peak, peaks
from jounce.trajectory import JointTrajectory

if TYPE_CHECKING:
    import xarray

    from jounce.integrate.results.robot_simulation import RobotSimulation

VERSION = 1
"""Version of the format of the results; it increases if a key changes or is removed."""


def plain(value: Any) -> Any:
    """Return a value for JSON: None for numbers that are not finite, lists for arrays, text for paths.

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


def result_json(command: str, data: Mapping[str, Any]) -> str:
    """Return the JSON text of the result of a command."""
    from jounce.version import __version__

    record = {"jounce": __version__, "record": VERSION, "command": command, **plain(data)}
    return json.dumps(record, indent=1, allow_nan=False)


def error_as_json(kind: str, problem: object) -> str:
    """Return an error or a warning as JSON in one line: its kind, message, file, line, name and value."""
    record: dict[str, Any] = {"kind": type(problem).__name__ if isinstance(problem, Exception) else "Error"}
    cause = problem.args[0] if isinstance(problem, Exception) and problem.args else None
    cause_or_problem = cause if isinstance(cause, JounceError) else problem
    if isinstance(cause_or_problem, JounceError):
        record["kind"] = type(cause_or_problem).__name__
        value = None if cause_or_problem.value is UNSET else plain(cause_or_problem.value)
        path = None if cause_or_problem.path is None else str(cause_or_problem.path)
        record |= {
            "message": cause_or_problem.message,
            "file": path,
            "line": cause_or_problem.line,
            "name": cause_or_problem.name,
            "value": value,
        }
    else:
        record |= {"message": str(cause_or_problem), "file": None, "line": None, "name": None, "value": None}
    record["text"] = " ".join(str(cause_or_problem).split())
    if details := getattr(cause_or_problem, "details", ""):
        record["details"] = details
    return json.dumps({kind: record}, allow_nan=False)


def motion_result(
    motion: Motion | ChunkedMotion, file: Path, written: Path | None, refine: bool = True
) -> dict[str, Any]:
    """Return the results of `jounce run` and `jounce simulate` for a motion."""
    peak_records = [peak_facts(peak) for peak in peaks(motion, refine=refine)]
    return {"file": file, **motion_facts(motion), "peaks": peak_records, "written": written}


def peak_facts(peak: Peak) -> dict[str, Any]:
    """Return the facts of a peak, in SI."""
    record = dataclasses.asdict(peak)
    del record["size"]
    return record


def limits_result(
    report: LimitReport, robot: Path, trajectory: Path, written: Path | None, motion: JointTrajectory | None = None
) -> dict[str, Any]:
    """Return the results of `jounce check` for a trajectory and the limits of a robot."""
    names = {"worst": "value", "at": "time"}
    keys = ("joint", "quantity", "unit", "worst", "limit", "ratio", "at", "broken")
    return {
        "robot": report.robot,
        "file": robot,
        "trajectory": trajectory,
        "kept": report.kept,
        "broken": len(report.broken),
        "time": {"start": report.times[0], "stop": report.times[-1], "count": len(report.times)},
        "held": dict(report.held),
        "drives": report.drives,
        "limits": [{key: getattr(row, names.get(key, key)) for key in keys} for row in report.rows],
        "ends": ends_facts(report.ends),
        "hand_over": report.hand_over,
        "loads": load_facts(report),
        "between": None if motion is None else between_facts(motion),
        "written": written,
    }


def robot_motion_result(
    motion: RobotSimulation, peaks_found: Iterable[Peak], file: Path, written: Path | None
) -> dict[str, Any]:
    """Return the results of `jounce simulate` for a robot file."""
    energy = [float(x) if math.isfinite(x) else None for x in motion.energy[[0, -1]]]
    peak_records = [peak_facts(peak) for peak in peaks_found]
    return {
        "robot": motion.robot.name,
        "file": file,
        "order": motion.order,
        "time": grid_facts(motion.time),
        "followed_to": motion.ended_at,
        "energy_at_start": energy[0],
        "energy_at_stop": energy[1],
        "backend": motion.backend,
        "peaks": [{"joint": peak.pop("output"), **peak} for peak in peak_records],
        "ok": not motion.status.any(),
        "written": written,
    }


def torques_result(
    dataset: xarray.Dataset,
    peaks_found: Iterable[Peak],
    motion: JointTrajectory,
    ends: Sequence[TrajectoryEnd],
    files: tuple[Path, Path],
    written: Path | None,
) -> dict[str, Any]:
    """Return the results of `jounce torques` for a robot on a trajectory."""
    (robot, trajectory), times = files, dataset["time"].values
    peak_records = [peak_facts(peak) for peak in peaks_found]
    return {
        "robot": dataset.attrs["title"],
        "file": robot,
        "trajectory": trajectory,
        "rates": dataset.sizes["derivative"] - 1,
        "time": grid_facts(times),
        "held": [name for name in dataset.data_vars if name not in motion.names],
        "drives": dataset.attrs["drives"] == drives_note(True),
        "peaks": [{"joint": peak.pop("output"), **peak} for peak in peak_records],
        "ends": ends_facts(ends),
        "between": between_facts(motion),
        "written": written,
    }
