"""How the solver's functions are compiled."""

from collections.abc import Callable
from functools import cached_property, lru_cache, update_wrapper
from typing import Any

import jax

from jounce.kinematics.device import on_processor
from jounce.mechanism.preconditions import check_process


def compiler_options() -> dict[str, Any] | None:
    """Return options that halve XLA's compile time of long chains of small operations, without making them slower.

    They are private to XLA, and a release that does not know them refuses them: then there are none, as on a GPU.
    """
    return _processor_options() if on_processor() else None


@lru_cache(maxsize=1)
def _processor_options() -> dict[str, Any] | None:
    options = {"xla_cpu_use_fusion_emitters": False}
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
        return jax.jit(self.function, static_argnames=self.static, compiler_options=compiler_options())

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Call the compiled function."""
        check_process()
        return self.jitted(*arguments, **keywords)


def compiled(*static: str) -> Callable[[Callable[..., Any]], Compiled]:
    """Compile the decorated function at its first call, with these static arguments."""
    return lambda function: Compiled(function, static)
