"""Expressions of named values, parsed with a whitelist over Python's syntax tree and never passed to ``eval``."""

from __future__ import annotations

import ast
import keyword
import math
import numbers
import operator
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Set as AbstractSet
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NoReturn

from jounce.errors import ExpressionError, JounceError, did_you_mean, show_value
from jounce.units.function_hints import function_hint

CONSTANTS: dict[str, float] = {"pi": math.pi, "deg": math.pi / 180.0}
"""Constants in every expression."""

_UNITS = "mm cm m um km inch s ms min rad mrad rev rpm Hz kHz N kN Nm kg g J W kW MPa bar".split()  # likely units
_NAMES = "sin cos tan asin acos atan atan2 sinh cosh tanh exp log sqrt".split()
FUNCTIONS: dict[str, tuple[int, Callable[..., float]]] = {
    **{name: (2 if name == "atan2" else 1, getattr(math, name)) for name in _NAMES},
    "abs": (1, math.fabs),
    "sign": (1, lambda x: float((x > 0) - (x < 0))),
}
"""Functions in every expression: number of arguments, and implementation for plain numbers."""

RESERVED = frozenset({"t", *CONSTANTS, *FUNCTIONS})
"""Names that no parameter can have."""

PARAMETER_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")
"""Pattern of the name of a parameter."""

MAX_CHARACTERS = 2000
MAX_NESTING = 50

_OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**", ast.UAdd: "pos", ast.USub: "neg"}
_ARITHMETIC: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": operator.pow,
    "neg": operator.neg,
    "pos": operator.pos,
}
_REPORTED = {
    ast.Subscript: "an index in brackets",
    ast.Lambda: "a lambda",
    ast.IfExp: "a conditional",
    ast.Compare: "a comparison",
    ast.BoolOp: "a logical operator",
    ast.List: "a list",
    ast.Tuple: "a comma",
    ast.Dict: "a mapping",
    ast.Set: "a set",
    **dict.fromkeys((ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp), "a comprehension"),
    ast.JoinedStr: "a string",
    ast.NamedExpr: "an assignment",
    ast.Starred: "a starred argument",
    ast.Await: "await",
    **dict.fromkeys((ast.Yield, ast.YieldFrom), "yield"),
}
_ALLOWED = "allowed are numbers, names, + - * / **, parentheses and the usual functions"

# An instruction of the postfix program: kind, operand, number of arguments, column.
_Instruction = tuple[str, Any, int, int]


def check_parameter_name(given: object, error: type[JounceError], **location: Any) -> None:
    """Raise an error unless expressions can use the name of a parameter; `location` says where it is given."""
    if not isinstance(given, str) or not PARAMETER_NAME.fullmatch(given):
        raise error("a name is up to 100 letters, digits, _, not starting with a digit", value=given, **location)
    if given in RESERVED:
        raise error(f"the name '{given}' is reserved for expressions; give another one", **location)
    if keyword.iskeyword(given):
        raise error(f"the word '{given}' cannot be a name in expressions; give another one", **location)


