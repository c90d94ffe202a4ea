"""Equations as a C99 file that needs only the mathematical library."""

import math
import textwrap
from collections.abc import Sequence
from functools import partial

from jounce.version import __version__
from jounce.written_equations.operations.functions import Argument, Code, Function, Stage, stages
from jounce.written_equations.operations.graph import REAL, Node
from jounce.written_equations.operations.statements import (
    ATOM,
    COMPARISON,
    INFIX,
    SUM,
    Names,
    Statements,
    Text,
    infix,
    one_line,
    used_inputs,
    wrapped,
)

_INFIX = INFIX | {"and": ("&&", COMPARISON), "or": ("||", COMPARISON)}
_CALLED = {"abs": "fabs", "rem": "fmod", "round": "rint", "is_finite": "isfinite"}
_HELPERS = {
    "sign": "static double sign(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x; }",
    "max": "static double larger(double a, double b) { return a != a || a > b ? a : b; }",
    "min": "static double smaller(double a, double b) { return a != a || a < b ? a : b; }",
}
_HELPER_NAMES = {"sign": "sign", "max": "larger", "min": "smaller"}
_comment = partial(textwrap.wrap, width=110, initial_indent=" * ", subsequent_indent=" * ")


def number(value: object) -> str:
    """Return the text of a number that C reads back exactly."""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float) and not math.isfinite(value):
        return "NAN" if math.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"
    return repr(value)


class _File:
    """The functions of a C file, each with its own statements."""

    def __init__(self, code: Code, prefix: str):
        self.code, self.graph, self.prefix = code, code.graph, prefix
        self.tables: dict[tuple, str] = {}
        self.helpers: set[str] = set()

    def expression(self, node: Node, operands: Sequence[Text]) -> Text:
        name = node.operation
        if name == "constant":
            negative = not isinstance(node.detail, bool) and node.detail < 0
            return Text(number(node.detail), SUM if negative else ATOM)
        if name == "lookup":
            table = self.tables.setdefault(node.detail, f"table{len(self.tables) + 1}")
            return Text(f"{table}[{operands[0].text}]")
        if name in _INFIX:
            return infix(operands[0], *_INFIX[name], operands[1])
        if name == "neg":
            return Text(f"-{operands[0].text}" if operands[0].tightness > SUM else f"-({operands[0].text})", SUM)
        if name == "not":
            return Text(f"!({operands[0].text})")
        if name == "where":
            condition, then, otherwise = (f"({x.text})" if x.tightness < ATOM else x.text for x in operands)
            return Text(f"({condition} ? {then} : {otherwise})")
        if name in ("real", "whole"):
            return Text(f"({'double' if name == 'real' else 'int'})({operands[0].text})")
        if name in _HELPERS and node.kind == REAL:
            self.helpers.add(name)
            return Text(f"{_HELPER_NAMES[name]}({', '.join(x.text for x in operands)})")
        if name in ("max", "min"):
            (a, b), sign = (f"({x.text})" if x.tightness < ATOM else x.text for x in operands), "><"[name == "min"]
            return Text(f"({a} {sign} {b} ? {a} : {b})")
        return Text(f"{_CALLED.get(name, name)}({', '.join(x.text for x in operands)})")

    def head(self, function: Function) -> str:
        """Return the first line of a function."""
        given = [
            f"double {x.name}" if isinstance(x.labels, str) else f"const double *{x.name}" for x in function.arguments
        ]
        orders = ["int orders"] if function.by_order else []
        return f"void {self.prefix}_{function.name}({', '.join([*given, *orders, 'double *out'])})"

    def described(self, function: Function) -> list[str]:
        """Return the comment lines before a function."""
        text = f"{function.text}: out[{']['.join(x.upper() for x in function.axes)}], the last index running fastest."
        if function.by_order:
            text += f" orders: how many of them are requested, at most {len(function.results)}."
        lines = ["/*", *_comment(text)]
        for x in function.arguments:
            rows = f", {_rows(x)} of them" if x.by_order else ""
            lines += _comment(f"{x.name}: {x.text}{rows}.")
        return [*lines, " */"]

    def function(self, function: Function) -> str:
        names, roots = Names(self.code.names), function.roots
        statements = Statements(self.graph, self.expression, names.of, _assignment)
        counts, needed = statements.shared(roots), used_inputs(self.graph, roots)
        for argument in function.arguments:  # a scalar has the name of the argument
            if isinstance(argument.labels, str):
                names.fix(argument.labels, argument.name)
        lines = [*self.described(function), self.head(function), "{"]
        entries = [(row[0], label) for stage in stages(function) for row in stage.rows for label in row[0].row(row[1])]
        used = {argument.name for argument, label in entries if label in needed}
        lines += [f"    (void){x.name};" for x in function.arguments if x.name not in used]
        lines += [] if roots else ["    (void)out;"] + ["    (void)orders;"] * function.by_order
        place = 0
        for k, stage in enumerate(stages(function)):
            if function.by_order and roots:
                lines += [f"    if (orders < {k + 1}) {{", "        return;", "    }"]
            lines += _unpacked(names, stage, needed)
            results = [int(x) for x in stage.results.ravel()]
            lines += statements.write(results, counts)
            lines += [f"    out[{place + i}] = {statements.text(x)};" for i, x in enumerate(results)]
            place += len(results)
        return "\n".join([*lines, "}"])


