"""Equations as a Python module that makes SymPy expressions; writing the module does not need SymPy."""

import math
from collections.abc import Sequence
from typing import Any

from jounce.written_equations.languages.python_code import NumPyModule
from jounce.written_equations.operations.functions import Argument, Code, Function, Stage
from jounce.written_equations.operations.statements import (
    ATOM,
    INFIX,
    SUM,
    Names,
    Statements,
    Text,
    wrapped,
)

_CALLED = {
    "max": "sp.Max", "min": "sp.Min", "rem": "rem", "abs": "sp.Abs", "ceil": "sp.ceiling", "eq": "sp.Eq", "ne": "sp.Ne",
    "and": "sp.And", "or": "sp.Or", "not": "sp.Not", "round": "rounded", "expm1": "expm1", "log1p": "log1p",
    "pow": "sp.Pow", "is_finite": "is_finite", "hypot": "hypot",
}  # fmt: skip
_HELPERS = {
    # the evaluation of sp.Mod searches for common divisors, which takes minutes in long expressions
    "rem": (
        "x, y",
        "size, divisor = sp.Abs(x), sp.Abs(y)",
        "known = not (size.free_symbols or divisor.free_symbols)",
        "return sp.sign(x) * sp.Mod(size, divisor, evaluate=known)",
    ),
    "rounded": (  # halves to the even number
        "x",
        "low, high = sp.ceiling(x - sp.Rational(1, 2)), sp.floor(x + sp.Rational(1, 2))",
        "return low + (1 - (-1) ** low) / 2 * (high - low)",
    ),
    "hypot": ("x, y", "return sp.sqrt(x**2 + y**2)"),
    "expm1": ("x", "return sp.exp(x) - 1"),
    "log1p": ("x", "return sp.log(1 + x)"),
    "is_finite": ("x", "return sp.true"),
}


class SymPyModule(NumPyModule):
    """The text of a SymPy module, whose functions return matrices of expressions."""

    infix = {name: text for name, text in INFIX.items() if name not in ("eq", "ne")}
    heading = (
        "Needs SymPy. Each function returns expressions of its arguments, by default of the symbols below; of others, "
        "such as functions of time, where they are given. sp.lambdify(..., cse=True) makes functions of numbers.",
    )

    def imports(self) -> list[str]:
        """Return the import lines."""
        return ["import sympy as sp"]

    def constants(self) -> list[str]:
        """Return the lines that define symbols, and functions that SymPy lacks."""
        lines, names = [], Names(self.code.names)
        for argument in {x.name: x for function in self.code.functions for x in function.arguments}.values():
            if isinstance(argument.labels, str):
                lines.append(f'{argument.name} = sp.Symbol("{argument.name}", real=True)')
                continue
            lines.append(f"{argument.name} = " + ("(" if argument.by_order else _symbols(names, argument.labels)))
            if argument.by_order:
                lines += [f"    {_symbols(names, row)}," for row in argument.labels] + [")"]
        for name in sorted(self._vectorized):
            given, *body = _HELPERS[name]
            lines += ["", "", f"def {name}({given}):", *(f"    {line}" for line in body)]
        return lines

    def parameter(self, argument: Argument) -> str:
        """Return the text of an argument in a definition, a symbol by default."""
        return f"{argument.name}={argument.name}"

    def constant(self, value: Any) -> Text:
        """Return the text of a number: whole numbers exactly, other numbers as doubles."""
        if isinstance(value, bool):
            return Text("sp.true" if value else "sp.false")
        if not math.isfinite(value):
            return Text("sp.nan" if math.isnan(value) else "sp.oo" if value > 0 else "(-sp.oo)")
        is_integer = float(value).is_integer() and abs(value) < 2**53
        return Text(repr(int(value) if is_integer else value), SUM if value < 0 else ATOM)

    def called(self, name: str, operands: Sequence[Text]) -> Text:
        """Return the text of a function of operands."""
        texts = [x.text for x in operands]
        if name == "where":
            return Text(f"sp.Piecewise(({texts[1]}, {texts[0]}), ({texts[2]}, True))")
        if name in ("real", "whole"):
            return operands[0]
        function_name = _CALLED.get(name, f"sp.{name}")
        if function_name in _HELPERS:
            self._vectorized.add(function_name)
        return Text(f"{function_name}({', '.join(texts)})")

    def before(self, function: Function) -> list[str]:
        """Return the lines before the first results."""
        return ["    out = []"] if function.by_order else []

    def until(self, k: int) -> list[str]:
        """Return the lines before the results of a further order."""
        del k
        return []

    def put(self, function: Function, k: int, stage: Stage, statements: Statements) -> list[str]:
        """Return the lines that store results."""
        del k
        texts = [statements.text(int(x)) for x in stage.results.ravel()]
        shape = stage.results.shape
        if not shape:
            return [f"    out.append({texts[0]})"]
        rows, columns = shape if len(shape) == 2 else (shape[0], 1)
        opening = "out.append(" if function.by_order else "out = ("
        return [f"    {opening}sp.Matrix({rows}, {columns}, [", *wrapped(texts, indent=" " * 8), "    ]))"]


def _symbols(names: Names, labels: Sequence[str]) -> str:
    return f"sp.symbols({[names.of(x) for x in labels]!r}, real=True)"


def sympy_module(code: Code) -> str:
    """Return the text of a SymPy module."""
    return SymPyModule(code).text()
