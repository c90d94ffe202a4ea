"""The page of a subject: its motion, the display options, and the current instant."""

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

SLOWLY = 6  # pictures between two updates of legend and plots


class Observer:
    """A panel that is notified of events; by default it does nothing."""

    def on_recording(self, recording: Recording) -> None:
        """Respond to a new motion."""

    def on_failure(self, error: JounceError) -> None:
        """Respond to a failure for the newest values."""

    def on_busy(self, busy: bool) -> None:
        """Respond to the start or the end of the work of the solver."""

    def on_time(self, instant: float) -> None:
        """Respond to a time of the player, s."""

    def on_frame(self, frame: int) -> None:
        """Respond to another shown instant; not called for every picture of the player."""


class Page:
    """A displayed motion on a viser server; panels change it, and the player moves it.

    Parameters
    ----------
    server : viser.ViserServer
    subject : Subject
    order : int
        Highest derivative.

    Attributes
    ----------
    session : Session
        Session that solves the motion.
    player : Player
        Clock of the page.
    overlay : Overlay
        Shown arrows, paths and loads.
    frame : int
        Index of the shown instant.
    observers : list of Observer
        Panels of the page.
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
        """The shown motion."""
        return self.overlay.recording

    @property
    def options(self) -> DisplayOptions:
        """The display options."""
        return self.overlay.options

    def _take_over_motion(self, recording: Recording) -> None:
        """Display a new motion, in the worker; the overlay is computed before the page changes."""
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
        """Change the display options; the worker applies them, as forces take time."""

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
        """Show the current instant; nothing else is computed."""
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
        """Stop the threads and the server."""
        self.player.end()
        self.session.close()
        stop_silently(self.server)
