"""Memory for the arrays that a loop changes, or that ways of which one is taken make."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from jounce.execution.llvm.text.arrays import filled
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.scalars import is_same_constant
from jounce.execution.llvm.text.stored import copied, is_large, put
from jounce.execution.llvm.text.values import Region, Value, kind_of
from jounce.execution.llvm.text.views import Array, Deferred, InMemory, Stored, contiguous

LEAST_SIZE = 16  # numbers of an array of which constants are looked for: to find that they do not stay costs a turn


class LoopVariables:
    """Arrays that a loop or a branch changes, in memory; but for constants that they are known to keep.

    Parameters
    ----------
    code : Code
        What is written to.
    avals, lanes : sequence
        Shapes and types of the arrays, and whether their numbers differ from lane to lane.
    invariants : sequence of mapping, optional
        Of the places in each array at which a constant stays to that constant.
    """

    def __init__(
        self,
        code: Code,
        avals: Sequence[Any],
        lanes: Sequence[bool],
        invariants: Sequence[Mapping[int, Value]] | None = None,
    ):
        self.invariants: list[dict[int, Value]] = list(map(dict, invariants)) if invariants else [{} for _ in avals]
        self._stored: dict[tuple[int, int], list[tuple[Value, slice]]] = {}  # constants, and by which lines
        self.code, self.shapes = code, [aval.shape for aval in avals]
        self.large = [is_large(code, aval) for aval in avals]
        self.regions = [
            (code.taken_room if large else code.room)(math.prod(aval.shape), kind_of(aval.dtype), lanes=vector)
            for aval, vector, large in zip(avals, lanes, self.large, strict=True)
        ]

    def load(self, ways: int = 0) -> list[Array]:
        """Return the arrays as they are; large ones stay where they are.

        Parameters
        ----------
        ways : int, default 0
            By how many ways they were stored so far, of which one was taken, if constants are to be known that all
            of them have stored.
        """

        def number(which: int, k: int) -> Value:
            known = self.invariants[which].get(k) or self._same_in(which, k, ways)
            return known or self.code.load(self.regions[which], k)

        return [
            contiguous(self.regions[which], shape)
            if large
            else filled(shape, [number(which, k) for k in range(math.prod(shape))])
            for which, (shape, large) in enumerate(zip(self.shapes, self.large, strict=True))
        ]

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep the memory while the loop is written."""
        before = len(self.code.held)
        self.code.held += self.regions
        try:
            yield
        finally:
            del self.code.held[before:]

    def store(self, arrays: Sequence[Array]) -> None:
        """Change the arrays: where a number is what was there when it was loaded, there is nothing to do."""
        targets = [contiguous(region, shape) for region, shape in zip(self.regions, self.shapes, strict=True)]
        changing = {target.region for target, array in zip(targets, arrays, strict=True) if not target.is_same(array)}
        read_first = [  # what is a part of an array that changes is read before
            copied(self.code, array) if _reads_others(array, target, changing) else array
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

    def note_invariants(self, ways: int) -> None:
        """Take back what stored a constant that is the same in all ways, each written in a scope of its own."""
        for (which, k), stores in self._stored.items():
            if (value := self._same_in(which, k, ways)) is not None:
                self.invariants[which][k] = value
                for _, lines in stores:
                    self.code.lines[lines] = [""] * (lines.stop - lines.start)

    def _same_in(self, which: int, k: int, ways: int) -> Value | None:
        """Return the constant that all of so many ways have stored in a place."""
        stored = [value for value, _ in self._stored.get((which, k), ())]
        if len(stored) != ways or not all(is_same_constant(stored[0], value) for value in stored):
            return None
        return stored[0] if stored else None


def may_be_invariant(value: Value) -> bool:
    """Tell whether a value is a constant double, of which matrices of certain zeros are full."""
    return value.constant is not None and value.kind == "f"


def invariants_of(code: Code, array: Array) -> dict[int, Value]:
    """Return the constants of a matrix that a loop begins with, by their places, which the loop may keep."""
    if isinstance(array, InMemory) or code.large is not None or array.size < LEAST_SIZE:
        return {}
    return {k: value for k, value in enumerate(flat(array)) if may_be_invariant(value)}


def _reads_others(array: Array, target: Stored, changing: Collection[Region]) -> bool:
    """Tell whether an array reads other numbers that change than the one in whose place a number is put."""
    read = array.given if isinstance(array, Deferred) else [array] if isinstance(array, Stored) else []
    return any(part.region in changing and not target.is_same(part) for part in read)
