"""Long CSV files of numbers only, such as an hour of a log at 1 kHz, read without a text for each entry."""

from __future__ import annotations

import csv
import dataclasses
import functools
import io
import os
import re
from collections.abc import Mapping, Sequence
from decimal import Decimal, InvalidOperation
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import JounceError
from jounce.io.files.reading import LARGEST_NUMBER, MAX_SAMPLES, read_file

LONG = 5_000_000
"""Size in bytes up to which a file is read entry by entry, so that entries may be text."""
LARGE = 1e8
LONGEST = 2_000_000_000
_ROW = re.compile(r"at row (\d+)")


@dataclasses.dataclass(frozen=True, eq=False)
class Numbers:
    """The numbers of a long table.

    Parameters
    ----------
    header_line : int
        Line of the names of the columns; each line below it is a row.
    names : sequence of str
        Names of the columns, with their units.
    values : array of shape (row, column)
        Numbers as written, minus the offsets.
    offsets : dict of int to Decimal
        Offsets subtracted from large numbers of a column, such as stamps, before rounding.
    """

    header_line: int
    names: Sequence[str]
    values: Float[np.ndarray, "row column"]
    offsets: Mapping[int, Decimal]


def numbers_of(path: str, error_type: type[JounceError]) -> Numbers | None:
    """Return the numbers of a long file with a row of names; None if the file is short or of another kind.

    Raises
    ------
    JounceError
        Of the given type, if the file cannot be read, is not text in UTF-8, or is larger than 2 GB.
    """
    try:
        if os.stat(path).st_size <= LONG:  # noqa: PTH116 - the reader reports errors of the name
            return None
    except (OSError, ValueError):
        return None
    content = read_file(path, LONGEST, what="the samples", error=error_type)
    start = content.find(b"\n") + 1
    try:
        names = [entry.strip() for entry in next(csv.reader([content[:start].decode("utf-8-sig")], strict=True))]
    except (UnicodeDecodeError, csv.Error, StopIteration):
        return None
    blank = b"\n\n" in content or b"\n\r\n" in content
    if blank or len(names) < 2 or any(_is_number(name) or not name for name in names):
        return None
    offsets = _offsets(content[start : start + content[start:].find(b"\n")])
    read: Any = {k: functools.partial(_beyond, origin) for k, origin in offsets.items()}
    stream = io.BytesIO(content)
    stream.seek(start)
    try:
        text = io.TextIOWrapper(stream, encoding="utf-8")
        values = np.loadtxt(text, delimiter=",", comments=None, ndmin=2, converters=read or None)
    except (ValueError, UnicodeDecodeError) as reason:
        if len(content) <= MAX_SAMPLES:
            return None
        row = _ROW.search(str(reason))
        reason_text = str(reason).split(";")[0].encode("ascii", "backslashreplace").decode("ascii")
        message = f"a file of this length may contain numbers only: {reason_text}"
        raise error_type(message, path=path, line=None if row is None else 2 + int(row[1])) from None
    return Numbers(1, names, values, offsets) if values.shape[1] == len(names) else None


def _offsets(row: bytes) -> dict[int, Decimal]:
    """Return the large numbers of a row, by column."""
    offsets = {}
    for k, entry in enumerate(row.decode("utf-8", "replace").split(",")):
        if _is_number(entry) and LARGE <= abs(float(entry)) <= LARGEST_NUMBER:
            offsets[k] = Decimal(entry.strip())
    return offsets


def _beyond(origin: Decimal, text: str) -> float:
    try:
        return float(Decimal(text.strip()) - origin)
    except InvalidOperation:
        raise ValueError(f"could not convert string {text!r}") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
