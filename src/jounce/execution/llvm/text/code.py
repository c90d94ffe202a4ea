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
        byte_count = count * (self.width if lanes else 1) * DTYPES[kind].itemsize
        if byte_count > MOST_ON_STACK:
            self.entry.append(f"{name} = getelementptr i8, ptr %heap, i64 {self.heap}")
            self.heap += -(-byte_count // 64) * 64
        else:
            type_ = f"<{self.width} x {IN_MEMORY[kind]}>" if lanes else IN_MEMORY[kind]
            self.entry.append(f"{name} = alloca {type_}, i64 {count}, align 64")
            self.memory += byte_count
        return Region(name, kind, lanes)

    def taken_room(self, size: int, kind: str, *, lanes: bool) -> Region:
        """Return memory that can be released; reuse released memory if there is any."""
        key = max(1, size), kind, lanes
        released = self._free.get(key)
        region = released.pop() if released else self.room(size, kind, lanes=lanes)
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
            element, name = IN_MEMORY[kind], f"@c{len(self._tables)}"
            texts = (literal(self.constant(number)) for number in table)
            entries = ", ".join(f"{element} {str(int(text == 'true')) if kind == 'b' else text}" for text in texts)
            self.constants.append(f"{name} = private constant [{table.size} x {element}] [{entries}], align 64")
            region = self._tables[key] = Region(name, kind, False)
        return region

    def load_along(self, region: Region, index: int | Value) -> Value:
        """Return a vector of consecutive numbers in memory from an index on."""
        type_, position = f"<{self.width} x {IN_MEMORY[region.kind]}>", self._address(region, index)
        hint = ", !invariant.load !0" if region.given else ""
        text = f"load {type_}, ptr {position}, align {DTYPES[region.kind].itemsize}{hint}"
        return self._read(text, type_, region.kind, lanes=True)

    def store_along(self, region: Region, index: int | Value, value: Value) -> None:
        """Emit the store of a vector of consecutive numbers from an index of memory on."""
        type_, position = f"<{self.width} x {IN_MEMORY[region.kind]}>", self._address(region, index)
        operand = self.stored_operand(value, type_, lanes=True)
        self.lines.append(f"store {type_} {operand}, ptr {position}, align {DTYPES[region.kind].itemsize}")

    def _read(self, text: str, type_: str, kind: str, *, lanes: bool, home: tuple[Region, int] | None = None) -> Value:
        """Return the value that an instruction loads from memory with a given type."""
        name = self.fresh()
        self.lines.append(f"{name} = {text}")
        return Value(self.truths(name, type_, lanes=lanes) if kind == "b" else name, kind, lanes, home=home)

    def truths(self, numbers: str, type_: str, *, lanes: bool) -> str:
        """Return truth values from their representation in memory."""
        name = self.fresh()
        self.lines.append(f"{name} = trunc {type_} {numbers} to {self.type_of('b', lanes=lanes)}")
        return name

    def stored_operand(self, value: Value, type_: str, *, lanes: bool) -> str:
        """Return a value as the operand of a store, in the type of memory."""
        operand = self.operand(value, lanes=lanes)
        if value.kind != "b":
            return operand
        return self._emitted(f"zext {self.type_of('b', lanes=lanes)} {operand} to {type_}", "b", lanes=True).name

    def _address(self, region: Region, index: int | Value) -> str:
        position = str(index) if isinstance(index, int) else self.operand(index, lanes=False)
        address = f"getelementptr {IN_MEMORY[region.kind]}, ptr {region.pointer}, i64 {position}"
        return self._emitted(address, "l", lanes=False).name

    def load(self, region: Region, index: int | Value) -> Value:
        """Return the number at an index of memory."""
        if isinstance(index, Value) and index.lanes:
            return self._gathered(region, index)
        type_, position = self._element(region, index)
        hint, home = ", !invariant.load !0" if region.given else "", (region, index) if isinstance(index, int) else None
        return self._read(f"load {type_}, {position}{hint}", type_, region.kind, lanes=region.lanes, home=home)

    def store(self, region: Region, index: int | Value, value: Value) -> None:
        """Emit the store of a number at an index of memory."""
        if isinstance(index, Value) and index.lanes:
            self._scatter(region, index, value)
            return
        type_, position = self._element(region, index)
        self.lines.append(f"store {type_} {self.stored_operand(value, type_, lanes=region.lanes)}, {position}")

    def _gathered(self, region: Region, index: Value) -> Value:
        """Return numbers at indices of memory that differ from lane to lane."""
        indices, type_, kinds = self._addresses(region, index)
        mask = self.operand(self.constant(True), lanes=True)
        function = f"@llvm.masked.gather.{kinds}.v{self.width}p0"
        self.intrinsics.add(f"declare {type_} {function}(<{self.width} x ptr>, i32, <{self.width} x i1>, {type_})")
        align = DTYPES[region.kind].itemsize
        inputs = f"<{self.width} x ptr> {indices}, i32 {align}, <{self.width} x i1> {mask}, {type_} poison"
        return self._read(f"call {type_} {function}({inputs})", type_, region.kind, lanes=True)

    def _scatter(self, region: Region, index: Value, value: Value) -> None:
        """Emit the store of numbers at indices that differ from lane to lane; each lane has its own memory."""
        indices, type_, kinds = self._addresses(region, index)
        operand, mask = self.stored_operand(value, type_, lanes=True), self.operand(self.constant(True), lanes=True)
        function = f"@llvm.masked.scatter.{kinds}.v{self.width}p0"
        self.intrinsics.add(f"declare void {function}({type_}, <{self.width} x ptr>, i32, <{self.width} x i1>)")
        align = DTYPES[region.kind].itemsize
        inputs = f"{type_} {operand}, <{self.width} x ptr> {indices}, i32 {align}, <{self.width} x i1> {mask}"
        self.lines.append(f"call void {function}({inputs})")

    def _addresses(self, region: Region, index: Value) -> tuple[str, str, str]:
        """Return the addresses of numbers at indices that differ from lane to lane, their type, and its short name."""
        element = IN_MEMORY[region.kind]
        if region.lanes:
            read_first = Value("%total", "l", False) if region.given else self.constant(self.width, "l")
            counts = ", ".join(f"i64 {k}" for k in range(self.width))
            lane = Value(f"<{counts}>", "l", True)
            index = self.arithmetic("add", self.arithmetic("mul", index, read_first), lane)
            if region.given:
                index = self.arithmetic("add", index, Value("%lane", "l", False))
        vector = self.operand(index, lanes=True)
        address = f"getelementptr {element}, ptr {region.pointer}, <{self.width} x i64> {vector}"
        suffix = f"v{self.width}{'f64' if region.kind == 'f' else element}"
        return self._emitted(address, "l", lanes=True).name, f"<{self.width} x {element}>", suffix

    def _element(self, region: Region, index: int | Value) -> tuple[str, str]:
        """Return the type of a number in memory, and its address with the alignment."""
        element = IN_MEMORY[region.kind]
        type_ = f"<{self.width} x {element}>" if region.lanes else element
        position = str(index) if isinstance(index, int) else self.operand(index, lanes=False)
        if region.given and region.lanes:
            start = self._emitted(f"mul i64 {position}, %total", "l", lanes=False).name
            position = self._emitted(f"add i64 {start}, %lane", "l", lanes=False).name
        address = f"getelementptr {element if region.given else type_}, ptr {region.pointer}, i64 {position}"
        name = self._emitted(address, "l", lanes=False).name
        return type_, f"ptr {name}, align {DTYPES[region.kind].itemsize}"

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
        lines, entry, scope_length, self.memory, self.heap, free_regions, taken, count, subroutines = mark
        self._free, self._taken = {key: list(regions) for key, regions in free_regions.items()}, dict(taken)
        del self.lines[lines:], self.entry[entry:], self.taken[count:]
        self._forget(self._scopes[-1][scope_length:])
        del self._scopes[-1][scope_length:]
        while len(self.subroutines) > subroutines:
            self.subroutines.popitem()


def flat(array: np.ndarray) -> list[Value]:
    """Return the values of an array, the last axis fastest."""
    return array.ravel().tolist()
