"""Peak memory of a process that solves a long grid, beside what its outputs take."""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, Reported, ready
from benchmarks.processes import command

FILE = EXAMPLES / "four_bar.yaml"


def peak(instants: int) -> Callable[[], Any]:
    """Return what gives the peak of a process that solves the four-bar over so many instants."""
    script = f"import numpy, jounce; jounce.solve(jounce.load({str(FILE)!r}), numpy.linspace(0, 2, {instants}))"
    return lambda: Reported(command([sys.executable, "-c", script]).memory)


def cases(quick: bool) -> Cases:
    """Yield one grid, long enough for the outputs to outweigh the libraries."""
    instants, few = 100_000 if quick else 1_000_000, 10_001
    outputs = jn.solve(jn.load(FILE), np.linspace(0, 2, few)).outputs.values()
    size = sum(values.nbytes for values in outputs) * instants / few
    libraries = peak(few)()
    yield Case(
        f"four-bar to jounce, {instants:,} instants",
        [
            Contestant(
                f"jounce, peak above that for {few:,}",
                ready(lambda: Reported(peak(instants)().value - libraries.value)),
            ),
            Contestant("its outputs", ready(lambda: Reported(size)), aim=2.0),
            Contestant(f"libraries and {few:,} instants", ready(lambda: libraries)),
        ],
        clock="memory",
        rounds=0,
    )
