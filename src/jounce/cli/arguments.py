"""Strict conversion of words of the command line to values, without silent rounding or truncation."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jounce.errors import JounceError, MechanismFileError, did_you_mean

_WHOLE = re.compile(r"[+-]?[0-9]{1,18}(\.0*)?")


def converted(kind: Any, tokens: Sequence[Any]) -> Any:
    """Return the value of an option; cyclopts itself converts 2.5 to 2, and accepts numbers that are not finite.

    Raises
    ------
    JounceError
        If a number must be whole and is not, or is not finite.
    """
    import cyclopts

    if kind in (int, float):
        return [_number(kind, token) for token in tokens][-1]
    return cyclopts.convert(kind, tokens)


def _number(kind: type, token: Any) -> int | float:
    text = token.value.strip()
    if kind is int:
        if not _WHOLE.fullmatch(text):
            raise JounceError("must be a whole number", name=token.keyword, value=token.value)
        return int(text.partition(".")[0])
    try:
        number = math.nan if "_" in text else float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise JounceError("must be a finite number", name=token.keyword, value=token.value)
    return number


def check_ending(path: Path, valid: Sequence[str]) -> None:
    """Raise MechanismFileError unless a file has one of the suffixes; folders are left to their reader."""
    suffix = path.suffix.lower()
    if suffix not in valid and not path.is_dir():
        raise MechanismFileError(
            f"the kind of a file is given by its extension; {did_you_mean(suffix, valid)}", path=path
        )
