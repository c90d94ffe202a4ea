"""Scalar operations as text for LLVM, each on one number or on a vector of lanes."""

import itertools
import math
import operator
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from jounce.execution.llvm.text import values
from jounce.execution.llvm.text.values import DTYPES, SCALARS, UnsupportedOperationError, Value, kind_of, literal

MOST_LINES = 500_000  # of text: LLVM compiles some 5,000 to 20,000 lines in a second
MOST_LINES_WITHOUT_LOOPS = 120_000  # of fully unrolled code: LLVM takes minutes for more
DOUBLES: dict[str, tuple[str, Any]] = {  # in LLVM, in Python
    "add": ("fadd contract", operator.add),
    "sub": ("fsub contract", operator.sub),
    "mul": ("fmul contract", operator.mul),
    "div": ("fdiv", np.divide),
    "rem": ("", np.fmod),
    "max": ("maximum", np.maximum),
    "min": ("minimum", np.minimum),
}
INTEGERS: dict[str, tuple[str, Any]] = {
    "add": ("add", operator.add),
    "sub": ("sub", operator.sub),
    "mul": ("mul", operator.mul),
    "div": ("sdiv", values.quotient),
    "rem": ("srem", values.remainder),
    "max": ("smax", max),
    "min": ("smin", min),
}
UNSIGNED = {"sdiv": "udiv", "srem": "urem", "smax": "umax", "smin": "umin"}
BOOLEANS = {"add": "or", "max": "or", "mul": "and", "min": "and"}
CALLED = frozenset("maximum minimum smax smin umax umin".split())  # LLVM intrinsics, not instructions
COMMUTATIVE = frozenset("add mul max min".split())
PLAIN: dict[tuple[type, str | None], tuple[str, Any]] = {  # numbers whose type determines their kind
    **dict.fromkeys(itertools.product((float, np.float64), ("f", None)), ("f", np.float64)),
    **dict.fromkeys(itertools.product((bool, np.bool_), ("b", None)), ("b", np.bool_)),
    **dict.fromkeys(itertools.product((int, np.int64), ("l",)), ("l", np.int64)),
}
NEUTRAL = {"add": 0, "sub": 0, "mul": 1, "div": 1}
TURNS = "sin", "cos"  # computed together for a vector of lanes
COMPARISONS: dict[str, tuple[str, str, str, Any]] = {  # of doubles, of signed and of unsigned integers, in Python
    "eq": ("oeq", "eq", "eq", operator.eq),
    "ne": ("une", "ne", "ne", operator.ne),
    "lt": ("olt", "slt", "ult", operator.lt),
    "le": ("ole", "sle", "ule", operator.le),
    "gt": ("ogt", "sgt", "ugt", operator.gt),
    "ge": ("oge", "sge", "uge", operator.ge),
}
LOGIC = {"and": operator.and_, "or": operator.or_, "xor": operator.xor}
CONVERSIONS = {"lf": "sitofp", "if": "sitofp", "bf": "uitofp", "li": "trunc", "il": "sext", "bi": "zext", "bl": "zext"}
CONVERSIONS |= {"uf": "uitofp", "ul": "zext", "ui": "bitcast", "iu": "bitcast"}


