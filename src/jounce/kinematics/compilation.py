"""How the solver's functions are compiled."""

from collections.abc import Callable
from contextlib import nullcontext
from functools import cached_property, lru_cache, update_wrapper, wraps
from typing import Any

import jax

from jounce.jet.loops import tight_loops


@lru_cache(maxsize=1)
def compiler_options() -> dict[str, Any] | None:
    """Return options that halve XLA's compile time of long chains of small operations, without making them slower.

    They are private to XLA, and a release that does not know them refuses them: then there are none.
    """
    options = {"xla_cpu_use_fusion_emitters": False}
    if jax.default_backend() != "cpu":
        return None
    try:
        jax.jit(lambda: 0.0, compiler_options=options).lower().compile()
    except (RuntimeError, ValueError):  # jax.errors.JaxRuntimeError is a RuntimeError
        return None
    return options


class Compiled:
    """A function compiled at its first call, as by `jax.jit` with the solver's options."""

    def __init__(self, function: Callable[..., Any], static: tuple[str, ...]):
        self.function, self.static = function, static
        update_wrapper(self, function)

    @cached_property
    def jitted(self) -> Any:
        """The function as `jax.jit` returns it."""
        options = compiler_options()

        @wraps(self.function)
        def traced(*arguments: Any, **keywords: Any) -> Any:
            with tight_loops() if options else nullcontext():
                return self.function(*arguments, **keywords)

        return jax.jit(traced, static_argnames=self.static, compiler_options=options)

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Call the compiled function."""
        return self.jitted(*arguments, **keywords)


def compiled(*static: str) -> Callable[[Callable[..., Any]], Compiled]:
    """Compile the decorated function at its first call, with these static arguments."""
    return lambda function: Compiled(function, static)
