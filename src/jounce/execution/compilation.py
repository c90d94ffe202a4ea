"""Compilation of functions of arrays: to machine code, or by XLA under JAX transformations and without machine code."""

import inspect
import os
from collections.abc import Callable, Mapping
from functools import cache, cached_property, update_wrapper
from typing import Any

import jax
from jax.core import Tracer

from jounce.base.jax_internals import runs_at_once
from jounce.base.shapes import has_tracers
from jounce.execution.device import on_processor
from jounce.execution.translated import Translated, all_shaped
from jounce.settings import check_process, under_own_settings

LARGE = 32  # size of arrays that stay in memory in the machine code of one instant; smaller ones are unrolled
_NOTHING = jax.tree.structure(())


UNENDING = ("simplify-while-loops", "while-loop-invariant-code-motion", "while-loop-constant-sinking", "reshape-mover")
"""XLA passes that undo each other's work twenty or thirty times: those over loops, which have nothing to do in programs
of this package, and one that moves reshapes to places from which the simplifier moves them back."""


def compiler_options(*, narrow: bool = False) -> dict[str, Any] | None:
    """Return options that halve XLA's compile time of long chains of small operations at the same speed.

    They are private to XLA; unknown ones are left out for other releases. There are none on a GPU.

    Parameters
    ----------
    narrow : bool, default False
        Whether arrays are so short that calls dominate the run time. LLVM then uses only its first level of
        optimization, which saves a fifth of the compile time.
    """
    if not on_processor():
        return None
    options = {"xla_cpu_use_fusion_emitters": False, "xla_disable_hlo_passes": ",".join(UNENDING)}
    if narrow and not _level_is_set():
        options["xla_backend_optimization_level"] = 1
    return {name: value for name, value in options.items() if name in _known_options()} or None


def _level_is_set() -> bool:
    """Return whether the environment sets the optimization level of LLVM."""
    return "xla_backend_optimization_level" in os.environ.get("XLA_FLAGS", "")


@cache
def _known_options() -> frozenset[str]:
    """Return the options that this release of XLA knows; JAX 0.11, for example, has no older emitters."""
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
        Function of arrays, of pytrees of arrays, and of static arguments.
    static : tuple of str
        Names of the static arguments.
    narrow : bool, optional
        Whether the arrays are short, as for `compiler_options`.
    """

    def __init__(self, function: Callable[..., Any], static: tuple[str, ...], *, narrow: bool = False):
        self.function, self.static, self.narrow = function, static, narrow

    @cached_property
    def jitted(self) -> Any:
        """The function compiled by `jax.jit` with the options."""
        options = compiler_options(narrow=self.narrow)
        return jax.jit(self.function, static_argnames=self.static, compiler_options=options)

    @cached_property
    def _within(self) -> Any:
        """The function without options, for use within another program: JAX takes options for whole programs only."""
        return jax.jit(self.function, static_argnames=self.static)

    @under_own_settings
    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Call the compiled function."""
        check_process()
        leaves = jax.tree.leaves((arguments, keywords))
        traced = [leaf for leaf in leaves if isinstance(leaf, Tracer)] if has_tracers(leaves) else []
        call = self.jitted if all(map(runs_at_once, traced)) else self._within
        return call(*arguments, **keywords)


class Compiled:
    """A function compiled at its first call: to machine code, or by XLA if JAX traces it or there is no machine code.

    Parameters
    ----------
    function : callable
        Function of arrays, of pytrees of arrays, and of static arguments.
    static : tuple of str
        Names of the static arguments.
    made_of : tuple of callable, optional
        Functions of the package that define what it computes, if it is not one of them itself.
    narrow : bool, optional
        Whether the arrays are short in programs of XLA, as for `compiler_options`.
    brief : bool, optional
        Whether calls are so few or so short that compilation dominates: LLVM then does not optimize, in a seventh of
        the time.
    otherwise : mapping of str to object, optional
        Static arguments for XLA that replace the given ones.
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
        if not has_tracers(leaves):
            arrays = all_shaped(leaves)
            if (code := self._code(arrays, tree, static)) is not None:
                return code(arrays)
        return self.on_xla(*arguments, **keywords, **static | self._otherwise)

    @under_own_settings
    def prepare(self, *arguments: Any, **keywords: Any) -> None:
        """Compile the machine code for arrays or `jax.ShapeDtypeStruct` of given shapes.

        XLA compiles at the first call instead.
        """
        _, _, static, leaves, tree = self._parts(arguments, keywords)
        self._code(all_shaped(leaves), tree, static)

    def _parts(self, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> tuple[Any, Any, dict[str, Any], Any, Any]:
        """Return the arguments without static ones, the static ones, and the leaves and structure of the former."""
        keywords |= zip(self._names[self._traced :], arguments[self._traced :], strict=False)
        arguments = arguments[: self._traced]
        static = {name: keywords.pop(name) for name in self._static if name in keywords}
        return arguments, keywords, static, *jax.tree.flatten((arguments, keywords))

    def _code(self, arrays: list[Any], tree: Any, static: Mapping[str, Any]) -> Any:
        """Return the machine code for arguments; None if there is none."""
        return self.machine_code.program((arrays, tree), ((), _NOTHING), static, large=LARGE)


def compiled(*static: str, **options: Any) -> Callable[[Callable[..., Any]], Compiled]:
    """Return a decorator that compiles a function at its first call; see `Compiled`."""
    return lambda function: Compiled(function, static, **options)
