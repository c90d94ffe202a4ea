"""Equations as a file of C99 that needs the mathematical library alone."""

import math
from collections.abc import Iterable, Sequence

from jounce.version import __version__
from jounce.written_equations.graph import REAL, Graph, Node
from jounce.written_equations.mechanism_equations import MechanismEquations
from jounce.written_equations.statements import (
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


def number(value: object) -> str:
    """Return a number as C reads it back exactly."""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float) and not math.isfinite(value):
        return "NAN" if math.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"
    return repr(value)


class _File:
    """Functions of C, each with statements of its own."""

    def __init__(self, graph: Graph):
        self.graph = graph
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
            condition, yes, no = (f"({x.text})" if x.tightness < ATOM else x.text for x in operands)
            return Text(f"({condition} ? {yes} : {no})")
        if name in ("real", "whole"):
            return Text(f"({'double' if name == 'real' else 'int'})({operands[0].text})")
        if name in _HELPERS and node.kind == REAL:
            self.helpers.add(name)
            return Text(f"{_HELPER_NAMES[name]}({', '.join(x.text for x in operands)})")
        if name in ("max", "min"):
            (a, b), sign = (f"({x.text})" if x.tightness < ATOM else x.text for x in operands), "><"[name == "min"]
            return Text(f"({a} {sign} {b} ? {a} : {b})")
        return Text(f"{_CALLED.get(name, name)}({', '.join(x.text for x in operands)})")

    def statements(self, names: Names) -> Statements:
        return Statements(
            self.graph, self.expression, lambda label: "t" if label == "t" else names.of(label), _assignment
        )


def _assignment(name: str, text: str, kind: str) -> str:
    return f"    const {'double' if kind == REAL else 'int'} {name} = {text};"


def c_file(equations: MechanismEquations, name: str) -> str:
    """Return the text of a file with the equations of a mechanism; `name` begins the names of its functions."""
    file = _File(equations.graph)
    functions = [
        _residual(file, equations, name),
        "",
        _jacobian(file, equations, name),
        "",
        _right_side(file, equations, name),
    ]
    lines = [
        "/*",
        f" * {one_line(equations.title)}: constraint equations, written by jounce {__version__}.",
        *_head(name),
    ]
    for what, labels in (("q", equations.coordinates), ("columns", equations.columns), ("rows", equations.rows)):
        lines += [f" * {what}:", *wrapped([one_line(x) for x in labels], indent=" *   ")]
    lines += [" */", "#include <math.h>", ""]
    counts = {
        "COORDINATES": len(equations.coordinates), "COLUMNS": len(equations.columns), "ROWS": len(equations.rows),
        "ORDER": equations.order,
    }  # fmt: skip
    lines += ["enum {", *(f"    {name.upper()}_{key} = {count}," for key, count in counts.items())]
    lines[-1] = lines[-1].rstrip(",")
    lines += ["};", "", f"void {name}_residual(double t, const double *q, double *out);"]
    lines += [f"void {name}_jacobian(double t, const double *q, double *out);"]
    lines += [
        f"void {name}_right_side(double t, const double *q, const double *velocities, int orders, double *out);",
        "",
    ]
    for values, table in file.tables.items():
        kind = "double" if isinstance(values[0], float) else "int"
        lines += [f"static const {kind} {table}[{len(values)}] = {{", *wrapped([number(x) for x in values]), "};", ""]
        lines[-3] = lines[-3].rstrip(",")
    lines += [_HELPERS[helper] for helper in sorted(file.helpers)] + [""] * bool(file.helpers)
    return "\n".join([*lines, *functions]) + "\n"


def _head(name: str) -> list[str]:
    return [
        " *",
        " * Phi(q, t) = 0, and each time derivative of it, Phi_q q^(k) = right_side(k). SI units.",
        " * q: global positions of the origins of the bodies, m, angles, rad, and in space Euler parameters from",
        " * the body to the global frame, the scalar first. Columns of the Jacobian and of velocities: derivatives",
        " * of positions and angles, and in space angular velocities along the axes of the body, rad/s, and their",
        " * derivatives.",
        f" * {name}_residual: out[ROWS]. {name}_jacobian: out[ROWS][COLUMNS], row after row.",
        f" * {name}_right_side: out[orders][ROWS], orders from 1 to {name.upper()}_ORDER; it reads",
        " * velocities[orders - 1][COLUMNS]: q', q'', and so on.",
        " *",
    ]


def _unpacked(names: Names, labels: Sequence[str], needed: set, source: str, first: int = 0) -> list[str]:
    return [f"    const double {names.of(x)} = {source}[{first + k}];" for k, x in enumerate(labels) if x in needed]


def _reads(labels: Iterable[str], needed: set) -> bool:
    return any(label in needed for label in labels)


def _residual(file: _File, equations: MechanismEquations, name: str) -> str:
    names, roots = Names(), equations.residual.tolist()
    statements, needed = file.statements(names), used_inputs(equations.graph, roots)
    lines = [f"void {name}_residual(double t, const double *q, double *out)", "{"]
    lines += _unused(equations, needed, out=bool(roots))
    lines += _unpacked(names, equations.coordinates, needed, "q")
    lines += statements.write(roots, statements.shared(roots))
    lines += [f"    out[{k}] = {statements.text(x)};" for k, x in enumerate(roots)]
    return "\n".join([*lines, "}"])


def _unused(equations: MechanismEquations, needed: set, *, out: bool) -> list[str]:
    lines = [] if "t" in needed else ["    (void)t;"]
    lines += [] if _reads(equations.coordinates, needed) else ["    (void)q;"]
    return lines + ([] if out else ["    (void)out;"])


def _jacobian(file: _File, equations: MechanismEquations, name: str) -> str:
    names, roots = Names(), [int(x) for x in equations.jacobian.ravel()]
    statements, needed = file.statements(names), used_inputs(equations.graph, roots)
    lines = [f"void {name}_jacobian(double t, const double *q, double *out)", "{"]
    lines += _unused(equations, needed, out=bool(roots))
    lines += _unpacked(names, equations.coordinates, needed, "q")
    lines += statements.write(roots, statements.shared(roots))
    lines += [f"    out[{k}] = {statements.text(x)};" for k, x in enumerate(roots)]
    return "\n".join([*lines, "}"])


def _right_side(file: _File, equations: MechanismEquations, name: str) -> str:
    names, graph = Names(), equations.graph
    statements, rows, columns = file.statements(names), len(equations.rows), len(equations.columns)
    roots = [int(x) for x in equations.right_side.ravel()]
    counts, needed = statements.shared(roots), used_inputs(graph, roots)
    lines = [
        f"void {name}_right_side(double t, const double *q, const double *velocities, int orders, double *out)",
        "{",
        *_unused(equations, needed, out=bool(rows)),
    ]
    if not any(_reads(labels, needed) for labels in equations.velocities):
        lines.append("    (void)velocities;")
    lines += _unpacked(names, equations.coordinates, needed, "q")
    for k, side in enumerate(equations.right_side.tolist()):
        lines += [f"    if (orders < {k + 1}) {{", "        return;", "    }"]
        if k:
            lines += _unpacked(names, equations.velocities[k - 1], needed, "velocities", (k - 1) * columns)
        lines += statements.write(side, counts)
        lines += [f"    out[{k * rows + i}] = {statements.text(x)};" for i, x in enumerate(side)]
    return "\n".join([*lines, "}"])
