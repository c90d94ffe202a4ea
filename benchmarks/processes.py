"""Measurements in other processes: whole commands, and workers that keep a computation ready."""

import importlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from benchmarks.cases import ROOT, CannotRunError, Reported

SECONDS_TO_ANSWER = 900.0


class Usage(NamedTuple):
    """What a command took: seconds on all cores together, seconds that one waits, and bytes at the peak."""

    processor: float
    wall: float
    memory: float


def command(words: Sequence[str], environment: Mapping[str, str] | None = None) -> Usage:
    """Run a command and return what it took.

    Raises
    ------
    CannotRunError
        If it ends with another status than 0; with the last line that it wrote.
    """
    start = time.perf_counter()
    child = subprocess.Popen(
        words, cwd=ROOT, env=os.environ | (environment or {}), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    with child.stderr as stream:
        message = stream.read().decode(errors="replace").strip()
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise CannotRunError(
            f"`{' '.join(words[1:4])}` ended with {child.returncode}: {message.rpartition(chr(10))[2]}"
        )
    wall = time.perf_counter() - start
    return Usage(used.ru_utime + used.ru_stime, wall, used.ru_maxrss * (1 if sys.platform == "darwin" else 1024))


class Worker:
    """A process of its own that does one computation whenever it is message to, and says how long that took.

    Parameters
    ----------
    task : str
        ``module:function``; called with the arguments, that function returns the one that is timed.
    arguments
        Of that function.
    environment : mapping of str to str
        What its environment has besides that of this process.
    cores : int, optional
        How many cores it is kept to.
    """

    def __init__(
        self, task: str, *arguments: Any, environment: Mapping[str, str] | None = None, cores: int | None = None
    ):
        own, other = get_context("spawn").Pipe()
        job = (other, task, arguments, dict(environment or {}), cores)
        get_context("spawn").Process(target=_serve, args=job, daemon=True).start()
        other.close()
        self.connection = own

    def run(self) -> Reported:
        """Compute once."""
        self.connection.send("run")
        if not self.connection.poll(SECONDS_TO_ANSWER):
            raise CannotRunError(f"no answer within {SECONDS_TO_ANSWER:g} s")
        try:
            answer = self.connection.recv()
        except EOFError:
            raise CannotRunError("the process ended without an answer") from None
        if isinstance(answer, str):
            raise CannotRunError(answer)
        return answer


def _serve(connection: Connection, task: str, arguments: Any, environment: dict[str, str], cores: int | None) -> None:
    if environment and "jax" in sys.modules:  # by what starts the process, which begins with its imports
        connection.send(f"JAX is imported already, and heeds {', '.join(environment)} no more")
        return
    os.environ.update(environment)
    if cores is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-cores:])
    try:
        module, _, name = task.partition(":")
        run: Callable[[], Any] = getattr(importlib.import_module(module), name)(*arguments)
        while connection.recv() == "run":
            start = time.perf_counter()
            outcome = run()
            connection.send(Reported(time.perf_counter() - start, outcome))
    except EOFError:
        return
    except Exception as failure:  # noqa: BLE001 - message to the process that asked
        connection.send(f"{type(failure).__name__}: {failure}")
