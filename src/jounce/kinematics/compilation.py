"""How the solver's functions are compiled."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any

import jax


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
    except Exception:  # whatever the release of XLA raises
        return None
    return options


def compiled(*static: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile a function at its first call, as `jax.jit` with these static arguments and the solver's options."""

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @lru_cache(maxsize=1)
        def jitted() -> Any:
            return jax.jit(function, static_argnames=static, compiler_options=compiler_options())

        @wraps(function)
        def call(*arguments: Any, **keywords: Any) -> Any:
            return jitted()(*arguments, **keywords)

        call.jitted = jitted  # pyright: ignore[reportFunctionMemberAccess] - for tests that count compilations
        return call

    return decorate
