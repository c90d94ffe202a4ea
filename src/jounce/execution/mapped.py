"""A function of one instant mapped over many, by machine code or by XLA with the same interface.

XLA calls one array operation after another, each through memory. Machine code does all operations on an instant in the
registers of the processor, several instants at a time (`jounce.execution.llvm`). Instants that start from the results
of others are solved in rounds, each with as many instants as there are lanes.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from jounce.base.padding import padded
from jounce.base.shapes import has_tracers, is_traced
from jounce.execution.backends import LLVM, xla_backend
from jounce.execution.chunks import in_chunks
from jounce.execution.compilation import LARGE, ByXla
from jounce.execution.device import on_processor
from jounce.execution.llvm.programs import Program
from jounce.execution.threads import Threads
from jounce.execution.translated import Translated, all_shaped
from jounce.settings import under_own_settings

WIDTHS = (8, 256)  # instants of XLA programs, each compiled once
GPU_WIDTH = 2**15  # the same on a GPU, which batches must fill
STARTS = 64  # multiple to which the number of starting instants of XLA rounds is padded
FEWEST_TOGETHER, MOST_TOGETHER = 64, 1024  # instants of one call of machine code in a loop
CACHED_ENTRIES = 2**17  # numbers of their arguments: a megabyte
SIDE_BY_SIDE = 128  # samples along the first axis that XLA computes at once, so that they fit into the cache
Rounds = Callable[[Int[np.ndarray, "round lane"]], None]
_published: dict[str, Program] = {}  # programs by the names by which other machine code calls them


@dataclasses.dataclass(frozen=True)
class OnLlvm:
    """Machine code of a function of one instant, with its shared arguments."""

    machine_code: Program
    shared: Sequence[np.ndarray]

    @property
    def backend(self) -> str:
        """Name of the backend."""
        return LLVM

    def __call__(self, lanes: Any, threads: int = 1) -> Any:
        """Return the results for many instants, divided among threads if they lie along the first axis."""
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(lanes)]
        if threads == 1:
            return self.machine_code(self.shared, leaves)
        with Threads(threads, compiled=True) as pool:
            parts = 4 * threads  # so that no thread waits long for another
            return self.machine_code(self.shared, leaves, parts, pool.map)

    def together(self, entries: int) -> tuple[int, ...]:
        """Return the number of instants of one call in a loop, for a number of entries of each instant."""
        return (max(FEWEST_TOGETHER, min(MOST_TOGETHER, CACHED_ENTRIES // max(1, entries))),)

    def rounds(
        self, lanes: tuple[Any, Any, Any], results: Any, sources: Int[np.ndarray, " time"], links: Sequence[int]
    ) -> Rounds:
        """Return the runner that solves instants in rounds, where later rounds start from the results of earlier ones.

        Parameters
        ----------
        lanes : tuple
            The arguments of an instant in three parts, instants last: those linked to its source, its own, and those
            held for all instants, of one instant. Each round reads their current values.
        results : pytree
            Output arrays. Those of linked arguments are the same arrays, unless all sources are beyond the instants or
            in the previous round. None for results that are not needed.
        sources : array of int, shape (time,)
            Index of the source of each instant; negative for the same lane of the previous round.
        links : sequence of int
            For each leaf of the linked arguments, the index of the leaf of the results that it is taken from.
        """
        leaves: Any = [[np.asarray(leaf) for leaf in jax.tree.leaves(group)] for group in lanes]
        stored = jax.tree.leaves(results, is_leaf=lambda x: x is None)
        return self.machine_code.rounds(self.shared, leaves, stored, sources, links)

    @property
    def width(self) -> int:
        """Number of instants in a round: the lanes of a vector."""
        return self.machine_code.width

    @cached_property
    def name(self) -> str:
        """Name by which other machine code calls the program; see `called`."""
        name = self.machine_code.name
        if name not in _published:
            self.machine_code.publish()
            _published[name] = self.machine_code
        return name


def called(name: str, shared: Any, lanes: Any) -> Any:
    """Return the results of published machine code as part of a traced program that becomes machine code."""
    return _published[name].in_program(jax.tree.leaves(shared), jax.tree.leaves(lanes))


@dataclasses.dataclass(frozen=True)
class OnXla:
    """XLA programs of a function of one instant, for instants side by side, with its shared arguments.

    Parameters
    ----------
    mapped : Mapped
        The function.
    shared : pytree
        Shared arguments.
    form : PyTreeDef
        Structure of the arguments of an instant.
    how : tuple
        Static arguments, by name.
    width : int
        Number of instants in a round.
    """

    mapped: "Mapped"
    shared: Any
    form: Any
    how: tuple[tuple[str, Any], ...]
    width: int

    @property
    def backend(self) -> str:
        """Name of the backend."""
        return xla_backend()

    def __call__(self, lanes: Any, threads: int = 1) -> Any:
        """Return the results for many instants, computed in blocks of few sizes, divided among threads."""
        axis = 0 if self.mapped.rows else -1
        lanes = jax.tree.map(np.asarray, lanes)
        count = jax.tree.leaves(lanes)[0].shape[axis]

        def computed(indices: Int[np.ndarray, " lane"]) -> Any:
            block = jax.tree.map(lambda x: _taken(x, indices, axis), lanes)
            return self.mapped.on_xla(self.shared, block, how=self.how)

        return in_chunks(computed, count, (self._block_width(count),), axis, threads=threads)

    def together(self, entries: int) -> tuple[int, ...]:  # noqa: ARG002 - the interface of `OnLlvm`
        """Return the numbers of instants of one call in a loop: few, or many."""
        return self.mapped.widths

    def _block_width(self, count: int) -> int:
        """Return the number of instants of one call, for a total count."""
        small, *middle, large = self.mapped.widths if on_processor() else (SIDE_BY_SIDE, GPU_WIDTH)
        # at least half of a large block is used, so that at most twice the work is done
        return small if count <= small else middle[0] if middle and count <= large // 2 else large

    def rounds(
        self, lanes: tuple[Any, Any, Any], results: Any, sources: Int[np.ndarray, " time"], links: Sequence[int]
    ) -> Rounds:
        """Return the runner of rounds, as for `OnLlvm`; the output arrays are written when all rounds are solved."""
        linked, own, held = map(jax.tree.leaves, lanes)
        stored = jax.tree.leaves(results, is_leaf=lambda x: x is None)
        recorded = tuple(k for k, array in enumerate(stored) if array is not None or k in links)
        outputs, source_count = [stored[k] for k in recorded], linked[0].shape[-1]
        positions = tuple(recorded.index(k) for k in links)

        def run(targets: Int[np.ndarray, "round lane"]) -> None:
            order, total = targets.ravel(), self.width * _power(len(targets))
            index = np.full(source_count, -1)
            if stored[links[0]] is linked[0]:
                index[order[::-1]] = np.arange(len(order))[::-1]
            source = sources[order]
            position = np.where(source < 0, np.arange(len(order)) - self.width, index[source])
            before = np.unique(source[position < 0])  # sources that are not among the targets
            source = np.where(position < 0, total + np.searchsorted(before, source), position)
            room = STARTS * _power(-(-len(before) // STARTS))
            starts = [padded(x[..., before], room) for x in linked]
            given = [padded(x[..., order], total) for x in own]
            order_of_rounds = padded(source, total), np.asarray(len(targets))
            how = positions, recorded, self.width, self.form, self.how
            result = self.mapped.in_rounds(self.shared, starts, (given, held), order_of_rounds, how=how)
            for array, part in zip(outputs, result, strict=True):
                if array is not None:
                    array[..., order] = np.asarray(part)[..., : len(order)]

        return run


def _power(count: int) -> int:
    """Return the least power of four that is not below a count, so that few sizes are compiled."""
    return 4 ** math.ceil(math.log(max(1, count), 4))


def _taken(array: np.ndarray, indices: Int[np.ndarray, " lane"], axis: int) -> np.ndarray:
    """Return some instants of an array; zeros if it has none."""
    if array.shape[axis]:
        return np.take(array, indices, axis)
    return np.zeros((len(indices), *array.shape[1:]) if axis == 0 else (*array.shape[:-1], len(indices)), array.dtype)


def at_lanes(arrays: Any, lanes: Int[np.ndarray, " lane"] | Bool[np.ndarray, " lane"]) -> Any:
    """Return arrays at some instants along their last axis."""
    return jax.tree.map(lambda x: x[..., lanes], arrays)


class Mapped:
    """A function of one instant that can be run for many.

    Parameters
    ----------
    function : callable
        Function of two pytrees of arrays, shared by all instants and of instants along the last axis, as in its
        results, and of static arguments by name. Machine code is compiled from it for one instant.
    by_xla : callable, optional
        The same function in a form that suits XLA better for many instants.
    rows : bool, default False
        Whether arrays of many instants, arguments and results, have the instants along their first axis.
    made_of : tuple of callable, optional
        Functions of the package that define what it computes, if it is not one of them itself.
    widths : tuple of int, optional
        Increasing numbers of instants of XLA programs.
    narrow : bool, default False
        Whether the arrays are short in XLA programs, as for `ByXla`.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        *,
        by_xla: Callable[..., Any] | None = None,
        rows: bool = False,
        made_of: tuple[Callable[..., Any], ...] = (),
        widths: tuple[int, ...] = WIDTHS,
        narrow: bool = False,
    ):
        self.function, self.rows, self.widths = function, rows, widths
        self._many, made_of = by_xla or function, made_of or (function,)
        self.machine_code = Translated(function, made_of, rows=rows)
        self.on_xla = ByXla(self._block_of_rows if rows else self._block, ("how",), narrow=narrow)
        self.in_rounds = ByXla(self._in_rounds, ("how",))
        self.__wrapped__, self.__doc__ = function, function.__doc__  # so that `structure` finds it by name
        self.__module__, self.__qualname__ = function.__module__, function.__qualname__

    def __reduce__(self) -> str:
        """Pickle it as its name: results hold those that compute further ones, when they are asked for."""
        return self.__qualname__

    @under_own_settings
    def program(
        self,
        shared: Any,
        lanes: Any,
        *,
        large: int | None = None,
        width: Callable[[], int] | None = None,
        **static: Any,
    ) -> OnLlvm | OnXla:
        """Return the program for arguments of a structure, of which `lanes` are an example.

        Parameters
        ----------
        shared, lanes : pytree
            Arguments of the function, or their shapes and types.
        large : int, optional
            Size beyond which arrays stay in memory in machine code, as for `object_file`.
        width : callable, optional
            Function that returns the number of instants in a round of XLA.
        **static
            Further arguments of the function.
        """
        leaves, structure = jax.tree.flatten(shared)
        lane_leaves, form = jax.tree.flatten(lanes)
        if not has_tracers([*leaves, *lane_leaves]):
            arrays, parts = all_shaped(leaves), all_shaped(lane_leaves)
            code = self.machine_code.program((arrays, structure), (parts, form), static, large=large)
            if code is not None:
                return OnLlvm(code, arrays)
        return OnXla(self, shared, form, tuple(static.items()), 1 if width is None else width())

    def at_instants(
        self,
        shared: Any,
        lanes_of: Callable[[np.ndarray], Any],
        count: int,
        *,
        large: int = LARGE,
        **static: Any,
    ) -> Any:
        """Return the results for all instants, and the name of the backend.

        Parameters
        ----------
        shared : pytree
            As for `program`.
        lanes_of : callable
            Function from indices of instants to their arguments; it is called once for few instants.
        count : int
            Number of instants, at least one.
        large : int, optional
            Size beyond which arrays stay in memory in machine code, as for `object_file`.
        **static
            Further arguments of the function.
        """
        is_small = count <= FEWEST_TOGETHER
        lanes = lanes_of(np.arange(count if is_small else 1))
        program = self.program(shared, lanes, large=large, **static)
        if program.backend != LLVM and is_traced((shared, lanes)):
            return self.on_xla(shared, lanes_of(np.arange(count)), how=tuple(static.items())), xla_backend()
        if is_small:
            return program(lanes), program.backend
        widths = program.together(sum(np.size(x) for x in jax.tree.leaves(lanes)))
        return in_chunks(lambda indices: program(lanes_of(indices)), count, widths, filled=False), program.backend

    def along(self, shared: Any, lanes: Any, *, large: int = LARGE, **static: Any) -> Any:
        """Return the results for all instants of arrays along their last axis, as `at_instants` does."""
        count = np.shape(jax.tree.leaves(lanes)[0])[-1]
        return self.at_instants(shared, partial(at_lanes, lanes), count, large=large, **static)[0]

    def prepare(self, shared: Any, lanes: Any, *, large: int = LARGE, **static: Any) -> None:
        """Compile the machine code that `along` calls; XLA programs depend on the number of instants."""
        self.program(shared, lanes, large=large, **static)

    def _block(self, shared: Any, lanes: Any, how: tuple[tuple[str, Any], ...]) -> Any:
        return self._many(shared, lanes, **dict(how))

    def _block_of_rows(self, shared: Any, lanes: Any, how: tuple[tuple[str, Any], ...]) -> Any:
        def block(lanes: Any) -> Any:
            last = jax.tree.map(lambda x: jnp.moveaxis(jnp.asarray(x), 0, -1), lanes)
            return jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0), self._many(shared, last, **dict(how)))

        count = jax.tree.leaves(lanes)[0].shape[0]
        if count <= SIDE_BY_SIDE or not on_processor():
            return block(lanes)
        parts = jax.tree.map(lambda x: jnp.reshape(x, (count // SIDE_BY_SIDE, SIDE_BY_SIDE, *x.shape[1:])), lanes)
        return jax.tree.map(lambda x: jnp.reshape(x, (count, *x.shape[2:])), jax.lax.map(block, parts))

    def _in_rounds(
        self, shared: Any, starts: Sequence[Any], others: tuple[Any, Any], order: tuple[Any, Any], how: Any
    ) -> Any:
        """Return the results of instants in the order of rounds, for `OnXla.rounds`.

        Each round is written as one contiguous block, for which XLA has fast code, unlike for scattered numbers.
        """
        (own, held), (sources, turns), (links, recorded, width, form, static) = others, order, how
        total = len(sources)

        def solved(linked: Sequence[Any], own: Sequence[Any]) -> list[Any]:
            repeated = [jnp.broadcast_to(jnp.asarray(x), (*x.shape[:-1], width)) for x in held]
            given = jax.tree.unflatten(form, [*linked, *own, *repeated])
            result = jax.tree.leaves(self._many(shared, given, **dict(static)))
            return [result[k] for k in recorded]

        def round_part(x: Any, turn: Any) -> Any:
            return jax.lax.dynamic_slice_in_dim(x, turn * width, width, axis=-1)

        def go_on(turn: Any, stored: list[Any]) -> list[Any]:
            source = round_part(sources, turn)
            parts = solved([jnp.take(stored[k], source, axis=-1) for k in links], [round_part(x, turn) for x in own])
            put = jax.lax.dynamic_update_slice_in_dim
            return [put(array, part, turn * width, -1) for array, part in zip(stored, parts, strict=True)]

        examples = [[jax.ShapeDtypeStruct((*x.shape[:-1], width), x.dtype) for x in group] for group in (starts, own)]
        shapes = jax.eval_shape(solved, *examples)
        stored = [jnp.zeros((*x.shape[:-1], total), x.dtype) for x in shapes]
        for k, start in zip(links, starts, strict=True):
            stored[k] = jnp.concatenate([stored[k], start], axis=-1)
        result = jax.lax.fori_loop(0, turns, go_on, stored)
        return [x[..., :total] for x in result]


def mapped(**options: Any) -> Callable[[Callable[..., Any]], Mapped]:
    """Return a decorator that makes a function `Mapped`."""
    return lambda function: Mapped(function, **options)
