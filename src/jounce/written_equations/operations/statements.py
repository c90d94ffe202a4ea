"""A graph as a sequence of statements: operations used more than once have names, others are nested."""

import keyword
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from jounce.written_equations.operations.graph import Graph, Node

LONGEST = 90  # characters of a statement with nested operations
RESERVED = frozenset(keyword.kwlist) | frozenset(
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while t q np "
    "orders out shape sp y0 y1 yn j0 j1 jn gamma".split()
)


class Names:
    """Unique names for inputs in a language, as close to the labels as its rules allow."""

    def __init__(self, taken: Iterable[str] = ()):
        self._taken = set(RESERVED) | set(taken)
        self._known: dict[str, str] = {}

    def fix(self, label: str, name: str) -> None:
        """Assign a name to a label."""
        self._taken.add(name)
        self._known[label] = name

    def of(self, label: str) -> str:
        """Return the name of a label."""
        if label not in self._known:
            stem = re.sub(r"[^0-9a-zA-Z]+", "_", label.encode("ascii", "replace").decode()).strip("_") or "x"
            stem = f"b_{stem}" if stem[0].isdigit() or re.fullmatch(r"[sk]\d+|table\d+", stem) else stem
            name, count = stem, 1
            while name in self._taken:
                count += 1
                name = f"{stem}_{count}"
            self._taken.add(name)
            self._known[label] = name
        return self._known[label]


class Text(NamedTuple):
    """The text of an operation, and its precedence, `ATOM` for the highest."""

    text: str
    tightness: int = 3


COMPARISON, SUM, PRODUCT, ATOM = range(4)
INFIX = {
    "add": ("+", SUM), "sub": ("-", SUM), "mul": ("*", PRODUCT), "div": ("/", PRODUCT), "lt": ("<", COMPARISON),
    "le": ("<=", COMPARISON), "gt": (">", COMPARISON), "ge": (">=", COMPARISON), "eq": ("==", COMPARISON),
    "ne": ("!=", COMPARISON),
}  # fmt: skip
"""Infix operators common to Python and C, and their precedences."""


def infix(left: Text, sign: str, tightness: int, right: Text) -> Text:
    """Return the text of an infix operation, with the necessary brackets."""
    first = left.text if left.tightness >= max(tightness, SUM) else f"({left.text})"
    second = right.text if right.tightness > max(tightness, COMPARISON) else f"({right.text})"
    return Text(f"{first} {sign} {second}", tightness)


class Statements:
    """Statements for the operations that results need.

    Parameters
    ----------
    graph : Graph
        The operations.
    expression : callable
        Function that returns the text of a node from the node and the texts of its operands.
    inputs : callable
        Function that returns the name of an input from its label.
    assignment : callable
        Function that returns a line from a name, a text and a kind of numbers.
    """

    def __init__(
        self,
        graph: Graph,
        expression: Callable[[Node, Sequence[Text]], Text],
        inputs: Callable[[str], str],
        assignment: Callable[[str, str, str], str],
    ):
        self._graph, self._expression, self._inputs, self._assignment = graph, expression, inputs, assignment
        self._texts: dict[int, Text] = {}
        self._named: set[int] = set()  # inputs, constants, and operations with names
        self._count = 0
        self._lines: list[str] = []

    def shared(self, roots: Sequence[int]) -> dict[int, int]:
        """Return the number of uses of each operation that results need."""
        counts: dict[int, int] = {}
        for number in self._graph.reached(roots):
            for operand in self._graph.nodes[number].operands:
                counts[operand] = counts.get(operand, 0) + 1
        for number in roots:
            counts[number] = counts.get(number, 0) + 1
        return counts

    def write(self, roots: Sequence[int], counts: dict[int, int]) -> list[str]:
        """Return the further lines that results need, besides lines from earlier calls."""
        self._lines = []
        for number in self._graph.reached(roots):
            if number in self._texts:
                continue
            node = self._graph.nodes[number]
            if node.operation == "input":
                self._texts[number] = Text(self._inputs(node.detail))
                self._named.add(number)
                continue
            self._texts[number] = self._written(node)
            if node.operation == "constant":
                self._named.add(number)
            elif counts.get(number, 0) > 1:
                self._name(number)
        return self._lines

    def text(self, number: int) -> str:
        """Return the text of a result after `write`."""
        return self._texts[number].text

    def _written(self, node: Node) -> Text:
        """Return the text of an operation; operands get names until the text is short enough."""
        while True:
            text = self._expression(node, [self._texts[x] for x in node.operands])
            inner = [x for x in node.operands if x not in self._named]
            if len(text.text) <= LONGEST or not inner:
                return text
            self._name(max(inner, key=lambda x: len(self._texts[x].text)))

    def _name(self, number: int) -> None:
        self._count += 1
        name = f"s{self._count}"
        self._lines.append(self._assignment(name, self._texts[number].text, self._graph.nodes[number].kind))
        self._texts[number] = Text(name)
        self._named.add(number)


def used_inputs(graph: Graph, roots: Iterable[int]) -> set[Any]:
    """Return the names of the inputs that results need."""
    return {graph.nodes[n].detail for n in graph.reached(roots) if graph.nodes[n].operation == "input"}


def wrapped(texts: Sequence[str], width: int = 110, indent: str = "    ") -> list[str]:
    """Return texts separated by commas, in lines of a limited width."""
    lines, line = [], indent
    for text in texts:
        if len(line) + len(text) + 2 > width and line.strip():
            lines.append(line.rstrip())
            line = indent
        line += f"{text}, "
    return [*lines, line.rstrip()] if line.strip() else lines


def one_line(text: str) -> str:
    """Return a title or a label for a comment: ASCII, in one line, without the end of a comment."""
    ascii_text = " ".join((text or "A mechanism").encode("ascii", "replace").decode().split())
    return ascii_text.replace("*/", "* /").replace("/*", "/ *").rstrip(".")
