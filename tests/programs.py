"""The compiled functions of the package, and how many programs each has."""

import sys

import jounce.integrate  # noqa: F401 - the compiled functions of all rooms are there from the start
from jounce.execution.compilation import ByXla, Compiled
from jounce.execution.mapped import Mapped

SOME = {"march", "take_steps", "exerted", "balanced", "advance_instant"}


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


def _by_xla(function: Compiled | Mapped) -> list[ByXla]:
    return [function.on_xla, *([function.in_rounds] if isinstance(function, Mapped) else [])]


def counts() -> dict[str, int]:
    """Return how many programs there are, those of machine code among them."""
    jitted = {n: sum(c.jitted._cache_size() for c in _by_xla(f)) for n, f in functions().items()}
    return {name: jitted[name] + len(function.machine_code) for name, function in functions().items()}


def forget() -> None:
    """Forget all machine code, as in a new process."""
    for function in functions().values():
        function.machine_code._programs.clear()
