"""How functions of arrays are compiled: as machine code, or by XLA for what JAX traces and what has no code."""

import inspect
import os
from collections.abc import Callable, Mapping
from functools import cache, cached_property, update_wrapper
from typing import Any

import jax
from jax.core import Tracer

from jounce.base.jax_internals import runs_at_once
from jounce.base.shapes import only_arrays
from jounce.execution.device import on_processor
from jounce.execution.translated import Translated, all_shaped
from jounce.settings import check_process, under_own_settings

LARGE = 32  # numbers of an array that stays in memory in machine code of one instant
_NOTHING = jax.tree.structure(())


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


class ByXla:
    """A function compiled by XLA at its first call, as by `jax.jit` with the solver's options.

    Parameters
    ----------
    function : callable
        Of arrays, of pytrees of them, and of static arguments.
    static : tuple of str
        Names of the static arguments.
    narrow : bool, optional
        Whether its arrays are short, as `compiler_options` has it.
    """

    def __init__(self, function: Callable[..., Any], static: tuple[str, ...], *, narrow: bool = False):
        self.function, self.static, self.narrow = function, static, narrow

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
        leaves = jax.tree.leaves((arguments, keywords))
        traced = [] if only_arrays(leaves) else [leaf for leaf in leaves if isinstance(leaf, Tracer)]
        whole = self.jitted if all(map(runs_at_once, traced)) else self._within
        return whole(*arguments, **keywords)


class Compiled:
    """A function compiled at its first call: to machine code, by XLA where JAX traces it or there is no code for it.

    Parameters
    ----------
    function : callable
        Of arrays, of pytrees of them, and of static arguments.
    static : tuple of str
        Names of the static arguments.
    made_of : tuple of callable, optional
        Functions of the package that say what it computes, where it is none of them itself.
    narrow : bool, optional
        Whether its arrays are short in a program of XLA, as `compiler_options` has it.
    brief : bool, optional
        Whether it is called so seldom, or has so little to compute, that one waits longer for the compiler: then LLVM
        optimizes nothing, in a seventh of the time.
    otherwise : mapping of str to object, optional
        Static arguments for XLA, in the place of those given.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        static: tuple[str, ...],
        made_of: tuple[Callable[..., Any], ...] = (),
        *,
        narrow: bool = False,
        brief: bool = False,
        otherwise: Mapping[str, Any] | None = None,
    ):
        self.function, self._static, self._otherwise = function, static, dict(otherwise or {})
        self.machine_code = Translated(function, made_of or (function,), single=True, brief=brief)
        self.on_xla = ByXla(function, static, narrow=narrow)
        self._names = tuple(inspect.signature(function).parameters)
        self._traced = min([self._names.index(name) for name in static], default=len(self._names))
        update_wrapper(self, function)

    @under_own_settings
    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Call the compiled function."""
        check_process()
        arguments, keywords, static, leaves, tree = self._parts(arguments, keywords)
        if only_arrays(leaves) or not any(isinstance(leaf, Tracer) for leaf in leaves):
            arrays = all_shaped(leaves)
            if (code := self._code(arrays, tree, static)) is not None:
                return code(arrays)
        return self.on_xla(*arguments, **keywords, **static | self._otherwise)

    @under_own_settings
    def prepare(self, *arguments: Any, **keywords: Any) -> None:
        """Make the machine code for arrays of these shapes, or `jax.ShapeDtypeStruct` in their places.

        XLA compiles when it is called.
        """
        _, _, static, leaves, tree = self._parts(arguments, keywords)
        self._code(all_shaped(leaves), tree, static)

    def _parts(self, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> tuple[Any, Any, dict[str, Any], Any, Any]:
        """Return the arguments without static ones, these, and the leaves and the structure of the others."""
        keywords |= zip(self._names[self._traced :], arguments[self._traced :], strict=False)
        arguments = arguments[: self._traced]
        static = {name: keywords.pop(name) for name in self._static if name in keywords}
        return arguments, keywords, static, *jax.tree.flatten((arguments, keywords))

    def _code(self, arrays: list[Any], tree: Any, static: Mapping[str, Any]) -> Any:
        """Return machine code for arguments, None where there is none."""
        return self.machine_code.program((arrays, tree), ((), _NOTHING), static, large=LARGE)


def compiled(*static: str, **how: Any) -> Callable[[Callable[..., Any]], Compiled]:
    """Compile the decorated function at its first call, with these static arguments, as `Compiled` has it."""
    return lambda function: Compiled(function, static, **how)
