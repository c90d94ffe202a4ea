"""Functions of one instant as machine code for many, where there is a compiler for it and the code is not too long.

XLA calls one operation on arrays after another, and each goes through memory. Here all operations on an instant follow
one another in the registers of the processor, several instants at a time (see `jounce.execution.llvm`).
"""

import dataclasses
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cached_property, partial
from typing import Any

import jax
import numpy as np

from jounce.execution.alone import is_wanted
from jounce.execution.llvm import machine
from jounce.execution.llvm.modules import object_file
from jounce.execution.llvm.programs import Program
from jounce.execution.llvm.relays import Relay
from jounce.execution.llvm.text.scalars import MOST_LINES
from jounce.execution.llvm.text.values import UnsupportedOperationError
from jounce.execution.store import current_store, made_or_kept
from jounce.execution.structure import UndescribedError, program_key, settings
from jounce.execution.threads import Threads
from jounce.settings import under_own_settings
from jounce.shapes import is_traced

_published: dict[str, Program] = {}  # by the names under which other machine code calls them


@dataclasses.dataclass(frozen=True)
class Prepared:
    """Machine code of a function of one instant, with what all instants share."""

    machine_code: Program
    shared: list[np.ndarray]

    def __call__(self, lanes: Any, threads: int = 1) -> Any:
        """Return the results for many instants, which are shared among threads where they lie along the first axis."""
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(lanes)]
        if threads == 1:
            return self.machine_code(self.shared, leaves)
        with Threads(threads, compiled=True) as pool:
            parts = 4 * threads  # none is to wait long for another
            return self.machine_code(self.shared, leaves, parts, pool.map)

    def relay(self, lanes: tuple[Any, Any, Any], results: Any, sources: np.ndarray) -> Relay:
        """Return what solves instants in rounds, see `Program.relay`; what is None among the results is not wanted."""
        leaves: Any = [[np.asarray(leaf) for leaf in jax.tree.leaves(group)] for group in lanes]
        kept = jax.tree.leaves(results, is_leaf=lambda x: x is None)
        return self.machine_code.relay(self.shared, leaves, kept, sources)

    @property
    def lanes(self) -> int:
        """How many instants a vector holds."""
        return self.machine_code.width

    @cached_property
    def name(self) -> str:
        """Name by which other machine code calls it, as `called` has it."""
        name = self.machine_code.name
        if name not in _published:
            self.machine_code.publish()
            _published[name] = self.machine_code
        return name


def called(name: str, shared: Any, lanes: Any) -> Any:
    """Return the results of machine code as part of a program that becomes machine code, too."""
    return _published[name].in_program(jax.tree.leaves(shared), jax.tree.leaves(lanes))


class SideBySide:
    """A function of one instant, of which `program` makes machine code.

    Parameters
    ----------
    function : callable
        Of two pytrees of arrays, shared by all instants and of the instant, with a last axis of length one, as its
        results have; and of static arguments.
    rows : bool, default False
        Whether arrays of many instants, those given and the results, have the instants along their first axis.
    made_of : tuple of callable, optional
        Functions of the package that say what it computes, where it is none of them itself.
    most_lines : int, optional
        Of LLVM's text: what is longer takes too long to compile for what it gains.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        *,
        rows: bool = False,
        made_of: tuple[Callable[..., Any], ...] = (),
        most_lines: int = MOST_LINES,
    ):
        self.function, self.rows, self.made_of = function, rows, made_of or (function,)
        self.most_lines = most_lines
        self._programs: dict[Any, Program | None] = {}
        self._lock = threading.Lock()
        self.__wrapped__, self.__doc__ = function, function.__doc__  # by which a name in the package is known as its

    def __len__(self) -> int:
        """How many programs were wanted, those that there is no code for included."""
        return len(self._programs)

    @under_own_settings
    def program(
        self, shared: Any, lanes: Any, *, large: int | None = None, hasty: bool = False, **static: Any
    ) -> Prepared | None:
        """Return its machine code; None where there is none: no compiler, or no code for what it does.

        Whole numbers among what is shared, which say what is joined to what, are part of the program.

        Parameters
        ----------
        shared, lanes : pytree
            Of arrays, as the function has them.
        large : int, optional
            Arrays of more numbers are in memory, as `object_file` has it.
        hasty : bool, default False
            Whether it is to be there soon rather than fast.
        **static
            Further arguments of the function.
        """
        leaves, structure = jax.tree.flatten(shared)
        few, form = jax.tree.flatten(lanes)
        if not is_wanted() or is_traced([*leaves, *few]):
            return None
        arrays = [np.asarray(leaf) for leaf in leaves]
        kinds = tuple([(x.shape, x.dtype) for x in arrays])
        ones = tuple([(self._one(np.shape(x)), np.asarray(x).dtype) for x in few])
        places = {k: x for k, x in enumerate(arrays) if x.dtype.kind in "iu" and x.ndim}
        known = tuple([x.tobytes() for x in places.values()])
        key = structure, form, kinds, ones, known, large, hasty, tuple(static.items()), settings()
        with self._lock:
            if key not in self._programs:
                parts = zip((structure, form), (kinds, ones), strict=True)
                given = [jax.tree.unflatten(tree, [jax.ShapeDtypeStruct(*kind) for kind in its]) for tree, its in parts]
                self._programs[key] = self._made(tuple(given), places, {"large": large, "hasty": hasty}, static)
            program = self._programs[key]
        return None if program is None else Prepared(program, arrays)

    def _one(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of an instant's part of an array."""
        return (*(shape[1:] if self.rows else shape[:-1]), 1)

    def _made(
        self,
        given: tuple[Any, Any],
        places: Mapping[int, np.ndarray],
        how: dict[str, Any],
        static: dict[str, Any],
    ) -> Program | None:
        """Return a program from the store of programs, or one that is made."""
        function = partial(self.function, **static)
        options: Any = how | {"most_lines": self.most_lines}

        def make() -> tuple[Any, ...]:
            try:
                binary, results = object_file(function, *given, places, rows=self.rows, **options)
            except UnsupportedOperationError:  # which is kept, too: to find it out takes long
                return b"", None, None
            return binary, tuple(map(jax.tree.leaves, given)), results

        key = self._key(given, places, static | how) if current_store() is not None else None
        return made_or_kept(key, make, self._loaded)

    def _loaded(self, binary: bytes, given: Any, results: Any) -> Program | None:
        return Program(binary, given, results, rows=self.rows) if binary else None

    def _key(self, given: tuple[Any, Any], places: Mapping[int, np.ndarray], static: dict[str, Any]) -> str | None:
        """Return the name of a program in other processes, None where it holds something of a user's own."""
        leaves, tree = jax.tree.flatten(given)
        kinds = [*((leaf.shape, str(leaf.dtype)) for leaf in leaves), *places.values(), machine.processor()]
        with suppress(UndescribedError):
            return program_key(self.made_of, tree, kinds, static)
        return None
