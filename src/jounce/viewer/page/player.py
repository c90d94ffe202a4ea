"""The clock of the page, which plays, stops and loops at any speed, and reports the time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from jounce.settings import under_own_settings

RATE = 30.0  # pictures per second


class Player:
    """Time that runs between a start and a stop.

    Parameters
    ----------
    start, stop : float
        Ends of the time, s.
    on_time : callable
        Called with the time, s, from the thread of the player.
    """

    def __init__(self, start: float, stop: float, on_time: Callable[[float], None]):
        self.start, self.stop, self.on_time = start, stop, on_time
        self.now, self.speed, self.loop = start, 1.0, True
        self.playing = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=under_own_settings(self._run), name="jounce-view-player", daemon=True)

    def begin(self) -> None:
        """Start the thread."""
        self._thread.start()

    def end(self) -> None:
        """Stop the thread."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def advanced(self, elapsed: float) -> float:
        """Return the time after an elapsed time in seconds, and stop at the end unless the player loops.

        Examples
        --------
        >>> player = Player(0.0, 2.0, print)
        >>> player.now, player.speed = 1.5, 2.0
        >>> player.advanced(0.5)
        0.5
        """
        duration = self.stop - self.start
        target = self.now + elapsed * self.speed
        if target > self.stop or target < self.start:
            if self.loop and duration > 0:
                return self.start + (target - self.start) % duration
            self.playing = False
            return self.stop if target > self.stop else self.start
        return target

    def _run(self) -> None:
        last = time.perf_counter()
        while not self._ended.wait(1.0 / RATE):
            now = time.perf_counter()
            if self.playing:
                self.now = self.advanced(now - last)
                self.on_time(self.now)
            last = now
