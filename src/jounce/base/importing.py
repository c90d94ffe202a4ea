"""Rooms are imported when something of them is first used, by one thread at a time."""

import contextlib
import gc
import threading
from collections.abc import Iterator

lock = threading.RLock()
"""Held while functions import subpackages: two threads that import at once may see modules half initialized."""

frozen = threading.Event()
"""Set once objects of others were found frozen, which takes as long as there are many of them to count."""


@contextlib.contextmanager
def without_garbage_collection() -> Iterator[None]:
    """Leave the search for garbage until later.

    Imports, and programs that are traced and written, leave little, and each search looks through all of JAX again: a
    quarter of the time of Python in which a program is made.
    """
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        if not frozen.is_set() and gc.get_freeze_count():
            frozen.set()
        if not frozen.is_set():  # what is imported stays: it counts as old without being looked through
            gc.freeze()
            gc.unfreeze()
        gc.enable()
