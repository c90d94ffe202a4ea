"""All cores of the machine beside one, each in a process of its own; and several threads of one process."""

import hashlib
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Thread
from typing import Any

import numpy as np

from benchmarks.cases import EXAMPLES, Case, Cases, Contestant
from benchmarks.processes import Worker

LOOP = 8  # times


def solve(name: str, instants: int, threads: int) -> Callable[[], Any]:
    """Return what solves a mechanism in so many threads at once; within a worker."""
    import jounce as jn

    mechanism, grid = jn.load(EXAMPLES / f"{name}.yaml"), np.linspace(0.0, 2.0, instants)
    return _at_once(lambda: jn.solve(mechanism, grid).outputs["psi"], threads)


def torques(samples: int, threads: int) -> Callable[[], Any]:
    """Return what computes the panda's torque and two rates in so many threads at once; within a worker."""
    import jounce as jn
    from benchmarks.arm import arm, motion

    robot, (q, _) = arm(), motion(samples)
    return _at_once(lambda: jn.inverse_dynamics(robot, q, drives=False), threads)


def derivation(rounds: int, threads: int) -> Callable[[], Any]:
    """Return what derives keys in so many rounds shared among threads, without memory or locks; within a worker."""

    def share(_: int) -> bytes:
        return hashlib.pbkdf2_hmac("sha256", b"jounce", b"jerk", rounds // threads)

    def shared() -> None:
        others = [Thread(target=share, args=(k,)) for k in range(1, threads)]
        for other in others:
            other.start()
        share(0)
        for other in others:
            other.join()

    return shared


def _at_once(work: Callable[[], Any], threads: int) -> Callable[[], Any]:
    if threads == 1:
        return work
    pool = ThreadPoolExecutor(threads)
    return lambda: [future.result() for future in [pool.submit(work) for _ in range(threads)]].pop()


def in_a_loop(task: str, arguments: tuple[Any, ...]) -> Callable[[], Any]:
    """Return what does a work several times without a pause; within a worker."""
    work = globals()[task](*arguments, 1)

    def looping() -> Any:
        for _ in range(LOOP - 1):
            work()  # what it returns is not kept, as the memory of it would have to be found anew
        return work()

    return looping


def _machine(rounds: int, cores: int, pause: float) -> Case:
    """Return what the machine gives at most: it may begin a second thread on the core of the first after a pause, s."""

    def deriving(threads: int, given: int | None) -> Callable[[], Any]:
        def build() -> Callable[[], Any]:
            worker = Worker("benchmarks.cores:derivation", rounds, threads, cores=given)

            def run() -> Any:
                time.sleep(pause)  # before the worker begins to measure
                return worker.run()

            return run

        return build

    contestants = [
        Contestant(f"OpenSSL, {cores} threads", deriving(cores, None)),
        Contestant("OpenSSL, one core", deriving(1, 1)),
    ]
    name = f"key derivation, {rounds:,} rounds" + (f", after {pause:g} s of pause" if pause else "")
    return Case(name, contestants, count=rounds, unit="round", clock="wall time")


def _looping(name: str, work: tuple[str, tuple[Any, ...], int], cores: int) -> Case:
    """Return a work that takes little time, done several times without a pause."""
    task, arguments, count = work

    def looping(given: int | None) -> Callable[[], Any]:
        return lambda: Worker("benchmarks.cores:in_a_loop", task, arguments, cores=given).run

    contestants = [
        Contestant(f"jounce, {cores} cores", looping(None)),
        Contestant("jounce, one core", looping(1)),
    ]
    unit = "sample" if task == "torques" else "instant"
    return Case(f"{name}, {LOOP} in a loop", contestants, count=LOOP * count, unit=unit, clock="wall time")


def cases(quick: bool) -> Cases:
    """Yield grids and batches; errors are how far results are from those of one core."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    instants, longest, samples = (5_000, 10_000, 5_000) if quick else (100_000, 1_000_000, 100_000)
    works = {
        f"four-bar to jounce, {instants:,} instants": ("solve", ("four_bar", instants), instants),
        f"four-bar to jounce, {longest:,} instants": ("solve", ("four_bar", longest), longest),
        f"RSUR to jounce, {instants:,} instants": ("solve", ("rsur", instants), instants),
        f"torque and two rates of the panda, {samples:,} samples": ("torques", (samples,), samples),
    }
    first, *_, last = works
    short = first, last  # so short that a pause before them matters
    for rounds in (1_000,) if quick else (115_000, 275_000):  # about as long as the panda's and the four-bar's
        yield _machine(rounds, cores, 0.0)
        yield _machine(rounds, cores, 0.2)
    for name, (task, arguments, count) in works.items():
        known: dict[str, Any] = {}

        def contestant(
            title: str,
            threads: int,
            given: int | None,
            of: tuple[str, Any, int] = (task, arguments, count),
            known: Any = known,
        ) -> Contestant:
            task, arguments, count = of

            def error(found: Any) -> float:
                return float(np.abs(found - known.setdefault("first", found)).max())

            worker = lambda: Worker(f"benchmarks.cores:{task}", *arguments, threads, cores=given).run  # noqa: E731
            return Contestant(title, worker, error, count=count * threads)

        yield Case(
            name,
            [
                contestant(f"jounce, {cores} cores", 1, None),
                contestant("jounce, one core", 1, 1),
                contestant("jounce, two threads at once", 2, None),
            ],
            count=count,
            unit="sample" if task == "torques" else "instant",
            reference="the first row's results, the largest difference",
            clock="wall time",
        )
        if name in short:
            yield _looping(name, (task, arguments, count), cores)
