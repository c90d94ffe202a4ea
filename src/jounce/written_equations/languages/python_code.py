"""Equations as a Python module that needs only NumPy."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from jounce.version import __version__
from jounce.written_equations.operations.functions import Argument, Code, Function, Stage, stages
from jounce.written_equations.operations.graph import Node
from jounce.written_equations.operations.statements import (
    ATOM,
    COMPARISON,
    INFIX,
    PRODUCT,
    SUM,
    Names,
    Statements,
    Text,
    infix,
    one_line,
    used_inputs,
    wrapped,
)

WIDTH = 110
_CALLED = {
    "max": "maximum", "min": "minimum", "rem": "fmod", "pow": "power", "atan2": "arctan2", "is_finite": "isfinite",
    "asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh", "acosh": "arccosh", "atanh": "arctanh",
    "round": "rint", "not": "logical_not",
}  # fmt: skip
_LIBRARY = {"erf": "math.erf", "erfc": "math.erfc"}  # functions that NumPy lacks


def number(value: object) -> str:
    """Return the text of a number that Python reads back exactly."""
    if isinstance(value, float) and not math.isfinite(value):
        return "np.nan" if math.isnan(value) else "np.inf" if value > 0 else "-np.inf"
    return repr(value)


class NumPyModule:
    """The text of a NumPy module of functions, each with its own statements."""

    infix: ClassVar[dict[str, tuple[str, int]]] = INFIX | {"and": ("&", COMPARISON), "or": ("|", COMPARISON)}
    heading: ClassVar[tuple[str, ...]] = (
        "Each function takes one instant; with further axes behind the first ones, it takes many of them at once.",
    )

    def __init__(self, code: Code):
        self.code, self.graph = code, code.graph
        self._tables: dict[tuple, list[str]] = {}
        self._vectorized: set[str] = set()

    def text(self) -> str:
        """Return the text of the module."""
        functions = [self.function(function) for function in self.code.functions]
        title = one_line(self.code.title).replace("\\", "/").replace('"', "'")
        lines = [f'"""{title}: {self.code.subject}, written by jounce {__version__}.']
        for paragraph in (*self.code.about, *self.heading):
            lines += ["", *textwrap.wrap(paragraph, WIDTH)]
        lines += ['"""', "", *self.imports(), "", f"ORDER = {self.code.order}"]
        for name, labels in self.code.labels.items():
            lines += [f"{name} = (", *wrapped([repr(x) for x in labels]), ")"] if labels else [f"{name} = ()"]
        for name, values in self.code.values.items():
            lines += [f"{name} = (", *wrapped([repr(x) for x in values]), ")"]
        lines += self.constants()
        return "\n".join([*lines, *("\n\n" + function for function in functions)]) + "\n"

    def imports(self) -> list[str]:
        """Return the import lines."""
        return [*(["import math", ""] if self._vectorized else []), "import numpy as np"]

    def constants(self) -> list[str]:
        """Return the lines that define constants and helpers before the functions."""
        lines = [f"{name} = np.vectorize({_LIBRARY[name]})" for name in sorted(self._vectorized)]
        return lines + [line for table in self._tables.values() for line in table]

    def expression(self, node: Node, operands: Sequence[Text]) -> Text:
        """Return the text of an operation."""
        name, texts = node.operation, [x.text for x in operands]
        if name == "constant":
            return self.constant(node.detail)
        if name == "lookup":
            return Text(f"{self._table(node.detail)}[{texts[0]}]")
        if name in self.infix:
            return infix(operands[0], *self.infix[name], operands[1])
        if name == "neg":
            return Text(f"-{texts[0]}" if operands[0].tightness > SUM else f"-({texts[0]})", SUM)
        return self.called(name, operands)

    def constant(self, value: Any) -> Text:
        """Return the text of a number."""
        return Text(number(value), SUM if isinstance(value, float | int) and value < 0 else ATOM)

    def called(self, name: str, operands: Sequence[Text]) -> Text:
        """Return the text of a function of operands."""
        if name in ("real", "whole"):
            return infix(operands[0], "*", PRODUCT, Text("1.0" if name == "real" else "1"))
        if name in _LIBRARY:
            self._vectorized.add(name)
        function_name = name if name in _LIBRARY else f"np.{_CALLED.get(name, name)}"
        return Text(f"{function_name}({', '.join(x.text for x in operands)})")

    def _table(self, values: tuple) -> str:
        if values not in self._tables:
            name = f"table{len(self._tables) + 1}"
            self._tables[values] = [f"{name} = np.array([", *wrapped([number(x) for x in values]), "])"]
        return self._tables[values][0].partition(" ")[0]

    def function(self, function: Function) -> str:
        """Return the text of a function."""
        names, roots = Names(self.code.names), function.roots
        statements = Statements(self.graph, self.expression, names.of, _assignment)
        counts, needed = statements.shared(roots), used_inputs(self.graph, roots)
        for argument in function.arguments:  # a scalar has the name of the argument
            if isinstance(argument.labels, str):
                names.fix(argument.labels, argument.name)
        lines = [f"def {function.name}({', '.join(self.parameter(x) for x in function.arguments)}):"]
        lines += [*_documented(function), *self.before(function)]
        for k, stage in enumerate(stages(function)):
            if k:
                lines += self.until(k)
            lines += _unpacked(names, stage, needed)
            lines += statements.write([int(x) for x in stage.results.ravel()], counts)
            lines += self.put(function, k, stage, statements)
        return "\n".join([*lines, "    return out"])

    def parameter(self, argument: Argument) -> str:
        """Return the text of an argument in a definition."""
        return argument.name

    def before(self, function: Function) -> list[str]:
        """Return the lines before the first results."""
        shapes = [f"np.shape({x.name}){_axes(x)}" for x in function.arguments]
        shape = f"np.broadcast_shapes({', '.join(shapes)})"
        if not function.by_order:
            sizes = ", ".join(map(str, function.results.shape))
            return [f"    out = np.zeros(({sizes}, *{shape}))"]
        sizes = "".join(f"{n}, " for n in function.results.shape[1:])
        return [*_orders(function), f"    shape = {shape}", f"    out = np.zeros((orders, {sizes}*shape))"]

    def until(self, k: int) -> list[str]:
        """Return the lines before the results of a further order."""
        return [f"    if orders < {k + 1}:", "        return out"]

    def put(self, function: Function, k: int, stage: Stage, statements: Statements) -> list[str]:
        """Return the lines that store results."""
        lines, first = [], (k,) if function.by_order else ()
        for place in np.ndindex(*stage.results.shape):
            root = int(stage.results[place])
            if not (self.graph.is_constant(root) and self.graph.value(root) == 0):
                lines.append(f"    out[{', '.join(map(str, (*first, *place)))}] = {statements.text(root)}")
        return lines


