"""Programs of user code: traced by JAX, with the captured numbers as arguments.

A Python function cannot be a cache key: what it computes may change while the object stays the same, as with a gain
read from an attribute, a list, or a global. A function is therefore traced, in milliseconds, whenever it is used. Two
functions are equal if their programs are, operation by operation, whatever numbers they hold. These numbers become
arguments, so that a changed gain is noticed, but not compiled anew. Integers, exponents and shapes are part of the
program, as are numbers within loops and branches.
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

MOST_TRACED = 1000  # programs kept of functions traced before
_JAX = Path(str(jax.__file__)).parent.as_posix() + "/"
_CALLER = _JAX + "_src/numpy/ufunc_api.py"  # compiles users' functions as if they were its own
_CALLS = ("jit", "pjit")
_BY_IDENTITY = frozenset("cond scan while".split())  # JAX traces their functions once per object
_OF_ARRAYS = ("_searchsorted_scan_impl",)  # functions of JAX itself that have loops

_anew = jax.make_user_context(None)
_count = itertools.count()
_lock = threading.Lock()
_known: dict[Any, "Program"] = {}


@dataclasses.dataclass(frozen=True)
class OpaqueObject:
    """An object of which only the identity is known."""

    value: Any

    def __eq__(self, other: object) -> bool:
        return isinstance(other, OpaqueObject) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)


@dataclasses.dataclass(frozen=True)
class Program:
    """A program of JAX; equal programs perform the same operations.

    Parameters
    ----------
    digest : str
        Digest of all operations.
    nameless : tuple of OpaqueObject
        Objects in the program without a description, such as calls into Python.
    shapes : tuple of tuple of int
        Shapes of the captured values.
    closed : ClosedJaxpr
        The program as a function of the captured values and the arguments.
    """

    digest: str
    nameless: tuple[OpaqueObject, ...]
    shapes: tuple[tuple[int, ...], ...] = dataclasses.field(compare=False)
    closed: ClosedJaxpr = dataclasses.field(compare=False, repr=False)

    def __call__(self, captured: Sequence[Any], *arguments: Any) -> list[Any]:
        """Return the list of results for captured values and arguments."""
        return jaxpr_as_fun(self.closed)(*captured, *arguments)


class CapturedFunction(NamedTuple):
    """A traced function: its program and the numbers that it captured.

    Attributes
    ----------
    program : Program
        Program of the function.
    captured : tuple of array
        Captured numbers.
    traced : ClosedJaxpr
        The program as traced by JAX, with the numbers in place.
    result : pytree
        Shapes and types of the result.
    """

    program: Program
    captured: tuple[Any, ...]
    traced: ClosedJaxpr
    result: Any


@under_own_settings
def captured_function(function: Callable[..., Any], *examples: Any) -> CapturedFunction:
    """Return the program of a function of arrays as it is now, and the numbers that it captures.

    Parameters
    ----------
    function : callable
        JAX-traceable function.
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
    closed, result = _traced(function, jax.tree.map(_shaped, examples))  # weak types would give other programs
    description = _Description()
    captured = tuple(description.of(closed))
    key = description.digest(), tuple(map(OpaqueObject, description.nameless))
    with _lock:
        program = _known.get(key)
    if program is None:
        given = [_shaped(x) for x in captured], [_shaped(v.aval) for v in closed.jaxpr.invars]
        replayed = jax.make_jaxpr(lambda values, arguments: _Replay(values).of(closed, arguments))(*given)
        program = Program(*key, tuple(np.shape(x) for x in captured), replayed)
        if dtype := _narrowed(closed.jaxpr):
            digits = int(jnp.finfo(dtype).precision)
            message = f"a function given here computes in {dtype}: results have {digits} digits; convert nothing to it"
            warn_caller(PrecisionWarning(message))
    with _lock:
        _known.pop(key, None)
        _known[key] = program  # reinserted: the most recently used is last
        while len(_known) > MOST_TRACED:
            del _known[next(iter(_known))]
    return CapturedFunction(program, captured, closed, result)


def value_key(closed: ClosedJaxpr) -> tuple[str, tuple[OpaqueObject, ...]]:
    """Return a key of a program including the numbers in it."""
    description = _Description(values=True)
    description.of(closed)
    return description.digest(), tuple(map(OpaqueObject, description.nameless))


def may_hold_stale_functions(closed: ClosedJaxpr) -> bool:
    """Return whether a program contains users' functions that JAX traces once per object."""
    return _may_hold_stale_functions(closed.jaxpr)


def known_as(digest: str) -> AbstractContextManager[None]:
    """Return a context in which JAX caches users' functions by a digest of their program, not by object."""
    return _anew(digest)


def parameters_of(equation: JaxprEqn) -> tuple[list[str], list[Any]]:
    """Return a description of the parameters of an operation, and the objects in them without a description."""
    description = _Description()
    return description.parameters(equation), description.nameless


def _shaped(x: Any) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct(np.shape(x), np.result_type(x.dtype if hasattr(x, "dtype") else x))


