"""Functions of small arrays as machine code, where there is a compiler for it.

XLA makes a program of calls, one for each operation on arrays, and each takes longer than the arithmetic on a few
numbers. Here one sequence of machine code does all of it, single values in registers and loops over what is larger (see
`jounce.execution.llvm`). It is compiled sooner, too.
"""

import os
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import jax
import numpy as np

from jounce.execution.device import on_processor
from jounce.execution.llvm import machine
from jounce.execution.llvm.modules import object_file
from jounce.execution.llvm.programs import Single
from jounce.execution.llvm.text.values import UnsupportedOperationError
from jounce.execution.store import current_store, is_wanted_soon, made_or_kept
from jounce.execution.structure import UndescribedError, program_key, settings

VARIABLE = "JOUNCE_NATIVE"  # 0 leaves everything to XLA
LARGE = 32  # numbers of an array that stays in memory
_thread = threading.local()


def is_wanted() -> bool:
    """Tell whether there is to be machine code: there is a compiler, and nothing forbids it."""
    return os.environ.get(VARIABLE, "") != "0" and machine.is_usable() and on_processor()


def is_traced_alone() -> bool:
    """Tell whether what this thread traces becomes machine code, in which a loop is shorter than all its turns."""
    return getattr(_thread, "tracing", False)


class Alone:
    """A function of arrays, of which `program` makes machine code.

    Parameters
    ----------
    function : callable
        Of arrays, of pytrees of them, and of static arguments.
    made_of : tuple of callable
        Functions of the package that say what it computes.
    """

    def __init__(self, function: Callable[..., Any], made_of: tuple[Callable[..., Any], ...]):
        self.function, self.made_of = function, made_of
        self._programs: dict[Any, Single | None] = {}
        self._lock = threading.Lock()

    def program(self, leaves: Sequence[Any], tree: Any, static: Mapping[str, Any]) -> Callable[[], Any] | None:
        """Return what computes the results for arguments; None where there is no code for it.

        Parameters
        ----------
        leaves, tree
            What JAX takes apart arguments and keywords into, each an array of NumPy or a number.
        static : mapping
            Further keywords.
        """
        if not is_wanted():
            return None
        arrays = [np.asarray(leaf) for leaf in leaves]
        kinds = tuple([(x.shape, x.dtype) for x in arrays])
        key = tree, kinds, tuple((name, type(value), value) for name, value in static.items()), settings()
        if key not in self._programs:
            with self._lock:
                if key not in self._programs:
                    self._programs[key] = self._made(tree, arrays, kinds, static)
        program = self._programs[key]
        return None if program is None else partial(program, arrays)

    def _made(self, tree: Any, arrays: Sequence[np.ndarray], kinds: Any, static: Mapping[str, Any]) -> Single | None:
        """Return a program from the store of programs, or one that is made."""
        given = jax.tree.unflatten(tree, [jax.ShapeDtypeStruct(x.shape, x.dtype) for x in arrays])

        def function(given: Any, _: Any) -> Any:
            _thread.tracing = True
            try:
                return self.function(*given[0], **given[1], **static)
            finally:
                _thread.tracing = False

        def make() -> tuple[Any, ...]:
            try:
                binary, results = object_file(function, given, (), {}, large=LARGE, alone=True, hasty=is_wanted_soon())
            except UnsupportedOperationError:  # which is kept, too
                return b"", None, None
            return binary, jax.tree.leaves(given), results

        name = None
        if current_store() is not None:
            with suppress(UndescribedError):
                told = [(shape, dtype.str) for shape, dtype in kinds]
                name = program_key(self.made_of, tree, [told, "alone", is_wanted_soon(), machine.processor()], static)
        return made_or_kept(name, make, lambda binary, *rest: Single(binary, *rest) if binary else None)
