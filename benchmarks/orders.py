"""What each further derivative costs: the RSUR mechanism over 10,000 instants, positions included, to order 2 up to 10.

The best of the rounds is printed, since other work on the machine only adds time. Run: ``python benchmarks/orders.py``
"""

from pathlib import Path

from timing import race, report, use_one_core

use_one_core()

import numpy as np  # noqa: E402

import jounce as jn  # noqa: E402

INSTANTS = 10_000
ORDERS = {2: "acceleration", 3: "jerk", 4: "jounce", 6: "the sixth derivative", 10: "the tenth derivative"}


def main() -> None:
    """Print the time to each order, and its ratio to accelerations."""
    mechanism = jn.load(Path(__file__).parents[1] / "examples" / "rsur.yaml")
    time = np.linspace(0.0, 2.0, INSTANTS)
    names = {order: f"to {name} (order {order})" for order, name in ORDERS.items()}
    competitors = {
        name: lambda order=order: jn.solve(mechanism, time, order=order).outputs["psi"] for order, name in names.items()
    }
    report(f"RSUR, {INSTANTS} instants, one core", race(competitors, rounds=40, best=True), INSTANTS, names[2])


if __name__ == "__main__":
    main()
