"""Rows in a folder, each with the day and the circumstances of its measurement: read, merged, written whole."""

import json
from collections import Counter
from collections.abc import Collection, Mapping
from datetime import date
from pathlib import Path
from typing import Any

from benchmarks import BENCHMARKS
from benchmarks.tables import Rows, as_csv, as_markdown

FILE = "table.json"
WORDS = ("benchmark", "day", "case", "contestant", "version", "unit", "clock", "reference", "left out")
KEYS = (*WORDS, "cost", "ratio", "aim", "error", "at")


class TableError(Exception):
    """Raised where the table in a folder cannot be read; the message says why, and what to do."""


def read(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of the table in a folder, each with its day and all its circumstances; none without a table.

    In tables of older versions the day is one of the circumstances of all rows.
    """
    file = folder / FILE
    if not file.exists():
        return []
    try:
        whole = json.loads(file.read_text(encoding="utf-8"))
        about = dict(whole["circumstances"])
        older = {"day": about.pop("day")} if "day" in about else {}
        rows = [older | row | {"circumstances": about | row.get("circumstances", {})} for row in whole["rows"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise _unreadable(file, f"{type(error).__name__}: {error}") from error
    for k, row in enumerate(rows, 1):
        if flaw := _flaw(row):
            raise _unreadable(file, f"row {k}: {flaw}")
    return rows


def _unreadable(file: Path, reason: str) -> TableError:
    return TableError(
        f"{file} cannot be read, so no rows can be added to it ({reason}); restore the file, or remove it, or measure "
        "all benchmarks, without --only, which replaces it"
    )


def _flaw(row: Mapping[str, Any]) -> str:
    """Return what is wrong with a row that was read, or nothing."""
    if missing := [key for key in KEYS if key not in row]:
        return f"it has no {', '.join(missing)}"
    if wrong := [key for key in WORDS if not isinstance(row[key], str)]:
        return f"{', '.join(wrong)} must be text"
    if row["benchmark"] not in BENCHMARKS:
        return f"there is no benchmark {row['benchmark']!r}"
    try:
        date.fromisoformat(row["day"])
    except ValueError:
        return f"{row['day']!r} is not a day, such as 2026-11-23"
    if row["cost"] is None and not row["left out"]:
        return "it has no cost, and no reason for that"
    if not all(row[key] is None or _is_spread(row[key]) for key in ("cost", "ratio")):
        return "cost and ratio must be three numbers each"
    if not all(row[key] is None or _is_number(row[key]) for key in ("aim", "error")):
        return "aim and error must be numbers"
    if not all(isinstance(value, str) for value in row["circumstances"].values()):
        return "circumstances must be text"
    return "" if isinstance(row["at"], dict) else "at must be an object"


def _is_spread(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(_is_number(x) for x in value)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def merged(kept: Rows, measured: Rows, failed: Collection[str] = ()) -> list[Mapping[str, Any]]:
    """Return kept rows with those of measured benchmarks in the place of their own, in the order of the benchmarks.

    Benchmarks that failed have part of their rows at most, and replace none.
    """
    there = {row["benchmark"] for row in kept}
    new = [row for row in measured if row["benchmark"] not in there.intersection(failed)]
    replaced = {row["benchmark"] for row in new}
    order = list(BENCHMARKS)
    return sorted(
        [*(row for row in kept if row["benchmark"] not in replaced), *new],
        key=lambda row: order.index(row["benchmark"]),
    )


def write(rows: Rows, folder: Path) -> None:
    """Write ``table.json``, ``table.md`` and ``table.csv``: what most rows have in common once, the rest with each row.

    Each file takes its place when it is complete; the first, from which the others follow, has all measurements.
    """
    from jounce.io.files.writing import replacing  # imports JAX, which this process does not need to measure

    about = _common(rows)
    short = []
    for row in rows:
        own = {key: value for key, value in row["circumstances"].items() if about.get(key) != value}
        rest = {key: value for key, value in row.items() if key != "circumstances"}
        short.append(rest | ({"circumstances": own} if own else {}))
    texts = {
        FILE: json.dumps({"circumstances": about, "rows": short}, indent=1) + "\n",
        "table.md": as_markdown(short, about),
        "table.csv": as_csv(short, about),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        with replacing(folder / name) as scratch:
            scratch.write_bytes(text.encode())


def _common(rows: Rows) -> dict[str, str]:
    """Return, of each circumstance that all rows tell, what most of them tell."""
    every = [row["circumstances"] for row in rows]
    keys = [key for key in every[0] if all(key in own for own in every)] if every else []
    return {key: Counter(own[key] for own in every).most_common(1)[0][0] for key in keys}
