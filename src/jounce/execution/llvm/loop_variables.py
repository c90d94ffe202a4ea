"""Memory for the arrays that a loop carries, or that the branches of a conditional return."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from jax.extend.core import Literal

from jounce.execution.llvm.text.arrays import each, filled
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.scalars import is_same_constant
from jounce.execution.llvm.text.stored import copied, is_large, put, stored
from jounce.execution.llvm.text.values import Region, Value, kind_of
from jounce.execution.llvm.text.views import Array, Deferred, InMemory, Stored, as_read, contiguous

LEAST_SIZE = 16  # least size of an array whose constants are tracked: a failed guess costs one more translation


class LoopVariables:
    """Arrays that a loop or a conditional changes, in memory except for entries known to stay constant.

    Parameters
    ----------
    code : Code
        Code to emit to.
    avals, lanes : sequence
        Shapes and types of the arrays, and whether their numbers differ from lane to lane.
    invariants : sequence of mapping, optional
        For each array, the invariant constants by index.
    regions : sequence of Region or None, optional
        Memory of arrays that are changed in place.
    """

    def __init__(
        self,
        code: Code,
        avals: Sequence[Any],
        lanes: Sequence[bool],
        invariants: Sequence[Mapping[int, Value]] | None = None,
        regions: Sequence[Region | None] | None = None,
    ):
        self.invariants: list[dict[int, Value]] = list(map(dict, invariants)) if invariants else [{} for _ in avals]
        self._stored: dict[tuple[int, int], list[tuple[Value, slice]]] = {}  # constants, and their lines
        self.code, self.shapes = code, [aval.shape for aval in avals]
        self.large = [is_large(code, aval) for aval in avals]
        self.regions = [
            region
            or (code.taken_room if large else code.room)(math.prod(aval.shape), kind_of(aval.dtype), lanes=vector)
            for aval, vector, large, region in zip(
                avals, lanes, self.large, regions or [None] * len(avals), strict=True
            )
        ]

    def load(self, ways: int = 0, new: Sequence[Array] | None = None) -> list[Array]:
        """Return the current arrays; large ones stay in memory.

        Parameters
        ----------
        ways : int, default 0
            Number of branches that have stored the arrays, so that constants stored by all of them are known.
        new : sequence of array, optional
            New arrays of the active lanes; a number that is already in its place is not loaded.
        """

        def number(index: int, k: int, value: Value | None) -> Value:
            if value is not None and value.home == (self.regions[index], k):
                return value
            invariant = self.invariants[index].get(k) or self._same_in(index, k, ways)
            return invariant or self.code.load(self.regions[index], k)

        result: list[Array] = []
        for index, (shape, large) in enumerate(zip(self.shapes, self.large, strict=True)):
            if large:
                result.append(contiguous(self.regions[index], shape))
                continue
            array = None if new is None else new[index]
            values = flat(array) if isinstance(array, np.ndarray) else [None] * math.prod(shape)
            result.append(filled(shape, [number(index, k, value) for k, value in enumerate(values)]))
        return result

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep the memory while the loop is emitted."""
        before = len(self.code.held)
        self.code.held += self.regions
        try:
            yield
        finally:
            del self.code.held[before:]

    def store(self, arrays: Sequence[Array]) -> None:
        """Store the arrays; numbers that are unchanged since they were loaded are not stored."""
        targets = [contiguous(region, shape) for region, shape in zip(self.regions, self.shapes, strict=True)]
        changed = {target.region for target, array in zip(targets, arrays, strict=True) if not target.is_same(array)}
        read_first = [  # arrays that are parts of changing arrays are copied first
            copied(self.code, array) if _reads_others(array, target, changed) else array
            for target, array in zip(targets, arrays, strict=True)
        ]
        for number, (target, array) in enumerate(zip(targets, read_first, strict=True)):
            if isinstance(array, InMemory) or is_large(self.code, array):
                if not target.is_same(array):
                    put(self.code, target, array)
                continue
            for k, value in enumerate(flat(array)):
                if value.home == (target.region, k) or k in self.invariants[number]:
                    continue
                before = len(self.code.lines)
                self.code.store(target.region, k, value)
                if may_be_invariant(value):
                    lines = slice(before, len(self.code.lines))
                    self._stored.setdefault((number, k), []).append((value, lines))

    def note_rows(self, rows: Sequence[Array], length: int) -> None:
        """Record the constants in rows that a loop makes, one in each of `length` iterations."""
        for invariants, row in zip(self.invariants, rows, strict=True):
            if not isinstance(row, InMemory):
                constants = [(k, value) for k, value in enumerate(flat(row)) if may_be_invariant(value)]
                invariants |= {turn * row.size + k: value for turn in range(length) for k, value in constants}

    def note_invariants(self, ways: int) -> None:
        """Remove the stores of constants that are the same in all branches, each emitted in its own scope."""
        for (index, k), stores in self._stored.items():
            if (value := self._same_in(index, k, ways)) is not None:
                self.invariants[index][k] = value
                for _, lines in stores:
                    self.code.lines[lines] = [""] * (lines.stop - lines.start)

    def _same_in(self, index: int, k: int, ways: int) -> Value | None:
        """Return the constant that all branches have stored at an index; None if they differ."""
        stored = [value for value, _ in self._stored.get((index, k), ())]
        if len(stored) != ways or not all(is_same_constant(stored[0], value) for value in stored):
            return None
        return stored[0] if stored else None


