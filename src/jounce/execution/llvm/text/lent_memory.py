"""Memory of arrays while a program is translated: what is live, and what is given back."""

from collections.abc import Callable, Sequence
from typing import Any

from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.values import Region
from jounce.execution.llvm.text.views import Array, Deferred, InMemory, Stored


def among(arrays: Sequence[Array]) -> Callable[[Region], bool]:
    """Return what tells the memory of some arrays."""
    return regions_of(arrays).__contains__


def let_go(code: Code, known: dict[Any, Array], variables: Sequence[Any]) -> None:
    """Forget variables that are not read any more, and give back what memory only they had."""
    gone = [known.pop(variable, None) for variable in variables]
    give_back(code, [array for array in gone if isinstance(array, InMemory)])


def give_back(code: Code, arrays: Sequence[Array]) -> None:
    """Give back the memory of arrays, unless others are in it, too."""
    for region in regions_of(arrays) if arrays else ():
        if code.is_unshared(region):
            code.release(region)


def give_back_but(code: Code, taken: Sequence[Region], arrays: Sequence[Array]) -> None:
    """Give back memory that was taken, but that of arrays."""
    live = regions_of(arrays) if taken else {}
    for region in dict.fromkeys(taken):
        if region not in live:
            code.release(region)


def regions_of(arrays: Sequence[Array]) -> dict[Region, None]:
    """Return the memory of arrays, and of what they are computed from: each once, in their order.

    A set has another order in each process, and memory that is given back in another order is taken so: then the same
    program has another text, and another name in the store.
    """
    parts = [array.given if isinstance(array, Deferred) else [array] for array in arrays]
    return dict.fromkeys(part.region for some in parts for part in some if isinstance(part, Stored))
