"""Functions that JAX traces once for a program, however often the program calls them.

`jax.jit` traces a function once for arguments of the same structure and shapes, and `jax.jvp` and `jax.vmap` transform
the traced program once; machine code and XLA inline it. Nothing is shared between programs, since a user's functions
may change in between.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial, wraps
from typing import Any, ParamSpec, TypeVar

import jax

P = ParamSpec("P")
R = TypeVar("R")
_thread = threading.local()


@contextmanager
def one_program() -> Iterator[None]:
    """Return a context in which this thread traces one program, with each function traced once."""
    before = getattr(_thread, "functions", None)
    _thread.functions = {}
    try:
        yield
    finally:
        _thread.functions = before


def traced_once(*, static: tuple[int, ...] = ()) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator of a function of pytrees that programs call several times with the same shapes.

    Parameters
    ----------
    static : tuple of int
        Positions of arguments that are not arrays.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def called(*arguments: P.args, **keywords: P.kwargs) -> R:
            functions: dict[Any, Any] | None = getattr(_thread, "functions", None)
            if functions is None:
                return function(*arguments, **keywords)
            if function not in functions:
                functions[function] = jax.jit(partial(function), static_argnums=static)
            return functions[function](*arguments, **keywords)

        return called

    return decorate
