"""Values at many instants, computed in chunks of a few lengths, so that one program serves grids of any length."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import numpy as np
from jaxtyping import Int

from jounce.execution.threads import Threads, thread_count

Result = TypeVar("Result")

WIDTHS = (256,)  # instants: one program serves a motion, its peaks and a long grid


def in_chunks(
    function: Callable[[Int[np.ndarray, " chunk"]], Result],
    count: int,
    widths: tuple[int, ...] = WIDTHS,
    axis: int = -1,
    *,
    filled: bool = True,
    threads: int | None = None,
) -> Result:
    """Return what a function of indices of instants gives, for all of them; few lengths of chunks are compiled.

    Chunks are computed in several threads at once; the function must let them.

    Parameters
    ----------
    function : callable
        Maps indices to a pytree of arrays with the instants along the axis.
    count : int
        How many instants there are; the index of what stands in for one is -1 where there is none.
    widths : tuple of int
        Lengths of chunks, increasing: the first that holds all instants, or else the last.
    axis : int, default -1
        Of the instants in the results.
    filled : bool, default True
        Whether the last chunk is filled up; what a `Mapped` makes needs none of that, and returns arrays of its own.
    threads : int, optional
        How many compute; as `thread_count` says unless given.
    """
    if not filled and count <= widths[-1]:
        return function(np.arange(count))
    width = next((width for width in widths if count <= width), widths[-1])

    def computed(first: int) -> Any:
        last = first + width if filled else min(first + width, count)
        return jax.tree.map(np.asarray, function(np.minimum(np.arange(first, last), count - 1)))

    with Threads(thread_count() if threads is None else threads) as pool:
        parts = list(pool.map(computed, range(0, max(count, 1), width)))

    def whole(*arrays: np.ndarray) -> np.ndarray:
        joined = np.concatenate(arrays, axis)  # a copy that its user may write to
        return joined[(slice(None),) * (axis % joined.ndim) + (slice(count),)]

    return jax.tree.map(whole, *parts)
