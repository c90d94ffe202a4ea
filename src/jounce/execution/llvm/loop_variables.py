"""Memory for the arrays that a loop changes, or that ways of which one is taken make."""

import math
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from jounce.execution.llvm.text.arrays import filled
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.stored import copied, is_large, put
from jounce.execution.llvm.text.values import Region, kind_of
from jounce.execution.llvm.text.views import Array, Deferred, InMemory, Stored, contiguous


class LoopVariables:
    """Arrays that a loop or a branch changes, in memory."""

    def __init__(self, code: Code, avals: Sequence[Any], lanes: Sequence[bool]):
        self.code, self.shapes = code, [aval.shape for aval in avals]
        self.large = [is_large(code, aval) for aval in avals]
        self.regions = [
            (code.taken_room if large else code.room)(math.prod(aval.shape), kind_of(aval.dtype), lanes=vector)
            for aval, vector, large in zip(avals, lanes, self.large, strict=True)
        ]

    def load(self) -> list[Array]:
        """Return the arrays as they are; large ones stay where they are."""
        return [
            contiguous(region, shape)
            if large
            else filled(shape, [self.code.load(region, k) for k in range(math.prod(shape))])
            for region, shape, large in zip(self.regions, self.shapes, self.large, strict=True)
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
        for target, array in zip(targets, read_first, strict=True):
            if isinstance(array, InMemory) or is_large(self.code, array):
                if not target.is_same(array):
                    put(self.code, target, array)
                continue
            for k, value in enumerate(flat(array)):
                if value.home != (target.region, k):
                    self.code.store(target.region, k, value)


def _reads_others(array: Array, target: Stored, changing: Collection[Region]) -> bool:
    """Tell whether an array reads other numbers that change than the one in whose place a number is put."""
    read = array.given if isinstance(array, Deferred) else [array] if isinstance(array, Stored) else []
    return any(part.region in changing and not target.is_same(part) for part in read)
