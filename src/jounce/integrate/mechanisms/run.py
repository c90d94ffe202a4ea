"""A run of a mechanism: its steps, and the explanation if they fail."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.accelerations import Equations, Instants, State
from jounce.dynamics.forward.initial_state import ConsistentStart
from jounce.dynamics.friction.coupling import joints_with_friction
from jounce.dynamics.motion_values import Coordinates, cut, pose_of
from jounce.execution.compilation import compiled
from jounce.integrate.marching.marching import STUCK, DenseOutput, Outcome, RunLimits, march, unexpanded
from jounce.integrate.marching.runs import AbstractRun
from jounce.integrate.mechanisms.programs_ahead import march_settings
from jounce.integrate.steps.events import EventDetector, pose_coordinates
from jounce.integrate.steps.lookahead import hiding_names, watched_names
from jounce.integrate.steps.methods import AbstractMethod, evaluated
from jounce.jet import Jet
from jounce.kinematics import Status
from jounce.kinematics.position_analysis.curve_ends import ends_of
from jounce.mechanism.building.element_indices import force_names

AHEAD = 1e-9  # of the time so far: distance of the instant beyond collapsed steps that is checked for finite values
FEW = 4  # derivatives that are checked for finite values


class MechanismRun(AbstractRun):
    """A run of a mechanism; `watched` tells whether the user requests events."""

    def __init__(
        self,
        start: ConsistentStart,
        method: AbstractMethod,
        limits: RunLimits,
        detectors: Sequence[EventDetector],
        *,
        watched: bool,
    ):
        order, instant = method.expansion_order(float(limits.tolerance)), np.array([limits.start])
        super().__init__(unexpanded(start.equations, start.state, instant, order=order), limits, detectors)
        self.start = start
        self._settings = march_settings(start.equations, self.current, method, watched=watched)

    def attempted(self) -> tuple[Any, tuple[Any, Any], Any]:
        """See `AbstractRun`."""
        return march(self.start.equations, self.current, self.limits, **self._settings)

    def initial_step(self) -> DenseOutput:
        """See `AbstractRun`."""
        current = self.current
        polynomial = current.expansion.state.map(lambda part: np.asarray(part)[None, ..., 0])
        angles = tuple(np.asarray(part).T for part in current.angles)
        return DenseOutput(np.asarray(current.time), np.zeros(1), polynomial, np.full(1, -1), angles)

    def note_ends(self, first: int) -> None:
        """Set the ending to an end of a curve if one of the events from index `first` on happened."""
        for k, ends in enumerate(ends_of(self.start.model)):
            for beyond_high in (False, True):
                for instant in self.happened[first + 2 * k + beyond_high]:
                    self.ending = Status.END_OF_CURVE, f"{ends.words(beyond_high)} at t = {instant:g} s"
                    self.stopped_at = None

    def explained(self) -> tuple[Status, str]:
        """Return the reason why the steps ended, and the force, joint or body to look at."""
        current = self.current
        series, time = current.expansion.state, current.time.item()
        start = dataclasses.replace(self.start, equations=self.start.equations.near(current.angles))
        ahead_by = self.direction * AHEAD * max(abs(time), abs(time - self.limits.start))
        ahead = evaluated(series.map(lambda part: part[:2]), np.array([ahead_by]))
        for state, instant in ((series.map(lambda part: part[0]), time), (ahead, time + ahead_by)):
            finite = all(np.isfinite(part).all() for part in state)
            if finite and (names := _unfit(start, state, instant)):
                return Status.INADMISSIBLE, f"{names} at t = {instant:g} s"
        if names := _unfit_rates(start, pose_coordinates(series), time):
            return Status.INADMISSIBLE, f"a derivative of {names} at t = {time:g} s"
        if current.outcome.item() == Outcome.UNBALANCED:
            names = hiding_names(self.start.model, start.equations, series.map(lambda x: x[0]), np.array([[time]]))
            return Status.UNBALANCED, f"{', '.join(names) or 'all joints'} at t = {time:g} s"
        kink = int(self.parts[-1].kink[-1]) if self.parts else -1
        if current.short.item() >= STUCK and kink >= 0:
            fault = "switches without end, as dry friction does at rest: smooth it, as by tanh(v/v0)"
            return Status.COLLAPSED, f"{watched_names(self.start.model)[kink]} at t = {time:g} s {fault}"
        acceleration = np.abs(np.asarray(current.expansion.acceleration[0])[..., 0])
        joints = joints_with_friction(self.start.model, self.start.model.system)
        if joints and not np.isfinite(acceleration).all():
            return Status.LOCKED, f"friction locks at t = {time:g} s: {', '.join(joints)}"
        if (blocked := current.blocked.item()) >= 0:
            return Status.COLLAPSED, f"{watched_names(self.start.model)[blocked]} at t = {time:g} s"
        scale = np.asarray(self.start.equations.system.column_scale)[:, None]
        sizes = np.nan_to_num(acceleration / scale, nan=np.inf).max(axis=0)
        return Status.COLLAPSED, f"body {self.start.model.bodies[int(np.argmax(sizes))]}"


def unsound_forces(start: ConsistentStart, sound: Bool[np.ndarray, " force"]) -> str:
    """Return the names of the applied forces that are not sound, as text."""
    return ", ".join(f"forces.{n}" for n, is_sound in zip(force_names(start.model), sound, strict=True) if not is_sound)


def _unfit(start: ConsistentStart, state: State, instant: float) -> str:
    """Return the names of the applied forces that are not finite in a state, as text."""
    system = start.equations.system
    if not system.forces:
        return ""
    return unsound_forces(start, np.asarray(_finite_forces(start.equations, state, np.array([[instant]])))[:, 0])


@compiled(narrow=True, brief=True)
def _finite_forces(equations: Equations, state: State, time: Instants) -> Bool[Numbers, "force 1"]:
    return equations.system.finite_forces(equations.pose(state), Jet.variable(time, 1))


def _unfit_rates(start: ConsistentStart, coordinates: Coordinates, instant: float) -> str:
    """Return the names of the applied forces with low derivatives that are not finite at an instant, as text."""
    is_finite = np.isfinite(coordinates["position"]).reshape(len(coordinates["position"]), -1).all(axis=1)
    order = min(int(np.argmin(np.append(is_finite, False))) - 1, FEW)
    if order < 1:
        return ""
    pose = pose_of(cut(coordinates, order), start.model.pose_type)
    clock, names = Jet.variable(np.array([[instant]]), order), []
    for group, members in zip(start.equations.system.forces, start.model.forces, strict=True):
        with np.errstate(all="ignore"):  # nonfinite values are reported by name
            sizes = np.stack([np.asarray(c) for c in group.force(pose, clock).dense().coefficients])
        sizes = np.broadcast_to(sizes, (*sizes.shape[:2], len(members), 1))
        is_sound = np.atleast_1d(np.isfinite(sizes).all(axis=(0, 1, 3)))
        names += [f"forces.{name}" for name, fit in zip(members, is_sound, strict=True) if not fit]
    return ", ".join(names)
