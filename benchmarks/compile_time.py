"""First solve (tracing and compilation included) against the number of joints of a kind and of instants.

A chain of links, each driven relative to the one before. Compilation should not depend on the number of links, nor,
up to 1024 instants and beyond that again, on the number of instants. Run: ``python benchmarks/compile_time.py``
"""

import itertools
import time

from timing import use_one_core

use_one_core()

import jax  # noqa: E402
import numpy as np  # noqa: E402

import jounce as jn  # noqa: E402


def chain(links: int) -> jn.Mechanism:
    """Return an open chain of links of 0.1 m, all driven by one law."""
    names = ["ground", *(f"link{k}" for k in range(links))]
    pairs = list(itertools.pairwise(names))
    return jn.Mechanism(
        space="planar",
        parameters={"speed": 0.3},
        bodies={name: jn.Body([0.1 * k, 0.0]) for k, name in enumerate(names[1:])},
        joints={f"pin{k}": jn.planar.Revolute(pair, [0.1 * (k > 0), 0], [0, 0]) for k, pair in enumerate(pairs)},
        drivers={
            f"turn{k}": jn.drivers.CoordinateDriver(pair, "angle", motion="speed*sin(t)/10")
            for k, pair in enumerate(pairs)
        },
        outputs={"tip": jn.PointOutput(names[-1], [0.1, 0])},
    )


def first_and_second(mechanism: jn.Mechanism, instants: int) -> tuple[float, float]:
    """Return the seconds of the first solve in an empty compilation cache, and of the next."""
    jax.clear_caches()
    seconds = []
    for _ in range(2):
        start = time.perf_counter()
        jn.solve(mechanism, np.linspace(0.0, 1.0, instants))
        seconds.append(time.perf_counter() - start)
    return seconds[0], seconds[1]


def main() -> None:
    """Print compile time, as first minus second solve."""
    first_and_second(chain(2), 10)
    for links, instants in ((2, 100), (8, 100), (32, 100), (8, 1000), (8, 2000), (8, 20000)):
        first, second = first_and_second(chain(links), instants)
        print(f"{links:>3} links {instants:>6} instants: compilation {first - second:5.2f} s, solve {second:5.2f} s")


if __name__ == "__main__":
    main()
