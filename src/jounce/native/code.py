"""Scalar operations as text for LLVM, each on one number or side by side on a vector of lanes."""

import math
import operator
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

SCALARS = {"f": "double", "l": "i64", "i": "i32", "b": "i1"}
KINDS = {np.dtype(float): "f", np.dtype(np.int64): "l", np.dtype(np.int32): "i", np.dtype(bool): "b"}
DTYPES = {kind: dtype for dtype, kind in KINDS.items()}
IN_MEMORY = SCALARS | {"b": "i8"}
ARITHMETIC: dict[str, tuple[str, str, Any]] = {  # of doubles, of whole numbers, in Python
    "add": ("fadd contract", "add", operator.add),
    "sub": ("fsub contract", "sub", operator.sub),
    "mul": ("fmul contract", "mul", operator.mul),
    "div": ("fdiv", "sdiv", np.divide),
    "max": ("maximum", "smax", np.maximum),
    "min": ("minimum", "smin", np.minimum),
    "rem": ("frem", "srem", np.fmod),
}
COMPARISONS: dict[str, tuple[str, str, Any]] = {
    "eq": ("oeq", "eq", operator.eq),
    "ne": ("une", "ne", operator.ne),
    "lt": ("olt", "slt", operator.lt),
    "le": ("ole", "sle", operator.le),
    "gt": ("ogt", "sgt", operator.gt),
    "ge": ("oge", "sge", operator.ge),
}
INTRINSICS = frozenset("sqrt fabs floor ceil roundeven round".split())


class UnsupportedOperationError(Exception):
    """An operation that this room has no code for."""


@dataclass(frozen=True, eq=False)
class Region:
    """Numbers of one kind one after another in memory, each alone or as a vector of lanes."""

    pointer: str
    kind: str
    lanes: bool
    given: bool = False  # by the caller: lanes of a number lie `%total` apart, and nothing is written there


@dataclass(frozen=True, eq=False)
class Value:
    """A number of the program: a constant, or what an operation before has found, for each lane or for all."""

    name: str
    kind: str
    lanes: bool
    constant: Any = None
    home: tuple[Region, int] | None = None  # where it is in memory, as long as it can be used


