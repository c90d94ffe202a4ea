"""Readers under texts changed by chance: ``python -m tests.fuzz --cases 100000 --seed 1``.

Each reader has a process of its own, with at most 1 GB of memory beyond what it starts with. A case that takes the
process with it is told, and the next process goes on behind it. ``--reader urdf --case 17`` reads one case again and
shows it. One case of a hundred is a long text, which may not take more than its share of the time for a quarter of it.
The exit status is 0 where every case ended with a result or with one error of the family, and said nothing.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import faulthandler
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
MEMORY = 1_000_000_000  # bytes
MORE = {"toml": 3, "json": 3, "urdf": 4, "sdf": 4, "mjcf": 4, "results": 4, "table": 2, "expression": 2, "netcdf": 1.5}
WEIGHTS = MORE | {"sweep": 0.2, "payload": 0.5}  # of 1 for the others; these take longer


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=2000, help="of all readers together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--reader", help="this one only")
    parser.add_argument("--case", type=int, help="show what becomes of one case")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no case after this time")
    parser.add_argument("--growth", type=int, metavar="SIZE", help="time texts of a size, and of four times it")
    parser.add_argument("--worker", type=int, nargs=2, metavar=("FIRST", "COUNT"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        return work(given.reader, given.seed, *given.worker)
    if given.growth:
        from tests.fuzz.growth import report

        return report(given.growth)
    if given.case is not None:
        return show(given.reader, given.seed, given.case)
    return drive(given.cases, given.seed, given.reader, given.seconds)


def drive(cases: int, seed: int, only: str | None, seconds: float) -> int:
    """Run all cases, print a tally and the failures, and return the exit status."""
    from tests.fuzz.readers import READERS

    weights = {name: WEIGHTS.get(name, 1) for name in READERS if only in (None, name)}
    started, failures = time.monotonic(), {}
    tally: dict[str, collections.Counter[str]] = {}
    for name, weight in weights.items():
        share, spent = int(cases * weight / sum(weights.values())), time.monotonic() - started
        allowed = (seconds - spent) * weight / sum(weights[other] for other in weights if other not in tally)
        tally[name] = run(name, seed, share, allowed, failures)
        print(f"{name:12}{sum(tally[name].values()):8}  {words(tally[name])}", flush=True)
    took, count = time.monotonic() - started, sum(sum(found.values()) for found in tally.values())
    print(f"{'all':12}{count:8}  {words(sum(tally.values(), collections.Counter()))}")
    print(f"{took:.0f} s, {count / took:.0f} cases a second; seed {seed}")
    for place, found in failures.items():
        print(f"\n== {place}: {found['count']} times, first --reader {found['reader']} --case {found['index']}")
        print(f"{found['words']}\n-- the text, shrunk:\n{found['text']}")
    return 1 if failures else 0


def words(found: collections.Counter[str]) -> str:
    return ", ".join(f"{kind} {number}" for kind, number in found.most_common())


def run(name: str, seed: int, count: int, seconds: float, failures: dict) -> collections.Counter[str]:
    """Run the cases of one reader, in as many processes as it takes."""
    tally: collections.Counter[str] = collections.Counter()
    first, end = 0, time.monotonic() + seconds
    while first < count and time.monotonic() < end:
        command = [sys.executable, "-m", "tests.fuzz", "--reader", name, "--seed", str(seed)]
        command += ["--seconds", str(end - time.monotonic()), "--worker", str(first), str(count - first)]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            at = first
            for line in process.stdout:
                record = json.loads(line)
                at = record.get("index", at)
                for kind, number in record.get("tally", {}).items():
                    tally[kind] += number
                if record.get("done"):
                    return tally
                if "place" in record:
                    known = failures.setdefault(record["place"], {**record, "count": 0, "reader": name})
                    known["count"] += 1
                if time.monotonic() > end:
                    process.terminate()
                    return tally
        tally["dies"] += 1
        text = f"status {process.returncode}"
        failures.setdefault(f"{name} dies", {"count": 1, "reader": name, "index": at, "words": text, "text": ""})
        first = at + 1
    return tally


def work(name: str, seed: int, first: int, count: int) -> int:
    """Run cases and tell of them on standard output: the number of each before it begins, kinds in between."""
    from tests.fuzz.cases import ALLOWED, TIME_LIMIT, WAIT, case, clocked, is_clocked, judged, shrunk

    def tell(**said: object) -> None:
        print(json.dumps(said), file=out, flush=True)

    with open(sys.stdout.fileno(), "w", closefd=False) as out, tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        tally: collections.Counter[str] = collections.Counter()
        seen: set[str] = set()
        hearing = os.fdopen(os.dup(2), "w")  # of this process itself; what cases say is kept from it
        with contextlib.suppress(Exception):
            judged(name, case(name, seed, 0), folder)  # all is imported
        bound_memory()
        for index in range(first, first + count):
            tell(index=index, tally=tally)
            tally.clear()
            faulthandler.dump_traceback_later(
                3 * TIME_LIMIT, exit=True, file=hearing
            )  # where Python does not come to a signal
            content, timed = case(name, seed, index), is_clocked(name, index)
            found = clocked(name, seed, index, folder) if timed else judged(name, content, folder)
            tally[found.kind] += 1
            if found.kind in ALLOWED:
                continue
            faulthandler.dump_traceback_later(3 * WAIT * TIME_LIMIT, exit=True, file=hearing)
            text = b"" if found.place in seen or timed else shrunk(name, content, folder)
            seen.add(found.place)
            tell(place=found.place, words=found.words, text=text.decode("utf-8", "backslashreplace"), index=index)
        faulthandler.cancel_dump_traceback_later()
        tell(tally=tally, done=True)
    return 0


def bound_memory() -> None:
    """Let the process take 1 GB more than it has."""
    with contextlib.suppress(OSError, ValueError):
        pages = int(pathlib.Path("/proc/self/statm").read_text().split()[0])
        bound = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (bound, bound))


def show(name: str, seed: int, index: int) -> int:
    """Print one case and what becomes of it."""
    from tests.fuzz.cases import ALLOWED, case, clocked, is_clocked, judged

    content = case(name, seed, index)
    with tempfile.TemporaryDirectory() as kept:
        folder = pathlib.Path(kept)
        found = clocked(name, seed, index, folder) if is_clocked(name, index) else judged(name, content, folder)
    print(content.decode("utf-8", "backslashreplace"), f"\n== {found.kind}\n{found.words}")
    return 0 if found.kind in ALLOWED else 1


if __name__ == "__main__":
    sys.exit(main())
