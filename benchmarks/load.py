"""Reading the four-bar file into a checked mechanism, beside parsing the same YAML with ruamel.yaml alone.

Run: ``python benchmarks/load.py``
"""

from pathlib import Path

from timing import race, use_one_core

use_one_core()

from ruamel.yaml import YAML  # noqa: E402

import jounce as jn  # noqa: E402


def main() -> None:
    """Print milliseconds and the ratio."""
    path = Path(__file__).parents[1] / "examples" / "four_bar.yaml"
    bare = YAML(typ="safe", pure=True)
    medians = race({"ruamel.yaml, safe loader": lambda: bare.load(path), "jounce.load": lambda: jn.load(path)})
    for name, seconds in medians.items():
        print(f"{name:<26} {seconds * 1e3:6.2f} ms   {seconds / medians['ruamel.yaml, safe loader']:.2f} x")


if __name__ == "__main__":
    main()
