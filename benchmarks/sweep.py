"""A sweep of four-bars: what its workers cost beside one process, how long it takes in all, and its memory."""

import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray

import jounce as jn
from benchmarks.cases import EXAMPLES, CannotRunError, Case, Cases, Contestant, Reported, ready
from benchmarks.processes import command

FILE = EXAMPLES / "four_bar.yaml"
INSTANTS = 200
VARY = {"AB": "3cm:5cm", "BC": "13cm:15cm"}
SCRIPT = """
import sys
import numpy
import jounce
jounce.sweep({file!r}, {vary!r}, {out!r}, numpy.linspace(0, 2, {instants}), sample="sobol:{designs}", workers={workers})
"""
OFTEN = 0.05  # s between looks at the memory


def words(designs: int, workers: int | None, out: Path) -> list[str]:
    """Return the command that sweeps so many designs."""
    settings = {"file": str(FILE), "vary": VARY, "out": str(out), "instants": INSTANTS}
    return [sys.executable, "-c", SCRIPT.format(**settings, designs=designs, workers=workers)]


def processor(few: int, many: int, workers: int) -> Callable[[], Reported]:
    """Return what gives the processor time of the designs beyond the first few: starting and compiling are left out."""

    def measure() -> Reported:
        with tempfile.TemporaryDirectory() as folder:
            taken = [
                command(words(designs, workers, Path(folder, f"{designs}.zarr")), {"JOUNCE_THREADS": "1"}).processor
                for designs in (few, many)
            ]
            return Reported(taken[1] - taken[0], error(Path(folder, f"{many}.zarr")))

    return measure


def error(folder: Path) -> float:
    """Return the error of the peaks of three designs, against solutions of each alone."""
    found, mechanism = xarray.open_zarr(folder), jn.load(FILE)
    errors = []
    for k in np.linspace(0, found.sizes["design"] - 1, 3).astype(int):
        lengths = {name: float(found[name][k]) for name in VARY}
        motion = jn.solve(mechanism.with_parameters(**lengths), np.linspace(0, 2, INSTANTS))
        peak = np.abs(motion.outputs["psi"]).max(axis=0)
        errors.append(np.abs(found["psi_peak"][k].values / peak - 1).max())
    return float(max(errors))


def whole(designs: int) -> Callable[[], Reported]:
    """Return what gives the wall time of a sweep on all cores, starting and compiling counted."""

    def measure() -> Reported:
        with tempfile.TemporaryDirectory() as folder:
            begun = time.perf_counter()
            command(words(designs, None, Path(folder, "sweep.zarr")))
            return Reported(time.perf_counter() - begun, error(Path(folder, "sweep.zarr")))

    return measure


def memory(designs: int) -> Callable[[], Reported]:
    """Return what gives the memory of all processes of a sweep together at the peak, what they share counted once."""

    def measure() -> Reported:
        if not Path("/proc/self/smaps_rollup").exists():
            raise CannotRunError("only Linux says how much memory processes share")
        peak, ended = [0], threading.Event()

        def look() -> None:
            while not ended.wait(OFTEN):
                peak[0] = max(peak[0], sum(map(_share, _below(str(folder)))))

        with tempfile.TemporaryDirectory() as folder:
            watch = threading.Thread(target=look)
            watch.start()
            try:
                command(words(designs, None, Path(folder, "sweep.zarr")))
            finally:
                ended.set()
                watch.join()
        return Reported(peak[0])

    return measure


def _below(mark: str) -> list[int]:
    """Return the process whose command line has a mark, and all that come from it."""
    parents, found = {}, set()
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if mark.encode() in (entry / "cmdline").read_bytes():
                found.add(int(entry.name))
        except OSError:
            continue
    for _ in range(4):
        found |= {child for child, parent in parents.items() if parent in found}
    return sorted(found)


def _share(process: int) -> int:
    """Return the bytes of a process, each page that several have divided among them."""
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def cases(quick: bool) -> Cases:
    """Yield what Dask adds, the whole time, and the memory."""
    few, many, all_of_them = (512, 1024, 1024) if quick else (4096, 20_480, 100_000)

    def unchanged(found: Any) -> float:
        return found

    yield Case(
        f"four-bars x {INSTANTS} instants to jounce, designs beyond the first {few:,}",
        [
            Contestant("two worker processes by Dask", ready(processor(few, many, 2)), unchanged),
            Contestant("the same work in one process", ready(processor(few, many, 0)), unchanged, aim=1.15),
        ],
        count=many - few,
        unit="design",
        reference="three designs solved alone, relative, of the peaks",
        rounds=1 if quick else 3,
    )
    yield Case(
        f"{all_of_them:,} four-bars x {INSTANTS} instants to jounce, on all cores, start counted",
        [Contestant("jounce", ready(whole(all_of_them)), unchanged)],
        clock="wall time",
        rounds=0,
        reference="three designs solved alone, relative, of the peaks",
    )
    yield Case(
        f"{all_of_them:,} four-bars x {INSTANTS} instants to jounce, all processes together",
        [Contestant("jounce", ready(memory(all_of_them)))],
        clock="memory",
        rounds=0,
    )
