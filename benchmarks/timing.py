"""Shared by the benchmarks: repeated timing of competitors in one process, on one core, interleaved."""

import os
import time
from collections.abc import Callable, Mapping


def use_one_core() -> None:
    """Pin the process to one core and keep XLA and BLAS to one thread; call it before JAX is imported."""
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def race(competitors: Mapping[str, Callable[[], object]], rounds: int = 15, *, best: bool = False) -> dict[str, float]:
    """Return the median seconds of each, or the least, run in turns so that a busy machine slows all of them alike."""
    times: dict[str, list[float]] = {name: [] for name in competitors}
    for run in competitors.values():
        run()
    for _ in range(rounds):
        for name, run in competitors.items():
            start = time.perf_counter()
            run()
            times[name].append(time.perf_counter() - start)
    return {name: sorted(values)[0 if best else len(values) // 2] for name, values in times.items()}


def report(title: str, medians: Mapping[str, float], count: int, base: str) -> None:
    """Print microseconds for each instant, and every ratio to the `base`."""
    print(title)
    for name, seconds in medians.items():
        print(f"  {name:<58} {seconds / count * 1e6:9.2f} us an instant   {seconds / medians[base]:6.2f} x")