def _assignment(name: str, text: str, kind: str) -> str:
    del kind
    return f"    {name} = {text}"


def _documented(function: Function) -> Iterator[str]:
    """Return the lines of the docstring of a function."""
    axes = ", ".join(function.axes) + ("," if len(function.axes) == 1 else "")
    remark = ", for as many orders as the arguments are enough for" if function.by_order else ""
    first = f'"""{function.text}, ({axes}){remark}.'
    paragraphs = [f"{x.name}: {x.text}." for x in function.arguments]
    yield from textwrap.wrap(first, WIDTH, subsequent_indent="    ", initial_indent="    ")
    yield ""
    for paragraph in paragraphs:
        yield from textwrap.wrap(paragraph, WIDTH, initial_indent="    ", subsequent_indent="    ")
    yield '    """'


def _orders(function: Function) -> list[str]:
    """Return the line that computes the number of orders for which the arguments suffice."""
    shift = {x.name: 1 - x.lead for x in function.arguments if x.by_order}
    lengths = [f"len({name})" + (f" {'+-'[n < 0]} {abs(n)}" if n else "") for name, n in shift.items()]
    return [f"    orders = max(0, min({', '.join([*lengths, str(len(function.results))])}))"]


def _axes(argument: Argument) -> str:
    return "[2:]" if argument.by_order else "" if isinstance(argument.labels, str) else "[1:]"


def _unpacked(names: Names, stage: Stage, needed: set) -> list[str]:
    lines = []
    for argument, order in stage.rows:
        if not isinstance(argument.labels, str):
            source = argument.name if order is None else f"{argument.name}[{order}]"
            lines += [f"    {names.of(x)} = {source}[{k}]" for k, x in enumerate(argument.row(order)) if x in needed]
    return lines


def python_module(code: Code) -> str:
    """Return the text of a NumPy module."""
    return NumPyModule(code).text()
