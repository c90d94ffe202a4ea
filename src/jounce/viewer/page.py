"""The page of one subject: its motion, what is wanted of it, and what is shown at the instant of now."""

from __future__ import annotations

import threading
from typing import Any, Protocol, runtime_checkable

import numpy as np

from jounce.errors import JounceError
from jounce.viewer.arrows import Marked
from jounce.viewer.exports import quiet_stop
from jounce.viewer.player import Player
from jounce.viewer.prepared import Prepared, Wanted
from jounce.viewer.scene import Scene
from jounce.viewer.session import Session, Subject
from jounce.viewer.take import Take

__all__ = ["Follower", "Page"]

SLOWLY = 6  # legend and plots follow every so many pictures


@runtime_checkable
class Follower(Protocol):
    """A panel, which is told what happens."""

    def on_take(self, take: Take) -> None:
        """There is a new motion."""
        ...

    def on_failure(self, error: JounceError) -> None:
        """There is none for the newest values."""
        ...

    def on_busy(self, busy: bool) -> None:
        """The solver begins to work, or has nothing left to do."""
        ...

    def on_time(self, instant: float) -> None:
        """The player is at a time, s."""
        ...

    def on_frame(self, take: Take, frame: int) -> None:
        """Another instant is shown; not told of every picture of the player."""
        ...


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
    prepared : Prepared
        What is shown.
    frame : int
        Index of the instant that is shown.
    followers : list of Follower
        Panels.
    """

    def __init__(self, server: Any, subject: Subject, order: int):
        self.server, self.scene = server, Scene(server)
        self.lock = threading.RLock()
        self.followers: list[Follower] = []
        self.session = Session(subject, order, self._arrived, self._failed, self._busy)
        take = self.session.take
        marked = ()
        if take.looks.spots and take.order >= 1:
            marked = (Marked(take.looks.spots[0], tuple(range(1, min(take.order, 2) + 1))),)
        self.prepared = Prepared.of(take, Wanted(marked, path_order=min(1, take.order)))
        self.player = Player(float(take.time[0]), float(take.time[-1]), self._played)
        self.frame = self._pictures = 0
        self.scene.stage(take)
        self.scene.dress(take)
        self.prepared.begin(self.scene)
        self._refresh()

    @property
    def take(self) -> Take:
        """The motion that is shown."""
        return self.prepared.take

    @property
    def wanted(self) -> Wanted:
        """What is shown of it."""
        return self.prepared.wanted

    def _arrived(self, take: Take) -> None:
        """Take over a new motion, in the worker; what takes time is done before the page is touched."""
        prepared = Prepared.of(take, self.wanted)
        with self.lock:
            player = self.player
            player.start, player.stop = float(take.time[0]), float(take.time[-1])
            player.now = float(np.clip(player.now, player.start, player.stop))
            with self.server.atomic():
                self.scene.dress(take)
                self._exchange(prepared)
            for follower in self.followers:
                follower.on_take(take)
                follower.on_frame(take, self.frame)

    def _failed(self, error: JounceError) -> None:
        with self.lock:
            for follower in self.followers:
                follower.on_failure(error)

    def _busy(self, busy: bool) -> None:
        with self.lock:
            for follower in self.followers:
                follower.on_busy(busy)

    def want(self, wanted: Wanted) -> None:
        """Show something else of the motion; done by the worker, as forces take a moment."""

        def job() -> None:
            prepared = Prepared.of(self.take, wanted)
            with self.lock:
                with self.server.atomic():
                    self._exchange(prepared)
                for follower in self.followers:
                    follower.on_frame(self.take, self.frame)

        self.session.later(job)

    def _exchange(self, prepared: Prepared) -> None:
        self.prepared = prepared
        prepared.begin(self.scene)
        self._refresh()

    def _refresh(self) -> None:
        """Show the instant of now; nothing is computed but which one it is."""
        self.frame = self.take.frame_at(self.player.now)
        self.prepared.show(self.scene, self.frame)

    def seek(self, instant: float) -> None:
        """Go to a time, s."""
        with self.lock:
            self.player.now = float(np.clip(instant, self.player.start, self.player.stop))
            with self.server.atomic():
                self._refresh()
            for follower in self.followers:
                follower.on_time(self.player.now)
                follower.on_frame(self.take, self.frame)

    def _played(self, instant: float) -> None:
        if not self.server.get_clients():
            return
        with self.lock:
            with self.server.atomic():
                self._refresh()
            self._pictures += 1
            for follower in self.followers:
                follower.on_time(instant)
                if self._pictures % SLOWLY == 0 or not self.player.playing:
                    follower.on_frame(self.take, self.frame)

    def close(self) -> None:
        """End the threads and the server."""
        self.player.end()
        self.session.close()
        quiet_stop(self.server)
