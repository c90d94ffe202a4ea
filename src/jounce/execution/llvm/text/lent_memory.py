"""Lifetimes of the memory of arrays during translation."""

from collections.abc import Callable, Sequence
from typing import Any

from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.values import Region
from jounce.execution.llvm.text.views import Array, Deferred, InMemory, Stored


def among(arrays: Sequence[Array]) -> Callable[[Region], bool]:
    """Return the predicate of the memory of some arrays."""
    return regions_of(arrays).__contains__


def forget_variables(code: Code, arrays: dict[Any, Array], variables: Sequence[Any]) -> None:
    """Forget variables that are not read any more, and release memory that only they used."""
    forgotten = [arrays.pop(variable, None) for variable in variables]
    release_arrays(code, [array for array in forgotten if isinstance(array, InMemory)])


def release_arrays(code: Code, arrays: Sequence[Array]) -> None:
    """Release the memory of arrays unless it is still used."""
    for region in regions_of(arrays) if arrays else ():
        if code.is_unshared(region):
            code.release(region)


def release_all_but(code: Code, regions: Sequence[Region], arrays: Sequence[Array]) -> None:
    """Release allocated memory except that of arrays."""
    live = regions_of(arrays) if regions else {}
    for region in dict.fromkeys(regions):
        if region not in live:
            code.release(region)


def regions_of(arrays: Sequence[Array]) -> dict[Region, None]:
    """Return the memory of arrays and of their operands, each once, in order.

    The order of a set differs between processes, and so would the order of reuse: the same program would have another
    text, and another name in the store.
    """
    parts = [array.given if isinstance(array, Deferred) else [array] for array in arrays]
    return dict.fromkeys(part.region for operands in parts for part in operands if isinstance(part, Stored))
