"""Equations as a module of Python that needs NumPy alone."""

import math
from collections.abc import Sequence

import numpy as np

from jounce.version import __version__
from jounce.written_equations.graph import Graph, Node
from jounce.written_equations.mechanism_equations import MechanismEquations
from jounce.written_equations.statements import (
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

_INFIX = INFIX | {"and": ("&", COMPARISON), "or": ("|", COMPARISON)}
_CALLED = {
    "max": "np.maximum", "min": "np.minimum", "rem": "np.fmod", "abs": "np.abs", "sign": "np.sign", "pow": "np.power",
    "atan2": "np.arctan2", "is_finite": "np.isfinite", "where": "np.where", "asin": "np.arcsin", "acos": "np.arccos",
    "atan": "np.arctan", "asinh": "np.arcsinh", "acosh": "np.arccosh", "atanh": "np.arctanh", "round": "np.rint",
    "not": "np.logical_not",
}  # fmt: skip
_LIBRARY = {"erf": "math.erf", "erfc": "math.erfc"}  # NumPy has none


def number(value: object) -> str:
    """Return a number as Python reads it back exactly."""
    if isinstance(value, float) and not math.isfinite(value):
        return "np.nan" if math.isnan(value) else "np.inf" if value > 0 else "-np.inf"
    return repr(value)


class _Tables:
    """The tables of numbers that a module holds."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._known: dict[tuple, str] = {}

    def name_of(self, values: tuple) -> str:
        if values not in self._known:
            self._known[values] = f"table{len(self._known) + 1}"
            self.lines.append(f"{self._known[values]} = np.array([")
            self.lines += wrapped([number(x) for x in values])
            self.lines.append("])")
        return self._known[values]


class _Module:
    """Functions of Python, each with statements of its own."""

    def __init__(self, graph: Graph):
        self.graph, self.tables, self.vectorized = graph, _Tables(), set[str]()

    def expression(self, node: Node, operands: Sequence[Text]) -> Text:
        name = node.operation
        if name == "constant":
            negative = isinstance(node.detail, float | int) and node.detail < 0
            return Text(number(node.detail), SUM if negative else ATOM)
        if name == "lookup":
            return Text(f"{self.tables.name_of(node.detail)}[{operands[0].text}]")
        if name in _INFIX:
            return infix(operands[0], *_INFIX[name], operands[1])
        if name == "neg":
            return Text(f"-{operands[0].text}" if operands[0].tightness > SUM else f"-({operands[0].text})", SUM)
        if name in ("real", "whole"):
            return infix(operands[0], "*", PRODUCT, Text("1.0" if name == "real" else "1"))
        if name in _LIBRARY:
            self.vectorized.add(name)
        called = name if name in _LIBRARY else _CALLED.get(name, f"np.{name}")
        return Text(f"{called}({', '.join(x.text for x in operands)})")

    def statements(self, names: Names) -> Statements:
        return Statements(
            self.graph, self.expression, lambda label: "t" if label == "t" else names.of(label), _assignment
        )


def _assignment(name: str, text: str, kind: str) -> str:
    del kind
    return f"    {name} = {text}"


def python_module(equations: MechanismEquations) -> str:
    """Return the text of a module with the equations of a mechanism."""
    module = _Module(equations.graph)
    functions = [
        _residual(module, equations), "", "", _jacobian(module, equations), "", "", _right_side(module, equations)
    ]  # fmt: skip
    lines = [f'"""{_title(equations)}', "", *_HEAD, '"""', ""]
    if module.vectorized:
        lines += ["import math", ""]
    lines += ["import numpy as np", "", f"ORDER = {equations.order}"]
    for name, labels in (
        ("COORDINATES", equations.coordinates),
        ("COLUMNS", equations.columns),
        ("ROWS", equations.rows),
    ):
        lines += [f"{name} = (", *wrapped([repr(x) for x in labels]), ")"]
    lines += [f"{name} = np.vectorize({_LIBRARY[name]})" for name in sorted(module.vectorized)]
    lines += module.tables.lines
    return "\n".join([*lines, "", "", *functions]) + "\n"


_HEAD = """\
Phi(q, t) = 0, and each time derivative of it, Phi_q q^(k) = right_side(k). SI units. Each function takes one instant;
with further axes behind the first ones, it takes many of them at once.

COORDINATES are the entries of q: global positions of the origins of the bodies, m, angles, rad, and in space Euler
parameters from the body to the global frame, the scalar first. COLUMNS are those of the Jacobian, and of velocities:
derivatives of positions and angles, and in space angular velocities along the axes of the body, rad/s, and their
derivatives. ROWS are those of the joints and drivers.""".splitlines()


def _title(equations: MechanismEquations) -> str:
    title = one_line(equations.title).replace("\\", "/").replace('"', "'")
    return f"{title}: constraint equations, written by jounce {__version__}."


def _unpacked(names: Names, labels: Sequence[str], needed: set, source: str) -> list[str]:
    return [f"    {names.of(x)} = {source}[{k}]" for k, x in enumerate(labels) if x in needed]


def _residual(module: _Module, equations: MechanismEquations) -> str:
    names, roots = Names(), equations.residual.tolist()
    statements = module.statements(names)
    lines = [
        "def residual(t, q):",
        '    """Return Phi, (row,), from the time, s, and the coordinates, (coordinate,)."""',
    ]
    lines += _unpacked(names, equations.coordinates, used_inputs(equations.graph, roots), "q")
    lines += statements.write(roots, statements.shared(roots))
    lines += [f"    out = np.zeros(({len(roots)}, *np.broadcast_shapes(np.shape(t), np.shape(q)[1:])))"]
    lines += [f"    out[{k}] = {statements.text(x)}" for k, x in enumerate(roots) if not _zero(equations.graph, x)]
    return "\n".join([*lines, "    return out"])


def _jacobian(module: _Module, equations: MechanismEquations) -> str:
    names, graph = Names(), equations.graph
    rows, columns = equations.jacobian.shape
    statements = module.statements(names)
    entries = [(i, j, int(equations.jacobian[i, j])) for i, j in np.ndindex(rows, columns)]
    entries = [(i, j, x) for i, j, x in entries if not _zero(graph, x)]
    roots = [x for *_, x in entries]
    lines = ["def jacobian(t, q):", '    """Return Phi_q, (row, column), from the time, s, and the coordinates."""']
    lines += _unpacked(names, equations.coordinates, used_inputs(graph, roots), "q")
    lines += statements.write(roots, statements.shared(roots))
    lines += [f"    out = np.zeros(({rows}, {columns}, *np.broadcast_shapes(np.shape(t), np.shape(q)[1:])))"]
    lines += [f"    out[{i}, {j}] = {statements.text(x)}" for i, j, x in entries]
    return "\n".join([*lines, "    return out"])


def _right_side(module: _Module, equations: MechanismEquations) -> str:
    names, graph = Names(), equations.graph
    statements = module.statements(names)
    roots = [int(x) for x in equations.right_side.ravel()]
    counts, needed = statements.shared(roots), used_inputs(graph, roots)
    rows = len(equations.rows)
    lines = [
        "def right_side(t, q, velocities):",
        '    """Return Phi_q q^(k) for k = 1, 2, ..., (order, row): nu, gamma, eta, sigma and those beyond.',
        "",
        "    What belongs to q^(k) follows from the derivatives below it: from velocities, (order, column), that is",
        f"    q', q'', ..., of n orders, n + 1 follow, to {equations.order}.",
        '    """',
        f"    orders = min(len(velocities) + 1, {equations.order})",
        "    shape = np.broadcast_shapes(np.shape(t), np.shape(q)[1:], np.shape(velocities)[2:])",
        f"    out = np.zeros((orders, {rows}, *shape))",
    ]
    lines += _unpacked(names, equations.coordinates, needed, "q")
    for k, side in enumerate(equations.right_side.tolist()):
        if k:
            lines += [f"    if orders < {k + 1}:", "        return out"]
            lines += _unpacked(names, equations.velocities[k - 1], needed, f"velocities[{k - 1}]")
        lines += statements.write(side, counts)
        lines += [f"    out[{k}, {i}] = {statements.text(x)}" for i, x in enumerate(side) if not _zero(graph, x)]
    return "\n".join([*lines, "    return out"])


def _zero(graph: Graph, number_of_node: int) -> bool:
    return graph.is_constant(number_of_node) and graph.value(number_of_node) == 0
