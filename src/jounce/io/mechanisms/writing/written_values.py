"""Values as data of a mechanism file: numbers, text and lists."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.errors import MechanismError
from jounce.trajectory import Expression


def plain(value: Any, location: str) -> Any:
    """Return a value as numbers, text and lists; integers without a decimal point."""
    if isinstance(value, Expression):
        return value.text
    if isinstance(value, str | bool):
        return value
    if isinstance(value, numbers.Real) or (np.shape(value) == () and hasattr(value, "dtype")):
        return plain_number(float(value), location)
    if isinstance(value, Mapping):
        return {key: plain(entry, location) for key, entry in value.items()}
    try:
        return [plain(entry, location) for entry in (value.tolist() if hasattr(value, "tolist") else value)]
    except TypeError:
        message = f"a {type(value).__name__} has no form in a file"
        raise MechanismError(message, name=location) from None


def plain_number(value: float, location: str) -> float | int:
    """Return a finite number, as an int if it is an integer."""
    if not math.isfinite(value):
        raise MechanismError("must be finite", name=location, value=value)
    is_whole = value.is_integer() and abs(value) < 1e9 and math.copysign(1.0, value) == (1.0 if value >= 0 else -1.0)
    return int(value) if is_whole else value