@dataclass(frozen=True, init=False, repr=False)
class Expression:
    """A formula of numbers, names and the usual functions, safe to read from a file.

    Expressions contain numbers, names, ``+ - * / **``, parentheses, the constants ``pi`` and ``deg`` (pi/180), and the
    functions sin cos tan asin acos atan atan2 sinh cosh tanh exp log sqrt abs sign. Angles are in radians. Expressions
    are immutable, and equal if their texts are.

    Parameters
    ----------
    text : str
        The formula, at most 2000 ASCII characters, nested at most 50 deep.
    names : iterable of str, optional
        Permitted free names; any name by default.
    functions : mapping of str to tuple of int, optional
        Additional functions, with their permitted numbers of arguments. Such an expression cannot be evaluated, but
        interpreted by `folded`.

    Attributes
    ----------
    text : str
        The formula, without surrounding spaces.
    names : frozenset of str
        The free names in it, without constants and functions.

    Raises
    ------
    ExpressionError
        If the text contains anything else; the message names the piece and its column.

    Examples
    --------
    >>> law = Expression("30*deg + 60*deg*sin(2*pi*t/tau)")
    >>> sorted(law.names)
    ['t', 'tau']
    >>> round(law.evaluate({"t": 0.5, "tau": 2.0}) / CONSTANTS["deg"], 9)
    90.0
    """

    text: str
    names: frozenset[str] = field(compare=False)
    _program: tuple[_Instruction, ...] = field(compare=False)

    def __init__(
        self,
        text: str,
        names: Iterable[str] | None = None,
        functions: Mapping[str, tuple[int, ...]] | None = None,
    ) -> None:
        if not isinstance(text, str):
            raise ExpressionError("an expression must be text", value=text)
        clean = re.sub(r"\s", " ", text).strip()
        program = _compile(clean, tuple((functions or {}).items()))
        free = frozenset(operand for kind, operand, _, _ in program if kind == "name")
        self.__dict__.update(text=clean, names=free, _program=program)
        if names is not None:
            self.check(names)

    def check(self, names: Iterable[str]) -> None:
        """Raise ExpressionError unless every free name is among ``names``.

        Parameters
        ----------
        names : iterable of str
            The defined names.
        """
        valid_names = names if isinstance(names, Mapping | AbstractSet) else set(names)
        for kind, operand, _, column in self._program:
            if kind == "name" and operand not in valid_names:
                _refuse_name(operand, column, self.text, valid_names)

    def evaluate(self, environment: Mapping[str, Any] | None = None) -> Any:
        """Return the value, in the units of the given values.

        Parameters
        ----------
        environment : mapping of str to number, array, tracer or Jet
            Value of every free name; shapes broadcast.

        Returns
        -------
        float, array or Jet
            A float if every value is a plain number.

        Raises
        ------
        ExpressionError
            If a name has no value, or plain numbers leave the domain of a function (a division by zero, the logarithm
            of a negative number, an overflow). Arrays and jets give ``nan`` or ``inf`` instead.

        Examples
        --------
        >>> Expression("2*a**2 - 1").evaluate({"a": 3})
        17.0
        """
        values = {} if environment is None else environment

        def named(name: str, column: int) -> Any:
            if name not in values:
                _refuse_name(name, column, self.text, values)
            value = values[name]
            return float(value) if isinstance(value, numbers.Real) else value

        return self._folded(float, named, self._apply)

    def folded(
        self, number: Callable[[float], Any], name: Callable[[str], Any], operation: Callable[[str, list[Any]], Any]
    ) -> Any:
        """Return the result of the formula for given interpretations of its numbers, names and operations.

        `operation` takes the word of an operation (``+ - * / ** pos neg``, or a function) and its arguments.
        """
        return self._folded(number, lambda text, _: name(text), lambda word, arguments, _: operation(word, arguments))

    def _folded(self, number: Any, name: Any, operation: Any) -> Any:
        stack: list[Any] = []
        for kind, operand, count, column in self._program:
            if kind == "number":
                stack.append(number(operand))
            elif kind == "name":
                stack.append(name(operand, column))
            else:
                arguments = stack[len(stack) - count :]
                del stack[len(stack) - count :]
                stack.append(operation(operand, arguments, column))
        return stack[0]

    def _apply(self, word: str, arguments: list[Any], column: int) -> Any:
        """Return the result of an operator or function; a float for plain numbers."""
        if not all(isinstance(argument, float) for argument in arguments):
            return _operate_on_arrays(word, arguments)
        try:
            value = FUNCTIONS[word][1](*arguments) if word in FUNCTIONS else _ARITHMETIC[word](*arguments)
            if isinstance(value, complex):  # a root of a negative number
                raise ValueError
        except (ArithmeticError, ValueError) as error:
            problem = "is too large" if isinstance(error, OverflowError) else "is not defined"
        else:
            if math.isfinite(value) or not all(map(math.isfinite, arguments)):
                return value
            problem = "is too large"
        text = _show_operation(word, arguments)
        raise ExpressionError(f"{text} {problem}{_where(column, self.text)}", column=column)

    def __repr__(self) -> str:
        return f"Expression({self.text!r})"

    def __str__(self) -> str:
        return self.text

    def __deepcopy__(self, memo: dict[int, Any]) -> Expression:
        return self


def _show_operation(word: str, arguments: list[float]) -> str:
    """Return the text of an operation on plain numbers, for messages."""
    if word in FUNCTIONS:
        return f"{word}({', '.join(f'{argument:g}' for argument in arguments)})"
    return f" {word} ".join(f"{argument:g}" if argument >= 0 else f"({argument:g})" for argument in arguments)


def _operate_on_arrays(word: str, arguments: list[Any]) -> Any:
    """Return the result of an operator or a function for jets, arrays, tracers and numbers."""
    if word in FUNCTIONS:
        import jounce.jet  # local, to start quickly

        return getattr(jounce.jet, word)(*arguments)
    exponent = arguments[-1]
    if word == "**" and isinstance(exponent, float) and exponent.is_integer() and abs(exponent) <= 1e6:
        return arguments[0] ** int(exponent)
    return _ARITHMETIC[word](*arguments)


def _where(column: int, text: str) -> str:
    return f" at column {column} of {show_value(text)}"


def _fail(problem: str, column: int, text: str, hint: str = _ALLOWED) -> NoReturn:
    raise ExpressionError(f"{problem}{_where(column, text)}; {hint}", column=column)


def _refuse_name(name: str, column: int, text: str, names: Iterable[str]) -> NoReturn:
    if name in FUNCTIONS:
        _fail(f"the function '{name}' stands without its arguments", column, text, f"write {name}(...)")
    candidates = {*names, *CONSTANTS}
    unit = f"; for the unit {name} make a parameter, such as lift: 5 {name}" if name in _UNITS else ""
    _fail(f"unknown name '{name}'", column, text, did_you_mean(name, candidates) + unit)


