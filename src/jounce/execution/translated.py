"""Functions of JAX as machine code: for a single instant, or for many side by side; made once for each structure.

XLA makes a program of calls, one for each operation on arrays, and each takes longer than the arithmetic on a few
numbers. Here one sequence of machine code does all of it (see `jounce.execution.llvm`): of one instant, single values
are in registers, and loops go over what is larger; of many, the registers hold several instants at a time.
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
from jounce.base.shapes import only_arrays
from jounce.execution.backends import uses_machine_code, warn_of_missing
from jounce.execution.background import ByKey
from jounce.execution.llvm.modules import object_file
from jounce.execution.llvm.programs import Program, Single
from jounce.execution.llvm.text.values import UnsupportedOperationError
from jounce.execution.store.programs import current_store, is_in_haste, loaded_or_made
from jounce.execution.structure import UndescribedError, cache_key, settings
from jounce.execution.traced_once import one_program

Group = tuple[Sequence[np.ndarray | jax.ShapeDtypeStruct], Any]  # leaves of a tree, or their forms, and its structure
LITTLE = 20_000  # numbers that a program is given: of more, even one call takes long
_thread = threading.local()


def all_shaped(leaves: Sequence[Any]) -> list[Any]:
    """Return leaves as arrays of NumPy; a form, which has only shape and type, stays as it is."""
    if only_arrays(leaves):
        return list(leaves)
    return [leaf if type(leaf) in (np.ndarray, jax.ShapeDtypeStruct) else np.asarray(leaf) for leaf in leaves]


def traces_one_instant() -> bool:
    """Return whether this thread traces a program of an instant, for which loops are not unrolled beforehand."""
    return getattr(_thread, "tracing", False)


@dataclasses.dataclass(frozen=True)
class WhenMade:
    """A static argument that is found when a program is made, and not at each call.

    Parameters
    ----------
    find : callable
        Returns it; None where there is to be no machine code. It depends only on the other static arguments, the forms
        of the arguments, and the whole numbers in their arrays.
    """

    find: Callable[[], Any] = dataclasses.field(compare=False)


class Translated:
    """A function of arrays, of which `program` makes machine code.

    Parameters
    ----------
    function : callable
        Of two pytrees of arrays, shared by all instants and of the instant, with a last axis of length one, as its
        results have; and of static arguments. With `single`, it takes the arguments and keywords in the first pytree.
    made_of : tuple of callable
        Functions of the package that say what it computes.
    single : bool, default False
        Whether there is one instant only.
    rows : bool, default False
        Whether arrays of many instants, those given and the results, have the instants along their first axis.
    brief : bool, default False
        Whether it is called so seldom that, for small arguments, it is compiled with fewer optimizations.
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
        """Return the number of programs that were requested, including those without machine code."""
        return len(self._programs)

    def program(self, shared: Group, lanes: Group, static: Mapping[str, Any], *, large: int | None = None) -> Any:
        """Return the machine code, `Single` or `Program`; None where there is none: no compiler, or no code for it.

        Arrays of whole numbers that all instants share, which are indices, are part of the program.

        Parameters
        ----------
        shared, lanes : tuple
            The leaves of the arguments, or their shapes and types, and their structure.
        static : mapping
            Further arguments of the function, which may be found when a program is made.
        large : int, optional
            Arrays of more numbers are in memory, as `object_file` has it.
        """
        if not uses_machine_code():
            return None
        (arrays, structure), (few, form) = shared, lanes
        kinds = tuple([(x.shape, x.dtype) for x in arrays])
        ones = tuple([(self._one(x.shape), x.dtype) for x in few])
        found_later = [name for name, value in static.items() if type(value) is WhenMade]
        matters, hasty = found_later or not self._single, is_in_haste()
        indices: Any = {k: x for k, x in enumerate(arrays) if x.dtype.kind in "iu" and x.ndim} if matters else {}
        known = tuple([x.tobytes() for x in indices.values()])
        static_key = tuple([(name, type(value), value) for name, value in static.items()])
        key = structure, form, kinds, ones, known, large, hasty, static_key, settings()

        def make() -> Any:
            late = {name: static[name].find() for name in found_later}
            if None in late.values():
                return None
            parts = zip((structure, form), (kinds, ones), strict=True)
            given = [jax.tree.unflatten(tree, [jax.ShapeDtypeStruct(*x) for x in its]) for tree, its in parts]
            constant = {} if self._single else indices
            return self._made((given[0], given[1]), constant, {"large": large, "hasty": hasty}, {**static, **late})

        program = self._programs.get(key, make)
        if isinstance(program, str):
            warn_of_missing(program)
            return None
        return program

    def _one(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of an instant's part of an array."""
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
        """Return a program from the store of programs, or one that is made; or what there is no code for."""
        function = partial(self._traced, **static)
        options: Any = how | {"rows": self._rows, "single": self._single}
        options["brief"] = self._brief and sum(leaf.size for leaf in jax.tree.leaves(given)) <= LITTLE

        def make() -> tuple[Any, ...]:
            try:
                with compiling(self.function):
                    binary, results = object_file(function, *given, indices, **options)
            except UnsupportedOperationError as missing:  # stored, too, as it takes long to find out
                return b"", str(missing), None
            return binary, tuple(map(jax.tree.leaves, given)), results

        key = self._key(given, indices, dict(static) | how) if current_store() is not None else None
        return loaded_or_made(key, make, self._loaded)

    def _loaded(self, binary: bytes, given: Any, results: Any) -> Single | Program | str | None:
        if not binary:
            return given
        return Single(binary, given, results) if self._single else Program(binary, given, results, rows=self._rows)

    def _key(self, given: tuple[Any, Any], indices: Mapping[int, np.ndarray], static: dict[str, Any]) -> str | None:
        """Return the name of a program in other processes, None where it holds something of a user's own."""
        leaves, tree = jax.tree.flatten(given)
        kinds = [*((leaf.shape, str(leaf.dtype)) for leaf in leaves), *indices.values()]
        with suppress(UndescribedError):
            return cache_key(self.made_of, tree, [*kinds, "single" if self._single else "side by side"], static)
        return None
