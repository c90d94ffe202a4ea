"""Buffers in which a thread solves many instants in rounds; they stay in its cache, and results are copied out."""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, TypeVar

import jax
import numpy as np
from jaxtyping import Float, Int

from jounce.execution.buffer_pool import arrays_in, bytes_needed, lend
from jounce.kinematics.continuation.correct_and_differentiate import SolvedState
from jounce.kinematics.continuation.solver import Solver

Item = TypeVar("Item")
Indices = Int[np.ndarray, " lane"]
Rounds = Int[np.ndarray, "round width"]


class SolveBuffer:
    """Memory in which one thread solves one set of instants after another.

    For one motion, the states of all instants are kept, since others start from them, with the anchors behind them. For
    many designs, whose instants start from anchors or from the round before, only outputs are kept.

    Parameters
    ----------
    solver : Solver
        Solver of the instants.
    like : tuple
        State of an instant, as an example of the form.
    size, anchors : int
        Largest number of instants, and of anchors.

    Attributes
    ----------
    first_anchor : int
        Index of the first anchor among the states from which instants may start.
    state : tuple
        Jets of coordinates and outputs, and the sign of the determinant, of all instants; None for parts not kept.
    status : array of int, shape (size,)
    """

    def __init__(self, solver: Solver, like: SolvedState, size: int, anchors: int):
        design, of_designs = solver.own or {}, solver.own is not None
        self.first_anchor, outputs = (0, like[1]) if of_designs else (size, ())
        leaves, form = jax.tree.flatten(solver.needed(like) if of_designs else like)
        shapes = [(*leaf.shape[:-1], self.first_anchor + anchors) for leaf in leaves]
        shapes += [*((*value.shape[:-1], size) for value in (*outputs, *design.values())), *[(size,)] * 4]
        kinds = [*[float] * (len(shapes) - 2), *[int] * 2]
        arrays = iter(arrays_in(lend(bytes_needed(shapes)), shapes, kinds))
        self._known = jax.tree.unflatten(form, [next(arrays) for _ in leaves])
        outputs_only = dict.fromkeys(like[0]), tuple([next(arrays) for _ in outputs]), None
        self.state: tuple[Any, Any, Any] = outputs_only if of_designs else self._known
        self.own = {k: next(arrays) for k in design} if of_designs else None
        self.time, self.step, self.status, self.source = arrays
        self.source[:] = 0
        self.width = solver.program.width
        source_data = self._known if of_designs else solver.needed(self._known)
        self._run = solver.rounds(source_data, self.state, self.step, self.time, self.status, self.source, self.own)
        self.rounds: Rounds = np.zeros((0, self.width), np.int64)

    def put_anchors(self, parts: Iterable[Sequence[np.ndarray]]) -> None:
        """Store the anchors: for each leaf of their state, the parts to concatenate along the last axis."""
        for array, columns in zip(jax.tree.leaves(self._known), parts, strict=True):
            count = sum(x.shape[-1] for x in columns)
            np.concatenate(columns, axis=-1, out=array[..., self.first_anchor : self.first_anchor + count])

    def load(
        self,
        time: Float[np.ndarray, " time"],
        sources: tuple[Indices, Float[np.ndarray, " time"]],
        rounds: Rounds,
        design: Mapping[int, np.ndarray] = MappingProxyType({}),
    ) -> None:
        """Load instants to be solved.

        Parameters
        ----------
        time : array of shape (time,)
            Instants, s.
        sources : tuple of array, shape (time,)
            Source of each instant (an instant, an anchor, or, if negative, its lane of the round before), and the time
            step from there, s.
        rounds : array of int, shape (rounds, lanes)
            Instants of each round.
        design : dict of int to array, optional
            Values of the designs, designs last; each design has the same number of the instants.
        """
        count = len(time)
        self.time[:count], self.rounds = time, rounds
        self.source[:count], self.step[:count] = sources
        for k, array in (self.own or {}).items():
            designs = design[k].shape[-1]
            array[..., :count].reshape(*array.shape[:-1], designs, -1)[...] = design[k][..., None]

    def solve(self) -> None:
        """Solve the instants loaded last."""
        self._run(self.rounds)

    def results(self, count: int) -> tuple[Any, Indices]:
        """Return the states and outcomes of the first `count` instants."""
        return jax.tree.map(lambda x: x[..., :count], self.state), self.status[:count]


def solve_in_buffers(
    new: Callable[[], SolveBuffer],
    items: Sequence[Item],
    load: Callable[[SolveBuffer, Item], int],
    put: Callable[[Item, Any, Indices], None],
    parallel_map: Callable[[Callable[[Item], int], Iterable[Item]], Iterator[int]],
) -> Iterator[int]:
    """Solve items, each in a buffer, and yield the number of instants of each.

    Parameters
    ----------
    new : callable
        Makes a buffer for a thread.
    items : sequence
        Items to solve.
    load : callable
        Loads an item into a buffer, and returns its number of instants.
    put : callable
        Stores the states and outcomes of the instants of an item. Several threads may call it at once; the arrays are
        reused after the call.
    parallel_map : callable
        Works like `map`; it may call from several threads at once.
    """
    idle_buffers: list[SolveBuffer] = []  # of threads between two items
    lock = threading.Lock()  # short operations run faster one thread at a time than contending for Python's lock

    def solve(item: Item) -> int:
        with lock:
            buffer = idle_buffers.pop() if idle_buffers else new()
            count = load(buffer, item)
        buffer.solve()
        put(item, *buffer.results(count))
        idle_buffers.append(buffer)
        return count

    yield from parallel_map(solve, items)
