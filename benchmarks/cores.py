"""All cores of the machine beside one, each in a process of its own; and several threads of one process."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Thread
from typing import Any

import numpy as np

from benchmarks.cases import EXAMPLES, Case, Cases, Contestant
from benchmarks.processes import Worker


def solve(name: str, instants: int, threads: int) -> Callable[[], Any]:
    """Return what solves a mechanism in so many threads at once; within a worker."""
    import jounce as jn

    mechanism, time = jn.load(EXAMPLES / f"{name}.yaml"), np.linspace(0.0, 2.0, instants)
    return _at_once(lambda: jn.solve(mechanism, time).outputs["psi"], threads)


def torques(samples: int, threads: int) -> Callable[[], Any]:
    """Return what computes the panda's torque and two rates in so many threads at once; within a worker."""
    import jounce as jn
    from benchmarks.arm import arm, motion

    robot, (q, _) = arm(), motion(samples)
    return _at_once(lambda: jn.inverse_dynamics(robot, q), threads)


def roots(times: int, threads: int) -> Callable[[], Any]:
    """Return what takes square roots of 100,000 numbers so many times, shared among threads; within a worker."""
    numbers = [np.linspace(1.0, 2.0, 100_000) for _ in range(threads)]
    found = [np.empty_like(x) for x in numbers]

    def share(k: int) -> None:
        for _ in range(times // threads):
            np.sqrt(numbers[k], out=found[k])

    def shared() -> Any:
        others = [Thread(target=share, args=(k,)) for k in range(1, threads)]
        for other in others:
            other.start()
        share(0)
        for other in others:
            other.join()
        return found[0]

    return shared


def _at_once(work: Callable[[], Any], threads: int) -> Callable[[], Any]:
    if threads == 1:
        return work
    pool = ThreadPoolExecutor(threads)
    return lambda: [future.result() for future in [pool.submit(work) for _ in range(threads)]].pop()


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
    times = 20 * cores if quick else 400 * cores
    yield Case(
        "square roots in the cache, what the machine gives",
        [
            Contestant(f"NumPy, {cores} threads", lambda: Worker("benchmarks.cores:roots", times, cores).run),
            Contestant("NumPy, one core", lambda: Worker("benchmarks.cores:roots", times, 1, cores=1).run),
        ],
        count=times,
        unit="array",
        clock="wall time",
    )
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
