"""Start of a mechanism: its assembly at the first instant and its degrees of freedom, as plain data."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np
from typing_extensions import TypedDict

from jounce.dynamics.forward.initial_state import initial_as_drivers
from jounce.errors import JounceError, MobilityError
from jounce.kinematics.assembly.assemble import (
    check_assembled,
    check_mobility,
    find_assembly,
    freely_moving,
    redundancy_of,
    warn_of_parts_turned_over,
)
from jounce.kinematics.assembly.gauss_newton import Displacements, assemble_from_guess
from jounce.kinematics.assembly.idle_motions import idle_motions
from jounce.kinematics.assembly.mobility import Mobility, independent, mobility
from jounce.linear_algebra.host_jacobian import HostJacobian
from jounce.mechanism import Mechanism, Model, build
from jounce.mechanism.building.builder import with_reference
from jounce.reporting.text.summaries import freedom_words

TOLERANCE = 1e-12


class RepetitionFacts(TypedDict):
    """A joint or driver with equations that follow from those of others, and their number."""

    kind: str
    name: str
    equations: int
    of: list[str]


class FreedomFacts(TypedDict):
    """Numbers of coordinates and equations, and the remaining degrees of freedom."""

    coordinates: int
    equations: int
    of_drivers: int
    independent: int
    of_joints: int
    left: int
    redundant: int
    redundant_among: list[str]
    repeated: list[RepetitionFacts]
    moving: list[str]
    idle: list[list[str]]
    words: str
    message: str | None


class AssemblyFacts(TypedDict):
    """Whether the bodies can be assembled, at which instant, and the largest gap of the joints."""

    status: Literal["assembled", "open"]
    message: str | None
    at: float
    open: float | None


class BranchFacts(TypedDict):
    """A family of motions: the tangent of each body, m and rad up to a factor."""

    freedom: int
    cusp: bool
    tangents: dict[str, list[list[float]]]


class MobilityFacts(TypedDict):
    """Mobility of a mechanism with its drivers released: see `jounce.kinematics.Mobility`."""

    count: int
    instantaneous: int
    finite: int
    order: int | None
    kind: str
    blocked: int | None
    branches: list[BranchFacts]
    words: str


class StartingState:
    """The mechanism assembled at its first instant, with its degrees of freedom."""

    def __init__(self, mechanism: Mechanism, model: Model, instant: float):
        self.mechanism, self.model, self.instant = mechanism, model, instant
        self.is_singular, self.jacobian = False, None
        self.coordinates, self.assembly = self._assembled()
        self.freedom = self._counted()
        massive = any(body.mass is not None for body in mechanism.bodies.values())
        prescribed = self.freedom["left"] == 0 or self.freedom["idle"]
        possible = not self.is_singular and bool(prescribed or massive)
        self.ok = self.assembly["status"] == "assembled" and possible

    def mobility(self) -> dict[str, Any] | None:
        """Return the mobility with drivers released; None if the mechanism cannot be assembled."""
        is_rolling = any(joint.nonholonomic for joint in self.mechanism.joints.values())  # motions depend on rates
        if self.coordinates is None or self.jacobian is None or is_rolling:
            return None
        joints = self.jacobian.take(np.array([name.startswith("joints.") for name in self.model.rows], bool))
        equations, columns = joints.shape
        are_independent = joints.rank == equations
        return _facts_of(independent(columns, equations) if are_independent else mobility(self.mechanism, self.instant))

    def _assembled(self) -> tuple[dict[str, Any] | None, dict[str, Any]]:
        facts = {"status": "assembled", "message": None, "at": self.instant, "open": None}
        model = build(initial_as_drivers(self.mechanism)) if self.mechanism.initial else self.model
        if not model.rows:
            return model.guess, facts
        model, trial = find_assembly(model, self.instant, TOLERANCE)
        facts["open"] = float(np.max(np.abs(trial.gaps))) if np.isfinite(trial.gaps).all() else None
        try:
            check_assembled(model, trial, self.instant)
        except JounceError as error:
            return None, facts | {"status": "open", "message": error.message}
        warn_of_parts_turned_over(model, trial)
        return trial.coordinates, facts

    def _counted(self) -> dict[str, Any]:
        mechanism, model, coordinates = self.mechanism, self.model, self.coordinates
        columns = int(model.system.shape[1])
        if coordinates is not None:
            model, _ = with_reference(dataclasses.replace(model, guess=coordinates), coordinates, self.instant)
        trial = assemble_from_guess(model, self.instant, TOLERANCE) if model.rows else None
        facts, message, idle = None, None, {}
        pattern = model.system.pattern
        jacobian = HostJacobian.of(pattern, np.zeros(pattern.entry_count))
        if trial is not None and trial.jacobian.finite().all():
            self.jacobian, self.row_scale = trial.jacobian, model.system.row_scale
            model, facts = redundancy_of(model, trial, self.instant)
            jacobian = facts.jacobian
            try:
                check_mobility(model, facts)
            except MobilityError as error:
                idle = idle_motions(model, facts, trial.coordinates, Displacements(model, self.instant))
                message = None if idle else error.message
        drives = np.array([name.startswith("drivers.") for name in model.rows], bool)
        freedom, rank = columns - jacobian.take(~drives).rank, jacobian.rank
        repeated = () if facts is None else facts.repetitions
        self.is_singular = facts is not None and facts.is_singular
        return {
            "coordinates": columns,
            "equations": len(model.rows),
            "of_drivers": int(drives.sum()),
            "independent": rank,
            "of_joints": freedom,
            "left": columns - rank,
            "redundant": len(model.rows) - rank,
            "redundant_among": [] if facts is None else list(facts.among),
            "repeated": [{**x._asdict(), "of": list(x.of)} for x in repeated],
            "moving": freely_moving(model, jacobian.free_directions).split(", ") if columns > rank else [],
            "idle": [list(bodies) for bodies, _ in idle.values()],
            "words": freedom_words(freedom, mechanism.drivers),
            "message": message,
        }


def _facts_of(result: Mobility) -> dict[str, Any]:
    """Return a mobility as plain data."""
    return {
        "count": result.count,
        "instantaneous": result.instantaneous,
        "finite": result.finite,
        "order": result.order,
        "kind": result.kind,
        "blocked": result.blocked,
        "branches": [
            {
                "freedom": branch.freedom,
                "cusp": branch.cusp,
                "tangents": {name: vectors.tolist() for name, vectors in branch.tangents.items()},
            }
            for branch in result.branches
        ],
        "words": str(result),
    }