@lru_cache(maxsize=4096)  # a file with many bodies repeats its expressions
def _compile(text: str, functions: tuple[tuple[str, tuple[int, ...]], ...] = ()) -> tuple[_Instruction, ...]:
    """Return the postfix program of a text, without recursion; `functions` are permitted in addition."""
    counts = {name: (count,) for name, (count, _) in FUNCTIONS.items()} | dict(functions)
    if not text:
        raise ExpressionError("the expression is empty", value=text)
    if len(text) > MAX_CHARACTERS:
        raise ExpressionError(
            f"the expression has {len(text)} characters, at most {MAX_CHARACTERS} are allowed", value=text
        )
    for position, character in enumerate(text):
        if not character.isascii() or not character.isprintable() or character in "#\\`$?;!":
            _fail(f"forbidden character {character.encode('unicode_escape').decode()!r}", position + 1, text)
    _check_parentheses(text)
    body = _parse(text)
    program: list[_Instruction] = []
    pending: list[tuple[ast.AST, int]] = [(body, 1)]
    while pending:  # preorder from right to left, which is the reverse of postfix
        node, depth = pending.pop()
        if depth > MAX_NESTING:
            _fail(f"the expression is nested more than {MAX_NESTING} deep", _column(node), text, "use parameters")
        kind, operand, children = _examine(node, text, counts)
        program.append((kind, operand, len(children), _column(node)))
        chain = isinstance(node, ast.BinOp) and not isinstance(node.op, ast.Pow)
        for index, child in enumerate(children):
            pending.append((child, depth if chain and index == 0 else depth + 1))
    return tuple(reversed(program))


def _check_parentheses(text: str) -> None:
    """Raise an error for parentheses nested too deeply, before Python's parser reads them."""
    depth = 0
    for position, character in enumerate(text):
        depth += (character in "([{") - (character in ")]}")
        if depth > MAX_NESTING:
            _fail(f"the expression is nested more than {MAX_NESTING} deep", position + 1, text, "use parameters")


def _parse(text: str) -> ast.AST:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        column = min(max(error.offset or 1, 1), len(text) + 1)
        hint = _ALLOWED
        if re.search(r"[0-9)]\s*[A-Za-z(]|[A-Za-z]\s+[A-Za-z0-9]", re.sub(r"[0-9.]+[eE][-+]?[0-9]+", "0", text)):
            hint = "a product needs its *, as in 30*deg"
        _fail("the expression cannot be read", column, text, hint)
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"the expression is nested more than {MAX_NESTING} deep", value=text) from None


def _column(node: ast.AST) -> int:
    return getattr(node, "col_offset", 0) + 1


def _examine(node: ast.AST, text: str, counts: Mapping[str, tuple[int, ...]]) -> tuple[str, Any, list[ast.AST]]:
    """Return kind, operand and children of a permitted node; raise an error for every other node."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return "number", _number(value, _column(node), text), []
        case ast.Name(id=name) if name not in FUNCTIONS:
            return ("number", CONSTANTS[name], []) if name in CONSTANTS else ("name", name, [])
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _OPERATORS:
            return "operator", _OPERATORS[type(sign)], [left, right]
        case ast.UnaryOp(op=sign, operand=operand) if type(sign) in _OPERATORS:
            return "operator", _OPERATORS[type(sign)], [operand]
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=keywords):
            return "call", name, _arguments(name, arguments, keywords, _column(node), text, counts)
    return _refuse(node, _column(node), text)


def _refuse(node: ast.AST, column: int, text: str) -> NoReturn:
    """Raise an error that names the forbidden element."""
    match node:
        case ast.Name(id=name):
            _refuse_name(name, column, text, ())
        case ast.BinOp(op=ast.BitXor()):
            _fail("the operator ^ is not allowed", column, text, "a power is written **")
        case ast.BinOp(op=sign) | ast.UnaryOp(op=sign):
            label = f"the operator {type(sign).__name__}"
        case ast.Call():
            _fail("something that is not a function is called", column, text, "a product needs its *, as in 2*(a + b)")
        case ast.Attribute(attr=attribute):
            label = f"an attribute, '.{attribute}',"
        case ast.Constant(value=bool() | None):
            label = f"the word '{node.value}'"
        case ast.Constant(value=str() | bytes()):
            label = "a string"
        case ast.Constant(value=complex()):
            label = "a complex number"
        case _:
            label = _REPORTED.get(type(node), "something else")
    _fail(f"{label} is not allowed", column, text)


def _number(value: int | float, column: int, text: str) -> float:
    """Return a literal as a finite float."""
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        _fail("a number too large", column, text, "numbers go up to 1.8e308")
    return number


def _arguments(
    name: str,
    arguments: list[ast.expr],
    keywords: list[ast.keyword],
    column: int,
    text: str,
    counts: Mapping[str, tuple[int, ...]],
) -> list[ast.AST]:
    """Return the arguments of a function, after a check that it exists and accepts their number."""
    if name not in counts:
        _fail(f"unknown function '{name}'", column, text, function_hint(name, counts))
    if keywords:
        _fail(f"a keyword in the arguments of {name} is not allowed", column, text)
    if len(arguments) not in counts[name]:
        noun = "argument" if counts[name] == (1,) else "arguments"
        count = " or ".join(map(str, counts[name]))
        _fail(f"{name} takes {count} {noun}, not {len(arguments)},", column, text, "separate arguments by commas")
    return list(arguments)
