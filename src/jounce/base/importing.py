"""Lazy imports of subpackages, by one thread at a time."""

import contextlib
import gc
import threading
from collections.abc import Iterator

lock = threading.RLock()
"""Held while functions import subpackages: two threads that import at once may see half-initialized modules."""

frozen = threading.Event()
"""Set once frozen objects of other packages were found, since counting them takes long if there are many."""


@contextlib.contextmanager
def without_garbage_collection() -> Iterator[None]:
    """Return a context without garbage collection.

    Imports, tracing and translation leave little garbage, while each collection traverses all of JAX: a quarter of the
    Python time in which a program is made.
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
        if not frozen.is_set():  # imported objects stay: move them to the old generation without a traversal
            gc.freeze()
            gc.unfreeze()
        gc.enable()
