"""Make the references again: python -m tests.problems.make_references [NAME ...]  (about a minute for all).

Each file in references/ holds, for one mechanism of examples/, the outputs and their derivatives to order 10 at eleven
instants of its time grid, as decimal strings of thirty digits from a fifty-digit solution by tests/oracles. The code
under test has no part in it.
"""

import json
import sys
import time

from mpmath import mp

from tests.oracles.mpmath_kinematics import solve_file
from tests.problems.mechanisms import EXAMPLES, REFERENCES

ORDER, DIGITS, STORED = 10, 50, 30


def text(number):
    """Return a number in thirty digits; what is zero up to the arithmetic becomes a plain zero."""
    return "0.0" if abs(number) < mp.mpf(10) ** -30 else mp.nstr(number, STORED)


def make(path):
    """Return the reference of one mechanism file as a plain dict."""
    times, found = solve_file(path, ORDER, DIGITS)
    outputs = {
        name: [[[text(d) for d in component] for component in instant] for instant in instants]
        for name, instants in found.items()
    }
    return {
        "file": path.name,
        "order": ORDER,
        "layout": "outputs: instant, component, derivative; plain derivatives, SI units",
        "time": [repr(t) for t in times],
        "outputs": outputs,
    }


def main(names):
    """Write the references of the named mechanisms, or of all."""
    for path in sorted(EXAMPLES.glob("*.yaml")):
        if names and path.stem not in names:
            continue
        start = time.perf_counter()
        (REFERENCES / f"{path.stem}.json").write_text(json.dumps(make(path), indent=0) + "\n", encoding="utf-8")
        print(f"{path.stem}: {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
