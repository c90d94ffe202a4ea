"""What code of a user computes: a program of JAX, whose captured numbers are arguments.

A Python function is no key of anything that is kept, as what it computes may change while it stays the same object: a
gain that it reads from an attribute, a list, a global. Here a function is traced whenever it is used, in milliseconds.
Two functions are equal where their programs are, operation by operation, whatever numbers they hold: those are handed
in as arguments, so that a changed gain neither goes unseen nor is compiled anew. Whole numbers, exponents and shapes
are part of the program, and so are numbers within loops and branches.
"""

import abc
import dataclasses
import hashlib
import itertools
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, jaxpr_as_fun

from jounce.errors import PrecisionWarning, warn_caller
from jounce.settings import under_own_settings

MOST_TRACED = 1000  # programs at most, of functions read before
_JAX = Path(str(jax.__file__)).parent.as_posix() + "/"
_CALLER = _JAX + "_src/numpy/ufunc_api.py"  # which compiles functions of users as its own
_CALLS = ("jit", "pjit")
_BY_IDENTITY = frozenset("cond scan while".split())  # whose functions JAX traces once for each object
_OF_ARRAYS = ("_searchsorted_scan_impl",)  # functions of JAX with loops that are no user's

_anew = jax.make_user_context(None)
_count = itertools.count()
_lock = threading.Lock()
_known: dict[Any, "Program"] = {}


@dataclasses.dataclass(frozen=True)
class OpaqueObject:
    """An object of which nothing is known but that it is itself."""

    value: Any

    def __eq__(self, other: object) -> bool:
        return isinstance(other, OpaqueObject) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)


@dataclasses.dataclass(frozen=True)
class Program:
    """A program of JAX, equal to another where that does the same operations.

    Parameters
    ----------
    digest : str
        Of all that it does.
    nameless : tuple of Same
        What it holds that has no description, such as calls into Python.
    shapes : tuple of tuple of int
        Of the captured values.
    closed : ClosedJaxpr
        The program, of the captured values and the arguments.
    """

    digest: str
    nameless: tuple[OpaqueObject, ...]
    shapes: tuple[tuple[int, ...], ...] = dataclasses.field(compare=False)
    closed: ClosedJaxpr = dataclasses.field(compare=False, repr=False)

    def __call__(self, captured: Sequence[Any], *arguments: Any) -> list[Any]:
        """Return the results for captured values, one after another, and arguments."""
        return jaxpr_as_fun(self.closed)(*captured, *arguments)


class CapturedFunction(NamedTuple):
    """A function that was read off.

    Attributes
    ----------
    program : Program
        What it does.
    captured : tuple of array
        The numbers that it holds.
    traced : ClosedJaxpr
        As JAX traced it, the numbers in their places.
    result : pytree
        Shapes and types of what it returns.
    """

    program: Program
    captured: tuple[Any, ...]
    traced: ClosedJaxpr
    result: Any


@under_own_settings
def captured_function(function: Callable[..., Any], *examples: Any) -> CapturedFunction:
    """Return what a function of arrays computes.

    Parameters
    ----------
    function : callable
        JAX-traceable.
    *examples
        Arguments, or their shapes and types.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> gains = [2.0, 3.0]
    >>> first = captured_function(lambda x: gains[0] * x + gains[1], jnp.zeros(()))
    >>> gains[:] = 5.0, 7.0
    >>> second = captured_function(lambda x: gains[0] * x + gains[1], jnp.zeros(()))
    >>> first.program == second.program, [float(x) for x in second.captured]
    (True, [5.0, 7.0])
    """
    closed, result = _traced(function, jax.tree.map(_shaped, examples))  # of no weak types, which are other programs
    description = _Description()
    captured = tuple(description.of(closed))
    key = description.digest(), tuple(map(OpaqueObject, description.nameless))
    with _lock:
        program = _known.get(key)
    if program is None:
        given = [_shaped(x) for x in captured], [_shaped(v.aval) for v in closed.jaxpr.invars]
        whole = jax.make_jaxpr(lambda values, arguments: _Replay(values).of(closed, arguments))(*given)
        program = Program(*key, tuple(np.shape(x) for x in captured), whole)
        if dtype := _narrowed(closed.jaxpr):
            digits = int(jnp.finfo(dtype).precision)
            message = f"a function given here computes in {dtype}: results have {digits} digits; convert nothing to it"
            warn_caller(PrecisionWarning(message))
    with _lock:
        _known.pop(key, None)
        _known[key] = program  # the last one used is last
        while len(_known) > MOST_TRACED:
            del _known[next(iter(_known))]
    return CapturedFunction(program, captured, closed, result)


def value_key(closed: ClosedJaxpr) -> tuple[str, tuple[OpaqueObject, ...]]:
    """Return what identifies a program and the numbers in it."""
    description = _Description(values=True)
    description.of(closed)
    return description.digest(), tuple(map(OpaqueObject, description.nameless))


def may_hold_stale_functions(closed: ClosedJaxpr) -> bool:
    """Tell whether a program holds functions of a user that JAX traces once for each object."""
    return _may_hold_stale_functions(closed.jaxpr)


