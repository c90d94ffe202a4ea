"""Contestants measured in turns, in one process, on one core where the case asks for it."""

import os
import statistics
import time
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any

from benchmarks.cases import CannotRunError, Case, Contestant, Reported

SECONDS_A_CASE, SECONDS_QUICK = 60.0, 4.0  # after which no further round is begun
FEWEST_ROUNDS = 3


def use_one_core() -> None:
    """Pin the process to one core and keep XLA and BLAS to one thread; call it before JAX is imported."""
    flags = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {flags}".strip()
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def measured(case: Case, quick: bool) -> Iterator[dict[str, Any]]:
    """Yield the row of each contestant of a case: its median, its quartiles, its error, and the library's ratio to it.

    The contestants take turns, so that a busy machine slows all of them alike; ratios are taken within each round.
    """
    clock = time.process_time if case.clock == "processor time" else time.perf_counter
    runs, errors, left_out = {}, {}, {}
    taken: dict[str, list[float]] = {entry.name: [] for entry in case.contestants}
    for entry in case.contestants:
        try:
            run = _built(entry)
            first, outcome = _timed(run, clock)
            errors[entry.name] = None if entry.error is None else float(entry.error(outcome))
        except Exception as failure:  # noqa: BLE001 - one contestant that fails is a row of the table
            left_out[entry.name] = _reason(failure)
            continue
        if case.rounds:
            runs[entry.name] = run
        else:
            taken[entry.name].append(first)
    for _ in _rounds(case.rounds, quick):
        for name, run in runs.items():
            taken[name].append(_timed(run, clock)[0])
    costs = {entry.name: [x / (entry.count or case.count) for x in taken[entry.name]] for entry in case.contestants}
    ours = costs[case.contestants[0].name]
    for k, entry in enumerate(case.contestants):
        cost = costs[entry.name]
        ratios = [x / y for x, y in zip(ours, cost, strict=True) if y > 0] if ours and cost and k else []
        yield {
            "case": case.name,
            "contestant": entry.name,
            "version": _version(entry.needs) if k else "",
            "unit": case.unit,
            "clock": case.clock,
            "cost": spread(cost),
            "ratio": spread(ratios),
            "aim": entry.aim,
            "error": errors.get(entry.name),
            "reference": case.reference,
            "rounds": len(cost),
            "at": dict(case.at),
            "left out": left_out.get(entry.name, ""),
        }


def _built(entry: Contestant) -> Callable[[], Any]:
    if entry.needs and find_spec(entry.needs) is None:
        raise CannotRunError(f"{entry.needs} is not installed; the extra `{entry.extra}` brings it")
    return entry.build()


def _timed(run: Callable[[], Any], clock: Callable[[], float]) -> tuple[float, Any]:
    """Return what a run took, or what it tells that it took, and what came out."""
    start = clock()
    outcome = run()
    taken = clock() - start
    return (outcome.value, outcome.outcome) if isinstance(outcome, Reported) else (taken, outcome)


def _rounds(most: int, quick: bool) -> Iterator[int]:
    until = time.perf_counter() + (SECONDS_QUICK if quick else SECONDS_A_CASE)
    for k in range(min(most, FEWEST_ROUNDS) if quick else most):
        if k >= FEWEST_ROUNDS and time.perf_counter() > until:
            return
        yield k


def _reason(failure: Exception) -> str:
    said = str(failure).strip().partition("\n")[0]
    return said if isinstance(failure, CannotRunError) else f"{type(failure).__name__}: {said}"


def _version(package: str) -> str:
    try:
        return version({"pinocchio": "pin"}.get(package, package)) if package else ""
    except PackageNotFoundError:
        return ""


def spread(values: list[float]) -> list[float] | None:
    """Return the lower quartile, the median and the upper quartile."""
    if len(values) < 2:
        return values * 3 or None
    return statistics.quantiles(values, n=4, method="inclusive")
