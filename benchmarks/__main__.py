"""Runs the benchmarks and writes their tables and figures: ``python -m benchmarks --help``."""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks import BENCHMARKS
from benchmarks.cases import ROOT
from benchmarks.timing import measured, use_one_core

LONGEST = 3600.0  # s, of one benchmark


def main() -> int:
    """Measure, print, write; return 1 if a benchmark did not run to its end."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=import_module("benchmarks").__doc__)
    parser.add_argument("--list", action="store_true", help="say what there is, and stop")
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=BENCHMARKS, help="these; others stay in the table")
    parser.add_argument("--quick", action="store_true", help="small sizes and three rounds: does it run?")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the tables and figures")
    parser.add_argument("--here", type=Path, help=argparse.SUPPRESS)  # measure in this process, rows into this file
    options = parser.parse_args()
    names = options.only or list(BENCHMARKS)
    if options.list:
        for name in names:
            print(f"{name:<12} {BENCHMARKS[name].about}")
        return 0
    if options.here is not None:
        _measure(names[0], options.quick, options.here)
        return 0
    from benchmarks import records, tables

    added_to: Path | None = options.out if options.only else None
    try:
        there = {row["benchmark"] for row in records.read(added_to)} if added_to else set()
    except records.TableError as error:  # reported before hours of measuring
        parser.error(str(error))
    rows, failed = [], []
    for name in names:
        print(f"{name}: {BENCHMARKS[name].about}", flush=True)
        found, fault = _in_own_process(name, options.quick)
        tables.show(found)
        rows += found
        if fault:
            failed.append(name)
            stay = "; its rows in the table stay as they were" if name in there else ""
            print(f"{name} did not run to its end: {fault}{stay}", file=sys.stderr)
    if options.out is not None and rows:
        from benchmarks import figures

        about = tables.circumstances(options.quick)
        rows = [row | {"circumstances": about} for row in rows]
        rows = records.merged(records.read(added_to) if added_to else [], rows, failed)
        records.write(rows, options.out)
        figures.draw(rows, options.out)
    return int(bool(failed))


def _measure(name: str, quick: bool, file: Path) -> None:
    """Write the rows of one benchmark, line by line as they come."""
    os.environ["JOUNCE_CACHE_DIR"] = ""  # rows of first calls are of programs that are compiled, unless they say so
    os.environ["JAX_ENABLE_X64"] = "1"  # for what is written in JAX itself: modules of benchmarks import it
    if BENCHMARKS[name].one_core:
        use_one_core()
    with file.open("w", encoding="utf-8") as stream:
        for case in import_module(f"benchmarks.{BENCHMARKS[name].module}").cases(quick):
            for row in measured(case, quick):
                known = {"benchmark": name, "day": datetime.now(UTC).date().isoformat()}
                print(json.dumps(known | row), file=stream, flush=True)


def _in_own_process(name: str, quick: bool) -> tuple[list[dict[str, Any]], str]:
    """Return the rows of one benchmark, and why it ended early, if it did."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rows.jsonl"
        words = [sys.executable, "-m", "benchmarks", "--only", name, "--here", str(file)]
        try:
            subprocess.run([*words, *["--quick"] * quick], cwd=ROOT, timeout=LONGEST, check=True)
            fault = ""
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as failure:
            fault = str(failure)
        lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        return [json.loads(line) for line in lines], fault


if __name__ == "__main__":
    sys.exit(main())
