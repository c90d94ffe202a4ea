"""A function of one instant as a program that runs it for many side by side."""

import ctypes
import hashlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from jounce.native.code import Code, Region, UnsupportedOperationError, flat
from jounce.native.handler import handler_text, is_known
from jounce.native.machine import MachineCode, compiled, vector_width
from jounce.native.operations import Values, constants, kind_of
from jounce.native.translation import translate

MOST_MEMORY = 2**20  # bytes of the stack: threads have little
ATTRIBUTES = """attributes #0 = { nounwind willreturn memory(none) }
attributes #2 = { nounwind willreturn memory(none) "min-legal-vector-width"="512" "prefer-vector-width"="512" }
attributes #1 = { nounwind "min-legal-vector-width"="512" "prefer-vector-width"="512" }
!0 = !{}"""


def object_file(function: Callable[..., Any], shared: Any, lanes: Any, known: Mapping[int, np.ndarray]) -> bytes:
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

    Raises
    ------
    UnsupportedOperationError
        Where there is no code for it, or too much.
    """
    return compiled(_text(jax.make_jaxpr(function)(shared, lanes), len(jax.tree.leaves(shared)), known, vector_width()))


class Program:
    """Machine code that runs a function of one instant for many.

    Parameters
    ----------
    binary : bytes
        From `object_file`.
    given, results : pytree
        Of what has the shapes and types of the arguments, shared and of an instant, and of the results for an instant.
    """

    def __init__(self, binary: bytes, given: tuple[Any, Any], results: Any):
        self._run = MachineCode(binary)
        self.name = f"jounce_{hashlib.sha256(binary).hexdigest()[:32]}"
        shared, lanes = map(jax.tree.leaves, given)
        self._shared = [(x.shape, x.dtype) for x in shared]
        self._lanes = [(x.shape[:-1], x.dtype) for x in lanes]
        leaves, self._structure = jax.tree.flatten(results)
        self._results = [(x.shape[:-1], x.dtype) for x in leaves]
        self._width = vector_width()

    def __call__(self, shared: Sequence[np.ndarray], lanes: Sequence[np.ndarray]) -> Any:
        """Return the results.

        Parameters
        ----------
        shared, lanes : sequence of array
            Leaves of the arguments; instants along the last axis.
        """
        count = lanes[0].shape[-1]
        total = max(count, self._width)
        self._check(shared, lanes, count)
        if total > count:
            lanes = [np.concatenate([x, np.repeat(x[..., -1:], total - count, axis=-1)], axis=-1) for x in lanes]
        given = [np.ascontiguousarray(x) for x in (*shared, *lanes)]
        found = [np.empty((*shape, total), dtype) for shape, dtype in self._results]
        addresses = [array.__array_interface__["data"][0] for array in (*given, *found)]
        if count:
            self._run((ctypes.c_void_p * len(addresses))(*addresses), total)
        return jax.tree.unflatten(self._structure, [x[..., :count] for x in found])

    def register(self) -> bool:
        """Make it known to XLA by its name, for `in_program`; tell whether that goes."""
        if is_known():
            jax.ffi.register_ffi_target(self.name, jax.ffi.pycapsule(self._run.handler), platform="cpu")
        return is_known()

    def in_program(self, shared: Sequence[Any], lanes: Sequence[Any]) -> Any:
        """Return the results as part of a program of JAX, for arguments as in a call; at least a vector of lanes."""
        count = lanes[0].shape[-1]
        if count < self._width:
            raise ValueError(f"{count} lanes, where a vector has {self._width}")
        self._check(shared, lanes, count)
        shapes = [jax.ShapeDtypeStruct((*shape, count), dtype) for shape, dtype in self._results]
        return jax.tree.unflatten(self._structure, jax.ffi.ffi_call(self.name, shapes)(*shared, *lanes))

    def _check(self, shared: Sequence[Any], lanes: Sequence[Any], count: int) -> None:
        """Raise ValueError unless arrays are of the shapes and types that the machine code reads."""
        wanted = [*self._shared, *(((*shape, count), dtype) for shape, dtype in self._lanes)]
        found = [(x.shape, x.dtype) for x in (*shared, *lanes)]
        if found != wanted:
            raise ValueError(f"arrays of {found}, where the program was made for {wanted}")


def _text(closed: Any, shared: int, known: Mapping[int, np.ndarray], width: int) -> str:
    """Return the text of a module with a function `run` of the addresses of all arrays and the number of lanes."""
    code, given = Code(width), []
    for number, variable in enumerate(closed.jaxpr.invars):
        if number in known:
            given.append(constants(code, known[number]))
            continue
        region = _region(code, number, kind_of(variable.aval.dtype), lanes=number >= shared)
        array = np.empty(variable.aval.shape, object)
        array.ravel()[:] = [code.load(region, k) for k in range(array.size)]
        given.append(array)
    results = translate(code, closed.jaxpr, [constants(code, number) for number in closed.consts], given)
    for number, array in enumerate(results, len(given)):
        _write(code, number, array)
    if code.memory > MOST_MEMORY:
        raise UnsupportedOperationError(f"{code.memory} bytes of memory")
    lines = [
        "define void @run(ptr noalias %arguments, i64 %total) #1 {",
        "begin:",
        *code.entry,
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
        "ret void",
        "}",
        *sorted(code.intrinsics | {"declare i64 @llvm.smin.i64(i64, i64)"}),
    ]
    for name, count in sorted(code.functions):
        lines += [f"declare double @{name}({', '.join(['double'] * count)}) #0", _lane_by_lane(name, count, width)]
    lines.append(handler_text(len(given), len(results), shared))
    return "\n".join([*lines, ATTRIBUTES])


def _region(code: Code, number: int, kind: str, *, lanes: bool) -> Region:
    """Return the memory of an argument or a result."""
    code.entry.append(f"%q{number} = getelementptr ptr, ptr %arguments, i64 {number}")
    code.entry.append(f"%a{number} = load ptr, ptr %q{number}, align 8, !invariant.load !0")
    return Region(f"%a{number}", kind, lanes, given=True)


def _write(code: Code, number: int, array: Values) -> None:
    values = flat(array)
    if not values:
        return
    region = _region(code, number, values[0].kind, lanes=True)
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
    return f'define internal {vector} @{name}_of_lanes({listed}) noinline #2 {{\n{body}\n}}'
