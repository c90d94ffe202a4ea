"""The page of one subject: its motion, what is to be shown of it, and what is shown at the instant of now."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from jounce.errors import JounceError
from jounce.viewer.page.local_server import stop_silently
from jounce.viewer.page.overlay import DisplayOptions, Overlay
from jounce.viewer.page.player import Player
from jounce.viewer.page.scene import ViserScene
from jounce.viewer.page.session import Session, Subject
from jounce.viewer.shapes.arrows import TracedPoint
from jounce.viewer.shapes.recording import Recording

SLOWLY = 6  # legend and plots follow every so many pictures


class Observer:
    """A panel, which is notified of events; by default it does nothing."""

    def on_recording(self, recording: Recording) -> None:
        """There is a new motion."""

    def on_failure(self, error: JounceError) -> None:
        """There is none for the newest values."""

    def on_busy(self, busy: bool) -> None:
        """The solver begins to work, or has nothing left to do."""

    def on_time(self, instant: float) -> None:
        """The player is at a time, s."""

    def on_frame(self, frame: int) -> None:
        """Another instant is shown; not called for every picture of the player."""


class Page:
    """A motion on a viser server, with what is shown of it; the panels change it, the player moves it.

    Parameters
    ----------
    server : viser.ViserServer
    subject : Subject
    order : int
        Highest derivative.

    Attributes
    ----------
    session : Session
        Solves.
    player : Player
        Its clock.
    overlay : Overlay
        What is shown.
    frame : int
        Index of the instant that is shown.
    observers : list of Observer
        Panels.
    """

    def __init__(self, server: Any, subject: Subject, order: int):
        self.server, self.scene = server, ViserScene(server)
        self.lock = threading.RLock()
        self.observers: list[Observer] = []
        self.session = Session(subject, order, self._take_over_motion, self._failed, self._busy)
        recording = self.session.recording
        traced = ()
        if recording.appearance.points and recording.order >= 1:
            traced = (TracedPoint(recording.first_moving_point(), tuple(range(1, min(recording.order, 2) + 1))),)
        self.player = Player(float(recording.time[0]), float(recording.time[-1]), self._played)
        self._pictures = 0
        self.scene.set_stage(recording)
        self.scene.set_shapes(recording)
        self._show(Overlay.of(recording, DisplayOptions(traced)))

    @property
    def recording(self) -> Recording:
        """The motion that is shown."""
        return self.overlay.recording

    @property
    def options(self) -> DisplayOptions:
        """What is shown of it."""
        return self.overlay.options

    def _take_over_motion(self, recording: Recording) -> None:
        """Take over a new motion, in the worker; what takes time is done before the page is touched."""
        overlay = Overlay.of(recording, self.options)
        with self.lock:
            player = self.player
            player.start, player.stop = float(recording.time[0]), float(recording.time[-1])
            player.now = float(np.clip(player.now, player.start, player.stop))
            with self.server.atomic():
                self.scene.set_shapes(recording)
                self._show(overlay)
            for observer in self.observers:
                observer.on_recording(recording)
                observer.on_frame(self.frame)

    def _failed(self, error: JounceError) -> None:
        with self.lock:
            for observer in self.observers:
                observer.on_failure(error)

    def _busy(self, busy: bool) -> None:
        with self.lock:
            for observer in self.observers:
                observer.on_busy(busy)

    def set_options(self, options: DisplayOptions) -> None:
        """Show something else of the motion; done by the worker, as forces take a moment."""

        def job() -> None:
            overlay = Overlay.of(self.recording, options)
            with self.lock:
                with self.server.atomic():
                    self._show(overlay)
                for observer in self.observers:
                    observer.on_frame(self.frame)

        self.session.run_between_solves(job)

    def _show(self, overlay: Overlay) -> None:
        self.overlay = overlay
        self.scene.begin(overlay)
        self._refresh()

    def _refresh(self) -> None:
        """Show the instant of now; nothing is computed but which one it is."""
        self.frame = self.recording.frame_at(self.player.now)
        self.scene.show(self.overlay, self.frame)

    def seek(self, instant: float) -> None:
        """Go to a time, s."""
        with self.lock:
            self.player.now = float(np.clip(instant, self.player.start, self.player.stop))
            with self.server.atomic():
                self._refresh()
            for observer in self.observers:
                observer.on_time(self.player.now)
                observer.on_frame(self.frame)

    def _played(self, instant: float) -> None:
        if not self.server.get_clients():
            return
        with self.lock:
            with self.server.atomic():
                self._refresh()
            self._pictures += 1
            for observer in self.observers:
                observer.on_time(instant)
                if self._pictures % SLOWLY == 0 or not self.player.playing:
                    observer.on_frame(self.frame)

    def close(self) -> None:
        """End the threads and the server."""
        self.player.end()
        self.session.close()
        stop_silently(self.server)
