"""Python's search for garbage, which is rare while programs are traced: that makes much that lasts, and little garbage.

Otherwise it takes about a tenth of the processor time in which a spatial mechanism is solved for the first time.
"""

import gc
import threading
from typing import Any

OFTEN_ENOUGH = 100_000  # objects more than before, after which Python looks for garbage


class RareCollection:
    """While some thread is within, Python looks for garbage after many objects only; then as it did before."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._within = 0
        self._before: tuple[int, ...] = ()

    def __enter__(self) -> "RareCollection":
        with self._lock:
            if not self._within:
                self._before = gc.get_threshold()
                if 0 < self._before[0] < OFTEN_ENOUGH:  # 0 is for never
                    gc.set_threshold(OFTEN_ENOUGH, *self._before[1:])
            self._within += 1
        return self

    def __exit__(self, *error: Any) -> None:
        with self._lock:
            self._within -= 1
            if not self._within and gc.get_threshold()[0] == OFTEN_ENOUGH:  # nobody has said otherwise meanwhile
                gc.set_threshold(*self._before)


RARELY = RareCollection()
"""Of this process, as its garbage is."""
