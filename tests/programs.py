"""The compiled functions of the package, and how many programs each has."""

import sys
from collections.abc import Iterator

import jounce.integrate  # noqa: F401 - the compiled functions of all rooms are there from the start
from jounce.execution.compilation import Compiled
from jounce.execution.mapped import Mapped

SOME = {"march", "take_steps", "exerted", "_balanced", "advance_instant"}


def functions() -> dict[str, Compiled | Mapped]:
    """Return them by name, of all modules that were imported."""
    found = {}
    for module in list(sys.modules.values()):
        if getattr(module, "__name__", "").startswith("jounce."):
            for value in vars(module).values():
                if isinstance(value, Compiled | Mapped):
                    found[value.function.__name__] = value
    assert set(found) >= SOME
    return found


def _by_xla(function: Compiled | Mapped) -> list[Compiled]:
    return [function] if isinstance(function, Compiled) else [function.on_xla, function.in_rounds]


def _programs(function: Compiled | Mapped) -> Iterator[dict]:
    yield function.machine_code._programs
    for compiled in _by_xla(function):
        yield compiled._programs


def counts() -> dict[str, int]:
    """Return how many programs there are, those of machine code among them."""
    jitted = {n: sum(c.jitted._cache_size() for c in _by_xla(f)) for n, f in functions().items()}
    return {name: jitted[name] + sum(map(len, _programs(function))) for name, function in functions().items()}


def forget() -> None:
    """Forget all programs, as in a new process."""
    for function in functions().values():
        for programs in _programs(function):
            programs.clear()