def known_as(digest: str) -> AbstractContextManager[None]:
    """Return within what JAX remembers functions of a user by what they compute, and not by the object."""
    return _anew(digest)


def parameters_of(equation: JaxprEqn) -> tuple[list[str], list[Any]]:
    """Return what distinguishes an operation from others of its name, and what of it has no description."""
    description = _Description()
    return description.parameters(equation), description.nameless


def _shaped(x: Any) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct(np.shape(x), np.result_type(x.dtype if hasattr(x, "dtype") else x))


def _traced(function: Callable[..., Any], examples: Sequence[Any]) -> tuple[ClosedJaxpr, Any]:
    """Return the program of a function as it is now: another function each time, of which JAX remembers nothing."""
    traced = jax.make_jaxpr(lambda *x: function(*x), return_shape=True)(*examples)
    if not _may_hold_stale_functions(traced[0].jaxpr):
        return traced
    with _anew(next(_count)):  # nothing traced before is found under it
        return jax.make_jaxpr(lambda *x: function(*x), return_shape=True)(*examples)


def _may_hold_stale_functions(jaxpr: Jaxpr, within: str = "") -> bool:
    """Tell whether a program holds functions of a user that JAX may have traced before."""
    for equation in jaxpr.eqns:
        name = equation.primitive.name
        if name in _BY_IDENTITY and within not in _OF_ARRAYS:
            return True
        for inner in _inner(equation):
            known = _is_of_libraries(inner) and _origin(inner) != _CALLER
            if not known or _may_hold_stale_functions(inner, str(equation.params.get("name", ""))):
                return True
    return False


def _inner(equation: JaxprEqn) -> Iterator[Jaxpr]:
    """Yield the programs within an operation."""
    for part in jax.tree.leaves(list(equation.params.values()), is_leaf=lambda x: isinstance(x, Jaxpr | ClosedJaxpr)):
        if isinstance(part, Jaxpr | ClosedJaxpr):
            yield part.jaxpr if isinstance(part, ClosedJaxpr) else part


def _narrowed(jaxpr: Jaxpr) -> np.dtype | None:
    """Return the type of less than double precision to which a program converts numbers; None if it does not."""
    for equation in jaxpr.eqns:
        made: Any = equation.params.get("new_dtype")
        taken: list[Any] = [v.aval for v in equation.invars]
        if equation.primitive.name == "convert_element_type" and taken[0].dtype == np.float64:
            made = np.dtype(made)
            if jnp.issubdtype(made, jnp.floating) and made != np.float64:
                return made
        for inner in _inner(equation):
            if dtype := _narrowed(inner):
                return dtype
    return None


def _is_of_libraries(jaxpr: Jaxpr) -> bool:
    return _origin(jaxpr).startswith(_JAX)


def _origin(jaxpr: Jaxpr) -> str:
    """Return the file of the function that a program was traced from; nothing if it is not known."""
    return Path(getattr(jaxpr.debug_info, "func_filename", None) or "").as_posix()


class Pass(abc.ABC):
    """Goes through a program, operation by operation, and through those of the functions that it calls."""

    def of(self, closed: ClosedJaxpr, arguments: Sequence[Any]) -> list[Any]:
        """Return what stands for the results of a program."""
        return self._read(closed.jaxpr, closed.consts, arguments)

    @abc.abstractmethod
    def captured(self, value: Any, dtype: np.dtype) -> Any:
        """Return what stands for a number that the function holds."""

    @abc.abstractmethod
    def fixed(self, value: Any, dtype: np.dtype) -> Any:
        """Return what stands for a number that is part of the program."""

    @abc.abstractmethod
    def applied(self, equation: JaxprEqn, operands: list[Any]) -> Sequence[Any]:
        """Return what stands for the results of an operation."""

    def _read(self, jaxpr: Jaxpr, constants: Sequence[Any], arguments: Sequence[Any]) -> list[Any]:
        numbers = {v: self._number(c, v.aval) for v, c in zip(jaxpr.constvars, constants, strict=True)}
        numbers.update(zip(jaxpr.invars, arguments, strict=True))

        def look(variable: Any, *, exponent: bool = False) -> Any:
            if not isinstance(variable, Literal):
                return numbers[variable]
            return self._number(variable.val, variable.aval, exponent=exponent)

        for equation in jaxpr.eqns:
            name = equation.primitive.name
            operands = [look(v, exponent=name == "pow" and k == 1) for k, v in enumerate(equation.invars)]
            if name in _CALLS:
                inner = equation.params["jaxpr"]
                results = self._read(inner.jaxpr, inner.consts, operands)
            else:
                results = self.applied(equation, operands)
            numbers.update(zip(equation.outvars, results, strict=True))
        return [look(v) for v in jaxpr.outvars]

    def _number(self, value: Any, aval: Any, *, exponent: bool = False) -> Any:
        known = exponent or not jnp.issubdtype(aval.dtype, jnp.inexact)
        return self.fixed(value, aval.dtype) if known and not isinstance(value, Tracer) else self.captured(
            value, aval.dtype
        )  # fmt: skip


