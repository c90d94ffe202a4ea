"""What a computation cannot start from, told at its door: values that JAX traces, a fork of a process that used JAX."""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ParamSpec, TypeVar

from jax.core import Tracer, eval_context

from jounce.errors import UnsupportedError
from jounce.interrupts import left_behind

P = ParamSpec("P")
R = TypeVar("R")


def check_process() -> None:
    """Raise UnsupportedError in a process that was forked after JAX had started: it would wait for ever.

    XLA computes in threads, and a fork has none of them, only the locks that they held.
    """
    if left_behind():
        raise UnsupportedError(
            "this process was forked from one in which JAX had already computed, and would wait for ever for threads "
            "that are not here; start processes by 'spawn' or 'forkserver' (multiprocessing.get_context), or fork "
            "before the first computation"
        )


def concrete(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function that decides by values refuse what JAX traces, and a fork of a process that used JAX.

    Within `jax.jit` it computes at once, since nothing it gets depends on what is traced: the result is a constant.

    Raises
    ------
    UnsupportedError
        If an argument holds a value that `jax.jit`, `jax.grad` or `jax.vmap` traces.
    """
    names = tuple(inspect.signature(function).parameters)

    @functools.wraps(function)
    def door(*arguments: P.args, **keywords: P.kwargs) -> R:
        check_process()
        given = dict(zip(names, arguments, strict=False)) | keywords
        for place in _traced(given, ""):
            raise UnsupportedError(
                f"jn.{function.__name__} decides by values, and cannot yet be used with values that jax.jit, jax.grad "
                "or jax.vmap trace; call it with numbers, one design after another",
                name=place,
            )
        with eval_context():  # ensure_compile_time_eval would compile each constant inside on its own
            return function(*arguments, **keywords)

    return door


def _traced(value: Any, place: str) -> Iterator[str]:
    """Yield the dotted names of values that JAX traces."""
    if isinstance(value, Tracer):
        yield place
    elif isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _traced(entry, f"{place}.{key}".lstrip("."))
    elif isinstance(value, (list, tuple)):
        for k, entry in enumerate(value):
            if not isinstance(entry, (int, float, str)):
                yield from _traced(entry, f"{place}[{k}]")
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from _traced(getattr(value, field.name, None), f"{place}.{field.name}".lstrip("."))
