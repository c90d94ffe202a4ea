"""A program as text for LLVM: operations on numbers, and memory for arrays."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from jounce.execution.llvm.text.scalars import Scalars
from jounce.execution.llvm.text.values import DTYPES, IN_MEMORY, Region, Value, literal

MOST_ON_STACK = 4096  # bytes of an array


@dataclass
class Code(Scalars):
    """A program that is being emitted.

    Attributes
    ----------
    entry : list of str
        Text of the entry block, which runs before the first vector of lanes.
    memory, heap : int
        Bytes allocated on the stack and on the heap.
    large : int or None
        Size beyond which arrays stay in memory, with loops over them; None to unroll all.
    single : bool
        Whether there is only one instant, so that vectors hold consecutive numbers of an array.
    constants : list of str
        Text of constant arrays in memory.
    changeable : set of Region
        Memory of single arrays, which may be changed in place once it is not read any more.
    held : list of Region
        Memory carried by loops that are being emitted, which is not released.
    taken : list of Region
        All memory in the order of allocation.
    plans : dict
        Plans of programs, from `plans.plan_of`.
    changes : list of Region
        Memory that the innermost loop changes, which a conditional within it may change in place.
    subroutines : dict
        Emitted subroutines, by the program and its constant arguments; see `subroutines`.
    """

    entry: list[str] = field(default_factory=list)
    memory: int = 0
    heap: int = 0
    large: int | None = None
    single: bool = False
    constants: list[str] = field(default_factory=list)
    changeable: set[Region] = field(default_factory=set)
    held: list[Region] = field(default_factory=list)
    taken: list[Region] = field(default_factory=list)
    plans: dict[Any, Any] = field(default_factory=dict)
    changes: Sequence[Region] = ()
    subroutines: dict[Any, Any] = field(default_factory=dict)
    _free: dict[tuple[int, str, bool], list[Region]] = field(default_factory=dict)  # released
    _taken: dict[Region, tuple[int, str, bool]] = field(default_factory=dict)  # in use, with what they hold
    _tables: dict[tuple[str, bytes], Region] = field(default_factory=dict)
    _users: list[Callable[[Region], bool]] = field(default_factory=list)  # whether memory is still used

    def room(self, size: int, kind: str, *, lanes: bool) -> Region:
        """Return memory for numbers of one kind."""
        name, count = self.fresh("m"), max(1, size)
        taken = count * (self.width if lanes else 1) * DTYPES[kind].itemsize
        if taken > MOST_ON_STACK:
            self.entry.append(f"{name} = getelementptr i8, ptr %heap, i64 {self.heap}")
            self.heap += -(-taken // 64) * 64
        else:
            of = f"<{self.width} x {IN_MEMORY[kind]}>" if lanes else IN_MEMORY[kind]
            self.entry.append(f"{name} = alloca {of}, i64 {count}, align 64")
            self.memory += taken
        return Region(name, kind, lanes)

    def taken_room(self, size: int, kind: str, *, lanes: bool) -> Region:
        """Return memory that can be released; reuse released memory if there is any."""
        key = max(1, size), kind, lanes
        free = self._free.get(key)
        region = free.pop() if free else self.room(size, kind, lanes=lanes)
        self._taken[region] = key
        self.changeable.add(region)
        self.taken.append(region)
        return region

    def release(self, region: Region) -> None:
        """Release memory for reuse, if it is releasable."""
        if region not in self.held and (key := self._taken.pop(region, None)) is not None:
            self._free.setdefault(key, []).append(region)

    @contextmanager
    def changing(self, regions: Sequence[Region]) -> Iterator[None]:
        """Emit an iteration of a loop that changes some memory."""
        before, self.changes = self.changes, regions
        try:
            yield
        finally:
            self.changes = before

    @contextmanager
    def used(self, wants: Callable[[Region], bool]) -> Iterator[None]:
        """Keep the memory that a function declares as still used."""
        self._users.append(wants)
        try:
            yield
        finally:
            self._users.pop()

    def is_unshared(self, region: Region) -> bool:
        """Return whether no declared use of memory remains."""
        return not any(wants(region) for wants in self._users)

    def constants_region(self, numbers: Sequence[Any], kind: str) -> Region:
        """Return the memory of constants."""
        table = np.array(numbers, DTYPES[kind])
        key = kind, table.tobytes()
        if (region := self._tables.get(key)) is None:
            one, name = IN_MEMORY[kind], f"@c{len(self._tables)}"
            texts = (literal(self.constant(number)) for number in table)
            listed = ", ".join(f"{one} {str(int(text == 'true')) if kind == 'b' else text}" for text in texts)
            self.constants.append(f"{name} = private constant [{table.size} x {one}] [{listed}], align 64")
            region = self._tables[key] = Region(name, kind, False)
        return region

    def load_along(self, region: Region, index: int | Value) -> Value:
        """Return a vector of consecutive numbers in memory from an index on."""
        of, position = f"<{self.width} x {IN_MEMORY[region.kind]}>", self._address(region, index)
        hint = ", !invariant.load !0" if region.given else ""
        text = f"load {of}, ptr {position}, align {DTYPES[region.kind].itemsize}{hint}"
        return self._read(text, of, region.kind, lanes=True)

    def store_along(self, region: Region, index: int | Value, value: Value) -> None:
        """Emit the store of a vector of consecutive numbers from an index of memory on."""
        of, position = f"<{self.width} x {IN_MEMORY[region.kind]}>", self._address(region, index)
        operand = self.stored_operand(value, of, lanes=True)
        self.lines.append(f"store {of} {operand}, ptr {position}, align {DTYPES[region.kind].itemsize}")

    def _read(self, text: str, of: str, kind: str, *, lanes: bool, home: tuple[Region, int] | None = None) -> Value:
        """Return the value that an instruction loads from memory with a given type."""
        name = self.fresh()
        self.lines.append(f"{name} = {text}")
        return Value(self.truths(name, of, lanes=lanes) if kind == "b" else name, kind, lanes, home=home)

    def truths(self, numbers: str, of: str, *, lanes: bool) -> str:
        """Return truth values from their representation in memory."""
        name = self.fresh()
        self.lines.append(f"{name} = trunc {of} {numbers} to {self.type_of('b', lanes=lanes)}")
        return name

    def stored_operand(self, value: Value, of: str, *, lanes: bool) -> str:
        """Return a value as the operand of a store, in the type of memory."""
        operand = self.operand(value, lanes=lanes)
        if value.kind != "b":
            return operand
        return self._emitted(f"zext {self.type_of('b', lanes=lanes)} {operand} to {of}", "b", lanes=True).name

    def _address(self, region: Region, index: int | Value) -> str:
        position = str(index) if isinstance(index, int) else self.operand(index, lanes=False)
        address = f"getelementptr {IN_MEMORY[region.kind]}, ptr {region.pointer}, i64 {position}"
        return self._emitted(address, "l", lanes=False).name

    def load(self, region: Region, index: int | Value) -> Value:
        """Return the number at an index of memory."""
        if isinstance(index, Value) and index.lanes:
            return self._gathered(region, index)
        of, position = self._element(region, index)
        hint, home = ", !invariant.load !0" if region.given else "", (region, index) if isinstance(index, int) else None
        return self._read(f"load {of}, {position}{hint}", of, region.kind, lanes=region.lanes, home=home)

    def store(self, region: Region, index: int | Value, value: Value) -> None:
        """Emit the store of a number at an index of memory."""
        if isinstance(index, Value) and index.lanes:
            self._scatter(region, index, value)
            return
        of, position = self._element(region, index)
        self.lines.append(f"store {of} {self.stored_operand(value, of, lanes=region.lanes)}, {position}")

    def _gathered(self, region: Region, index: Value) -> Value:
        """Return numbers at indices of memory that differ from lane to lane."""
        indices, of, kinds = self._addresses(region, index)
        every = self.operand(self.constant(True), lanes=True)
        function = f"@llvm.masked.gather.{kinds}.v{self.width}p0"
        self.intrinsics.add(f"declare {of} {function}(<{self.width} x ptr>, i32, <{self.width} x i1>, {of})")
        align = DTYPES[region.kind].itemsize
        given = f"<{self.width} x ptr> {indices}, i32 {align}, <{self.width} x i1> {every}, {of} poison"
        return self._read(f"call {of} {function}({given})", of, region.kind, lanes=True)

    def _scatter(self, region: Region, index: Value, value: Value) -> None:
        """Emit the store of numbers at indices that differ from lane to lane; each lane has its own memory."""
        indices, of, kinds = self._addresses(region, index)
        operand, every = self.stored_operand(value, of, lanes=True), self.operand(self.constant(True), lanes=True)
        function = f"@llvm.masked.scatter.{kinds}.v{self.width}p0"
        self.intrinsics.add(f"declare void {function}({of}, <{self.width} x ptr>, i32, <{self.width} x i1>)")
        align = DTYPES[region.kind].itemsize
        given = f"{of} {operand}, <{self.width} x ptr> {indices}, i32 {align}, <{self.width} x i1> {every}"
        self.lines.append(f"call void {function}({given})")

    def _addresses(self, region: Region, index: Value) -> tuple[str, str, str]:
        """Return the addresses of numbers at indices that differ from lane to lane, their type, and its short name."""
        one = IN_MEMORY[region.kind]
        if region.lanes:
            read_first = Value("%total", "l", False) if region.given else self.constant(self.width, "l")
            counts = ", ".join(f"i64 {k}" for k in range(self.width))
            lane = Value(f"<{counts}>", "l", True)
            index = self.arithmetic("add", self.arithmetic("mul", index, read_first), lane)
            if region.given:
                index = self.arithmetic("add", index, Value("%lane", "l", False))
        vector = self.operand(index, lanes=True)
        address = f"getelementptr {one}, ptr {region.pointer}, <{self.width} x i64> {vector}"
        short = f"v{self.width}{'f64' if region.kind == 'f' else one}"
        return self._emitted(address, "l", lanes=True).name, f"<{self.width} x {one}>", short

    def _element(self, region: Region, index: int | Value) -> tuple[str, str]:
        """Return the type of a number in memory, and its address with the alignment."""
        one = IN_MEMORY[region.kind]
        of = f"<{self.width} x {one}>" if region.lanes else one
        position = str(index) if isinstance(index, int) else self.operand(index, lanes=False)
        if region.given and region.lanes:
            first = self._emitted(f"mul i64 {position}, %total", "l", lanes=False).name
            position = self._emitted(f"add i64 {first}, %lane", "l", lanes=False).name
        address = f"getelementptr {one if region.given else of}, ptr {region.pointer}, i64 {position}"
        name = self._emitted(address, "l", lanes=False).name
        return of, f"ptr {name}, align {DTYPES[region.kind].itemsize}"

    # -- attempts -----------------------------------------------------------------------------------------------------

    def mark(self) -> tuple[Any, ...]:
        """Return the current state of the text, for `back_to`."""
        free_regions = {key: list(regions) for key, regions in self._free.items()}
        return (
            len(self.lines),
            len(self.entry),
            len(self._scopes[-1]),
            self.memory,
            self.heap,
            free_regions,
            dict(self._taken),
            len(self.taken),
            len(self.subroutines),
        )

    def back_to(self, mark: tuple[Any, ...]) -> None:
        """Undo what was emitted since a mark in the same scope."""
        lines, entry, known, self.memory, self.heap, free_regions, taken, count, subroutines = mark
        self._free, self._taken = {key: list(regions) for key, regions in free_regions.items()}, dict(taken)
        del self.lines[lines:], self.entry[entry:], self.taken[count:]
        self._forget(self._scopes[-1][known:])
        del self._scopes[-1][known:]
        while len(self.subroutines) > subroutines:
            self.subroutines.popitem()


def flat(array: np.ndarray) -> list[Value]:
    """Return the values of an array, the last axis fastest."""
    return array.ravel().tolist()