@dataclass
class Scalars:
    """Operations in their order of execution; none is repeated within a block and the blocks around it.

    Attributes
    ----------
    width : int
        Lanes of a vector.
    most : int
        Largest number of lines.
    lines : list of str
        Text that runs for each vector of lanes.
    functions : set
        Names and numbers of arguments of called C library functions.
    intrinsics : set of str
        Declarations of called LLVM intrinsics.
    active : Value or None
        Mask of the active lanes; None for all.
    sparse : bool
        Whether a constant zero is a structural zero, with which no product is emitted.
    """

    width: int
    most: int = MOST_LINES
    lines: list[str] = field(default_factory=list)
    functions: set[tuple[str, int]] = field(default_factory=set)
    intrinsics: set[str] = field(default_factory=set)
    active: Value | None = None
    sparse: bool = False
    _count: int = 0
    _known: dict[str, Value] = field(default_factory=dict)  # results of emitted instructions
    _scopes: list[list[str]] = field(default_factory=lambda: [[]])  # instructions first emitted in each scope
    _vectors: dict[tuple[str, str], str] = field(default_factory=dict)

    def __post_init__(self):
        self._types = {(kind, False): type_name for kind, type_name in SCALARS.items()}
        self._types |= {(kind, True): f"<{self.width} x {type_name}>" for kind, type_name in SCALARS.items()}

    # -- text ---------------------------------------------------------------------------------------------------------

    def fresh(self, letter: str = "v") -> str:
        """Return a new name."""
        self._count += 1
        return f"%{letter}{self._count}"

    def type_of(self, kind: str, *, lanes: bool) -> str:
        """Return the type of a number."""
        return self._types[kind, lanes]

    def operand(self, value: Value, *, lanes: bool) -> str:
        """Return a value as an operand; a single number is repeated in all lanes if a vector is needed."""
        if value.constant is not None:
            text = literal(value)
            return self._repeated(value.kind, text) if lanes else text
        if not lanes or value.lanes:
            return value.name
        vector, item = self.type_of(value.kind, lanes=True), SCALARS[value.kind]
        first = self._emitted(f"insertelement {vector} poison, {item} {value.name}, i64 0", value.kind, lanes=True).name
        indices = f"<{self.width} x i32> zeroinitializer"
        return self._emitted(f"shufflevector {vector} {first}, {vector} poison, {indices}", value.kind, lanes=True).name

    def _repeated(self, kind: str, text: str) -> str:
        if (vector := self._vectors.get((kind, text))) is None:
            vector = self._vectors[kind, text] = f"<{', '.join([f'{SCALARS[kind]} {text}'] * self.width)}>"
        return vector

    def _emitted(self, instruction: str, kind: str, *, lanes: bool) -> Value:
        """Return the result of an instruction without side effects, emitted only if it is new."""
        if (earlier := self._known.get(instruction)) is not None:
            return earlier
        if len(self.lines) > self.most:
            raise UnsupportedOperationError(f"a program of more than {self.most:,} lines")
        self._count += 1
        name = f"%v{self._count}"  # as from `fresh`
        self.lines.append(f"{name} = {instruction}")
        value = self._known[instruction] = Value(name, kind, lanes)
        self._scopes[-1].append(instruction)
        return value

    def _forget(self, instructions: Sequence[str]) -> None:
        """Forget instructions, so that they are emitted again when needed."""
        for instruction in instructions:
            del self._known[instruction]

    def _called(self, name: str, result: str, kinds: str, given: Sequence[str], *, lanes: bool) -> Value:
        """Return the result of an LLVM intrinsic, whose name ends in the types of `kinds`."""
        sizes = "".join(f".{f'v{self.width}' if lanes else ''}{'f64' if k == 'f' else SCALARS[k]}" for k in kinds)
        argument_type, result_type = self.type_of(kinds[-1], lanes=lanes), self.type_of(result, lanes=lanes)
        self.intrinsics.add(f"declare {result_type} @llvm.{name}{sizes}({', '.join([argument_type] * len(given))})")
        arguments = ", ".join(f"{argument_type} {operand}" for operand in given)
        return self._emitted(f"call {result_type} @llvm.{name}{sizes}({arguments})", result, lanes=lanes)

    @contextmanager
    def scope(self, active: Value | None = None) -> Iterator[None]:
        """Begin a scope, whose results are forgotten at its end, since not every path passes it.

        Parameters
        ----------
        active : Value or None
            Mask of the active lanes in the scope, if it differs from that around it.
        """
        outer_mask = self.active
        self.active = outer_mask if active is None else active
        self._scopes.append([])
        try:
            yield
        finally:
            self._forget(self._scopes.pop())
            self.active = outer_mask

    def among_active(self, choice: Value) -> Value:
        """Return a truth value restricted to the active lanes, if it differs from lane to lane."""
        return choice if self.active is None or not choice.lanes else self.logic("and", choice, self.active)

    def constant(self, number: Any, kind: str | None = None) -> Value:
        """Return a constant, by default of the kind of its type."""
        if (conversion := PLAIN.get((type(number), kind))) is not None:
            return Value("", conversion[0], False, conversion[1](number))
        scalar = (np.asarray(number) if kind is None else np.asarray(number).astype(DTYPES[kind]))[()]
        return Value("", kind or kind_of(scalar.dtype), False, scalar)

    # -- operations ---------------------------------------------------------------------------------------------------

    def arithmetic(self, operation: str, a: Value, b: Value) -> Value:
        """Return the sum, difference, product, quotient, remainder, larger or smaller of two numbers."""
        if a.kind == "b":
            if operation not in BOOLEANS:
                raise UnsupportedOperationError(f"{operation} of truth values")
            return self.logic(BOOLEANS[operation], a, b)
        word, python = (DOUBLES if a.kind == "f" else INTEGERS)[operation]
        word = UNSIGNED.get(word, word) if a.kind == "u" else word
        if a.constant is not None and b.constant is not None:
            return self.constant(python(a.constant, b.constant), a.kind)
        if a.constant is not None or b.constant is not None:
            if (operand := _neutral(operation, a, b)) is not None:
                return operand
            if self.sparse and a.kind == "f" and _is_nothing(operation, a, b):
                return self.constant(0.0)  # without a sign
        if operation in COMMUTATIVE and a.name > b.name:
            a, b = b, a
        if operation == "rem" and a.kind == "f":
            return self.call("fmod", a, b)
        if operation in ("div", "rem") and a.kind != "f":
            return self._division(operation, word, a, b)
        return self._pair(word, a, b)

    def _pair(self, word: str, a: Value, b: Value, kind: str | None = None) -> Value:
        lanes = a.lanes or b.lanes
        left = a.name if a.constant is None and a.lanes == lanes else self.operand(a, lanes=lanes)
        right = b.name if b.constant is None and b.lanes == lanes else self.operand(b, lanes=lanes)
        if word in CALLED:
            return self._called(word, a.kind, a.kind, (left, right), lanes=lanes)
        return self._emitted(f"{word} {self._types[a.kind, lanes]} {left}, {right}", kind or a.kind, lanes=lanes)

    def _division(self, operation: str, word: str, a: Value, b: Value) -> Value:
        """Return a quotient or remainder of integers as XLA defines it, with divisors that do not trap."""
        one, minimum = self.constant(1, a.kind), self.constant(np.iinfo(DTYPES[a.kind]).min, a.kind)
        if b.constant is None:  # in an inactive lane it may be undefined, with a different value at each use
            frozen = f"freeze {self.type_of(b.kind, lanes=b.lanes)} {b.name}"
            b = self._emitted(frozen, b.kind, lanes=b.lanes)
        opposite = self.compare("eq", b, self.constant(-1, a.kind)) if a.kind != "u" else self.constant(False)
        overflow = self.logic("and", self.compare("eq", a, minimum), opposite)
        is_zero = self.compare("eq", b, self.constant(0, a.kind))
        result = self._pair(word, a, self.select(self.logic("or", is_zero, overflow), one, b))
        return self.select(is_zero, self.constant(-1, a.kind) if operation == "div" else a, result)

    def compare(self, operation: str, a: Value, b: Value) -> Value:
        """Return whether a comparison of two numbers holds."""
        of_doubles, of_integers, unsigned, python = COMPARISONS[operation]
        if a.constant is not None and b.constant is not None:
            return self.constant(python(a.constant, b.constant), "b")
        word = f"fcmp {of_doubles}" if a.kind == "f" else f"icmp {unsigned if a.kind in 'bu' else of_integers}"
        return self._pair(word, a, b, "b")

    def logic(self, operation: str, a: Value, b: Value) -> Value:
        """Return `and`, `or` or `xor` of two truth values, or of the bits of two integers."""
        if a.constant is not None and b.constant is not None:
            return self.constant(LOGIC[operation](a.constant, b.constant), a.kind)
        for one, other in ((a, b), (b, a)):
            if one.constant is not None and one.kind == "b":
                if operation == "xor":
                    return self.inverted(other) if one.constant else other
                return other if bool(one.constant) == (operation == "and") else one
        if a.name == b.name and operation != "xor":
            return a
        return self._pair(operation, a, b)

    def negated(self, a: Value) -> Value:
        """Return the negative of a number."""
        if a.kind != "f":
            return self.arithmetic("sub", self.constant(0, a.kind), a)
        if a.constant is not None:
            return self.constant(-a.constant)
        return self._emitted(f"fneg {self.type_of('f', lanes=a.lanes)} {a.name}", "f", lanes=a.lanes)

    def inverted(self, a: Value) -> Value:
        """Return the negation of a truth value, or of each bit of an integer."""
        if a.constant is not None:
            return self.constant(np.invert(a.constant))
        return self._pair("xor", a, self.constant(True if a.kind == "b" else -1, a.kind))

    def digits(self, a: Value) -> Value:
        """Return the bits of a double as an integer."""
        if a.constant is not None:
            return self.constant(a.constant.view(np.int64))
        double, integer = self.type_of("f", lanes=a.lanes), self.type_of("l", lanes=a.lanes)
        return self._emitted(f"bitcast {double} {a.name} to {integer}", "l", lanes=a.lanes)

    def select(self, choice: Value, a: Value, b: Value) -> Value:
        """Return the first of two numbers where a truth value holds, and the second elsewhere."""
        if choice.constant is not None:
            return a if choice.constant else b
        if a is b or (a.name and a.name == b.name) or is_same_constant(a, b):
            return a
        lanes = choice.lanes or a.lanes or b.lanes
        mask, mask_type = self.operand(choice, lanes=lanes), self.type_of("b", lanes=lanes)
        left, right, kind = (
            self.operand(a, lanes=lanes),
            self.operand(b, lanes=lanes),
            self.type_of(a.kind, lanes=lanes),
        )
        return self._emitted(f"select {mask_type} {mask}, {kind} {left}, {kind} {right}", a.kind, lanes=lanes)

    def intrinsic(self, operation: str, a: Value) -> Value:
        """Return an LLVM intrinsic of one double that has an instruction."""
        return self._called(operation, "f", "f", (self.operand(a, lanes=a.lanes),), lanes=a.lanes)

    def call(self, function: str, *given: Value) -> Value:
        """Return a C library function of doubles, by one call for each lane except for sine and cosine."""
        lanes = any(value.lanes for value in given)
        if lanes and function in TURNS:
            self.functions |= {(name, 1) for name in TURNS}
            vector = self.type_of("f", lanes=True)
            pair = self._emitted(
                f"call {{ {vector}, {vector} }} @sine_and_cosine({vector} {given[0].name})", "f", lanes=True
            )
            index = TURNS.index(function)
            return self._emitted(f"extractvalue {{ {vector}, {vector} }} {pair.name}, {index}", "f", lanes=True)
        operands, kind = [self.operand(value, lanes=lanes) for value in given], self.type_of("f", lanes=lanes)
        self.functions.add((function, len(given)))
        callee = f"@{function}_of_lanes" if lanes else f"@{function}"
        arguments = ", ".join(f"{kind} {operand}" for operand in operands)
        return self._emitted(f"call {kind} {callee}({arguments})", "f", lanes=lanes)

    def converted(self, a: Value, to: str) -> Value:
        """Return a number converted to another kind; a double out of range becomes the nearest integer."""
        if a.kind == to:
            return a
        if a.constant is not None:
            exact = a.kind != "f" or to not in "liu"
            return self.constant(a.constant.astype(DTYPES[to]) if exact else values.nearest(a.constant, DTYPES[to]), to)
        if to == "b":
            return self.compare("ne", a, self.constant(0, a.kind))
        if a.kind == "f":  # `fptosi` returns poison if a number does not fit
            return self._called("fptoui.sat" if to == "u" else "fptosi.sat", to, to + "f", (a.name,), lanes=a.lanes)
        if to == "u" and a.kind != "i":  # by another kind, since equal instructions must have equal results
            return self.converted(self.converted(a, "i"), "u")
        kind, expected = self.type_of(a.kind, lanes=a.lanes), self.type_of(to, lanes=a.lanes)
        return self._emitted(f"{CONVERSIONS[a.kind + to]} {kind} {a.name} to {expected}", to, lanes=a.lanes)

    def anywhere(self, a: Value) -> str:
        """Return the name of the truth value whether a value holds in any lane."""
        if not a.lanes:
            return self.operand(a, lanes=False)
        vector, callee = self.type_of("b", lanes=True), f"@llvm.vector.reduce.or.v{self.width}i1"
        self.intrinsics.add(f"declare i1 {callee}({vector})")
        return self._emitted(f"call i1 {callee}({vector} {a.name})", "b", lanes=False).name

    # -- order --------------------------------------------------------------------------------------------------------

    def label(self) -> str:
        """Return a name for a block."""
        return self.fresh("b")[1:]

    def begin(self, label: str) -> None:
        """Begin a block."""
        self.lines.append(f"{label}:")

    def jump(self, label: str) -> None:
        """End a block with a jump to another."""
        self.lines.append(f"br label %{label}")

    def branch(self, choice: str, then: str, otherwise: str) -> None:
        """End a block with a branch to one of two others."""
        self.lines.append(f"br i1 {choice}, label %{then}, label %{otherwise}")


def _is_zero(a: Value) -> bool:
    return a.constant is not None and bool(a.constant == 0)


def _is_nothing(operation: str, a: Value, b: Value) -> bool:
    """Return whether a product or quotient is zero because of a zero factor or dividend."""
    return (operation in ("mul", "div") and _is_zero(a)) or (operation == "mul" and _is_zero(b))


def is_same_constant(a: Value, b: Value) -> bool:
    """Return whether two values are the same constant; zeros of different signs are not."""
    x, y = a.constant, b.constant
    return x is not None and y is not None and bool(x == y) and math.copysign(1, x) == math.copysign(1, y)


def _neutral(operation: str, a: Value, b: Value) -> Value | None:
    """Return the operand that an operation leaves unchanged because the other one is neutral; otherwise None.

    The sign of -0 + 0 is ignored, as by XLA.
    """
    if (neutral := NEUTRAL.get(operation)) is None:
        return None
    if b.constant is not None and b.constant == neutral:
        return a
    return b if operation in COMMUTATIVE and a.constant is not None and a.constant == neutral else None
