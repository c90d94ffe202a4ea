"""Functions that JAX traces once for a program, however often the program calls them.

`jax.jit` traces a function once for arguments of the same form, and `jax.jvp` and `jax.vmap` transform what it has
traced once; machine code and XLA write it in the place of each call. Programs share nothing: between two of them a
user's functions may change.
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
    """Trace a program in this thread, for which functions are traced once."""
    before = getattr(_thread, "functions", None)
    _thread.functions = {}
    try:
        yield
    finally:
        _thread.functions = before


def traced_once(*, static: tuple[int, ...] = ()) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate a function of pytrees of arrays that programs call several times with arguments of the same form.

    Parameters
    ----------
    static : tuple of int
        The places of arguments that are no arrays.
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
