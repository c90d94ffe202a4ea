"""How the solver's functions are compiled, and how what was compiled is kept for other processes.

Where there is a store, compiled programs go there, and come from there without the functions being traced: half of the
time of a first use is Python's. Without one `jax.jit` does everything.
"""

import inspect
import io
import os
import pickle
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, cached_property, partial, update_wrapper
from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jax.experimental import serialize_executable

from jounce.base.activity import compiling
from jounce.base.importing import uncollected
from jounce.base.jax_internals import description_reader, runs_at_once, without_sources
from jounce.base.shapes import only_arrays
from jounce.execution.background import ByKey
from jounce.execution.device import on_processor
from jounce.execution.store.programs import Descriptions, Store, current_store, is_in_haste, packed, unpacked
from jounce.execution.structure import UndescribedError, cache_key, settings
from jounce.execution.translated import Translated, all_shaped
from jounce.settings import check_process, under_own_settings

LARGE = 32  # numbers of an array that stays in memory in machine code of one instant
_NOTHING = jax.tree.structure(())
_thread = threading.local()
_requested = False  # whether JAX's own store, where it has one, asks `compiles_anew`


@contextmanager
def compiling_anew() -> Iterator[None]:
    """Have this thread compile meanwhile, and take nothing from JAX's own store, which asks `compiles_anew`.

    What XLA has read from bytes it cannot write again: it loses functions on the way.
    """
    _thread.anew = True
    try:
        yield
    finally:
        _thread.anew = False


def compiles_anew() -> bool:
    """Tell whether this thread is to compile, and takes nothing from JAX's own store."""
    return getattr(_thread, "anew", False)


def ask_before_jax() -> None:
    """Take note that JAX's own store asks `compiles_anew`."""
    global _requested
    _requested = True


def _store_of_xla() -> Store | None:
    """Return the store of what XLA compiles; None where JAX has a store of its own, or a device that was chosen."""
    config: Any = jax.config
    elsewhere = config.jax_compilation_cache_dir is not None and not _requested
    return None if elsewhere or config.jax_default_device is not None else current_store()


UNENDING = ("simplify-while-loops", "while-loop-invariant-code-motion", "while-loop-constant-sinking", "reshape-mover")
"""XLA's passes that undo each other's work, some twenty or thirty times: those over loops, which have nothing for them
to do here, and one that moves reshapes to where its simplifier does not want them."""


def compiler_options(*, narrow: bool = False) -> dict[str, Any] | None:
    """Return options that halve XLA's compile time of long chains of small operations, without making them slower.

    They are private to XLA: those that a release does not know are left out. There are none on a GPU.

    Parameters
    ----------
    narrow : bool, default False
        Whether arrays are so short that most of the time is that of calling operations: then LLVM need not do more
        than the first level of its optimizations, a fifth of the time in which a program is compiled.
    """
    if not on_processor():
        return None
    options = {"xla_cpu_use_fusion_emitters": False, "xla_disable_hlo_passes": ",".join(UNENDING)}
    if narrow and not _level_is_set():
        options["xla_backend_optimization_level"] = 1
    return {name: value for name, value in options.items() if name in _known_options()} or None


def _level_is_set() -> bool:
    """Tell whether the environment says how much LLVM is to optimize."""
    return "xla_backend_optimization_level" in os.environ.get("XLA_FLAGS", "")


@cache
def _known_options() -> frozenset[str]:
    """Return which of the options this release of XLA has; JAX 0.11, for one, came without the older emitters."""
    options = {"xla_cpu_use_fusion_emitters": False, "xla_disable_hlo_passes": "", "xla_backend_optimization_level": 1}
    if _are_known(options):
        return frozenset(options)
    return frozenset(name for name, value in options.items() if _are_known({name: value}))


def _are_known(options: dict[str, Any]) -> bool:
    try:
        jax.jit(lambda: 0.0, compiler_options=options).lower().compile()
    except (RuntimeError, ValueError):  # jax.errors.JaxRuntimeError is a RuntimeError
        return False
    return True


