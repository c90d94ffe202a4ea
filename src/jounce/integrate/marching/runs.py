"""A run of a simulation: its steps, their events, and its end."""

import abc
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

from jounce.execution.backends import backend_of
from jounce.integrate.marching.marching import MOVING, Outcome, RunLimits
from jounce.integrate.steps.events import AbstractDetector
from jounce.kinematics import Status

GOING = frozenset(MOVING.tolist())
FAILED = Outcome.COLLAPSED, Outcome.LOST, Outcome.UNBALANCED


class AbstractRun(abc.ABC):
    """One run: its steps so far, their events, and its end.

    Parameters
    ----------
    current : IntegratorState or Progress
        Initial state.
    limits : RunLimits
        End of the run, and bounds of its steps.
    detectors : sequence of AbstractDetector
        Detectors of the requested events.

    Attributes
    ----------
    current : IntegratorState or Progress
        Current state.
    happened : list of list of float
        For each event, the times at which it happened, s.
    stopped_at : float or None
        Time of the terminal event that ended the run, s.
    ending : tuple of Status and str
        Reason why the steps ended, and a hint where to look.
    backends : set of str
        Backends that took the steps.
    """

    def __init__(self, current: Any, limits: RunLimits, detectors: Sequence[AbstractDetector]):
        self.current, self.limits, self.detectors = current, limits, detectors
        self.direction = np.sign(limits.stop - limits.start)  # of time
        self.happened: list[list[float]] = [[] for _ in detectors]
        self.stopped_at: float | None = None
        self.ending = (Status.OK, "")
        self.backends: set[str] = set()
        self.parts: list[Any] = []

    @abc.abstractmethod
    def attempted(self) -> tuple[Any, tuple[Any, Any], Any]:
        """Return the state after some attempts, the attempted steps and whether they were taken, and their number."""

    @abc.abstractmethod
    def initial_step(self) -> Any:
        """Return the start as a step of zero length."""

    @abc.abstractmethod
    def explained(self) -> tuple[Status, str]:
        """Return the reason why the steps ended, and a hint where to look."""

    @property
    def steps(self) -> Any:
        """All steps taken."""
        return jax.tree.map(lambda *parts: np.concatenate(parts), *self.parts)

    def go(self, instants: np.ndarray, progress: Callable[[int, int], None] | None) -> None:
        """Take steps until the run ends, with a report of progress."""
        while self.current.outcome.item() in GOING and self.stopped_at is None:
            if (part := self._march()) is not None:
                self.parts.append(self._until_stopped(part))
            if progress is not None:
                is_passed = self.direction * instants <= self.direction * self.current.time.item()
                progress(int(np.sum(is_passed)), len(instants))
        if not self.parts:
            self.parts.append(self.initial_step())
        if self.current.outcome.item() in FAILED and self.stopped_at is None:
            self.ending = self.explained()

    def _march(self) -> Any:
        """Attempt some steps, and return those that were taken; None if there are none."""
        self.current, (steps, taken), count = self.attempted()
        self.backends.add(backend_of(steps))
        taken = np.asarray(taken)[: int(count), 0]
        if not taken.any():
            return None
        # a view, unless some were refused; the steps are joined, and so copied, at the end
        chosen = slice(len(taken)) if taken.all() else np.flatnonzero(taken)
        return jax.tree.map(lambda x: np.asarray(x)[chosen, ..., 0], steps)

    def _until_stopped(self, part: Any) -> Any:
        """Record the events in some steps, and return the steps up to the first terminal event, the last one cut."""
        events = [
            (step, after, index)
            for index, detector in enumerate(self.detectors)
            for step, after in detector.detect(part)
        ]
        for step, after, index in sorted(events, key=lambda x: (x[0], abs(x[1]))):
            instant = float(part.start[step] + after)
            self.happened[index].append(instant)
            if self.detectors[index].event.terminal:
                self.stopped_at = instant
                cut = jax.tree.map(lambda x, count=step + 1: x[:count], part)
                return cut._replace(length=np.append(part.length[:step], after))
        return part
