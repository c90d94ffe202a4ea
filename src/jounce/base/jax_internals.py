"""All uses of private parts of JAX and jaxlib in this package.

Other releases may lack these parts, or use their names otherwise; JAX and jaxlib 0.10 and 0.11 were tested. Without an
optional part, its purpose is not served: a program is not stored, or is compiled within another one. Required parts are
imported at the top, so that a release without them fails at once.
"""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import jax
from jax._src import config as config, core as core
from jax.core import Tracer

TRIED = (0, 10), (0, 11)  # tested releases of JAX
CERTAIN = "by_certain_entries"  # name scope of marked operations
OWN = "subroutine_"  # prefix of the names of functions that are not inlined


def is_tested_release() -> bool:
    """Return whether this release of JAX was tested; others may describe operations differently."""
    return jax.__version_info__[:2] in TRIED


def in_plain_operations(program: Any) -> Any:
    """Return a traced program with composite operations, which exist from JAX 0.12 on, lowered to plain ones."""
    if not getattr(program, "is_high", False):
        return program
    from jax._src.interpreters import partial_eval

    lowered = getattr(partial_eval, "lower_jaxpr2", None)
    return program if lowered is None else lowered(program)


def trace_settings() -> tuple[Any, ...]:
    """Return the settings of JAX in this thread by which `jax.jit` distinguishes programs."""
    return config.trace_context()


def processes_started() -> bool:
    """Return whether JAX has started XLA's threads; True if that is not known."""
    from jax._src import xla_bridge

    return getattr(xla_bridge, "backends_are_initialized", lambda: True)()


def runs_at_once(value: Tracer) -> bool:
    """Return whether operations on a tracer run at once, as under `jax.jvp` outside of `jax.jit`.

    A program called with such a tracer is a whole program, which takes compiler options. Operations on other tracers
    become part of another program.
    """
    trace: Any = getattr(value, "_trace", None)
    kinds = []
    while trace is not None:
        kinds.append(type(trace).__name__)
        trace = getattr(trace, "parent_trace", None)
    return kinds[-1:] == ["EvalTrace"] and {"JVPTrace", "BatchTrace"}.issuperset(kinds[:-1])


def use_file_cache(make: Callable[[str], tuple[Any, str]]) -> bool:
    """Have JAX store its own programs in the cache that a function returns for a path; return whether that works."""
    from jax._src import compilation_cache

    if is_available := hasattr(compilation_cache, "get_file_cache"):
        compilation_cache.get_file_cache = make
    return is_available


def by_certain_entries() -> Any:
    """Return a context or decorator that marks operations in which constant zeros are structural zeros of a matrix.

    Machine code omits products with structural zeros; with other zeros, the product with a nonfinite number is NaN.
    """
    return jax.named_scope(CERTAIN)


def is_by_certain_entries(equation: Any) -> bool:
    """Return whether an operation is marked by `by_certain_entries`."""
    return CERTAIN in str(equation.source_info.name_stack)


def subroutine(function: Callable[..., Any]) -> Any:
    """Return a function of arrays, jitted, that machine code contains once for all its calls."""

    @wraps(function)
    def named(*arguments: Any) -> Any:
        return function(*arguments)

    named.__name__ = OWN + function.__name__
    return jax.jit(named)


def is_subroutine(equation: Any) -> bool:
    """Return whether an operation is a call of a `subroutine`."""
    return str(equation.params.get("name", "")).startswith(OWN)


def sizes_of_scan(equation: Any) -> tuple[int, int]:
    """Return the numbers of constant and of carried operands of a `scan`.

    Releases of JAX store these in different ways. Carried operands have the same shape outside and inside the loop;
    operands that are read or collected by iteration have one more axis outside.
    """
    inner = equation.params["jaxpr"].jaxpr

    def alike(outer: Sequence[Any], inside: Sequence[Any]) -> int:
        return sum(x.aval.ndim == y.aval.ndim for x, y in zip(outer, inside, strict=True))

    carry = alike(equation.outvars, inner.outvars)
    return alike(equation.invars, inner.invars) - carry, carry