class Compiled:
    """A function compiled at its first call, as by `jax.jit` with the solver's options.

    Parameters
    ----------
    function : callable
        Of arrays, of pytrees of them, and of static arguments.
    static : tuple of str
        Names of the static arguments.
    made_of : tuple of callable, optional
        Functions of the package that say what it computes, where it is none of them itself.
    narrow : bool, optional
        Whether its arrays are short, as `compiler_options` has it.
    brief : bool, optional
        Whether a command calls it so seldom, or has it compute so little, that it waits longer for the compiler: then
        LLVM optimizes nothing in machine code, in a seventh of the time; nor in XLA's where code is needed soon, in
        half the time.
    single : bool or callable, optional
        Whether machine code, all in one piece, is better where there is a compiler for it; or what tells that from the
        arguments.
    otherwise : mapping of str to object, optional
        Static arguments where there is none, in the place of those given.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        static: tuple[str, ...],
        made_of: tuple[Callable[..., Any], ...] = (),
        *,
        narrow: bool = False,
        brief: bool = False,
        single: Callable[..., bool] | bool = False,
        otherwise: Mapping[str, Any] | None = None,
    ):
        self.function, self.static, self.made_of = function, static, made_of or (function,)
        self.narrow, self.brief = narrow, brief
        self._programs = ByKey()
        self._suits_single, self._otherwise = single, dict(otherwise or {})
        self.machine_code = Translated(function, self.made_of, single=True, brief=brief)
        self._names = tuple(inspect.signature(function).parameters)
        self._traced = min([self._names.index(name) for name in static], default=len(self._names))
        update_wrapper(self, function)

    @cached_property
    def jitted(self) -> Any:
        """The function as `jax.jit` returns it."""
        options = compiler_options(narrow=self.narrow)
        return jax.jit(self.function, static_argnames=self.static, compiler_options=options)

    @cached_property
    def _within(self) -> Any:
        """The function within a program of which it is a part: JAX takes options for the whole only."""
        return jax.jit(self.function, static_argnames=self.static)

    @under_own_settings
    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Call the compiled function."""
        check_process()
        arguments, keywords, static, leaves, tree = self._parts(arguments, keywords)
        traced = [] if only_arrays(leaves) else [leaf for leaf in leaves if isinstance(leaf, Tracer)]
        if not traced:
            arrays = all_shaped(leaves)
            if (code := self._code(arguments, keywords, static, arrays, tree)) is not None:
                return code(arrays)
        static |= self._otherwise
        if traced:
            whole = self.jitted if all(map(runs_at_once, traced)) else self._within
            return whole(*arguments, **keywords, **static)
        if (program := self._by_xla(arguments, keywords, static, leaves, tree)) is None:
            return self.jitted(*arguments, **keywords, **static)
        return program(*arguments, **keywords)

    @under_own_settings
    def prepare(self, *arguments: Any, **keywords: Any) -> None:
        """Make the program for arrays of these shapes, or `jax.ShapeDtypeStruct` in their places, unless it is there.

        Where `jax.jit` does everything, it compiles when it is called.
        """
        arguments, keywords, static, leaves, tree = self._parts(arguments, keywords)
        if self._code(arguments, keywords, static, all_shaped(leaves), tree) is None:
            self._by_xla(arguments, keywords, static | self._otherwise, leaves, tree)

    def _parts(self, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> tuple[Any, Any, dict[str, Any], Any, Any]:
        """Return the arguments without static ones, these, and the leaves and the structure of the others."""
        keywords |= zip(self._names[self._traced :], arguments[self._traced :], strict=False)
        arguments = arguments[: self._traced]
        static = {name: keywords.pop(name) for name in self.static if name in keywords}
        return arguments, keywords, static, *jax.tree.flatten((arguments, keywords))

    def _code(self, arguments: Any, keywords: Any, static: Mapping[str, Any], arrays: list[Any], tree: Any) -> Any:
        """Return machine code for arguments, None where there is none, or it does not suit them."""
        suits = self._suits_single
        if not (suits if isinstance(suits, bool) else suits(*arguments, **keywords, **static)):
            return None
        nothing = (), _NOTHING
        return self.machine_code.program((arrays, tree), nothing, static, large=LARGE, hasty=is_in_haste())

    def _by_xla(
        self, arguments: Any, keywords: Any, static: Mapping[str, Any], leaves: list[Any], tree: Any
    ) -> Callable[..., Any] | None:
        """Return the program of XLA for arguments, None where `jax.jit` has it."""
        store, kinds = _store_of_xla(), tuple(map(_kind, leaves))
        if store is None or None in kinds:
            return None
        static_key = tuple((name, type(value), value) for name, value in static.items())
        key = tree, kinds, static_key, self._level(), settings()
        return self._programs.get(key, lambda: self._made(store, tree, kinds, arguments, keywords, static))

    def _level(self) -> int | None:
        """Return how much LLVM is to optimize, where that is less than it does otherwise."""
        hasty = self.brief and is_in_haste() and on_processor() and not _level_is_set()
        return 0 if hasty and "xla_backend_optimization_level" in _known_options() else None

    def _made(
        self, store: Store, tree: Any, kinds: tuple[Any, ...], arguments: Any, keywords: Any, static: Mapping[str, Any]
    ) -> Callable[..., Any]:
        """Return a program from the store, or one that is compiled, and kept there if it has a name."""
        level = self._level()
        try:
            key = cache_key(self.made_of, tree, (*kinds, level), static)
        except UndescribedError:
            return partial(self.jitted, **static)

        def compiled_anew() -> Callable[..., Any]:
            with compiling_anew(), compiling(self.function):
                with uncollected():
                    lowered = self.jitted.lower(*arguments, **keywords, **static)
                    without_sources(lowered.compiler_ir())
                program = lowered.compile(None if level is None else {"xla_backend_optimization_level": level})
            if (content := _packed(program, tree)) is not None:
                store.put(key, content)
            return program

        def replaced() -> Callable[..., Any]:
            store.drop(key)
            return compiled_anew()

        if (stored := store.get(key)) is None:
            return compiled_anew()
        try:
            return _OnTrial(_unpacked(stored, tree), replaced)
        except Exception:  # noqa: BLE001 - whatever is wrong with it, it is compiled again
            return replaced()


class _OnTrial:
    """A program from a store, which has run to its end before it is trusted.

    Parameters
    ----------
    program : callable
    replaced : callable
        Returns the same, compiled again, whatever is wrong with that one.
    """

    def __init__(self, program: Callable[..., Any], replaced: Callable[[], Callable[..., Any]]):
        self._program, self._replaced = program, replaced

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        if self._replaced is None:
            return self._program(*arguments, **keywords)
        try:
            results = jax.block_until_ready(self._program(*arguments, **keywords))
        except Exception:  # noqa: BLE001 - see there
            self._program = self._replaced()
            results = self._program(*arguments, **keywords)
        self._replaced = None
        return results


def _packed(program: Any, tree: Any) -> bytes | None:
    """Return a program as bytes; None where it holds what cannot be written: calls into Python, or sorts that have run.

    So a program is written before it is run; one that `jax.jit` has run before it was to be kept may be none.
    """
    try:
        payload, in_tree, out_tree = serialize_executable.serialize(program)
        content = packed((payload, out_tree))
    except (RuntimeError, TypeError, ValueError, pickle.PicklingError):  # those of XLA are RuntimeErrors
        return None
    return content if in_tree == tree else None


def _unpacked(content: bytes, tree: Any) -> Callable[..., Any]:
    payload, out_tree = unpacked(content)
    description_reader(Descriptions)(
        io.BytesIO(payload), jax.devices()[0].client
    ).load()  # or JAX would run whatever is named there
    return serialize_executable.deserialize_and_load(payload, tree, out_tree)


def _kind(leaf: Any) -> tuple[Any, ...] | None:
    """Return what JAX compiles for in place of a value; None for what it traces, or what is on another device."""
    if type(leaf) is np.ndarray or isinstance(leaf, np.generic | jax.ShapeDtypeStruct):
        return leaf.shape, str(leaf.dtype), False
    if type(leaf) in (bool, int, float):
        return (type(leaf).__name__,)
    if isinstance(leaf, jax.Array) and not isinstance(leaf, Tracer) and leaf.sharding == _home():
        return leaf.shape, str(leaf.dtype), leaf.weak_type
    return None


@cache
def _home() -> jax.sharding.Sharding:
    """Return where arrays are unless they were put elsewhere."""
    return jax.sharding.SingleDeviceSharding(jax.devices()[0])


def compiled(*static: str, **how: Any) -> Callable[[Callable[..., Any]], Compiled]:
    """Compile the decorated function at its first call, with these static arguments, as `Compiled` has it."""
    return lambda function: Compiled(function, static, **how)
