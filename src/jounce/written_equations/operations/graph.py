"""A graph of operations on numbers, each operation once, without zero terms and with known values computed."""

import math
import operator
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

REAL, WHOLE, TRUTH = "real", "whole", "truth"


class Node(NamedTuple):
    """One operation.

    Parameters
    ----------
    operation : str
        Name: ``constant``, ``input``, ``lookup`` or one of `FUNCTIONS`.
    operands : tuple of int
        Numbers of the operand nodes.
    detail : object
        Value of a constant, name of an input, or table of a lookup.
    kind : str
        Kind of the result: ``real``, ``whole`` or ``truth``.
    """

    operation: str
    operands: tuple[int, ...]
    detail: Any
    kind: str


FUNCTIONS: dict[str, tuple[Callable[..., Any], str]] = {
    "add": (operator.add, ""),
    "sub": (operator.sub, ""),
    "mul": (operator.mul, ""),
    "div": (np.divide, REAL),
    "neg": (operator.neg, ""),
    "max": (np.maximum, ""),
    "min": (np.minimum, ""),
    "rem": (np.fmod, ""),
    "abs": (np.abs, ""),
    "sign": (np.sign, ""),
    "pow": (np.power, REAL),
    "atan2": (np.arctan2, REAL),
    "hypot": (np.hypot, REAL),
    "lt": (operator.lt, TRUTH),
    "le": (operator.le, TRUTH),
    "gt": (operator.gt, TRUTH),
    "ge": (operator.ge, TRUTH),
    "eq": (operator.eq, TRUTH),
    "ne": (operator.ne, TRUTH),
    "and": (lambda a, b: bool(a) and bool(b), TRUTH),
    "or": (lambda a, b: bool(a) or bool(b), TRUTH),
    "not": (lambda a: not a, TRUTH),
    "is_finite": (np.isfinite, TRUTH),
    "where": (lambda c, a, b: a if c else b, ""),
    "real": (float, REAL),
    "whole": (int, WHOLE),
} | {
    name: (function, REAL)
    for name, function in {
        "sqrt": np.sqrt, "cbrt": np.cbrt, "exp": np.exp, "expm1": np.expm1, "log": np.log, "log1p": np.log1p,
        "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
        "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "asinh": np.arcsinh, "acosh": np.arccosh,
        "atanh": np.arctanh, "erf": np.vectorize(math.erf), "erfc": np.vectorize(math.erfc), "floor": np.floor,
        "ceil": np.ceil, "round": np.rint,
    }.items()
}  # fmt: skip
"""Functions of operations on numbers, and the kinds of their results; empty for the kind of the last operand."""

SYMMETRIC = frozenset({"add", "mul", "max", "min", "hypot", "eq", "ne", "and", "or"})


