"""Mechanism files for the judge: a second reader of the same schema, with its own units and expressions."""

import ast
import operator
import re
from pathlib import Path

from mpmath import mp
from ruamel.yaml import YAML

from tests.oracles.mp_series import FUNCTIONS

UNITS = {
    "m": (1, 1),
    "cm": (1, 100),
    "mm": (1, 1000),
    "km": (1000, 1),
    "s": (1, 1),
    "ms": (1, 1000),
    "min": (60, 1),
    "rad": (1, 1),
    "kg": (1, 1),
    "g": (1, 1000),
}
NUMBER_WITH_UNIT = re.compile(r"^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s+([A-Za-z]+)\s*$")
OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def read(path):
    """Return the plain dict of a YAML mechanism file."""
    return YAML(typ="safe", pure=True).load(Path(path).read_text(encoding="utf-8"))


def value(entry, names=None, ctx=mp):
    """Return an entry of a file as a number in SI units, or as a series when a name in it stands for one.

    With ``ctx=mp`` a decimal in the file is taken exactly as typed (13.21 is 1321/100), never through its nearest
    double; with ``ctx=fp`` everything is a float.
    """
    if isinstance(entry, (int, float)):
        return ctx.mpf(repr(entry))
    if not isinstance(entry, str):
        return entry
    match = NUMBER_WITH_UNIT.match(entry)
    if match and match[2] == "deg":
        return ctx.mpf(match[1]) * ctx.pi / 180
    if match and match[2] in UNITS:
        up, down = UNITS[match[2]]
        return ctx.mpf(match[1]) * up / down
    constants = {"pi": +ctx.pi, "deg": ctx.pi / 180}
    return _evaluate(ast.parse(entry, mode="eval").body, constants | (names or {}), ctx)


def vector(entries, names=None, ctx=mp):
    """Return a list of entries as values."""
    return [value(entry, names, ctx) for entry in entries]


def parameters(description, ctx=mp):
    """Return the parameters of a mechanism by name."""
    found = {}
    for name, entry in (description.get("parameters") or {}).items():
        found[name] = value(entry, found, ctx)
    return found


def _evaluate(node, names, ctx):
    """Return the value of a syntax tree made of numbers, names, arithmetic and the usual functions."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, int) else ctx.mpf(repr(node.value))
    if isinstance(node, ast.Name):
        return names[node.id]
    if isinstance(node, ast.UnaryOp):
        inner = _evaluate(node.operand, names, ctx)
        return -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.BinOp):
        left, right = _evaluate(node.left, names, ctx), _evaluate(node.right, names, ctx)
        if isinstance(left, int) and isinstance(right, int):
            left = ctx.mpf(left)
        return OPERATORS[type(node.op)](left, right)
    if isinstance(node, ast.Call):
        return FUNCTIONS[node.func.id](*(_evaluate(argument, names, ctx) for argument in node.args))
    raise ValueError(ast.dump(node))
