"""Facts of an optimized design, with words and a table of values before and after."""

from __future__ import annotations

import dataclasses
from os import PathLike
from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from jounce.design import OptimizedDesign
from jounce.reporting.text.tables import Table


class ComparisonFacts(TypedDict):
    """One quantity before and after the optimization; SI."""

    kind: str
    name: str
    before: float | None
    after: float
    low: float | None
    high: float | None
    multiplier: float


class DesignFacts(TypedDict):
    """An optimized design."""

    title: str
    file: str
    status: str
    message: str
    objective: float
    parameters: dict[str, float]
    assembly: int | None
    comparisons: list[ComparisonFacts]
    smallest_singular_value: float
    residual: float
    grid_error: float
    searches: list[float | None]
    evaluations: int
    notes: list[str]


def design_facts(design: OptimizedDesign, file: str | PathLike[str]) -> DesignFacts:
    """Return the facts of an optimized design."""
    assembly = design.mechanism.assembly
    rows: Any = [dataclasses.asdict(row) for row in design.comparisons]
    return {
        "title": design.mechanism.title,
        "file": str(file),
        "status": design.status,
        "message": design.message,
        "objective": design.objective,
        "parameters": dict(design.parameters),
        "assembly": assembly if isinstance(assembly, int) else None,
        "comparisons": rows,
        "smallest_singular_value": design.smallest_singular_value,
        "residual": design.residual,
        "grid_error": design.grid_error,
        "searches": list(design.searches),
        "evaluations": design.evaluations,
        "notes": list(design.notes),
    }


def design_words(facts: DesignFacts) -> str:
    """Return the result of an optimization in a few lines."""
    lines = [facts["title"] or Path(facts["file"]).name, f"{facts['status']}: {facts['message']}"]
    lines += [f"note: {note}" for note in facts["notes"]]
    if facts["assembly"] is not None:
        lines.append(f"assembly {facts['assembly']}")
    lines.append(f"smallest singular value along the motion {facts['smallest_singular_value']:.3g}")
    return "\n".join(lines)


def design_table(facts: DesignFacts) -> Table:
    """Return the table of objective, conditions and parameters before and after, with their bounds."""
    rows = [
        [
            row["name"],
            _number(row["before"]),
            _number(row["after"]),
            _number(row["low"]),
            _number(row["high"]),
            _number(row["multiplier"] or None),
        ]
        for row in facts["comparisons"]
    ]
    headings = ("SI", "before", "after", "least", "most", "multiplier")
    return Table("", headings, rows, numbers=(1, 2, 3, 4, 5))


def _number(value: float | None) -> str:
    return "" if value is None else "-" if value != value else f"{value:.7g}"