class _Replay(Pass):
    """Does what the program does, with other captured numbers."""

    def __init__(self, values: Sequence[Any]):
        self._values = iter(values)

    def captured(self, value: Any, dtype: np.dtype) -> Any:
        del value, dtype
        return next(self._values)

    def fixed(self, value: Any, dtype: np.dtype) -> Any:
        return np.asarray(value, dtype)

    def applied(self, equation: JaxprEqn, operands: list[Any]) -> Sequence[Any]:
        outcome = equation.primitive.bind(*operands, **equation.primitive.get_bind_params(equation.params))
        return outcome if equation.primitive.multiple_results else [outcome]


class _Description(Pass):
    """Tells all that a program does, and collects the numbers that it holds."""

    def __init__(self, *, values: bool = False, rules: bool = True):
        self.values: list[Any] = []
        self.nameless: list[Any] = []
        self._lines, self._results, self._with_values, self._rules = [], itertools.count(), values, rules

    def of(self, closed: ClosedJaxpr, arguments: Sequence[Any] = ()) -> list[Any]:
        del arguments
        given = [self._argument(k, v.aval) for k, v in enumerate(closed.jaxpr.invars)]
        self._lines.append(f"of {given}")  # also of arguments that it does not read
        self._lines.append(f"return {super().of(closed, given)}")
        return self.values

    def digest(self) -> str:
        return hashlib.sha256("\n".join(self._lines).encode()).hexdigest()

    def captured(self, value: Any, dtype: np.dtype) -> Any:
        if self._with_values:
            return self.fixed(value, dtype)
        array = value if isinstance(value, Tracer) else np.asarray(value, dtype)
        self.values.append(array)
        return f"value {np.shape(array)} {dtype}"

    def fixed(self, value: Any, dtype: np.dtype) -> Any:
        if isinstance(value, Tracer):
            self.nameless.append(value)
            return f"nameless {len(self.nameless)}"
        return array_digest(np.asarray(value, dtype))

    def applied(self, equation: JaxprEqn, operands: list[Any]) -> Sequence[Any]:
        names = [f"%{next(self._results)}" for _ in equation.outvars]
        made: list[Any] = [v.aval for v in equation.outvars]
        kinds = [f"{aval.shape} {aval.dtype}" for aval in made]
        self._lines.append(f"{names} {kinds} = {equation.primitive.name} {self.parameters(equation)} {operands}")
        return names

    def parameters(self, equation: JaxprEqn) -> list[str]:
        """Return what distinguishes an operation from others of its name."""
        trusted = all(map(_is_of_libraries, _inner(equation))) and equation.primitive.name.startswith("custom_")
        given = sorted((key, value) for key, value in equation.params.items() if key != "name")
        description = [f"{key}={self._parameter(key, value, trusted)}" for key, value in given]
        if equation.primitive.name == "custom_jvp_call" and not trusted and self._rules:
            description.append(f"rule={self._rule(equation)}")
        return description

    def _argument(self, k: int, aval: Any) -> str:
        return f"argument {k} {aval.shape} {aval.dtype}"

    def _parameter(self, key: str, value: Any, trusted: bool) -> str:
        if isinstance(value, Jaxpr | ClosedJaxpr):
            return self._within(value)
        if isinstance(value, tuple | list):
            return f"{type(value).__name__}({', '.join(self._parameter(key, part, trusted) for part in value)})"
        if isinstance(value, np.ndarray | np.generic | jax.Array):
            return array_digest(np.asarray(value))
        if isinstance(value, bool | int | float | str | bytes | None):
            return repr(value)
        description = repr(value)
        if not callable(value) or isinstance(value, type):
            if " at 0x" not in description and type(value).__module__.partition(".")[0] in (
                "jax",
                "jaxlib",
                "numpy",
                "enum",
            ):
                return f"{type(value).__qualname__} {description}"
        elif trusted or key == "jvp_jaxpr_fun":
            return "a rule"
        self.nameless.append(value)
        return f"nameless {len(self.nameless)}"

    def _within(self, program: Jaxpr | ClosedJaxpr, *, rules: bool = True) -> str:
        """Return a description of a program within this one, its numbers included."""
        inner = _Description(values=True, rules=rules and self._rules)
        inner.of(program if isinstance(program, ClosedJaxpr) else ClosedJaxpr(program, ()))
        self.nameless += inner.nameless
        return inner.digest()

    def _rule(self, equation: JaxprEqn) -> str:
        """Return a description of the rule by which a user's function is differentiated."""
        count = len(equation.invars) - equation.params.get("num_consts", 0)
        jaxpr, constants, zeros = equation.params["jvp_jaxpr_fun"].call_wrapped(*[False] * count)
        return f"{self._within(ClosedJaxpr(jaxpr, constants), rules=False)} {zeros}"


def array_digest(array: np.ndarray) -> str:
    """Return what distinguishes an array from others: not rounded, and zero from minus zero."""
    return f"{array.shape} {array.dtype} {hashlib.sha256(array.tobytes()).hexdigest()}"