def _rows(argument: Argument) -> str:
    """Return the number of orders that an argument by order needs."""
    shift = argument.lead - 1
    return "orders" if not shift else f"orders {'+-'[shift < 0]} {abs(shift)}"


def _assignment(name: str, text: str, kind: str) -> str:
    return f"    const {'double' if kind == REAL else 'int'} {name} = {text};"


def c_file(code: Code, name: str) -> str:
    """Return the text of a file with the functions of some code; `name` is the prefix of their names."""
    file = _File(code, name)
    functions = [file.function(function) for function in code.functions]
    lines = ["/*", f" * {one_line(code.title)}: {code.subject}, written by jounce {__version__}.", " *"]
    for paragraph in code.about:
        lines += [*_comment(paragraph), " *"]
    for noun, labels in code.labels.items():
        lines += [f" * {noun}:", *wrapped([one_line(x) for x in labels], indent=" *   ")]
    lines += [" */", "#include <math.h>", ""]
    counts = {key: len(labels) for key, labels in code.labels.items()} | {"ORDER": code.order}
    lines += ["enum {", *(f"    {name.upper()}_{key} = {count}," for key, count in counts.items())]
    lines[-1] = lines[-1].rstrip(",")
    lines += ["};", "", *(f"{file.head(function)};" for function in code.functions), ""]
    for key, values in code.values.items():
        lines += [f"extern const double {name}_{key.lower()}[{len(values)}];"]
        lines += [
            f"const double {name}_{key.lower()}[{len(values)}] = {{",
            *wrapped(list(map(number, values))),
            "};",
            "",
        ]
        lines[-3] = lines[-3].rstrip(",")
    for values, table in file.tables.items():
        kind = "double" if isinstance(values[0], float) else "int"
        lines += [f"static const {kind} {table}[{len(values)}] = {{", *wrapped([number(x) for x in values]), "};", ""]
        lines[-3] = lines[-3].rstrip(",")
    lines += [_HELPERS[helper] for helper in sorted(file.helpers)] + [""] * bool(file.helpers)
    return "\n".join([*lines, *("\n" + function for function in functions)]).replace("\n\n\n", "\n\n") + "\n"


def _unpacked(names: Names, stage: Stage, needed: set) -> list[str]:
    lines = []
    for argument, order in stage.rows:
        if not isinstance(argument.labels, str):
            first = 0 if order is None else order * len(argument.labels[0])
            lines += [
                f"    const double {names.of(x)} = {argument.name}[{first + k}];"
                for k, x in enumerate(argument.row(order))
                if x in needed
            ]
    return lines
