"""Live solving: a worker that solves for the newest values and drops outdated requests."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Protocol, runtime_checkable

from jounce.errors import JounceError
from jounce.settings import under_own_settings
from jounce.viewer.shapes.recording import Parameter, Recording


@runtime_checkable
class Subject(Protocol):
    """A viewed object with parameters and a motion.

    Attributes
    ----------
    name : str
        Name of the subject.
    loaded : bool
        Whether it has forces to show.
    parameters : tuple of Parameter
        Parameters with sliders.
    no_sliders : str
        Text if there are no parameters.
    """

    name: str
    loaded: bool
    parameters: tuple[Parameter, ...]
    no_sliders: str

    def solve(self, values: Mapping[str, float], order: int) -> Recording:
        """Return the motion for some values, or raise JounceError."""
        ...


class Session:
    """The shown motion, solved again when parameters change.

    One thread solves. A request that arrives while it works waits, and a later request replaces it, so that outdated
    values are never solved for. After a failure, the last motion stays.

    Parameters
    ----------
    subject : Subject
        The viewed object.
    order : int
        Highest derivative.
    on_recording : callable, optional
        Called in the worker with each new `Recording`, before it is shown.
    on_failure : callable, optional
        Called in the worker with the error of a failed solve.
    on_busy : callable, optional
        Called in the worker with True when it starts to work and with False when no work is left.

    Attributes
    ----------
    recording : Recording
        The last successful motion.
    error : JounceError or None
        Error of the newest values, if they have no motion.
    solved : int
        Number of solves, including the first.
    elapsed : float
        Duration of the last solve, including `on_recording`, s.
    """

    def __init__(
        self,
        subject: Subject,
        order: int,
        on_recording: Callable[[Recording], object] = lambda _: None,
        on_failure: Callable[[JounceError], object] = lambda _: None,
        on_busy: Callable[[bool], object] = lambda _: None,
    ):
        self.subject, self.order = subject, order
        self.on_recording, self.on_failure, self.on_busy = on_recording, on_failure, on_busy
        self.values: dict[str, float] = {p.name: p.value for p in subject.parameters if not p.derived}
        self.error: JounceError | None = None
        self.recording = subject.solve(self.values, order)
        self.solved, self.elapsed = 1, 0.0
        self._requested: tuple[dict[str, float], int] | None = None
        self._jobs: list[Callable[[], object]] = []
        self._closed = self._working = False
        self._news = threading.Condition()
        self._worker = threading.Thread(target=under_own_settings(self._work), name="jounce-view-solver", daemon=True)
        self._worker.start()

    def request(self, values: Mapping[str, float] | None = None, order: int | None = None) -> None:
        """Request a motion with other values of some parameters, or of another order, without waiting for it."""
        with self._news:
            self.values.update(values or {})
            self.order = self.order if order is None else order
            self._requested = (dict(self.values), self.order)
            self._news.notify_all()

    def run_between_solves(self, job: Callable[[], object]) -> None:
        """Have the worker run a job between two solves, such as the computation of reactions."""
        with self._news:
            self._jobs.append(job)
            self._news.notify_all()

    def wait(self, timeout: float = 60.0) -> bool:
        """Wait until no work is left, and return whether that was reached within the timeout."""
        with self._news:
            return self._news.wait_for(lambda: self._closed or not self._pending, timeout)

    def close(self) -> None:
        """Stop the worker after its current solve."""
        with self._news:
            self._closed = True
            self._news.notify_all()
        self._worker.join(timeout=10.0)

    @property
    def _pending(self) -> bool:
        return self._requested is not None or bool(self._jobs) or self._working

    def _work(self) -> None:
        while True:
            with self._news:
                self._working = False
                self._news.notify_all()
                is_idle = not self._pending
            if is_idle:
                self.on_busy(False)
            with self._news:
                self._news.wait_for(lambda: self._closed or self._pending)
                if self._closed:
                    return
                self._working = True
                jobs, self._jobs = self._jobs, []
                requested, self._requested = self._requested, None
            self.on_busy(True)
            for job in jobs:
                self._guarded(job)
            if requested is not None:
                self._guarded(lambda requested=requested: self._solve(*requested))

    def _guarded(self, job: Callable[[], object]) -> None:
        """Run a job; its errors are shown, and the worker continues."""
        try:
            job()
        except JounceError as error:
            self._failed(error)
        except Exception as error:  # noqa: BLE001 - without its worker, the page would not respond
            from jounce.reporting.terminal import unexpected

            self._failed(JounceError(unexpected(error)))

    def _failed(self, error: JounceError) -> None:
        self.error = error
        self.on_failure(error)

    def _solve(self, values: dict[str, float], order: int) -> None:
        started = time.perf_counter()
        self.solved += 1
        recording = self.subject.solve(values, order)
        if recording.notice and not self.recording.notice:  # a partial motion does not replace a complete one
            raise JounceError(recording.notice)
        self.on_recording(recording)
        self.recording, self.error = recording, None
        self.elapsed = time.perf_counter() - started