@dataclass
class Code:
    """Operations in the order in which they run, no two of them the same within a block and those around it.

    Attributes
    ----------
    width : int
        Lanes of a vector.
    most : int
        Lines that there may be.
    lines, entry : list of str
        Text of what is run for each vector of lanes, and before the first.
    functions : set
        Names and numbers of arguments of the functions of C's library that are called.
    """

    width: int
    most: int
    lines: list[str] = field(default_factory=list)
    entry: list[str] = field(default_factory=list)
    memory: int = 0
    functions: set[tuple[str, int]] = field(default_factory=set)
    intrinsics: set[str] = field(default_factory=set)
    _count: int = 0
    _known: list[dict[Any, Value]] = field(default_factory=lambda: [{}])

    # -- text ---------------------------------------------------------------------------------------------------------

    def fresh(self, letter: str = "v") -> str:
        """Return a name that nothing has."""
        self._count += 1
        return f"%{letter}{self._count}"

    def type_of(self, kind: str, *, lanes: bool) -> str:
        """Return the type of a number."""
        return f"<{self.width} x {SCALARS[kind]}>" if lanes else SCALARS[kind]

    def operand(self, value: Value, *, lanes: bool) -> str:
        """Return a value as an operand, the same in all lanes where it is one number and a vector is wanted."""
        if value.constant is not None:
            text = literal(value.constant, value.kind)
            return f"<{', '.join([f'{SCALARS[value.kind]} {text}'] * self.width)}>" if lanes else text
        if not lanes or value.lanes:
            return value.name
        return self._found(("splat", value.name), value.kind, lambda name: self._splat(name, value), lanes=True).name

    def _splat(self, name: str, value: Value) -> str:
        vector, one = self.type_of(value.kind, lanes=True), SCALARS[value.kind]
        first = self.fresh()
        self.lines.append(f"{first} = insertelement {vector} poison, {one} {value.name}, i64 0")
        return f"{name} = shufflevector {vector} {first}, {vector} poison, <{self.width} x i32> zeroinitializer"

    def _found(self, key: Any, kind: str, text: Any, *, lanes: bool) -> Value:
        for known in reversed(self._known):
            if (value := known.get(key)) is not None:
                return value
        name = self.fresh()
        self.lines.append(text(name))
        value = self._known[-1][key] = Value(name, kind, lanes)
        return value

    @contextmanager
    def scope(self) -> Iterator[None]:
        """Forget afterwards what was found meanwhile: it is not found on every way on."""
        self._known.append({})
        try:
            yield
        finally:
            self._known.pop()

    # -- operations ---------------------------------------------------------------------------------------------------

    def constant(self, number: Any) -> Value:
        """Return a constant."""
        number = np.asarray(number)
        if number.dtype not in KINDS:
            raise UnsupportedOperationError(f"numbers of type {number.dtype}")
        return Value("", KINDS[number.dtype], False, number[()])

    def arithmetic(self, operation: str, a: Value, b: Value) -> Value:
        """Return the sum, difference, product, quotient, remainder, larger or smaller of two numbers."""
        of_doubles, of_integers, python = ARITHMETIC[operation]
        if a.constant is not None and b.constant is not None and (a.kind == "f" or operation not in ("div", "rem")):
            with np.errstate(all="ignore"):
                return self.constant(np.asarray(python(a.constant, b.constant), DTYPES[a.kind]))
        if (same := _neutral(operation, a, b)) is not None:
            return same
        if operation in ("add", "mul") and a.name > b.name:
            a, b = b, a
        if a.kind != "f" and operation in ("div", "rem"):
            b = self._divisor(a, b)
        lanes = a.lanes or b.lanes
        left, right, kind = self.operand(a, lanes=lanes), self.operand(b, lanes=lanes), self.type_of(a.kind, lanes=lanes)
        word = of_doubles if a.kind == "f" else of_integers

        def text(name: str) -> str:
            if operation in ("max", "min"):
                return f"{name} = call {kind} {self._intrinsic(word, a.kind, 2, lanes=lanes)}({kind} {left}, {kind} {right})"
            if word == "frem":
                raise AssertionError
            return f"{name} = {word} {kind} {left}, {right}"

        if word == "frem":
            return self.call("fmod", a, b)
        return self._found((operation, left, right, kind), a.kind, text, lanes=lanes)

    def _divisor(self, a: Value, b: Value) -> Value:
        """Return a divisor that does not end the process: none that is zero, and not -1 under the least number."""
        one = self.constant(np.ones((), DTYPES[a.kind]))
        zero, minus = self.constant(np.zeros((), DTYPES[a.kind])), self.constant(-np.ones((), DTYPES[a.kind]))
        least = self.constant(np.asarray(np.iinfo(DTYPES[a.kind]).min, DTYPES[a.kind]))
        beyond = self.logic("and", self.compare("eq", a, least), self.compare("eq", b, minus))
        return self.select(self.logic("or", self.compare("eq", b, zero), beyond), one, b)

    def compare(self, operation: str, a: Value, b: Value) -> Value:
        """Return whether a comparison of two numbers holds."""
        of_doubles, of_integers, python = COMPARISONS[operation]
        if a.constant is not None and b.constant is not None:
            return self.constant(np.asarray(python(a.constant, b.constant), bool))
        lanes = a.lanes or b.lanes
        left, right, kind = self.operand(a, lanes=lanes), self.operand(b, lanes=lanes), self.type_of(a.kind, lanes=lanes)
        word = f"fcmp {of_doubles}" if a.kind == "f" else f"icmp {of_integers.replace('s', 'u') if a.kind == 'b' else of_integers}"
        return self._found((word, left, right, kind), "b", lambda name: f"{name} = {word} {kind} {left}, {right}", lanes=lanes)

    def logic(self, operation: str, a: Value, b: Value) -> Value:
        """Return `and`, `or` or `xor` of two truth values or whole numbers."""
        for one, other in ((a, b), (b, a)):
            if one.constant is not None and one.kind == "b":
                if operation == "xor":
                    return self.negated(other) if one.constant else other
                return other if bool(one.constant) == (operation == "and") else one
        if a.name == b.name and operation != "xor":
            return a
        lanes = a.lanes or b.lanes
        left, right, kind = self.operand(a, lanes=lanes), self.operand(b, lanes=lanes), self.type_of(a.kind, lanes=lanes)
        return self._found((operation, left, right), a.kind, lambda name: f"{name} = {operation} {kind} {left}, {right}", lanes=lanes)

    def negated(self, a: Value) -> Value:
        """Return a number with the other sign, or the opposite of a truth value."""
        if a.constant is not None:
            return self.constant(np.asarray(not a.constant if a.kind == "b" else -a.constant, DTYPES[a.kind]))
        kind = self.type_of(a.kind, lanes=a.lanes)
        if a.kind == "f":
            return self._found(("neg", a.name), "f", lambda name: f"{name} = fneg {kind} {a.name}", lanes=a.lanes)
        if a.kind == "b":
            true = self.operand(self.constant(np.True_), lanes=a.lanes)
            return self._found(("not", a.name), "b", lambda name: f"{name} = xor {kind} {a.name}, {true}", lanes=a.lanes)
        return self.arithmetic("sub", self.constant(np.zeros((), DTYPES[a.kind])), a)

    def select(self, choice: Value, a: Value, b: Value) -> Value:
        """Return the first of two numbers where a truth value holds, the second elsewhere."""
        if choice.constant is not None:
            return a if choice.constant else b
        if a is b or (a.name and a.name == b.name) or (a.constant is not None and _same(a.constant, b.constant)):
            return a
        lanes = choice.lanes or a.lanes or b.lanes
        which, on = self.operand(choice, lanes=lanes), self.type_of("b", lanes=lanes)
        left, right, kind = self.operand(a, lanes=lanes), self.operand(b, lanes=lanes), self.type_of(a.kind, lanes=lanes)
        return self._found(
            ("select", which, left, right, kind),
            a.kind,
            lambda name: f"{name} = select {on} {which}, {kind} {left}, {kind} {right}",
            lanes=lanes,
        )

    def intrinsic(self, operation: str, a: Value) -> Value:
        """Return a function of one double that LLVM knows to have an instruction for."""
        kind, given = self.type_of("f", lanes=a.lanes), self.operand(a, lanes=a.lanes)
        return self._found(
            (operation, given),
            "f",
            lambda name: f"{name} = call {kind} {self._intrinsic(operation, 'f', 1, lanes=a.lanes)}({kind} {given})",
            lanes=a.lanes,
        )

    def _intrinsic(self, operation: str, kind: str, count: int, *, lanes: bool) -> str:
        size = {"f": "f64", "l": "i64", "i": "i32"}[kind]
        name, of = f"@llvm.{operation}.{f'v{self.width}' if lanes else ''}{size}", self.type_of(kind, lanes=lanes)
        self.intrinsics.add(f"declare {of} {name}({', '.join([of] * count)})")
        return name

    def call(self, function: str, *given: Value) -> Value:
        """Return a function of doubles of C's library, one call for each lane."""
        lanes = any(value.lanes for value in given)
        operands, kind = [self.operand(value, lanes=lanes) for value in given], self.type_of("f", lanes=lanes)
        self.functions.add((function, len(given)))
        called = f"@{function}_of_lanes" if lanes else f"@{function}"
        listed = ", ".join(f"{kind} {operand}" for operand in operands)
        return self._found((function, *operands), "f", lambda name: f"{name} = call {kind} {called}({listed})", lanes=lanes)

    def converted(self, a: Value, to: str) -> Value:
        """Return a number as one of another kind."""
        if a.kind == to:
            return a
        if a.constant is not None:
            with np.errstate(all="ignore"):
                return self.constant(np.asarray(a.constant).astype(DTYPES[to]))
        if to == "b":
            return self.compare("ne", a, self.constant(np.zeros((), DTYPES[a.kind])))
        words = {"fl": "fptosi", "fi": "fptosi", "lf": "sitofp", "if": "sitofp", "bf": "uitofp", "li": "trunc", "il": "sext"}
        word = words.get(a.kind + to, "zext")
        kind, wanted = self.type_of(a.kind, lanes=a.lanes), self.type_of(to, lanes=a.lanes)
        if word == "fptosi":  # of what does not fit anything may come
            saturated = f"@llvm.fptosi.sat.{f'v{self.width}' if a.lanes else ''}{SCALARS[to]}.{f'v{self.width}' if a.lanes else ''}f64"
            self.intrinsics.add(f"declare {wanted} {saturated}({kind})")
            return self._found((saturated, a.name), to, lambda name: f"{name} = call {wanted} {saturated}({kind} {a.name})", lanes=a.lanes)
        return self._found((word, a.name, to), to, lambda name: f"{name} = {word} {kind} {a.name} to {wanted}", lanes=a.lanes)

    def anywhere(self, a: Value) -> str:
        """Return the name of a truth value that holds where one holds in some lane."""
        if not a.lanes:
            return self.operand(a, lanes=False)
        name, of = self.fresh(), self.type_of("b", lanes=True)
        called = f"@llvm.vector.reduce.or.v{self.width}i1"
        self.intrinsics.add(f"declare i1 {called}({of})")
        self.lines.append(f"{name} = call i1 {called}({of} {a.name})")
        return name

    # -- memory -------------------------------------------------------------------------------------------------------

    def room(self, size: int, kind: str, *, lanes: bool) -> Region:
        """Return memory for numbers of one kind."""
        name = self.fresh("m")
        self.memory += max(1, size) * (self.width if lanes else 1) * DTYPES[kind].itemsize
        of = f"<{self.width} x {IN_MEMORY[kind]}>" if lanes else IN_MEMORY[kind]
        self.entry.append(f"{name} = alloca {of}, i64 {max(1, size)}, align 64")
        return Region(name, kind, lanes)

    def load(self, region: Region, index: int | Value) -> Value:
        """Return the number at a place of memory."""
        address, of, hint = self._address(region, index)
        name = self.fresh()
        self.lines.append(f"{name} = load {of}, ptr {address}, align 8{hint}" if region.kind != "b" else f"{name}m = load {of}, ptr {address}, align 1{hint}")
        if region.kind == "b":
            self.lines.append(f"{name} = trunc {of} {name}m to {self.type_of('b', lanes=region.lanes)}")
        return Value(name, region.kind, region.lanes, home=(region, index) if isinstance(index, int) else None)

    def store(self, region: Region, index: int | Value, value: Value) -> None:
        """Put a number at a place of memory."""
        address, of, _ = self._address(region, index)
        operand = self.operand(value, lanes=region.lanes)
        if region.kind == "b":
            wide = self.fresh()
            self.lines.append(f"{wide} = zext {self.type_of('b', lanes=region.lanes)} {operand} to {of}")
            operand = wide
        self.lines.append(f"store {of} {operand}, ptr {address}, align {1 if region.kind == 'b' else 8}")

    def _address(self, region: Region, index: int | Value) -> tuple[str, str, str]:
        """Return the address of a number, its type in memory, and what is known of it."""
        of = f"<{self.width} x {IN_MEMORY[region.kind]}>" if region.lanes else IN_MEMORY[region.kind]
        place = str(index) if isinstance(index, int) else self.operand(index, lanes=False)
        address, hint = self.fresh("p"), ", !invariant.load !0" if region.given else ""
        if region.given and region.lanes:
            first, sum_ = self.fresh(), self.fresh()
            self.lines += [f"{first} = mul i64 {place}, %total", f"{sum_} = add i64 {first}, %lane"]
            self.lines.append(f"{address} = getelementptr {IN_MEMORY[region.kind]}, ptr {region.pointer}, i64 {sum_}")
        else:
            self.lines.append(f"{address} = getelementptr {of}, ptr {region.pointer}, i64 {place}")
        return address, of, hint

    # -- order --------------------------------------------------------------------------------------------------------

    def label(self) -> str:
        """Return a name for a block."""
        return self.fresh("b")[1:]

    def begin(self, label: str) -> None:
        """Begin a block."""
        self.lines.append(f"{label}:")

    def jump(self, label: str) -> None:
        """End a block, and go on with another."""
        self.lines.append(f"br label %{label}")

    def branch(self, choice: str, then: str, otherwise: str) -> None:
        """End a block, and go on with one of two."""
        self.lines.append(f"br i1 {choice}, label %{then}, label %{otherwise}")

    def mark(self) -> tuple[int, int, int]:
        """Return how far the text has come, for `back_to`."""
        return len(self.lines), len(self.entry), len(self._known[-1])

    def back_to(self, mark: tuple[int, int, int]) -> None:
        """Take back what was written since a mark in the same scope."""
        lines, entry, known = mark
        del self.lines[lines:], self.entry[entry:]
        while len(self._known[-1]) > known:
            self._known[-1].popitem()


def literal(number: Any, kind: str) -> str:
    """Return a constant as LLVM reads it."""
    if kind == "f":
        return f"0x{int(np.asarray(number, float).view(np.uint64)):016X}"
    return str(bool(number)).lower() if kind == "b" else str(int(number))


def _same(a: Any, b: Any) -> bool:
    return b is not None and bool(a == b) and math.copysign(1, a) == math.copysign(1, b)


def _neutral(operation: str, a: Value, b: Value) -> Value | None:
    """Return the operand that an operation leaves as it is, if the other says so: one as a factor, zero in a sum."""
    nothing = {"add": 0, "sub": 0, "mul": 1, "div": 1}.get(operation)
    if nothing is None:
        return None
    if b.constant is not None and b.constant == nothing:
        return a
    return b if operation in ("add", "mul") and a.constant is not None and a.constant == nothing else None


def flat(array: np.ndarray) -> Sequence[Value]:
    """Return the values of an array, the last axis fastest."""
    return array.ravel().tolist()
