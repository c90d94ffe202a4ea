"""Results of a sweep as plain facts: the number of solved designs, and the designs with extreme peaks."""

import itertools
from collections import Counter
from typing import Any

import numpy as np

from jounce.kinematics import Status
from jounce.mechanism.time import last_step_words
from jounce.reporting.peaks import derivative_unit
from jounce.reporting.text.tables import Table, number
from jounce.sweeps.chunks import Plan


def sweep_facts(plan: Plan, checksum: str) -> dict[str, Any]:
    """Return the facts of a finished sweep, with its checksum; chunks are read one at a time."""
    import zarr

    group: Any = zarr.open_group(plan.folder, mode="r")
    outcomes: Counter[int] = Counter()
    extremes: dict[str, list[tuple[float, int] | None]] = {}
    columns = [column for quantity in plan.quantities for column in _columns(quantity, plan.problem.levels)]
    for chunk in range(plan.chunks):
        designs = slice(chunk * plan.chunk, chunk * plan.chunk + plan.size(chunk))
        outcomes.update(group["first_status"][designs].tolist())
        for quantity in plan.quantities:
            peaks = np.moveaxis(
                group[f"{quantity.name}_peak"][designs].reshape(plan.size(chunk), plan.problem.levels, -1), 2, 1
            )
            for name, values in zip(_names(quantity), np.moveaxis(peaks, 0, -1), strict=True):
                for order, row in enumerate(values):
                    pair = extremes.setdefault(f"{name}/{order}", [None, None])
                    for side, sign in enumerate((1, -1)):
                        pair[side] = _running_best(pair[side], sign * row, designs.start)
    rows = []
    for name, order, units in columns:
        low, high = extremes[f"{name}/{order}"]
        facts: dict[str, Any] = {"output": name, "derivative": order, "unit": derivative_unit(units, order)}
        for key, extreme, sign in (("least", low, 1), ("largest", high, -1)):
            facts[key] = None if extreme is None else sign * extreme[0]
            facts[f"{key}_at"] = None if extreme is None else _design(plan, extreme[1])
        rows.append(facts)
    failed = {Status(code).name.lower(): count for code, count in sorted(outcomes.items()) if code != Status.OK}
    remark = last_step_words(plan.problem.instants)
    return ({"remark": remark} if remark else {}) | {
        "designs": plan.space.count,
        "instants": len(plan.problem.instants),
        "vary": list(plan.space.variations),
        "failed": failed,
        "peaks": rows,
        "checksum": checksum,
    }


def sweep_summary(facts: dict[str, Any], name: str) -> str:
    """Return the summary of a sweep as text."""
    count, bad = facts["designs"], sum(facts["failed"].values())
    lines = [f"{name}: {count} designs ({', '.join(facts['vary'])}) at {facts['instants']} instants"]
    kinds = ", ".join(f"{number} {outcome.replace('_', ' ')}" for outcome, number in facts["failed"].items())
    lines.append("  all were solved" if not bad else f"  {count - bad} were solved at all instants, {bad} not: {kinds}")
    lines += [f"  {facts['remark']}"] if "remark" in facts else []
    return "\n".join([*lines, f"  checksum {facts['checksum']}"])


def sweep_table(facts: dict[str, Any]) -> Table:
    """Return a table of the smallest and largest peaks with their designs."""

    def text(values: dict[str, float] | None) -> str:
        return "-" if values is None else " ".join(f"{name}={number(value)}" for name, value in values.items())

    rows = [
        [x["output"], str(x["derivative"]), x["unit"], number(x["least"]), text(x["least_at"]), number(x["largest"]),
         text(x["largest_at"])]
        for x in facts["peaks"]
    ]  # fmt: skip
    headings = ("output", "derivative", "unit", "least peak", "of", "largest peak", "of")
    return Table("", headings, rows, (1, 3, 5), True)


def _names(quantity: Any) -> list[str]:
    labels = ["_".join(combination) for combination in itertools.product(*(labels for _, labels in quantity.axes))]
    return [f"{quantity.name}_{label}" if label else quantity.name for label in labels]


def _columns(quantity: Any, levels: int) -> list[tuple[str, int, str]]:
    return [(name, order, quantity.units) for name in _names(quantity) for order in range(levels)]


def _running_best(best: tuple[float, int] | None, values: np.ndarray, start: int) -> tuple[float, int] | None:
    """Return the least value so far and its design, the first one of equal values."""
    finite = np.where(np.isnan(values), np.inf, values)
    index = int(np.argmin(finite))
    if not np.isfinite(finite[index]) or (best is not None and best[0] <= finite[index]):
        return best
    return float(finite[index]), start + index


def _design(plan: Plan, index: int) -> dict[str, float]:
    return {name: float(value[0]) for name, value in plan.space.values(index, index + 1).items()}
