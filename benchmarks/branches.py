"""Does a motion stay on its branch? Random linkages, a third near singular positions, judged instant by instant.

The judge follows the quadratic loop equations of each linkage with steps proved by the theorem of Newton and
Kantorovich (`tests/oracles/linkage_paths.py`), from the position that jounce starts with, and knows how far the motion
reaches. An instant is wrong if jounce calls it OK and it lies elsewhere, or beyond the end of the motion. It is given
up if jounce calls it anything else though the motion reaches it. What is given up is counted apart where the motion has
come closer to a singular position than 1e-4, by the determinant of the scaled Jacobian (h/b in a slider-crank, the sine
of the transmission angle in a four-bar). Ends with status 1 if an instant is wrong, or if too many are given up.

Run: ``python benchmarks/branches.py [--count 10000] [--seed 0] [--kinds four-bar,RSSR] [--failures wrong.jsonl]``
"""

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.timing import use_one_core

if __name__ == "__main__":  # before JAX is imported; not of a process that takes the cases only
    use_one_core()

import numpy as np

from tests.problems.branch_study import FAMILIES, ORDERS, Case, judged, random_cases, solved
from tests.problems.linkages import NEAREST

LARGEST_SHARE_GIVEN_UP = 1e-3  # of the instants farther than 1e-4 from singular positions
HEADINGS = ("mechanisms", "instants", "OK", "wrong", "given up", "of them near", "rightly refused", "us/instant", "ms")


def main() -> int:
    """Print the table; return 1 if an instant is wrong or too many are given up."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=10_000, help="linkages, all kinds together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", help="names, with commas between them; all unless given")
    parser.add_argument("--orders", default=",".join(map(str, ORDERS)), help="of derivatives, drawn from these")
    parser.add_argument(
        "--nearest", type=float, default=NEAREST, help="smallest h over a length; rounding decides below 1e-7"
    )
    parser.add_argument("--failures", type=Path, help="file for the linkages that are wrong or given up, JSON by line")
    options = parser.parse_args()
    kinds = options.kinds.split(",") if options.kinds else list(FAMILIES)
    orders = [int(order) for order in options.orders.split(",")]

    started, total, reasons = time.perf_counter(), Counter(), Counter()
    lines = options.failures.open("w", encoding="utf-8") if options.failures else None
    print(" " * 28 + " ".join(f"{heading:>15}" for heading in HEADINGS))
    for index, kind in enumerate(kinds):
        count = options.count // len(kinds) + (index < options.count % len(kinds))
        tally = Counter()
        cases = random_cases(FAMILIES[kind], count, [options.seed, list(FAMILIES).index(kind)], orders, options.nearest)
        for case, verdict in judged([solved(case) for case in cases]):
            tally += verdict.tally
            reasons += verdict.reasons
            if lines and (verdict.tally["wrong"] or verdict.tally["given up"]):
                print(json.dumps(_record(case, verdict)), file=lines, flush=True)
        total += tally
        print(_row(kind, tally), flush=True)
    print(_row("all", total))
    print(_summary(total, reasons), f"{time.perf_counter() - started:.0f} s in all")
    far = total["given up"] - total["of them near"]
    return int(total["wrong"] > 0 or far > LARGEST_SHARE_GIVEN_UP * total["far"])


def _row(name: str, tally: Counter) -> str:
    costs = {
        "us/instant": tally["nanoseconds"] / 1e3 / max(tally["instants"], 1),
        "ms": tally["nanoseconds"] / 1e6 / max(tally["mechanisms"], 1),
    }
    cells = [f"{costs[h]:15.1f}" if h in costs else f"{tally[h]:15,d}" for h in HEADINGS]
    return f"{name:<28}" + " ".join(cells)


def _summary(total: Counter, reasons: Counter) -> str:
    far = total["given up"] - total["of them near"]
    costs = [
        f"{total[f'{which} nanoseconds'] / 1e3 / max(total[f'{which} instants'], 1):.0f} us an instant, "
        f"{total[f'{which} nanoseconds'] / 1e6 / max(total[f'{which} mechanisms'], 1):.0f} ms a mechanism {meaning}"
        for which, meaning in (
            ("smooth", "away from singular positions (above 0.1)"),
            ("close", "that misses one"),
            ("ending", "that ends at one"),
        )
    ]
    lines = [
        f"wrong: {total['wrong']} (off the branch {total['elsewhere']}, beyond the end {total['beyond']}, "
        f"derivatives {total['rates']}) of {total['OK']:,} called OK; {total['derivatives']:,} compared to jerk too",
        f"given up above 1e-4: {far} of {total['far']:,} ({100 * far / max(total['far'], 1):.3f} percent), "
        f"below: {total['of them near']} of {total['near']:,}",
        f"not judged, at or beyond an end that is too close to a singular position: {total['undecided']}",
        "processor time: " + "; ".join(costs),
        *(f"  {reason}: {number}" for reason, number in reasons.most_common()),
    ]
    return "\n".join(lines) + "\n"


def _record(case: Case, verdict: Any) -> dict[str, Any]:
    law = {name: float(value) for name, value in case.linkage.law._asdict().items()}
    return {
        "kind": case.linkage.family.name,
        "values": {name: float(value) for name, value in case.linkage.values.items()},
        "law": law,
        "guess": case.linkage.guess,
        "stop": float(case.time[-1]),
        "instants": len(case.time),
        "uneven": not np.allclose(np.diff(case.time), case.time[1] - case.time[0]),
        "order": case.order,
        "tally": dict(verdict.tally),
        "reasons": dict(verdict.reasons),
        "first": verdict.first,
        "smallest determinant": verdict.smallest,
        "ends at": verdict.end,
    }


if __name__ == "__main__":
    sys.exit(main())
