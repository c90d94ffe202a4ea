"""First calls in fresh processes of Python: with an empty folder of compiled programs, and with the one that this left.

The import of jounce and of JAX is measured beside them, and is not among them.
"""

import compileall
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from typing import Any

from benchmarks.cases import ROOT, CannotRunError, Case, Cases, Contestant, Reported

CALLS = {
    "four-bar, 201 instants": "jn.solve(jn.load('examples/four_bar.yaml'), np.linspace(0, 2, 201))",
    "RSUR, 201 instants": "jn.solve(jn.load('examples/rsur.yaml'), np.linspace(0, 2, 201))",
    "double pendulum, 1 s": "jn.simulate(jn.load('examples/double_pendulum.yaml'), np.linspace(0, 1, 201))",
    "free spatial slider-crank, 1 s": (
        "jn.simulate(jn.load('examples/spatial_slider_crank_free.yaml'), np.linspace(0, 1, 201))"
    ),
}
SCRIPT = """
import time
start = time.perf_counter()
import numpy as np
import jounce as jn
jn.load, jn.solve, jn.simulate
imported = time.perf_counter()
found = {call}
[np.asarray(values) for values in found.outputs.values()]
print(imported - start, time.perf_counter() - imported)
"""


def parts_of(call: str, folder: str) -> tuple[float, float]:
    """Return how long the import and the first call take in a process with a folder of programs, s."""
    environment = os.environ | {"JOUNCE_CACHE_DIR": folder}
    words = [sys.executable, "-c", SCRIPT.format(call=call)]
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise CannotRunError(f"ended with {done.returncode}: {done.stderr.strip().rpartition(chr(10))[2]}")
    imported, called = map(float, done.stdout.split())
    return imported, called


def emptied(call: str, part: int) -> Callable[[], Any]:
    """Return what measures a part with an empty folder."""

    def run() -> Reported:
        with tempfile.TemporaryDirectory() as folder:
            return Reported(parts_of(call, folder)[part])

    return run


def filled(call: str) -> Callable[[], Any]:
    """Return what measures the first call with the folder that such a process left before."""
    folder = tempfile.TemporaryDirectory()
    parts_of(call, folder.name)
    return lambda: Reported(parts_of(call, folder.name)[1])


def cases(quick: bool) -> Cases:
    """Yield a case for each call."""
    compileall.compile_dir(ROOT / "src", quiet=1)  # what an installation has, and some settings forbid to write
    for name, call in list(CALLS.items())[: 1 if quick else None]:
        for process, run, aim in (
            ("first", lambda call=call: emptied(call, 1), 6.0),
            ("next", lambda call=call: filled(call), 1.5),
        ):
            yield Case(
                f"first call in the {process} process of Python: {name}",
                [
                    Contestant("jounce", run),
                    Contestant("the import", lambda call=call: emptied(call, 0), aim=aim),
                ],
                clock="wall time",  # two threads compile
                rounds=3,
            )
