"""Facts of a solved or simulated motion, as plain data in SI units."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from typing_extensions import TypedDict

from jounce.dynamics.inverse.outputs.components import slack_ropes
from jounce.integrate import Simulation
from jounce.kinematics import ChunkedMotion, Motion, Status
from jounce.mechanism import AbstractMotionOutput, build, with_output_drivers
from jounce.mechanism.time import last_step_words
from jounce.reporting.unbounded import unbounded_outputs


class Span(TypedDict):
    """Instants of a motion, s."""

    start: float
    stop: float
    count: int
    solved: int


class Failure(TypedDict):
    """An instant that was not solved."""

    index: int
    time: float
    status: str
    fault: str | None


class MotionFacts(TypedDict):
    """Facts of a motion."""

    title: str
    space: Literal["planar", "spatial"]
    bodies: list[str]
    joints: list[str]
    drivers: list[str]
    forces: list[str]
    order: int
    time: Span
    failures: list[Failure]
    equations_of_joints: int
    equations_of_drivers: int
    change_points: list[float]
    backend: str  # compiler that gave the numbers
    coordinates: int
    remarks: list[str]


class EnergyFacts(TypedDict):
    """Energy of a simulation, J; None if no instant was reached."""

    start: float | None
    largest_change: float | None
    largest_kinetic: float | None


class Kink(TypedDict):
    """An instant at which a force has a kink or jumps."""

    time: float
    name: str


class SimulationFacts(MotionFacts):
    """Facts of a simulation."""

    mobility: str
    steps: int
    energy: EnergyFacts
    drift: float | None
    kinks: list[Kink]


def motion_facts(motion: Motion | ChunkedMotion) -> dict[str, Any]:
    """Return the facts of a motion: MotionFacts, or SimulationFacts.

    Parameters
    ----------
    motion : Motion or ChunkedMotion
        The motion; all chunks must have been solved.

    Examples
    --------
    >>> import jounce as jn
    >>> facts = motion_facts(jn.solve(jn.load("examples/four_bar.yaml"), order=0))
    >>> facts["drivers"], facts["equations_of_joints"], facts["time"]
    (['theta'], 5, {'start': 0.0, 'stop': 2.0, 'count': 201, 'solved': 201})
    """
    mechanism, times = motion.mechanism, motion.time
    failed = np.flatnonzero(motion.status != Status.OK)
    rows = build(with_output_drivers(mechanism)).rows
    drives = sum(name.startswith("drivers.") for name in rows)
    interval = {"start": float(times[0]), "stop": float(times[-1])}
    facts = {
        "title": mechanism.title,
        "space": mechanism.space,
        "bodies": list(mechanism.rigid_bodies),
        "joints": list(mechanism.joints),
        "drivers": list(mechanism.drivers),
        "forces": list(mechanism.forces),
        "order": motion.order,
        "time": interval | {"count": len(times), "solved": len(times) - len(failed)},
        "failures": [
            {"index": k, "time": times[k], "status": Status(motion.status[k]).name, "fault": motion.faults.get(k)}
            for k in failed.tolist()
        ],
        "equations_of_joints": len(rows) - drives,
        "equations_of_drivers": drives,
        "change_points": np.asarray(motion.change_points, float).tolist(),
        "backend": motion.backend,
        "coordinates": len(mechanism.bodies) * (3 if mechanism.space == "planar" else 6),
        "remarks": _remarks(motion),
    }
    return facts | _simulated(motion) if isinstance(motion, Simulation) else facts


def _remarks(motion: Motion | ChunkedMotion) -> list[str]:
    """Return the remarks on the instants and on outputs, such as the reason of NaN values, each once."""
    names: dict[str, list[str]] = {}
    for name, values in (motion.outputs if isinstance(motion, Motion) else {}).items():  # chunks are not kept
        output = motion.mechanism.outputs[name]
        if isinstance(output, AbstractMotionOutput) and (remark := output.remark(motion, values)):
            names.setdefault(remark, []).append(name)
    for name, instants in unbounded_outputs(motion).items():
        times = ", ".join(f"{instant:g} s" for instant in instants[:6]) + (", ..." if len(instants) > 6 else "")
        remark = f"grows without bound toward t = {times}, its extremes say only how near an instant comes"
        names.setdefault(remark, []).append(name)
    for name, remark in (slack_ropes(motion) if isinstance(motion, Motion) else {}).items():
        names.setdefault(remark, []).append(name)
    remarks = [f"{', '.join(those)}: {remark}" for remark, those in names.items()]
    return [*filter(None, [last_step_words(motion.time)]), *remarks]


def _simulated(motion: Simulation) -> dict[str, Any]:
    is_reached = motion.status == Status.OK
    any_reached, energy = bool(is_reached.any()), motion.energy[is_reached]
    return {
        "mobility": motion.mobility,
        "steps": motion.steps,
        "energy": {
            "start": energy[0] if any_reached else None,
            "largest_change": np.max(np.abs(energy - energy[0])) if any_reached else None,
            "largest_kinetic": np.max(motion.kinetic_energy[is_reached]) if any_reached else None,
        },
        "drift": np.max(motion.drift[is_reached]) if any_reached else None,
        "kinks": [{"time": time, "name": name} for time, name in motion.kinks],
    }
