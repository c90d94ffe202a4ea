"""The compiled functions of the package, and how many programs each has."""

import sys
from collections.abc import Iterator

import jounce.integrate  # noqa: F401 - the compiled functions of all rooms are there from the start
from jounce.kinematics.compilation import Compiled
from jounce.kinematics.side_by_side import SideBySide

SOME = {"march", "leg", "exerted", "_balanced", "advance_instant"}


def functions() -> dict[str, Compiled | SideBySide]:
    """Return them by name, of all modules that were imported."""
    found = {}
    for module in list(sys.modules.values()):
        if getattr(module, "__name__", "").startswith("jounce."):
            for value in vars(module).values():
                if isinstance(value, Compiled | SideBySide):
                    found[value.function.__name__] = value
    assert set(found) >= SOME
    return found


def _programs(function: Compiled | SideBySide) -> Iterator[dict]:
    yield function._programs
    if isinstance(function, Compiled):
        yield function._alone._programs


def counts() -> dict[str, int]:
    """Return how many programs there are, those of machine code among them."""
    jitted = {n: f.jitted._cache_size() if isinstance(f, Compiled) else 0 for n, f in functions().items()}
    return {name: jitted[name] + sum(map(len, _programs(function))) for name, function in functions().items()}


def forget() -> None:
    """Forget all programs, as in a new process."""
    for function in functions().values():
        for programs in _programs(function):
            programs.clear()
