"""A thousand double pendulums side by side, each with its own angles, against one alone; 10 s of motion.

Run: ``python benchmarks/batch.py [--runs 1000]``. Both times are of the second call: programs are compiled by then.
"""

import argparse
import statistics
import time

import numpy as np

import jounce as jn

TIME = [0.0, 10.0]


def pendulum() -> jn.Mechanism:
    """Return two point masses on massless rods, from rest at two angles."""
    rod = {"mass": 1.0, "inertia": 0.0, "center_of_mass": [1.0, 0.0]}
    start = {
        name: jn.drivers.CoordinateDriver(("ground", body), "angle", motion=name)
        for name, body in (("first", "upper"), ("second", "lower"))
    }
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        parameters={"first": 0.0, "second": 0.0},
        bodies={"upper": jn.Body([0, 0], **rod), "lower": jn.Body([1, 0], **rod)},
        joints={
            "A": jn.planar.Revolute(("ground", "upper"), [0, 0], [0, 0]),
            "B": jn.planar.Revolute(("upper", "lower"), [1, 0], [0, 0]),
        },
        initial=start,
        outputs={"upper": jn.AngleOutput("upper"), "lower": jn.AngleOutput("lower")},
    )


def seconds(run, rounds: int) -> float:
    """Return the median time of a call, after one that compiles."""
    run()
    found = []
    for _ in range(rounds):
        start = time.perf_counter()
        run()
        found.append(time.perf_counter() - start)
    return statistics.median(found)


def main() -> None:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    runs = parser.parse_args().runs
    generator = np.random.default_rng(0)
    first, second = generator.uniform(-0.5, 0.5, (2, runs))
    mechanism = pendulum()
    alone = seconds(lambda: jn.simulate(mechanism, TIME, order=1), 9)
    batch = seconds(lambda: jn.simulate_batch(mechanism, {"first": first, "second": second}, TIME, order=1), 3) / runs
    print(f"one alone: {1e3 * alone:.2f} ms")
    print(f"each of {runs} side by side: {1e3 * batch:.3f} ms, {alone / batch:.1f} times faster")


if __name__ == "__main__":
    main()
