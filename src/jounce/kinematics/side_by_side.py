"""Functions of one instant as machine code for many, where there is a compiler for it and the code is not too long.

XLA calls an operation on arrays after another, each of which goes through memory. Here all operations of an instant
follow one another in the registers of the processor, eight instants at a time (see `jounce.native`).
"""

import dataclasses
import os
import pickle
import threading
import zlib
from collections.abc import Callable
from functools import cached_property, partial, update_wrapper
from typing import Any

import jax
import numpy as np
from jax.core import Tracer

from jounce.kinematics.compilation import current_store
from jounce.kinematics.device import on_processor
from jounce.kinematics.structure import UndescribedError, being_debugged, program_key
from jounce.native import machine
from jounce.native.code import UnsupportedOperationError
from jounce.native.programs import Program, object_file

VARIABLE = "JOUNCE_NATIVE"  # 0 leaves everything to XLA


_registered: dict[str, Program] = {}  # by the names under which XLA calls them


@dataclasses.dataclass(frozen=True)
class Prepared:
    """Machine code of a function of one instant, with what all instants share."""

    machine_code: Program
    shared: list[np.ndarray]

    def __call__(self, lanes: Any) -> Any:
        """Return the results for instants along the last axis."""
        return self.machine_code(self.shared, [np.asarray(leaf) for leaf in jax.tree.leaves(lanes)])

    @cached_property
    def name(self) -> str | None:
        """Name by which programs of XLA call it, as `called` has it; None if they cannot."""
        name = self.machine_code.name
        if name not in _registered:
            if not self.machine_code.register():
                return None
            _registered[name] = self.machine_code
        return name


def called(name: str, shared: Any, lanes: Any) -> Any:
    """Return the results of machine code as part of a program of XLA."""
    return _registered[name].in_program(jax.tree.leaves(shared), jax.tree.leaves(lanes))


class SideBySide:
    """A function of one instant, of which `program` makes machine code.

    Parameters
    ----------
    function : callable
        Of two pytrees of arrays, shared by all instants and of the instant, with a last axis of length one, as its
        results have; and of static arguments.
    """

    def __init__(self, function: Callable[..., Any]):
        self.function = function
        self._programs: dict[Any, Program | None] = {}
        self._lock = threading.Lock()
        update_wrapper(self, function)

    def program(self, shared: Any, lanes: Any, **static: Any) -> Prepared | None:
        """Return its machine code; None where there is none.

        Whole numbers among what is shared, which say what is joined to what, are part of the program.
        """
        if not _wanted() or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((shared, lanes))):
            return None
        leaves, structure = jax.tree.flatten(shared)
        arrays = [np.asarray(leaf) for leaf in leaves]
        one = jax.tree.map(lambda x: jax.ShapeDtypeStruct((*x.shape[:-1], 1), x.dtype), lanes)
        places = {k: array for k, array in enumerate(arrays) if array.dtype.kind in "iu" and array.ndim}
        kinds = tuple((array.shape, array.dtype.str) for array in arrays)
        key = (
            structure,
            kinds,
            tuple(array.tobytes() for array in places.values()),
            tuple((leaf.shape, leaf.dtype) for leaf in jax.tree.leaves(one)),
            tuple(static.items()),
        )
        with self._lock:
            if key not in self._programs:
                self._programs[key] = self._made(shared, one, places, static)
            program = self._programs[key]
        return None if program is None else Prepared(program, arrays)

    def _made(self, shared: Any, one: Any, places: dict[int, np.ndarray], static: dict[str, Any]) -> Program | None:
        """Return a program from the store of programs, or one that is made, and kept there."""
        function, store = partial(self.function, **static), current_store()
        shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(np.shape(x), np.asarray(x).dtype), shared)
        key = None
        if store is not None:
            leaves, tree = jax.tree.flatten((shapes, one))
            kinds = [*((leaf.shape, str(leaf.dtype)) for leaf in leaves), *places.values(), machine.processor()]
            try:
                key = program_key((self.function,), tree, kinds, static)
            except UndescribedError:
                store = None
        if store is not None and key is not None and (kept := store.get(key)) is not None:
            try:
                binary, results = pickle.loads(zlib.decompress(kept))
                return Program(binary, results)
            except Exception:  # noqa: BLE001 - whatever is wrong with it, it is made again
                store.drop(key)
        try:
            binary = object_file(function, shapes, one, places)
        except UnsupportedOperationError:
            return None
        results = jax.eval_shape(function, shapes, one)
        if store is not None and key is not None:
            try:
                store.put(key, zlib.compress(pickle.dumps((binary, results)), level=1))
            except (TypeError, ValueError, AttributeError, pickle.PicklingError):
                pass
        return Program(binary, results)


def _wanted() -> bool:
    return os.environ.get(VARIABLE, "") != "0" and machine.is_installed() and on_processor() and not being_debugged()
