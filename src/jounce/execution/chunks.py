"""Evaluation at many instants in chunks of a few lengths, so that one program serves grids of any length."""

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
    """Return the results of a function of indices of instants, in chunks of few lengths and several threads.

    The function must be safe to call from several threads at once.

    Parameters
    ----------
    function : callable
        Function from indices to a pytree of arrays with the instants along the axis.
    count : int
        Number of instants; if it is zero, the function is called with the index -1.
    widths : tuple of int
        Increasing lengths of chunks: the first that holds all instants, or else the last, is used.
    axis : int, default -1
        Axis of the instants in the results.
    filled : bool, default True
        Whether the last chunk is padded; programs of a `Mapped` need no padding, and return new arrays.
    threads : int, optional
        Number of threads, by default that of `thread_count`.
    """
    if not filled and count <= widths[-1]:
        return function(np.arange(count))
    width = next((width for width in widths if count <= width), widths[-1])

    def computed(first: int) -> Any:
        last = first + width if filled else min(first + width, count)
        return jax.tree.map(np.asarray, function(np.minimum(np.arange(first, last), count - 1)))

    with Threads(thread_count() if threads is None else threads) as pool:
        parts = list(pool.map(computed, range(0, max(count, 1), width)))

    def concatenated(*arrays: np.ndarray) -> np.ndarray:
        joined = np.concatenate(arrays, axis)  # a copy, so that users may write to it
        return joined[(slice(None),) * (axis % joined.ndim) + (slice(count),)]

    return jax.tree.map(concatenated, *parts)
