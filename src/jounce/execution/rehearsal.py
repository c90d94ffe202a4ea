"""Programs that will be needed are compiled in another thread, while the first of them is compiled in this one.

XLA compiles a program in one thread, without Python's lock. What comes later is rehearsed on a mechanism that stands
still: its programs are those of the motion, which is not known yet.
"""

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any

import jax
import numpy as np

from jounce.execution.compilation import stopped_by
from jounce.execution.threads import callers_context, thread_count

NAME = "jounce-rehearsal"
_had: set[Any] = set()


def first_time(program: str, arguments: Any, *static: Any) -> bool:
    """Tell whether a program is asked about for the first time with arguments of such a structure and such shapes."""
    leaves, structure = jax.tree.flatten(arguments)
    key = program, structure, tuple(map(np.shape, leaves)), static
    new = key not in _had
    _had.add(key)
    return new


def is_rehearsing() -> bool:
    """Tell whether some thread still compiles what was rehearsed."""
    return any(thread.name == NAME for thread in threading.enumerate())


@contextlib.contextmanager
def tried() -> Iterator[None]:
    """Drop what goes wrong: it will be told by what is rehearsed here, when it is called with what was found."""
    with contextlib.suppress(Exception), np.errstate(all="ignore"):
        yield


@contextlib.contextmanager
def rehearsed(rehearsal: Callable[[], Any], *, wanted: bool) -> Iterator[None]:
    """Call a function in another thread meanwhile, for what it compiles; what it returns or raises is dropped.

    Parameters
    ----------
    rehearsal : callable
        To be called.
    wanted : bool
        Whether to; with one thread to compute, it is not called in any case.
    """
    if not wanted or thread_count() < 2:
        yield
        return
    enough, context = threading.Event(), callers_context()

    def rehearse() -> None:
        with tried(), context(), stopped_by(enough):
            rehearsal()

    thread = threading.Thread(target=rehearse, name=NAME)
    thread.start()
    try:
        yield
        thread.join()
    except BaseException:
        enough.set()  # after the program that it is compiling
        raise
