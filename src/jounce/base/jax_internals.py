"""What this package uses of JAX and jaxlib that is private to them: all of it is here, and nowhere else.

Another release may have none of it, or something else by the same name. It was tried with JAX and jaxlib 0.10 and 0.11.
Where a release is without something, that does not happen which it was for: a program is not
kept, or is compiled within another one; what cannot be done without is imported here, so that a release without it is
known at once.
"""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import jax
from jax._src import config as config, core as core
from jax.core import Tracer

TRIED = (0, 10), (0, 11)  # releases of JAX
CERTAIN = "by_certain_entries"  # a name of operations
OWN = "subroutine_"  # how the names of functions begin that are not written in the place of their calls


def is_tested_release() -> bool:
    """Tell whether this release of JAX was tried: another one may say otherwise what an operation is to do."""
    return jax.__version_info__[:2] in TRIED


def in_plain_operations(program: Any) -> Any:
    """Return a traced program without operations that stand for several, as some do from JAX 0.12 on."""
    if not getattr(program, "is_high", False):
        return program
    from jax._src.interpreters import partial_eval

    lowered = getattr(partial_eval, "lower_jaxpr2", None)
    return program if lowered is None else lowered(program)


def trace_settings() -> tuple[Any, ...]:
    """Return how JAX is set up in this thread, as `jax.jit` distinguishes its own programs."""
    return config.trace_context()


def processes_started() -> bool:
    """Tell whether JAX has started XLA's threads; where that is unknown, that it has."""
    from jax._src import xla_bridge

    return getattr(xla_bridge, "backends_are_initialized", lambda: True)()


def runs_at_once(value: Tracer) -> bool:
    """Tell whether what JAX does with a value that it traces runs at once, as under `jax.jvp` outside of `jax.jit`.

    Then a program is a whole one, which takes options. What is not known, and what is run later, is part of another.
    """
    trace: Any = getattr(value, "_trace", None)
    kinds = []
    while trace is not None:
        kinds.append(type(trace).__name__)
        trace = getattr(trace, "parent_trace", None)
    return kinds[-1:] == ["EvalTrace"] and {"JVPTrace", "BatchTrace"}.issuperset(kinds[:-1])


def use_file_cache(make: Callable[[str], tuple[Any, str]]) -> bool:
    """Have JAX keep its own programs in what a function makes for a path; tell whether this release supports that."""
    from jax._src import compilation_cache

    if known := hasattr(compilation_cache, "get_file_cache"):
        compilation_cache.get_file_cache = make
    return known


def by_certain_entries() -> Any:
    """Mark operations in which a constant zero is an entry that a matrix does not have, whatever it is multiplied by.

    Machine code leaves such products out; elsewhere zero times what is not finite is NaN. The mark is a context, or
    decorates a function.
    """
    return jax.named_scope(CERTAIN)


def is_by_certain_entries(equation: Any) -> bool:
    """Tell whether an operation is so marked."""
    return CERTAIN in str(equation.source_info.name_stack)


def subroutine(function: Callable[..., Any]) -> Any:
    """Decorate a function of arrays that machine code has once for all its calls: what follows is jitted, too."""

    @wraps(function)
    def named(*arguments: Any) -> Any:
        return function(*arguments)

    named.__name__ = OWN + function.__name__
    return jax.jit(named)


def is_subroutine(equation: Any) -> bool:
    """Tell whether an operation is a call of such a function."""
    return str(equation.params.get("name", "")).startswith(OWN)


def sizes_of_scan(equation: Any) -> tuple[int, int]:
    """Return how many operands of a loop of known length are constants, and how many are carried from turn to turn.

    Releases of JAX write this down in different ways. What is carried has one shape outside and inside the loop; what
    is read or collected turn by turn has one axis more outside.
    """
    inner = equation.params["jaxpr"].jaxpr

    def alike(outer: Sequence[Any], inside: Sequence[Any]) -> int:
        return sum(x.aval.ndim == y.aval.ndim for x, y in zip(outer, inside, strict=True))

    carry = alike(equation.outvars, inner.outvars)
    return alike(equation.invars, inner.invars) - carry, carry
