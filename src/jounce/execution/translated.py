"""JAX functions as machine code, for a single instant or for many side by side, compiled once for each structure.

A program of XLA consists of calls, one for each array operation, which take longer than the arithmetic on a few
numbers. Here a single sequence of machine code does all operations (see `jounce.execution.llvm`): for one instant,
small arrays are unrolled to registers and larger ones are loops; for many, registers hold several instants at a time.
"""

import dataclasses
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import jax
import numpy as np

from jounce.base.activity import compiling
from jounce.execution.backends import uses_machine_code, warn_of_missing
from jounce.execution.background import ByKey
from jounce.execution.llvm.modules import object_file
from jounce.execution.llvm.programs import Program, Single
from jounce.execution.llvm.text.values import UnsupportedOperationError
from jounce.execution.store.programs import current_store, is_in_haste, loaded_or_made
from jounce.execution.structure import UndescribedError, cache_key, settings
from jounce.execution.traced_once import one_program

Group = tuple[Sequence[np.ndarray | jax.ShapeDtypeStruct], Any]  # leaves of a tree, or their shapes, and its structure
FLOAT = np.dtype(float)
SHAPE = jax.ShapeDtypeStruct
LITTLE = 20_000  # entries of all arguments: with more, even one call is worth optimization
_thread = threading.local()


def all_shaped(leaves: Sequence[Any]) -> list[Any]:
    """Return leaves as NumPy arrays; a `jax.ShapeDtypeStruct` stays unchanged."""
    array = np.ndarray
    return [x if (kind := type(x)) is array or kind is SHAPE else np.asarray(x) for x in leaves]


def traces_one_instant() -> bool:
    """Return whether this thread traces a program for one instant, for which loops should not be unrolled."""
    return getattr(_thread, "tracing", False)


@dataclasses.dataclass(frozen=True)
class WhenMade:
    """A static argument that is computed when a program is made, and not at each call.

    Parameters
    ----------
    find : callable
        Function that returns the argument, or None for no machine code. It may depend only on the other static
        arguments, the shapes of the arguments, and the values of their integer arrays.
    """

    find: Callable[[], Any] = dataclasses.field(compare=False)


class Translated:
    """A function of arrays that is compiled to machine code.

    Parameters
    ----------
    function : callable
        Function of two pytrees of arrays, shared by all instants and of one instant, with a last axis of length one, as
        in its results; and of static arguments. With `single`, the arguments and keywords are in the first pytree.
    made_of : tuple of callable
        Functions of the package that define what it computes.
    single : bool, default False
        Whether there is only one instant.
    rows : bool, default False
        Whether arrays of many instants, arguments and results, have the instants along their first axis.
    brief : bool, default False
        Whether calls are so few that, for small arguments, it is compiled without optimization.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        made_of: tuple[Callable[..., Any], ...],
        *,
        single: bool = False,
        rows: bool = False,
        brief: bool = False,
    ):
        self.function, self.made_of = function, made_of
        self._single, self._rows, self._brief = single, rows, brief
        self._programs = ByKey()

    def __len__(self) -> int:
        """Return the number of requested programs, including those without machine code."""
        return len(self._programs)

    def program(self, shared: Group, lanes: Group, static: Mapping[str, Any], *, large: int | None = None) -> Any:
        """Return the machine code, `Single` or `Program`; None if there is no compiler, or no code for an operation.

        Shared integer arrays, which are indices, are compiled in.

        Parameters
        ----------
        shared, lanes : tuple
            The leaves of the arguments, or their shapes and types, and their structure.
        static : mapping
            Further arguments of the function, possibly `WhenMade`.
        large : int, optional
            Size beyond which arrays stay in memory, as for `object_file`.
        """
        if not uses_machine_code():
            return None
        (arrays, structure), (examples, form) = shared, lanes
        kinds = tuple([(x.shape, x.dtype) for x in arrays])
        lane_kinds = tuple([(self._one(x.shape), x.dtype) for x in examples])
        found_later = [name for name, value in static.items() if type(value) is WhenMade]
        is_keyed, hasty = found_later or not self._single, is_in_haste()
        others = [(k, x) for k, x in enumerate(arrays) if x.dtype is not FLOAT] if is_keyed else ()
        indices: Any = {k: x for k, x in others if x.dtype.kind in "iu" and x.ndim}
        values = tuple([x.tobytes() for x in indices.values()])
        static_key = tuple([(name, type(value), value) for name, value in static.items()])
        key = structure, form, kinds, lane_kinds, values, large, hasty, static_key, settings()

        def make() -> Any:
            late = {name: static[name].find() for name in found_later}
            if None in late.values():
                return None
            parts = zip((structure, form), (kinds, lane_kinds), strict=True)
            given = [jax.tree.unflatten(tree, [jax.ShapeDtypeStruct(*x) for x in group]) for tree, group in parts]
            constant = {} if self._single else indices
            return self._made((given[0], given[1]), constant, {"large": large, "hasty": hasty}, {**static, **late})

        program = self._programs.get(key, make)
        if isinstance(program, str):
            warn_of_missing(program)
            return None
        return program

    def _one(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of the part of an array for one instant."""
        return (*(shape[1:] if self._rows else shape[:-1]), 1)

    def _traced(self, given: Any, lanes: Any, **static: Any) -> Any:
        _thread.tracing = True
        try:
            with one_program():
                if self._single:
                    return self.function(*given[0], **given[1], **static)
                return self.function(given, lanes, **static)
        finally:
            _thread.tracing = False

    def _made(
        self, given: tuple[Any, Any], indices: Mapping[int, np.ndarray], how: dict[str, Any], static: Mapping[str, Any]
    ) -> Single | Program | str | None:
        """Return a program from the store, or a new one; or the name of the operation that has no code."""
        function = partial(self._traced, **static)
        options: Any = how | {"rows": self._rows, "single": self._single}
        options["brief"] = self._brief and sum(leaf.size for leaf in jax.tree.leaves(given)) <= LITTLE

        def make() -> tuple[Any, ...]:
            try:
                with compiling(self.function):
                    binary, results = object_file(function, *given, indices, **options)
            except UnsupportedOperationError as missing:  # stored, too, since the attempt takes long
                return b"", str(missing), None
            return binary, tuple(map(jax.tree.leaves, given)), results

        key = self._key(given, indices, dict(static) | how) if current_store() is not None else None
        return loaded_or_made(key, make, self._loaded)

    def _loaded(self, binary: bytes, given: Any, results: Any) -> Single | Program | str | None:
        if not binary:
            return given
        return Single(binary, given, results) if self._single else Program(binary, given, results, rows=self._rows)

    def _key(self, given: tuple[Any, Any], indices: Mapping[int, np.ndarray], static: dict[str, Any]) -> str | None:
        """Return the cache key of a program; None if it contains user code."""
        leaves, tree = jax.tree.flatten(given)
        kinds = [*((leaf.shape, str(leaf.dtype)) for leaf in leaves), *indices.values()]
        with suppress(UndescribedError):
            return cache_key(self.made_of, tree, [*kinds, "single" if self._single else "side by side"], static)
        return None
