"""Objectives and conditions as text: ``peak(psi, 4)``, ``span(C_x) <= 2 mm``; parsed like other expressions."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from typing import Any

from jounce.errors import ExpressionError, JounceError, MechanismError, did_you_mean, show_value
from jounce.units.dimensions import Dimension
from jounce.units.expression import FUNCTIONS, Expression
from jounce.units.values import parse_value

OVER_TIME: dict[str, tuple[int, ...]] = dict.fromkeys(
    ("peak", "maximum", "minimum", "span", "mean", "rms"),
    (1, 2, 4),  # the quantity, its derivative, and the two ends of the window of time
)
MEASURES: dict[str, tuple[int, ...]] = {**OVER_TIME, "at": (2, 3), "path_error": (2,), "path_deviation": (2,)}
"""Measures, which reduce a time-dependent quantity to one number, with their permitted numbers of arguments."""

EXERTED: dict[str, tuple[int, ...]] = {
    f"{kind}{component}": (1,) for kind in ("force", "torque") for component in ("", "_x", "_y", "_z")
}
"""Forces and torques of drivers and joints, and their components."""

WORDS = {**MEASURES, **EXERTED}
_RELATION = re.compile(r"(<=|>=|==|<|>|=)")
_NUMBER = re.compile(r"\s*[-+]?[0-9.]")


@dataclasses.dataclass(frozen=True)
class Node:
    """One step of an expression: a number, a name, or an operation on others.

    Parameters
    ----------
    kind : str
        ``"number"``, ``"name"``, or ``"call"`` of an operator or a function.
    word : float or str
        The number, the name, or the operation.
    parts : tuple of Node
        The operands.
    """

    kind: str
    word: Any
    parts: tuple[Node, ...] = ()

    @property
    def text(self) -> str:
        """The step as text."""
        operands = [part.text for part in self.parts]
        if self.kind != "call":
            return f"{self.word:g}" if self.kind == "number" else self.word
        if self.word in ("neg", "pos"):
            return f"{'-' if self.word == 'neg' else '+'}{operands[0]}"
        if self.word in WORDS or self.word in FUNCTIONS:
            return f"{self.word}({', '.join(operands)})"
        return f"({operands[0]} {self.word} {operands[1]})"

    @property
    def is_measured(self) -> bool:
        """Whether the expression contains a measure of the motion."""
        return self.word in MEASURES or any(part.is_measured for part in self.parts)

    def names(self) -> set[str]:
        """Return the names in the expression."""
        names = {self.word} if self.kind == "name" else set()
        return names.union(*(part.names() for part in self.parts))


@dataclasses.dataclass(frozen=True)
class Relation:
    """A condition that a design must fulfill: ``left <= right``, or ``left == right``.

    Parameters
    ----------
    text : str
        The given text, or one of the two relations of a double comparison.
    left, right : Node
    equal : bool
        Whether both must be equal.
    dimensions : tuple of Dimension or None
        Dimensions of sides with a unit.
    """

    text: str
    left: Node
    right: Node
    equal: bool
    dimensions: tuple[Dimension | None, Dimension | None] = (None, None)

    @property
    def bound_left(self) -> bool:
        """Whether the left side is the bound: a number, or the only side without a measure."""
        if self.left.is_measured != self.right.is_measured:
            return self.right.is_measured
        return self.left.kind == "number"


def parsed(text: str) -> Node:
    """Return a parsed expression of measures as nested steps.

    Raises
    ------
    ExpressionError
        If the text contains something that is not allowed; the message names it and its column.
    """
    return Expression(text, functions=WORDS).folded(
        lambda number: Node("number", number),
        lambda name: Node("name", name),
        lambda word, parts: Node("call", word, tuple(parts)),
    )


def parsed_relations(text: str) -> list[Relation]:
    """Return the conditions in a text: ``a <= b``, ``a == b``, or ``a <= b <= c``, which gives two.

    A side that is a number may have a unit.

    Raises
    ------
    ExpressionError, UnitError
        If the text is not a comparison, or a side cannot be read.
    """
    if not isinstance(text, str):
        raise ExpressionError("a condition must be text, such as 'span(psi) == 60 deg'", value=text)
    entries = _RELATION.split(text)
    if not 3 <= len(entries) <= 5:
        message = "a condition is a comparison by <=, >= or ==, such as 'peak(psi, 4) <= 20'"
        raise ExpressionError(message, value=text)
    sides = [_side(entry) for entry in entries[::2]]
    relations = []
    for k, sign in enumerate(entries[1::2]):
        (left, first), (right, second) = sides[k : k + 2][:: -1 if ">" in sign else 1]
        is_equality = sign in ("==", "=")
        phrase = text.strip() if len(entries) == 3 else f"{left.text} {'==' if is_equality else '<='} {right.text}"
        relations.append(Relation(phrase, left, right, is_equality, (first, second)))
    return relations


def _side(text: str) -> tuple[Node, Dimension | None]:
    """Return one side of a comparison, and its dimension if it has a unit."""
    try:
        return parsed(text), None
    except ExpressionError:
        if not _NUMBER.match(text):
            raise
        try:
            value = parse_value(text.strip(), "any")
        except JounceError as error:
            raise error.located(value=text.strip()) from None
        if isinstance(value.value, Expression):
            raise
        return Node("number", value.value), value.dimension


def folded(node: Node, number: Callable[[Any], Any], name: Callable[[str], Any], call: Callable[..., Any]) -> Any:
    """Return the fold of an expression by functions of numbers, names and calls; calls get their node."""
    if node.kind == "number":
        return number(node.word)
    if node.kind == "name":
        return name(node.word)
    return call(node)


def operated(operation: str, values: list[Any]) -> Any:
    """Return the result of one operation on numbers, arrays of JAX or jets."""
    names = [f"x{k}" for k in range(len(values))]
    if operation in ("pos", "neg"):
        text = f"{'-' if operation == 'neg' else '+'}x0"
    else:
        text = f"{operation}({', '.join(names)})" if operation in FUNCTIONS else f"x0 {operation} x1"
    is_literal = operation == "**" and isinstance(values[1], float)
    if is_literal:  # keep a whole exponent as a literal
        return Expression(f"x0 ** ({values[1]!r})").evaluate({"x0": values[0]})
    return Expression(text).evaluate(dict(zip(names, values, strict=True)))


def refuse_name(name: str, known: Mapping[str, str], text: str) -> ExpressionError:
    """Return the error for an unknown name, with the known names by kind."""
    kinds: dict[str, list[str]] = {}
    for known_name, kind in known.items():
        kinds.setdefault(kind, []).append(known_name)
    known_names = "; ".join(f"{kind}: {', '.join(names)}" for kind, names in kinds.items())
    hint = did_you_mean(name, known, limit=0)
    return ExpressionError(f"unknown name '{name}' in {show_value(text)}; {hint} {known_names}".replace(";  ", "; "))


def varying_message(text: str) -> MechanismError:
    """Return the error for a time-dependent quantity that is compared or minimized."""
    return MechanismError(
        f"changes in time; reduce it to one number, for example by peak({text}), rms({text}), mean({text}), "
        f"span({text}), "
        f"maximum({text}), minimum({text}) or at({text}, 0.5)",
        value=text,
    )
