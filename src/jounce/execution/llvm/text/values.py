"""Numbers of a program that is written for LLVM: their kinds, their names, and where they are in memory."""

from dataclasses import dataclass
from typing import Any

import numpy as np

SCALARS = {"f": "double", "l": "i64", "i": "i32", "u": "i32", "b": "i1"}
IN_MEMORY = SCALARS | {"b": "i8"}
KINDS = {np.dtype(float): "f", np.dtype(np.int64): "l", np.dtype(np.int32): "i", np.dtype(bool): "b"}
KINDS |= {np.dtype(np.uint32): "u"}
DTYPES = {kind: dtype for dtype, kind in KINDS.items()}


class UnsupportedOperationError(Exception):
    """What this room has no code for, in the words of a warning: 'there is no machine code for ...'."""


@dataclass(frozen=True, eq=False)
class Region:
    """Numbers of one kind one after another in memory, each alone or as a vector of lanes."""

    pointer: str
    kind: str
    lanes: bool
    given: bool = False  # by the caller: lanes of a number lie `%total` apart, and nothing is written there


@dataclass(eq=False, slots=True)  # not frozen, which takes three times as long to make, and there are many
class Value:
    """A number of the program: a constant, or what an operation before has found, for each lane or for all."""

    name: str
    kind: str
    lanes: bool
    constant: Any = None
    home: tuple[Region, int] | None = None  # where it is in memory, as long as it can be used


def kind_of(dtype: Any) -> str:
    """Return the kind of numbers of a type.

    Raises
    ------
    UnsupportedOperationError
        If there is none.
    """
    if (kind := KINDS.get(dtype)) is None:
        raise UnsupportedOperationError(f"numbers of type {dtype}")
    return kind


def literal(value: Value) -> str:
    """Return a constant as LLVM reads it."""
    if value.kind == "f":
        return f"0x{value.constant.view(np.uint64):016X}"
    number = value.constant.astype(np.int32) if value.kind == "u" else value.constant  # LLVM reads signed numbers
    return str(bool(number)).lower() if value.kind == "b" else str(int(number))


def nearest(number: Any, dtype: Any) -> int:
    """Return the whole number of a type that is nearest to a double toward zero, as XLA converts it."""
    limits = np.iinfo(dtype)
    whole = 0 if np.isnan(number) else int(min(max(number, -(2.0**63)), 2.0**63))
    return min(max(whole, limits.min), limits.max)


def quotient(a: Any, b: Any) -> Any:
    """Return a quotient of whole numbers as XLA has it: rounded toward zero, -1 where the divisor is zero."""
    if b in (0, -1):
        return -1 if b == 0 else -a  # of the least number, itself
    return abs(int(a)) // abs(int(b)) * (1 if (a < 0) == (b < 0) else -1)


def remainder(a: Any, b: Any) -> Any:
    """Return what a quotient of whole numbers leaves, with the sign of the dividend; all of it if that is by zero."""
    return a if b == 0 else abs(int(a)) % abs(int(b)) * (1 if a > 0 else -1)
