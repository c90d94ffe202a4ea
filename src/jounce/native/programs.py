"""A function of one instant as a program that runs it for many side by side."""

import ctypes
import hashlib
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from jounce.native import rows as rows_
from jounce.native.arrays import constants
from jounce.native.code import MOST_LINES, Code, flat
from jounce.native.handler import handler_text, is_known
from jounce.native.machine import MachineCode, compiled, vector_width
from jounce.native.relays import Column, Relay, relay_text
from jounce.native.stored import Array, Stored, contiguous, is_large, put, values_of
from jounce.native.translation import translate
from jounce.native.values import Region, UnsupportedOperationError, kind_of

MOST_MEMORY = 2**20  # bytes of the stack: threads have little
MOST_HEAP = 2**28  # bytes elsewhere
ATTRIBUTES = """attributes #0 = { nounwind willreturn memory(none) }
attributes #2 = { nounwind willreturn memory(none) "min-legal-vector-width"="512" "prefer-vector-width"="512" }
attributes #1 = { nounwind "min-legal-vector-width"="512" "prefer-vector-width"="512" }
!0 = !{}"""


def object_file(
    function: Callable[..., Any],
    shared: Any,
    lanes: Any,
    known: Mapping[int, np.ndarray],
    *,
    rows: bool = False,
    most_lines: int = MOST_LINES,
    large: int | None = None,
    alone: bool = False,
) -> bytes:
    """Return the machine code of a function of one instant, as an object file.

    Parameters
    ----------
    function : callable
        Of two pytrees of arrays, those that all instants share and those of the instant; their last axis is of length
        one, as is that of all results.
    shared, lanes : pytree
        Of arrays, or of what has the shape and type of one.
    known : mapping
        Leaves of `shared`, by their numbers, whose values are part of the program.
    rows : bool, default False
        Whether arrays of many instants, those given and the results, have the instants along their first axis.
    most_lines : int, optional
        Of LLVM's text.
    large : int, optional
        Arrays of more numbers stay in memory, and operations on them are loops: shorter code that takes longer. None
        unless given.
    alone : bool, default False
        Whether there is one instant only, all of whose arrays are in `shared`.

    Raises
    ------
    UnsupportedOperationError
        Where there is no code for it, or too much.
    """
    closed, count = jax.make_jaxpr(function)(shared, lanes), len(jax.tree.leaves(shared))
    return compiled(_text(closed, count, known, vector_width(), rows=rows, most_lines=most_lines, large=large, alone=alone))


class Single:
    """Machine code of a function of one instant, for it alone.

    Parameters
    ----------
    binary : bytes
        From `object_file`, with `alone`.
    given, results : pytree
        Of what has the shapes and types of the arguments and of the results.
    """

    def __init__(self, binary: bytes, given: Any, results: Any):
        self._run = MachineCode(binary)
        self._given = [(x.shape, x.dtype) for x in jax.tree.leaves(given)]
        leaves, self._structure = jax.tree.flatten(results)
        self._results = [(leaf.shape, leaf.dtype) for leaf in leaves]

    def __call__(self, given: Sequence[np.ndarray]) -> Any:
        """Return the results, for the leaves of the arguments."""
        if [(x.shape, x.dtype) for x in given] != self._given:
            raise ValueError(f"arrays of {[(x.shape, x.dtype) for x in given]}, where the program is for {self._given}")
        found = [np.empty(*shape) for shape in self._results]
        arrays = [*map(np.ascontiguousarray, given), *found]
        addresses = [array.__array_interface__["data"][0] for array in arrays]
        self._run((ctypes.c_void_p * len(addresses))(*addresses), 1)
        return jax.tree.unflatten(self._structure, found)


