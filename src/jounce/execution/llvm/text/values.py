"""Numbers of a program for LLVM: their kinds, names, and memory."""

from dataclasses import dataclass
from typing import Any

import numpy as np

SCALARS = {"f": "double", "l": "i64", "i": "i32", "u": "i32", "b": "i1"}
IN_MEMORY = SCALARS | {"b": "i8"}
KINDS = {np.dtype(float): "f", np.dtype(np.int64): "l", np.dtype(np.int32): "i", np.dtype(bool): "b"}
KINDS |= {np.dtype(np.uint32): "u"}
DTYPES = {kind: dtype for dtype, kind in KINDS.items()}


class UnsupportedOperationError(Exception):
    """There is no machine code for an operation; the message completes 'there is no machine code for ...'."""


@dataclass(frozen=True, eq=False)
class Region:
    """Consecutive numbers of one kind in memory, each a single number or a vector of lanes."""

    pointer: str
    kind: str
    lanes: bool
    given: bool = False  # by the caller: numbers are `%total` lanes apart, and arguments are read-only


@dataclass(eq=False, slots=True)  # not frozen, which takes three times as long to create
class Value:
    """A number of the program: a constant or the result of an operation, one for all lanes or one for each."""

    name: str
    kind: str
    lanes: bool
    constant: Any = None
    home: tuple[Region, int] | None = None  # its memory and index, as long as that is valid


def kind_of(dtype: Any) -> str:
    """Return the kind of numbers of a type.

    Raises
    ------
    UnsupportedOperationError
        If there is no kind for the type.
    """
    if (kind := KINDS.get(dtype)) is None:
        raise UnsupportedOperationError(f"numbers of type {dtype}")
    return kind


def literal(value: Value) -> str:
    """Return the literal of a constant in LLVM."""
    if value.kind == "f":
        return f"0x{value.constant.view(np.uint64):016X}"
    number = value.constant.astype(np.int32) if value.kind == "u" else value.constant  # LLVM reads signed numbers
    return str(bool(number)).lower() if value.kind == "b" else str(int(number))


def nearest(number: Any, dtype: Any) -> int:
    """Return a double truncated to an integer and clamped to the range of a type, as by XLA."""
    limits = np.iinfo(dtype)
    integer = 0 if np.isnan(number) else int(min(max(number, -(2.0**63)), 2.0**63))
    return min(max(integer, limits.min), limits.max)


def quotient(a: Any, b: Any) -> Any:
    """Return the quotient of integers as by XLA: rounded toward zero, -1 if the divisor is zero."""
    if b in (0, -1):
        return -1 if b == 0 else -a  # of the least number, itself
    return abs(int(a)) // abs(int(b)) * (1 if (a < 0) == (b < 0) else -1)


def remainder(a: Any, b: Any) -> Any:
    """Return the remainder of integers, with the sign of the dividend; the dividend if the divisor is zero."""
    return a if b == 0 else abs(int(a)) % abs(int(b)) * (1 if a > 0 else -1)
