"""Machine code of a function of one instant, run for one instant or for many side by side."""

import ctypes
import hashlib
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

from jounce.base.padding import padded
from jounce.execution.buffer_pool import address_of, lend
from jounce.execution.llvm.machine import MachineCode, vector_width
from jounce.execution.llvm.rounds import Column, RoundRunner


class Layout:
    """The layout of arrays in one block of memory, since NumPy takes long to return the address of an array.

    Parameters
    ----------
    kinds : sequence of tuple
        Shapes and types of the arrays.
    begin : int, default 0
        Bytes before the arrays.

    Attributes
    ----------
    offsets : array of int
        Offsets of the arrays in bytes.
    end : int
        End of the last array in bytes.
    """

    def __init__(self, kinds: Sequence[tuple[tuple[int, ...], Any]], start: int = 0):
        self._kinds = [(shape, np.dtype(dtype)) for shape, dtype in kinds]
        self.offsets, self.end, self._groups = np.empty(len(kinds), np.int64), start, []
        by_type = sorted(range(len(kinds)), key=lambda k: self._kinds[k][1].str)
        for _, group in itertools.groupby(by_type, key=lambda k: self._kinds[k][1].str):
            members, offset = list(group), -(-self.end // 64) * 64
            dtype, sizes = self._kinds[members[0]][1], [math.prod(self._kinds[k][0]) for k in members]
            ends = offset + dtype.itemsize * np.cumsum([0, *sizes])
            self.offsets[members], self.end = ends[:-1], int(ends[-1])
            self._groups.append((members, slice(offset, self.end)))
        self._places = list(zip(self._kinds, self.offsets.tolist(), strict=True))

    def put(self, memory: np.ndarray, arrays: Sequence[np.ndarray]) -> None:
        """Copy arrays of the layout's shapes and types to their places in a block of bytes."""
        room = memoryview(memory)  # pyright: ignore[reportArgumentType]
        for members, index in self._groups:
            parts: Any = [arrays[k] for k in members]
            try:
                room[index] = b"".join(parts)
            except (BufferError, TypeError, ValueError):  # an array is not contiguous
                room[index] = b"".join([x.tobytes() for x in parts])

    def views(self, memory: np.ndarray) -> list[np.ndarray]:
        """Return the arrays in a block of bytes as views."""
        return [np.ndarray(*kind, memory, index) for kind, index in self._places]


class Block:
    """The arguments and results of calls in one block of memory, with their addresses before them.

    Parameters
    ----------
    given, results : sequence of tuple
        Shapes and types of the arguments and of the results.
    """

    def __init__(self, given: Sequence[tuple[tuple[int, ...], Any]], results: Sequence[tuple[tuple[int, ...], Any]]):
        self._addresses = 8 * (len(given) + len(results))  # bytes
        self._given = Layout(given, self._addresses)
        self._results = Layout(results, self._given.end)
        self._offsets = np.concatenate([self._given.offsets, self._results.offsets])

    def results(self, run: MachineCode, given: Sequence[np.ndarray], lanes: int) -> list[np.ndarray]:
        """Return the results of machine code for arguments of the shapes and types of the block."""
        memory = lend(self._results.end)
        address = address_of(memory)
        np.add(self._offsets, address, out=memory[: self._addresses].view(np.int64))
        self._given.put(memory, given)
        run(address, lanes)
        return self._results.views(memory)


class Single:
    """Machine code of a function, run for one instant.

    Parameters
    ----------
    binary : bytes
        Object file from `modules.object_file`, with `single`.
    given, results : pytree
        Objects with the shapes and types of the arguments and of the results.
    """

    def __init__(self, binary: bytes, given: Any, results: Any):
        self._run = MachineCode(binary)
        leaves, (result, self._structure) = jax.tree.leaves(given), jax.tree.flatten(results)
        self._block = Block([(x.shape, x.dtype) for x in leaves], [(x.shape, x.dtype) for x in result])

    def __call__(self, given: Sequence[np.ndarray]) -> Any:
        """Return the results for the leaves of the arguments, which have the shapes and types of the program."""
        return jax.tree.unflatten(self._structure, self._block.results(self._run, given, 1))


class Program:
    """Machine code that runs a function of one instant for many.

    Parameters
    ----------
    binary : bytes
        Object file from `modules.object_file`.
    given, results : pytree
        Objects with the shapes and types of the arguments, shared and of one instant, and of the results of one
        instant.
    rows : bool, default False
        As for `object_file`.
    """

    def __init__(self, binary: bytes, given: tuple[Any, Any], results: Any, *, rows: bool = False):
        self._run = MachineCode(binary)
        shared, lanes = map(jax.tree.leaves, given)
        self._shared = [(x.shape, x.dtype) for x in shared]
        self._layout = Layout(self._shared)
        self._lanes = [(x.shape[:-1], x.dtype) for x in lanes]
        leaves, self._structure = jax.tree.flatten(results)
        self._results = [(leaf.shape[:-1], leaf.dtype) for leaf in leaves]
        self.width, self._rows = vector_width(), rows
        self._vector = Block(self._shared + self._many(self._lanes, self.width), self._many(self._results, self.width))
        # programs that differ only in unread arguments have the same code
        read = repr((self._shared, self._lanes, self._results)).encode()
        self.name = f"jounce_{hashlib.sha256(binary + read).hexdigest()[:32]}"

    def __call__(
        self,
        shared: Sequence[np.ndarray],
        lanes: Sequence[np.ndarray],
        parts: int = 1,
        parallel_map: Callable[..., Any] = map,
    ) -> Any:
        """Return the results.

        Parameters
        ----------
        shared, lanes : sequence of array
            Leaves of the arguments; instants along the last axis, or along the first.
        parts : int, default 1
            Number of calls of the machine code that share the instants, if these lie along the first axis.
        parallel_map : callable, optional
            Function like `map` that makes these calls; the machine code may run in several threads.
        """
        axis = 0 if self._rows else -1
        count = lanes[0].shape[axis]
        first = slice(count) if self._rows else (..., slice(count))
        self._check(shared, lanes, count)
        if 0 < count <= self.width:  # the last instant again in the other lanes
            indices = np.minimum(np.arange(self.width), count - 1)
            given = [*shared, *(x.take(indices, axis) for x in lanes)]
            # copies, as results may be kept for longer than the arguments in their block
            result = [x[first].copy() for x in self._vector.results(self._run, given, self.width)]
            return jax.tree.unflatten(self._structure, result)
        total = max(count, self.width)
        given = [np.ascontiguousarray(padded(x, total, axis)) for x in lanes]
        result = [np.empty(*kind) for kind in self._many(self._results, total)]
        memory = np.empty(self._layout.end, np.uint8)
        self._layout.put(memory, shared)
        arrays = [*given, *result]
        addresses = [*(self._layout.offsets + address_of(memory)).tolist(), *map(address_of, arrays)]
        if not self._rows or (vectors := total // self.width) < 2 or parts == 1:
            self._run((ctypes.c_void_p * len(addresses))(*addresses), total)
        else:
            steps = [0] * len(shared) + [x.strides[0] for x in arrays]
            ends = [vectors * k // parts * self.width for k in range(parts)] + [total]

            def run(part: int) -> None:
                start, stop = ends[part : part + 2]
                if start < stop:
                    pointers = [address + start * step for address, step in zip(addresses, steps, strict=True)]
                    self._run((ctypes.c_void_p * len(pointers))(*pointers), stop - start)

            list(parallel_map(run, range(parts)))
        return jax.tree.unflatten(self._structure, [x[first] for x in result])

    def rounds(
        self,
        shared: Sequence[np.ndarray],
        lanes: Sequence[Sequence[np.ndarray]],
        results: Sequence[np.ndarray | None],
        sources: np.ndarray,
        links: Sequence[int],
    ) -> RoundRunner:
        """Return the runner that solves instants in rounds, where later rounds start from the results of earlier ones.

        Parameters
        ----------
        shared : sequence of array
            Leaves of the shared arguments.
        lanes : three sequences of array
            Leaves of the arguments of an instant: those linked to its source, its own, and those held for all; see
            `RoundRunner`.
        results : sequence of array
            Output arrays for the leaves of the results; None for those that are not needed.
        sources, links : sequence of int
            As for `RoundRunner`.
        """
        if self._rows:
            raise ValueError("instants are along the first axis")
        _agree(shared, self._shared)
        columns = [Column(*kind, x) for kind, x in zip(self._lanes, itertools.chain(*lanes), strict=True)]
        first, second = itertools.accumulate(map(len, lanes[:2]))
        outputs = [Column(*kind, x) for kind, x in zip(self._results, results, strict=True)]
        groups = columns[:first], columns[first:second], columns[second:], outputs
        return RoundRunner(self._run.rounds, shared, *groups, sources, links, self.width)

    def publish(self) -> None:
        """Publish the program by its name to other machine code, for `in_program`."""
        if self._rows:
            raise ValueError("instants are along the first axis")
        self._run.publish(self.name)

    def in_program(self, shared: Sequence[Any], lanes: Sequence[Any]) -> Any:
        """Return the results as part of a traced program that becomes machine code, for arguments as in a call.

        There must be at least a vector of lanes. The call is represented by JAX's foreign function call (see
        `calls.call`); XLA does not know the name.
        """
        count = lanes[0].shape[-1]
        if count < self.width:
            raise ValueError(f"{count} lanes, where a vector has {self.width}")
        self._check(shared, lanes, count)
        shapes = [jax.ShapeDtypeStruct((*shape, count), dtype) for shape, dtype in self._results]
        return jax.tree.unflatten(self._structure, jax.ffi.ffi_call(self.name, shapes)(*shared, *lanes))

    def _check(self, shared: Sequence[Any], lanes: Sequence[Any], count: int) -> None:
        """Raise ValueError unless the arrays, with `count` instants, have the shapes and types of the program."""
        _agree([*shared, *lanes], [*self._shared, *self._many(self._lanes, count)])

    def _many(self, kinds: Sequence[tuple[tuple[int, ...], Any]], count: int) -> list[tuple[tuple[int, ...], Any]]:
        """Return the shapes and types of arrays of an instant for a number of instants."""
        return [((count, *shape) if self._rows else (*shape, count), dtype) for shape, dtype in kinds]


def _agree(arrays: Sequence[Any], expected: Sequence[tuple[tuple[int, ...], Any]]) -> None:
    """Raise ValueError unless arrays have the expected shapes and types."""
    result = [(x.shape, x.dtype) for x in arrays]
    if result != expected:
        raise ValueError(f"arrays of {result}, where the program was made for {expected}")