class Program:
    """Machine code that runs a function of one instant for many.

    Parameters
    ----------
    binary : bytes
        From `object_file`.
    given, results : pytree
        Of what has the shapes and types of the arguments, shared and of an instant, and of the results for an instant.
    rows : bool, default False
        As for `object_file`.
    """

    def __init__(self, binary: bytes, given: tuple[Any, Any], results: Any, *, rows: bool = False):
        self._run = MachineCode(binary)
        self.name = f"jounce_{hashlib.sha256(binary).hexdigest()[:32]}"
        shared, lanes = map(jax.tree.leaves, given)
        self._shared = [(x.shape, x.dtype) for x in shared]
        self._lanes = [(x.shape[:-1], x.dtype) for x in lanes]
        leaves, self._structure = jax.tree.flatten(results)
        self._results = [(leaf.shape[:-1], leaf.dtype) for leaf in leaves]
        self._width, self._rows = vector_width(), rows

    def __call__(
        self, shared: Sequence[np.ndarray], lanes: Sequence[np.ndarray], parts: int = 1, each: Callable[..., Any] = map
    ) -> Any:
        """Return the results.

        Parameters
        ----------
        shared, lanes : sequence of array
            Leaves of the arguments; instants along the last axis, or along the first.
        parts : int, default 1
            Among how many calls of the machine code the instants are shared, where they lie along the first axis.
        each : callable, optional
            What makes these calls, in the manner of `map`; the machine code may run in several threads.
        """
        axis = 0 if self._rows else -1
        count = lanes[0].shape[axis]
        total = max(count, self._width)
        self._check(shared, lanes, count)
        if total > count:
            lanes = [_filled(x, total, axis) for x in lanes]
        given = [np.ascontiguousarray(x) for x in (*shared, *lanes)]
        shapes = [((total, *shape) if self._rows else (*shape, total), dtype) for shape, dtype in self._results]
        found = [np.empty(*shape) for shape in shapes]
        arrays = [*given, *found]
        addresses = [array.__array_interface__["data"][0] for array in arrays]
        if not self._rows or (vectors := total // self._width) < 2 or parts == 1:
            self._run((ctypes.c_void_p * len(addresses))(*addresses), total)
        else:
            steps = [0] * len(shared) + [x.strides[0] for x in arrays[len(shared) :]]
            ends = [vectors * k // parts * self._width for k in range(parts)] + [total]

            def run(part: int) -> None:
                start, stop = ends[part : part + 2]
                if start < stop:
                    here = [address + start * step for address, step in zip(addresses, steps, strict=True)]
                    self._run((ctypes.c_void_p * len(here))(*here), stop - start)

            list(each(run, range(parts)))
        return jax.tree.unflatten(self._structure, [x[:count] if self._rows else x[..., :count] for x in found])

    def relay(
        self,
        shared: Sequence[np.ndarray],
        lanes: Sequence[Sequence[np.ndarray]],
        results: Sequence[np.ndarray | None],
        sources: np.ndarray,
    ) -> Relay:
        """Return what solves instants in rounds, of which later ones start from the results of earlier ones.

        Parameters
        ----------
        shared : sequence of array
            Leaves of what all instants share.
        lanes : three sequences of array
            Leaves of the arguments of an instant: those that it takes from its source, those that are its own, and
            those that all have the same; see `Relay`.
        results : sequence of array
            Where the leaves of the results go; None for those that nobody wants.
        sources : array of int
            Index of the source of each instant.
        """
        if self._rows:
            raise ValueError("instants are along the first axis")
        _agree(shared, self._shared)
        columns = [Column(*kind, x) for kind, x in zip(self._lanes, itertools.chain(*lanes), strict=True)]
        first, second = itertools.accumulate(map(len, lanes[:2]))
        kept = [Column(*kind, x) for kind, x in zip(self._results, results, strict=True)]
        groups = columns[:first], columns[first:second], columns[second:], kept
        return Relay(self._run.relay, shared, *groups, sources, self._width)

    def register(self) -> bool:
        """Make it known to XLA by its name, for `in_program`; tell whether that goes."""
        if self._rows or not is_known():
            return False
        jax.ffi.register_ffi_target(self.name, jax.ffi.pycapsule(self._run.handler), platform="cpu")
        return True

    def in_program(self, shared: Sequence[Any], lanes: Sequence[Any]) -> Any:
        """Return the results as part of a program of JAX, for arguments as in a call; at least a vector of lanes."""
        count = lanes[0].shape[-1]
        if count < self._width:
            raise ValueError(f"{count} lanes, where a vector has {self._width}")
        self._check(shared, lanes, count)
        shapes = [jax.ShapeDtypeStruct((*shape, count), dtype) for shape, dtype in self._results]
        return jax.tree.unflatten(self._structure, jax.ffi.ffi_call(self.name, shapes)(*shared, *lanes))

    def _check(self, shared: Sequence[Any], lanes: Sequence[Any], count: int) -> None:
        """Raise ValueError unless arrays of so many instants are of the shapes and types that the code reads."""
        many = [((count, *shape) if self._rows else (*shape, count), dtype) for shape, dtype in self._lanes]
        _agree([*shared, *lanes], [*self._shared, *many])


def _agree(arrays: Sequence[Any], wanted: Sequence[tuple[tuple[int, ...], Any]]) -> None:
    """Raise ValueError unless arrays are of the shapes and types wanted."""
    found = [(x.shape, x.dtype) for x in arrays]
    if found != wanted:
        raise ValueError(f"arrays of {found}, where the program was made for {wanted}")


def _filled(x: np.ndarray, total: int, axis: int) -> np.ndarray:
    """Repeat the last instant until there are so many; zeros where there is none."""
    x = np.moveaxis(x, axis, 0)
    found = np.zeros((total, *x.shape[1:]), x.dtype)
    if len(x):
        found[: len(x)], found[len(x) :] = x, x[-1]
    return np.moveaxis(found, 0, axis)


def _text(
    closed: Any,
    shared: int,
    known: Mapping[int, np.ndarray],
    width: int,
    *,
    rows: bool = False,
    most_lines: int = MOST_LINES,
    large: int | None = None,
    alone: bool = False,
) -> str:
    """Return the text of a module with a function `run` of the addresses of all arrays and the number of lanes."""
    code, given = Code(width, most_lines, large=large, alone=alone), []
    for number, variable in enumerate(closed.jaxpr.invars):
        if number in known:
            given.append(constants(code, known[number]))
            continue
        region = _region(code, number, kind_of(variable.aval.dtype), lanes=number >= shared and not alone)
        shape = variable.aval.shape
        if is_large(code, variable.aval) and not (rows and region.lanes):
            given.append(contiguous(region, shape))
            continue
        array = np.empty(shape, object)
        if rows and region.lanes:
            array.ravel()[:] = rows_.read(code, region.pointer, array.size, region.kind)
        else:
            array.ravel()[:] = [code.load(region, k) for k in range(array.size)]
        given.append(array)
    results = translate(code, closed.jaxpr, [constants(code, number) for number in closed.consts], given)
    for number, array in enumerate(results, len(given)):
        _write(code, number, array, rows=rows)
    if code.memory > MOST_MEMORY or code.heap > MOST_HEAP:
        raise UnsupportedOperationError(f"{code.memory} bytes of the stack, and {code.heap} elsewhere")
    borrowed, returned = [], []
    if code.heap:
        borrowed, returned = [f"%heap = call ptr @aligned_alloc(i64 64, i64 {code.heap})"], ["call void @free(ptr %heap)"]
    loop = [
        f"%most = sub i64 %total, {width}",
        "br label %lanes",
        "lanes:",
        "%done = phi i64 [0, %begin], [%next, %more]",
        "%lane = call i64 @llvm.smin.i64(i64 %done, i64 %most)",  # the last vectors may share lanes
        *code.lines,
        "br label %more",
        "more:",
        f"%next = add i64 %done, {width}",
        "%over = icmp sge i64 %next, %total",
        "br i1 %over, label %end, label %lanes",
        "end:",
    ]
    lines = [
        *code.constants,
        "define void @run(ptr noalias %arguments, i64 %total) #1 {",
        "begin:",
        *borrowed,
        *code.entry,
        *(code.lines if alone else loop),
        *returned,
        "ret void",
        "}",
        "declare ptr @aligned_alloc(i64, i64)",
        "declare void @free(ptr)",
        *sorted(code.intrinsics | {"declare i64 @llvm.smin.i64(i64, i64)"}),
    ]
    for name, count in sorted(code.functions):
        lines += [f"declare double @{name}({', '.join(['double'] * count)}) #0", _lane_by_lane(name, count, width)]
    if not alone:
        lines += [handler_text(len(given), len(results), shared), relay_text(width)]
    return "\n".join([*lines, ATTRIBUTES])


def _region(code: Code, number: int, kind: str, *, lanes: bool) -> Region:
    """Return the memory of an argument or a result."""
    code.entry.append(f"%q{number} = getelementptr ptr, ptr %arguments, i64 {number}")
    code.entry.append(f"%a{number} = load ptr, ptr %q{number}, align 8, !invariant.load !0")
    return Region(f"%a{number}", kind, lanes, given=True)


def _write(code: Code, number: int, array: Array, *, rows: bool) -> None:
    if not array.size:
        return
    if isinstance(array, Stored) and not rows:
        put(code, contiguous(_region(code, number, array.kind, lanes=not code.alone), array.shape), array)
        return
    values = flat(values_of(code, array))
    region = _region(code, number, values[0].kind, lanes=not code.alone)
    if rows:
        rows_.write(code, region.pointer, values)
        return
    for k, value in enumerate(values):
        code.store(region, k, value)


def _lane_by_lane(name: str, count: int, width: int) -> str:
    """Return the text of a function of C's library for a vector."""
    vector, lines = f"<{width} x double>", []
    for lane in range(width):
        lines += [f"%e{lane}_{k} = extractelement {vector} %a{k}, i64 {lane}" for k in range(count)]
        given = ", ".join(f"double %e{lane}_{k}" for k in range(count))
        lines.append(f"%r{lane} = call double @{name}({given})")
        before = "poison" if lane == 0 else f"%s{lane - 1}"
        lines.append(f"%s{lane} = insertelement {vector} {before}, double %r{lane}, i64 {lane}")
    listed = ", ".join(f"{vector} %a{k}" for k in range(count))
    body = "\n".join([*lines, f"ret {vector} %s{width - 1}"])
    return f"define internal {vector} @{name}_of_lanes({listed}) noinline #2 {{\n{body}\n}}"