class Graph:
    """Operations on numbers, each operation once.

    Attributes
    ----------
    nodes : list of Node
        Nodes in order: operands come before the node.
    ranges : dict of int to tuple of int
        Lower and upper bounds of nodes of whole numbers.
    """

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.ranges: dict[int, tuple[int, int]] = {}
        self._known: dict[Any, int] = {}
        self._node(Node("nothing", (), None, REAL))  # so that the numbers of all other nodes are truthy

    def constant(self, value: Any) -> int:
        """Return the node of a number, a whole number or a truth value."""
        if isinstance(value, bool | np.bool_):
            return self._node(Node("constant", (), bool(value), TRUTH))
        if isinstance(value, int | np.integer):
            number = self._node(Node("constant", (), int(value), WHOLE))
            self.ranges[number] = (int(value), int(value))
            return number
        value = float(value)
        key = "constant", value.hex() if value else "0"  # without a sign of zero
        return self._node(Node("constant", (), value or 0.0, REAL), key)

    def input(self, name: str | tuple[Any, ...]) -> int:
        """Return the node of an input."""
        return self._node(Node("input", (), name, REAL))

    def lookup(self, table: Sequence[Any], index: int) -> int:
        """Return the node of an entry of a table, by the node of its index."""
        low, high = self.ranges[index]
        entries = set(table[low : high + 1])
        if len(entries) == 1:
            return self.constant(next(iter(entries)))
        kind = TRUTH if isinstance(table[0], bool) else WHOLE if isinstance(table[0], int) else REAL
        number = self._node(Node("lookup", (index,), tuple(table), kind))
        if kind == WHOLE:
            self.ranges[number] = (min(entries), max(entries))
        return number

    def is_constant(self, *numbers: int) -> bool:
        """Tell whether all nodes are constants."""
        return all(self.nodes[number].operation == "constant" for number in numbers)

    def value(self, number: int) -> Any:
        """Return the value of a constant."""
        return self.nodes[number].detail

    def apply(self, name: str, *operands: int) -> int:
        """Return the node of a simplified operation."""
        if (simpler := self._simplified(name, operands)) is not None:
            return simpler
        function, kind = FUNCTIONS[name]
        kind = kind or self.nodes[operands[-1]].kind
        if self.is_constant(*operands):
            with np.errstate(all="ignore"):
                value = function(*map(self.value, operands))
            return self.constant({REAL: float, WHOLE: int, TRUTH: bool}[kind](value))
        if name in SYMMETRIC:
            operands = tuple(sorted(operands))
        number = self._node(Node(name, tuple(operands), None, kind))
        if kind == WHOLE and number not in self.ranges:
            self.ranges[number] = self._range(name, operands)
        return number

    def total(self, numbers: Iterable[int]) -> int:
        """Return the node of the sum of nodes, zero without nodes."""
        pending = list(numbers)
        if not pending:
            return self.constant(0.0)
        result = pending[0]
        for number in pending[1:]:
            result = self.apply("add", result, number)
        return result

    def reached(self, roots: Iterable[int]) -> list[int]:
        """Return all nodes that roots need, with the roots, operands first."""
        visited: set[int] = set()
        pending = list(roots)
        while pending:
            number = pending.pop()
            if number not in visited:
                visited.add(number)
                pending += self.nodes[number].operands
        return sorted(visited)

    def _node(self, node: Node, key: Any = None) -> int:
        key = node if key is None else key
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append(node)
        return self._known[key]

    def _is(self, number: int, value: int) -> bool:
        node = self.nodes[number]
        return node.operation == "constant" and node.kind != TRUTH and node.detail == value

    def _simplified(self, name: str, operands: tuple[int, ...]) -> int | None:
        """Return an exact simplification of an operation, also under rounding, or None."""
        a, b = operands[0], operands[-1]
        if name in ("add", "sub"):
            return self._sum(name, a, b)
        if name == "mul":
            return self._product(a, b)
        if name == "where":
            return self._selected(*operands)
        if name in ("and", "or"):
            return a if a == b else self._joined(name, a, b) or self._joined(name, b, a)
        if name in ("real", "whole"):
            return a if self.nodes[a].kind == {"real": REAL, "whole": WHOLE}[name] else None
        if name == "neg":
            return self.nodes[a].operands[0] if self.nodes[a].operation == "neg" else None
        operand = (
            (name == "div" and (self._is(b, 1) or (self._is(a, 0) and not self._is(b, 0))))
            or (name == "pow" and self._is(b, 1))
            or (name in ("max", "min") and a == b)
        )
        return a if operand else None

    def _sum(self, name: str, a: int, b: int) -> int | None:
        if name == "add":
            return b if self._is(a, 0) else a if self._is(b, 0) else self._difference(b, a) or self._difference(a, b)
        if self._is(b, 0):
            return a
        if a == b:
            return self.constant(0.0 if self.nodes[a].kind == REAL else 0)
        if self._is(a, 0):
            return self.apply("neg", b)
        return self.apply("add", a, self.nodes[b].operands[0]) if self.nodes[b].operation == "neg" else None

    def _difference(self, negative: int, other: int) -> int | None:
        if self.nodes[negative].operation != "neg" or self.is_constant(negative):
            return None
        return self.apply("sub", other, self.nodes[negative].operands[0])

    def _product(self, a: int, b: int) -> int | None:
        for x, y in ((a, b), (b, a)):
            if self._is(x, 0):
                return x
            if self._is(x, 1):
                return y
            if self._is(x, -1):
                return self.apply("neg", y)
            if self._is_factor(x) and (scaled := self._scaled(y)):
                return self.apply("mul", self.constant(self.value(x) * scaled[0]), scaled[1])
        for x, y in ((a, b), (b, a)):
            if self.nodes[x].operation == "neg":
                return self.apply("neg", self.apply("mul", self.nodes[x].operands[0], y))
        return None

    def _is_factor(self, number: int) -> bool:
        """Tell whether a node is a finite real constant, which can be multiplied with others beforehand."""
        node = self.nodes[number]
        return node.operation == "constant" and node.kind == REAL and math.isfinite(node.detail)

    def _scaled(self, number: int) -> tuple[float, int] | None:
        """Return the constant factor of an operation, and the node of the other factor; None without one."""
        node = self.nodes[number]
        if node.operation == "neg":
            return -1.0, node.operands[0]
        if node.operation not in ("mul", "div"):
            return None
        a, b = node.operands
        if node.operation == "div":
            return (1.0 / self.value(b), a) if self._is_factor(b) and self.value(b) else None
        factor, other = (a, b) if self._is_factor(a) else (b, a)
        return (self.value(factor), other) if self._is_factor(factor) else None

    def _selected(self, condition: int, yes: int, no: int) -> int | None:
        if yes == no:
            return yes
        if self.is_constant(condition):
            return yes if self.value(condition) else no
        return self._length(condition, no) if self.nodes[yes].detail == math.inf else None

    def _length(self, condition: int, otherwise: int) -> int | None:
        """Return the ``hypot`` node for a choice with the nodes that `jnp.hypot` makes, or None."""
        either = [self.nodes[x] for x in self.nodes[condition].operands]
        if self.nodes[condition].operation != "or" or any(node.operation != "eq" for node in either):
            return None
        sizes = [x for node in either for x in node.operands if self.nodes[x].operation == "abs"]
        if len(sizes) != 2:
            return None
        one, (large, small) = self.constant(1.0), (self.apply(name, *sizes) for name in ("max", "min"))
        no_length = self.apply("eq", large, self.constant(0.0))
        ratio = self.apply("div", small, self.apply("where", no_length, one, large))
        root = self.apply("sqrt", self.apply("add", one, self.apply("mul", ratio, ratio)))
        if self.apply("where", no_length, large, self.apply("mul", large, root)) != otherwise:
            return None
        return self.apply("hypot", *(self.nodes[x].operands[0] for x in sizes))

    def _joined(self, name: str, known: int, other: int) -> int | None:
        if not self.is_constant(known):
            return None
        return other if self.value(known) == (name == "and") else known

    def _range(self, name: str, operands: Sequence[int]) -> tuple[int, int]:
        """Return the lower and upper bounds of an operation on whole numbers."""
        ranges = [self.ranges.get(number, (0, 0)) for number in operands]
        if name == "where":
            return min(r[0] for r in ranges[1:]), max(r[1] for r in ranges[1:])
        if name == "neg":
            return -ranges[0][1], -ranges[0][0]
        if name in ("max", "min"):
            choose = max if name == "max" else min
            return choose(r[0] for r in ranges), choose(r[1] for r in ranges)
        if name in ("add", "sub", "mul"):
            ends = [FUNCTIONS[name][0](x, y) for x in ranges[0] for y in ranges[1]]
            return min(ends), max(ends)
        if name == "whole" and self.nodes[operands[0]].kind == TRUTH:
            return 0, 1
        raise KeyError(name)  # unknown bounds
