"""Buffers in which a thread solves many instants in rounds: they stay in its cache, and results are copied out."""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, TypeVar

import jax
import numpy as np
from jaxtyping import Float, Int

from jounce.execution.buffer_pool import acquire, arrays_in, bytes_needed, release
from jounce.kinematics.continuation.solver import Solver

Item = TypeVar("Item")
Indices = Int[np.ndarray, " lane"]
Rounds = Int[np.ndarray, "round width"]


class SolveBuffer:
    """The memory of a thread, for some instants after others, with the anchors that they start from behind them.

    Parameters
    ----------
    solver : Solver
        What solves the instants.
    like : tuple
        The state of an anchor.
    size, anchors : int
        The most instants and anchors that it is for.

    Attributes
    ----------
    state : tuple
        Of all instants, and behind them of the anchors.
    status : array of int, shape (size,)
    """

    def __init__(self, solver: Solver, like: Any, size: int, anchors: int):
        leaves, form = jax.tree.flatten(like)
        own = solver.own or {}
        shapes = [(*leaf.shape[:-1], size + anchors) for leaf in leaves]
        shapes += [*((*value.shape[:-1], size) for value in own.values()), *[(size,)] * 4]
        self.block, self.size = acquire(bytes_needed(shapes)), size
        kinds = [*[float] * (len(shapes) - 2), *[int] * 2]
        arrays = arrays_in(self.block, shapes, kinds)
        state, values = arrays[: len(leaves)], arrays[len(leaves) : -4]
        self.time, self.step, self.status, self.source = arrays[-4:]
        self.state = jax.tree.unflatten(form, state)
        self.own = None if solver.own is None else dict(zip(own, values, strict=True))
        self.source[:] = 0
        self.width = solver.program.width
        self._run = solver.rounds(self.state, self.step, self.time, self.status, self.source, self.own)
        self.rounds: Rounds = np.zeros((0, self.width), np.int64)

    def put_anchors(self, parts: Iterable[Sequence[np.ndarray]]) -> None:
        """Put anchors behind the instants: parts of each leaf of their state, anchors last."""
        for whole, columns in zip(jax.tree.leaves(self.state), parts, strict=True):
            count = sum(x.shape[-1] for x in columns)
            np.concatenate(columns, axis=-1, out=whole[..., self.size : self.size + count])

    def load(
        self,
        time: Float[np.ndarray, " time"],
        sources: tuple[Indices, Float[np.ndarray, " time"]],
        rounds: Rounds,
        own: Mapping[int, np.ndarray] = MappingProxyType({}),
    ) -> None:
        """Take up instants, s.

        Parameters
        ----------
        time : array of shape (time,)
            s.
        sources : tuple of array, shape (time,)
            What each starts from, an instant, or the anchor whose index is so much over the size; and the time from
            there, s.
        rounds : array of int, shape (rounds, lanes)
            In which they are solved.
        own : dict of int to array, optional
            The values of their designs, instants last.
        """
        count = len(time)
        self.time[:count], self.rounds = time, rounds
        self.source[:count], self.step[:count] = sources
        for k, whole in (self.own or {}).items():
            whole[..., :count] = own[k]

    def solve(self) -> None:
        """Solve the instants that were taken up last."""
        self._run(self.rounds)

    def results(self, count: int) -> tuple[Any, Indices]:
        """Return the states and the outcome of so many of them."""
        return jax.tree.map(lambda x: x[..., :count], self.state), self.status[:count]


def solve_in_buffers(
    new: Callable[[], SolveBuffer],
    items: Sequence[Item],
    begin: Callable[[SolveBuffer, Item], int],
    put: Callable[[Item, Any, Indices], None],
    each: Callable[[Callable[[Item], int], Iterable[Item]], Iterator[int]],
) -> Iterator[int]:
    """Solve items, each in a buffer, and yield how many instants each of them has.

    Parameters
    ----------
    new : callable
        Makes a buffer for a thread.
    items : sequence
        What is solved.
    begin : callable
        Loads an item into a buffer, and returns its number of instants.
    put : callable
        Takes over the states of the instants of an item, and the outcome of each. It may be called from several threads
        at once; the arrays are used again after it.
    each : callable
        In the manner of `map`; it may call from several threads at once.
    """
    idle_buffers: list[SolveBuffer] = []  # those of threads that are between two items
    lock = threading.Lock()  # many short operations go faster one thread after another than in turns for Python's lock

    def solve(item: Item) -> int:
        with lock:
            buffer = idle_buffers.pop() if idle_buffers else new()
            count = begin(buffer, item)
        buffer.solve()
        put(item, *buffer.results(count))
        idle_buffers.append(buffer)
        return count

    try:
        yield from each(solve, items)
    finally:
        while idle_buffers:  # one that a thread still uses is not among them
            release(idle_buffers.pop().block)