def may_be_invariant(value: Value) -> bool:
    """Return whether a value is a constant double, as many entries of matrices with known zeros."""
    return value.constant is not None and value.kind == "f"


def invariants_of(code: Code, array: Array) -> dict[int, Value]:
    """Return the constants of an initial array of a loop by index, which the loop may keep."""
    if isinstance(array, InMemory) or code.large is not None or array.size < LEAST_SIZE:
        return {}
    return {k: value for k, value in enumerate(flat(array)) if may_be_invariant(value)}


def still_invariant(invariants: Mapping[int, Value], array: Array) -> dict[int, Value]:
    """Return the invariants that an array still has after an iteration."""
    if not invariants or isinstance(array, InMemory):
        return {}
    values = flat(array)
    return {k: value for k, value in invariants.items() if is_same_constant(value, values[k])}


def chosen(code: Code, choice: Value, new: Sequence[Array], old: Sequence[Array]) -> list[Array]:
    """Return new arrays in lanes where a truth value holds, and old arrays elsewhere."""

    def either(x: Array, y: Array) -> Array:
        if not isinstance(x, InMemory) and not isinstance(y, InMemory):
            return each(lambda a, b: code.select(choice, a, b), x, y)
        a, b = (array if isinstance(array, Deferred) else as_read(stored(code, array)) for array in (x, y))
        if a.given[0].is_same(b.given[0]) and not isinstance(x, Deferred) and not isinstance(y, Deferred):
            return a.given[0]
        count = len(a.given)

        def body(values: Sequence[Value]) -> Value:
            return code.select(choice, a.body(values[:count]), b.body(values[count:]))

        return Deferred((*a.given, *b.given), a.kind, body, choice.lanes)

    return [either(x, y) for x, y in zip(new, old, strict=True)]


def _reads_others(array: Array, target: Stored, changed: Collection[Region]) -> bool:
    """Return whether an array reads changing numbers other than the one that each number replaces."""
    read = array.given if isinstance(array, Deferred) else [array] if isinstance(array, Stored) else []
    return any(part.region in changed and not target.is_same(part) for part in read)


class Homes:
    """The memory locations of values while branches are emitted, of which each lane takes one.

    Parameters
    ----------
    arrays : sequence of array
        Arguments of the branches.
    """

    def __init__(self, arrays: Sequence[Array]):
        values = [value for array in arrays if not isinstance(array, InMemory) for value in flat(array)]
        self._homes = [(value, value.home) for value in values if value.home is not None]
        self._changed: list[Value] = []

    def restore(self) -> None:
        """Begin another branch: earlier branches have changed memory in other lanes only."""
        for value, home in self._homes:
            if value.home is None:
                self._changed.append(value)
                value.home = home

    def forget(self, regions: Sequence[Region | None]) -> None:
        """End the branches: changed values, and those in some regions, are no longer in memory."""
        for value in self._changed:
            value.home = None
        for value, home in self._homes:
            if home[0] in regions:
                value.home = None


def unchanged(ways: Sequence[Any], inputs: Sequence[Array]) -> list[Array | None]:
    """Return the results that are unchanged arguments in all branches; None for other results."""
    result: list[Array | None] = []
    for variables in zip(*(way.outvars for way in ways), strict=True):
        indices = {way.invars.index(x) if x in way.invars else None for way, x in zip(ways, variables, strict=True)}
        index = indices.pop() if len(indices) == 1 else None
        result.append(None if index is None else inputs[index])
    return result


def changed_in_place(
    code: Code, branch: Value, first: Any, inputs: Sequence[Array], results: Sequence[int]
) -> list[Region | None]:
    """Return the loop memory of results that can be changed in place, since the first branch leaves them unchanged.

    Parameters
    ----------
    code : Code
        Code to emit to.
    branch : Value
        Index of the branch that a lane takes.
    first : Jaxpr
        The first branch.
    inputs : sequence of array
        Arguments of the branches.
    results : sequence of int
        Indices of the results.
    """
    given = dict(zip(first.invars, inputs, strict=True))
    regions: list[Region | None] = []
    for variable in [first.outvars[k] for k in results]:
        array, region = None if isinstance(variable, Literal) else given.get(variable), None
        if isinstance(array, np.ndarray) and code.large is None and (branch.lanes or code.active is None):
            values = [(k, value) for k, value in enumerate(flat(array)) if value.constant is None]
            homes = {value.home and value.home[0] for _, value in values}
            home = homes.pop() if len(homes) == 1 else None
            if home is not None and home.lanes and home in code.changes and home not in regions:
                region = home if all(value.home == (home, k) for k, value in values) else None
        regions.append(region)
    return regions