def _traced(function: Callable[..., Any], examples: Sequence[Any]) -> tuple[ClosedJaxpr, Any]:
    """Return the current program of a function, traced as a new function of which JAX has no cached trace."""
    traced = jax.make_jaxpr(lambda *x: function(*x), return_shape=True)(*examples)
    if not _may_hold_stale_functions(traced[0].jaxpr):
        return traced
    with _anew(next(_count)):  # finds no earlier traces
        return jax.make_jaxpr(lambda *x: function(*x), return_shape=True)(*examples)


def _may_hold_stale_functions(jaxpr: Jaxpr, within: str = "") -> bool:
    """Return whether a program contains users' functions that JAX may have traced before."""
    for equation in jaxpr.eqns:
        name = equation.primitive.name
        if name in _BY_IDENTITY and within not in _OF_ARRAYS:
            return True
        for inner in _inner(equation):
            is_library = _is_of_libraries(inner) and _origin(inner) != _CALLER
            if not is_library or _may_hold_stale_functions(inner, str(equation.params.get("name", ""))):
                return True
    return False


def _inner(equation: JaxprEqn) -> Iterator[Jaxpr]:
    """Yield the programs nested in an operation."""
    for part in jax.tree.leaves(list(equation.params.values()), is_leaf=lambda x: isinstance(x, Jaxpr | ClosedJaxpr)):
        if isinstance(part, Jaxpr | ClosedJaxpr):
            yield part.jaxpr if isinstance(part, ClosedJaxpr) else part


def _narrowed(jaxpr: Jaxpr) -> np.dtype | None:
    """Return the type narrower than double precision to which a program converts numbers, or None."""
    for equation in jaxpr.eqns:
        new_dtype: Any = equation.params.get("new_dtype")
        input_avals: list[Any] = [v.aval for v in equation.invars]
        if equation.primitive.name == "convert_element_type" and input_avals[0].dtype == np.float64:
            new_dtype = np.dtype(new_dtype)
            if jnp.issubdtype(new_dtype, jnp.floating) and new_dtype != np.float64:
                return new_dtype
        for inner in _inner(equation):
            if dtype := _narrowed(inner):
                return dtype
    return None


def _is_of_libraries(jaxpr: Jaxpr) -> bool:
    return _origin(jaxpr).startswith(_JAX)


def _origin(jaxpr: Jaxpr) -> str:
    """Return the file of the function that a program was traced from, or an empty string."""
    return Path(getattr(jaxpr.debug_info, "func_filename", None) or "").as_posix()


class Pass(abc.ABC):
    """A pass over a program and the programs of functions that it calls, operation by operation."""

    def of(self, closed: ClosedJaxpr, arguments: Sequence[Any]) -> list[Any]:
        """Return the representations of the results of a program."""
        return self._read(closed.jaxpr, closed.consts, arguments)

    @abc.abstractmethod
    def captured(self, value: Any, dtype: np.dtype) -> Any:
        """Return the representation of a captured number."""

    @abc.abstractmethod
    def fixed(self, value: Any, dtype: np.dtype) -> Any:
        """Return the representation of a number that is part of the program."""

    @abc.abstractmethod
    def applied(self, equation: JaxprEqn, operands: list[Any]) -> Sequence[Any]:
        """Return the representations of the results of an operation."""

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
        is_defined = exponent or not jnp.issubdtype(aval.dtype, jnp.inexact)
        return self.fixed(value, aval.dtype) if is_defined and not isinstance(value, Tracer) else self.captured(
            value, aval.dtype
        )  # fmt: skip


class _Replay(Pass):
    """Replay of a program with other captured numbers."""

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
    """Description of all operations of a program, with its captured numbers collected."""

    def __init__(self, *, values: bool = False, rules: bool = True):
        self.values: list[Any] = []
        self.nameless: list[Any] = []
        self._lines, self._results, self._with_values, self._rules = [], itertools.count(), values, rules

    def of(self, closed: ClosedJaxpr, arguments: Sequence[Any] = ()) -> list[Any]:
        del arguments
        given = [self._argument(k, v.aval) for k, v in enumerate(closed.jaxpr.invars)]
        self._lines.append(f"of {given}")  # including arguments that are not read
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
        avals: list[Any] = [v.aval for v in equation.outvars]
        kinds = [f"{aval.shape} {aval.dtype}" for aval in avals]
        self._lines.append(f"{names} {kinds} = {equation.primitive.name} {self.parameters(equation)} {operands}")
        return names

    def parameters(self, equation: JaxprEqn) -> list[str]:
        """Return a description of the parameters of an operation."""
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
        """Return a digest of a nested program, including its numbers."""
        inner = _Description(values=True, rules=rules and self._rules)
        inner.of(program if isinstance(program, ClosedJaxpr) else ClosedJaxpr(program, ()))
        self.nameless += inner.nameless
        return inner.digest()

    def _rule(self, equation: JaxprEqn) -> str:
        """Return a description of the differentiation rule of a user's function."""
        count = len(equation.invars) - equation.params.get("num_consts", 0)
        jaxpr, constants, zeros = equation.params["jvp_jaxpr_fun"].call_wrapped(*[False] * count)
        return f"{self._within(ClosedJaxpr(jaxpr, constants), rules=False)} {zeros}"


def array_digest(array: np.ndarray) -> str:
    """Return a digest of an array, which is exact and distinguishes zero from minus zero."""
    return f"{array.shape} {array.dtype} {hashlib.sha256(array.tobytes()).hexdigest()}"
