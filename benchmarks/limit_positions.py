"""Are limit positions and assemblies found, all of them? Random linkages, judged by closed forms and by elimination.

Limit positions: four-bars, slider-cranks and RSSRs, a third of them near a change point, traced from both assemblies in
every range of their crank; each limit position must be that of the closed form (`tests/oracles/limit_positions.py`).
Assemblies: Stephenson III six-bars driven at the link, against an elimination of degree six with sixty digits
(`tests/oracles/six_bar_assemblies.py`). Ends with status 1 if one is missing or too far off.

Run: ``python benchmarks/limit_positions.py [--count 1000] [--assemblies 200] [--seed 0]``
"""

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.timing import use_one_core

if __name__ == "__main__":  # before JAX is imported; not of a process that takes the cases only
    use_one_core()

import numpy as np

import jounce as jn
from tests.oracles.six_bar_assemblies import crank_angles
from tests.problems.branch_study import FAMILIES as LINKAGES
from tests.problems.limit_study import FAMILIES, LARGEST_ERROR, judged, random_linkage

STEPHENSON = "Stephenson III at the link"
NAMES = ("a", "b", "c", "d", "px", "py", "l", "r", "qx", "qy")


def main() -> int:
    """Print the tables; return 1 if something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=1000, help="linkages of each kind for limit positions")
    parser.add_argument("--assemblies", type=int, default=200, help="six-bars for assemblies")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    wrong = sum(limits(name, options.count, options.seed) for name in FAMILIES)
    return int(bool(wrong + assemblies(options.assemblies, options.seed)))


def limits(name: str, count: int, seed: int) -> int:
    """Print how the limit positions of a kind compare, and return how many linkages are wrong."""
    verdicts = [judged(random_linkage(name, seed, number)) for number in range(count)]
    errors = [verdict.error for verdict in verdicts]
    found = sum(len(verdict.expected) for verdict in verdicts)
    spent = np.median([verdict.seconds / verdict.traces for verdict in verdicts])
    wrong = sum(error > LARGEST_ERROR for error in errors)
    print(f"{name:>14}: {count} linkages, {found} limit positions, worst {max(errors):.1e} rad, {wrong} wrong,")
    print(f"{'':>14}  {1e3 * spent:.0f} ms for a trace")
    return wrong


def assemblies(count: int, seed: int) -> int:
    """Print how assemblies compare, and return how many linkages are wrong."""
    wrong, numbers, spent = 0, Counter(), 0.0
    for number in range(count):
        linkage = LINKAGES[STEPHENSON].linkage(np.random.default_rng([11 + seed, number]), False)[0]
        angles, _ = crank_angles(*(linkage.values[name] for name in NAMES), linkage.law(0.0))
        begun = time.process_time()
        found = jn.assemblies(linkage.mechanism, 0.0, circuits=False)
        spent += time.process_time() - begun
        crank = np.array([x.mechanism.bodies["crank"].angle for x in found])
        away = np.abs(np.angle(np.exp(1j * (crank[:, None] - np.array(angles)))))
        right = len(crank) == len(angles) and away.min(axis=0).max() < 1e-8 and away.min(axis=1).max() < 1e-8
        numbers[len(angles)] += 1
        wrong += not right
    some = ", ".join(f"{number} with {k}" for k, number in sorted(numbers.items()))
    print(
        f"{STEPHENSON}: {count} linkages ({some} assemblies), {wrong} wrong, {1e3 * spent / max(1, count):.0f} ms each"
    )
    return wrong


if __name__ == "__main__":
    sys.exit(main())
