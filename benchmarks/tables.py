"""Rows as a table: on the terminal, as Markdown, as CSV."""

import csv
import io
import os
import platform
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from itertools import groupby
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks import BENCHMARKS
from benchmarks.cases import ROOT

Rows = Sequence[Mapping[str, Any]]
HEADINGS = ("work", "by", "cost", "quartiles", "jounce takes that", "error")
WIDTH = 200  # of a table; a terminal that is narrower breaks its lines
TIME, MEMORY = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}, {"GB": 1e9, "MB": 1e6, "kB": 1e3, "B": 1.0}


def circumstances(quick: bool) -> dict[str, str]:
    """Return what the figures hold for: machine, versions, other work."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    own = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    found = {
        "processor": f"{model or platform.processor() or platform.machine()}, {cores} cores",
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "versions": f"jounce {own}, " + ", ".join(f"{name} {metadata.version(name)}" for name in ("jax", "numpy")),
    }
    if hasattr(os, "getloadavg"):
        found["other work"] = f"{os.getloadavg()[2]:.1f} processes wanted a core, on average over the last 15 minutes"
    return found | ({"sizes": "small, by --quick: to see that all runs, not to be quoted"} if quick else {})


def show(rows: Rows) -> None:
    """Print the rows of one benchmark."""
    table = Table(box=None, pad_edge=False)
    for heading in HEADINGS:
        table.add_column(heading, no_wrap=heading != "cost")  # where it is told why one was left out
    for cells in _cells(rows):
        table.add_row(*cells)
    Console(width=max(Console().width, WIDTH)).print(table, soft_wrap=True)


def as_markdown(rows: Rows, about: Mapping[str, str]) -> str:
    """Return a section for each benchmark, with the day, and with the circumstances that differ from those given."""
    return "\n".join(_markdown(rows, about)) + "\n"


def _markdown(rows: Rows, about: Mapping[str, str]) -> Iterator[str]:
    yield f"Written by `python -m benchmarks`. Unless a section says otherwise, {_in_words(about)}."
    for name, group in groupby(rows, key=lambda row: row["benchmark"]):
        own = list(group)
        days = " and ".join(sorted({row["day"] for row in own}))
        measured = "; ".join(filter(None, (f"measured on {days}", _in_words(own[0].get("circumstances", {})))))
        yield f"\n### {BENCHMARKS[name].about}\n"
        yield f"`python -m benchmarks --only {name}`, {own[0]['clock']}, {measured}.\n"
        yield "| " + " | ".join(HEADINGS) + " |"
        yield "|" + "---|" * len(HEADINGS)
        yield from ("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |" for cells in _cells(own))
        references = dict.fromkeys(row["reference"] for row in own if row["reference"])
        yield from (f"\nErrors are against {reference}." for reference in references)


def _in_words(about: Mapping[str, str]) -> str:
    return "; ".join(f"{key}: {value}" for key, value in about.items())


def as_csv(rows: Rows, about: Mapping[str, str]) -> str:
    """Return a line for each row, with a column for each circumstance in which rows differ."""
    spreads, at = ("cost", "ratio"), sorted({key for row in rows for key in row["at"]})
    differing = sorted({key for row in rows for key in row.get("circumstances", {})})
    flat = [
        {key: value for key, value in row.items() if key not in (*spreads, "at", "circumstances")}
        | {
            f"{key} {which}": x
            for key in spreads
            for which, x in zip(("low", "median", "high"), row[key] or [""] * 3, strict=True)
        }
        | {key: row["at"].get(key, "") for key in at}
        | {key: (about | row.get("circumstances", {})).get(key, "") for key in differing}
        for row in rows
    ]
    text = io.StringIO(newline="")
    table = csv.DictWriter(text, list(dict.fromkeys(key for line in flat for key in line)) or ["benchmark"])
    table.writeheader()
    table.writerows(flat)
    return text.getvalue()


def _cells(rows: Rows) -> Iterator[tuple[str, ...]]:
    for row, before in zip(rows, [None, *rows], strict=False):
        work = "" if before and before["case"] == row["case"] else row["case"]
        by = f"{row['contestant']} ({row['version']})" if row["version"] else row["contestant"]
        if row["left out"]:
            yield work, by, f"left out: {row['left out']}", "", "", ""
            continue
        error = "" if row["error"] is None else f"{row['error']:.1e}"
        yield work, by, *_cost(row), _ratio(row), error


def _cost(row: Mapping[str, Any]) -> tuple[str, str]:
    low, middle, high = row["cost"]
    units = MEMORY if row["clock"] == "memory" else TIME
    name, size = next(((name, size) for name, size in units.items() if middle >= size), list(units.items())[-1])
    article = "an" if row["unit"][0] in "aeiou" else "a"
    each = "" if row["unit"] == "run" else f" {article} {row['unit']}"
    return f"{middle / size:.3g} {name}{each}", f"{low / size:.3g} to {high / size:.3g}"


def _ratio(row: Mapping[str, Any]) -> str:
    if row["ratio"] is None:
        return ""
    low, middle, high = row["ratio"]
    aim = "" if row["aim"] is None else f"; aim {row['aim']:g}"
    return f"{middle:.3g} times ({low:.3g} to {high:.3g}{aim})"
