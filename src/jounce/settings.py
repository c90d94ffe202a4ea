"""The settings of JAX and NumPy under which this package computes, independent of those of the process.

JAX by default computes in single precision; with other settings it stops at nonfinite numbers, or takes hours without
compilation. Its settings hold for a thread or for the whole process, which belongs to the program that imports this
package, and are not changed. Instead, public functions and all methods of the package's objects compute in a context
that the outermost of nested calls enters. Threads inherit no context, and enter it themselves.
"""

import functools
import inspect
import sys
import threading
import types
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base import alterations
from jounce.base.interrupts import is_forked_after_jax
from jounce.base.jax_internals import config, core
from jounce.base.jax_options import OPTIONS
from jounce.errors import UnsupportedError

_packages: list[str] = []  # subpackages whose public functions compute in double precision
_modules: set[str] = set()  # their modules whose classes do

P = ParamSpec("P")
R = TypeVar("R")
OPERATORS = frozenset(
    f"__{name}__"
    for name in (
        *("init", "post_init", "check_init", "call", "getitem", "iter", "len", "contains", "float", "array", "repr"),
        *("neg", "pos", "abs", "add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv", "pow", "rpow"),
        *("matmul", "rmatmul", "mod", "lt", "le", "gt", "ge", "str", "format", "enter", "exit", "next", "getattr"),
    )
)
"""Special methods that may compute. JAX and Python call others, such as `__eq__` and `__hash__`, internally."""

LEFT_ALONE = frozenset({"tree_flatten", "tree_unflatten", "mro"})
"""Methods that JAX calls within transformations of any precision; they compute nothing."""


FLOATING_POINT = {"divide": "warn", "over": "warn", "invalid": "warn", "under": "ignore"}
"""NumPy's default handling of floating-point errors; operations in which these are harmless ignore them."""


class _Thread(threading.local):
    """The state of a thread."""

    computing = False  # within a context of this package


_states = [(getattr(config, name.removeprefix("jax_")), value) for name, value in OPTIONS.items()]
_thread, _double = _Thread(), config.enable_x64


class _OwnSettings:
    """The context in which this package computes; settings that have the right value already are not changed."""

    def __enter__(self) -> None:
        if not config.enable_x64.value and not core.trace_state_clean():
            raise UnsupportedError(
                "this would be computed in single precision: JAX transforms a function here (jax.grad, jax.jit, "
                'jax.vmap) with double precision switched off; call jax.config.update("jax_enable_x64", True) at the '
                "start of the program, or put `with jax.enable_x64(True):` around the call of the transformed function"
            )
        others: list[AbstractContextManager[Any]] = [
            state(value) for state, value in _states if (current := state.value) is not None and current != value
        ]
        if (given := np.geterr()) != FLOATING_POINT:
            quiet: Any = {kind: "ignore" if given[kind] == "ignore" else does for kind, does in FLOATING_POINT.items()}
            others.append(np.errstate(**quiet))
        for other in others:
            other.__enter__()
        self._before = others, _thread.computing
        _thread.computing = True

    def __exit__(self, kind: Any, error: BaseException | None, traceback: Any) -> None:
        others, _thread.computing = self._before
        for other in others[::-1]:
            other.__exit__(kind, error, traceback)
        if isinstance(error, AssertionError | RuntimeError):
            _check_device(error)


def check_process() -> None:
    """Raise UnsupportedError in a process that was forked after JAX had started, since it would hang.

    XLA computes in threads, which a fork does not have, although it has the locks that they held.
    """
    if is_forked_after_jax():
        raise UnsupportedError(
            "this process was forked after JAX had already computed, and would wait forever for threads that a fork "
            "does not have; start processes by 'spawn' or 'forkserver' (multiprocessing.get_context), or fork "
            "before the first computation"
        )


def _check_device(error: BaseException) -> None:
    """Raise UnsupportedError if JAX failed because its settings name a device that this machine does not have.

    The check follows a failure, since it starts the device and JAX's threads.
    """
    chosen, platforms = config.default_device.value, config.jax_platforms.value
    chosen = chosen if isinstance(chosen, str) else None
    try:
        jax.devices(chosen)
    except (AssertionError, RuntimeError):
        option, value = ("jax_default_device", chosen) if chosen else ("JAX_PLATFORMS", platforms)
        raise UnsupportedError(
            "JAX is set to compute on a device that it does not find here; leave it the choice, have it "
            'compute on the processor ("cpu"), or install the release of JAX for that device',
            name=option,
            value=value,
        ) from error


def own_settings() -> AbstractContextManager[Any]:
    """Return the context in which this package computes in this thread; an empty one if it is already active.

    Raises
    ------
    UnsupportedError
        Within a transformation of JAX in single precision, whose values are already rounded; or if JAX is set to
        compute on a device that this machine does not have.

    Examples
    --------
    >>> import jax, jax.numpy as jnp
    >>> from jounce.settings import own_settings
    >>> with jax.enable_x64(False), own_settings():
    ...     print(jnp.asarray(0.1).dtype)
    float64
    """
    return nullcontext() if _thread.computing and _double.value else _OwnSettings()


def under_own_settings(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function that computes under own settings; a generator does so at each of its steps."""
    if inspect.isgeneratorfunction(function):

        @functools.wraps(function)
        def steps(*arguments: Any, **keywords: Any) -> Iterator[Any]:
            running = function(*arguments, **keywords)
            while True:
                with own_settings():
                    try:
                        value = next(running)
                    except StopIteration as end:
                        return end.value
                yield value

        steps.own_settings = True  # pyright: ignore[reportAttributeAccessIssue]
        return steps  # pyright: ignore[reportReturnType]

    @functools.wraps(function)
    def wrapper(*arguments: P.args, **keywords: P.kwargs) -> R:
        if _thread.computing and _double.value:
            return function(*arguments, **keywords)
        with _OwnSettings():
            return function(*arguments, **keywords)

    wrapper.own_settings = True  # pyright: ignore[reportAttributeAccessIssue]
    return wrapper


def in_full(value: Any) -> jax.Array:
    """Return a float or complex array of lower precision in double precision, and other arrays unchanged.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from jounce.settings import own_settings, in_full
    >>> with own_settings():
    ...     print(in_full(jnp.float32(0.5)).dtype, in_full(2).dtype)
    float64 int64
    """
    array = jnp.asarray(value)
    narrow = jnp.issubdtype(array.dtype, jnp.inexact) and jnp.finfo(array.dtype).bits < 64
    return array.astype(complex if jnp.iscomplexobj(array) else float) if narrow else array


def called_back(function: Callable[[Any], Any], shapes: Any, values: Any, *, vmap_method: str) -> Any:
    """Return the result of a callback on the host in double precision, as `jax.pure_callback` does.

    JAX may call the function in another thread, where only the settings of the process hold: it would round the
    arguments to single precision and refuse the results. Numbers are therefore passed as pairs of 32-bit words.

    Parameters
    ----------
    function : callable
        Function from a pytree of NumPy arrays to a pytree of arrays.
    shapes : pytree of jax.ShapeDtypeStruct
        Shapes and types of the result.
    values : pytree of array
        Arrays of floats in double precision.
    vmap_method : str
        See `jax.pure_callback`.
    """

    @under_own_settings
    def of_words(words: Any) -> Any:
        result = function(jax.tree.map(lambda x: np.ascontiguousarray(x).view(np.float64)[..., 0], words))
        return jax.tree.map(lambda x, shape: _as_words_of_32_bits(np.asarray(x, shape.dtype)), result, shapes)

    def as_words(shape: Any) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct((*shape.shape, 2), np.uint32) if _is_wide(shape) else shape

    words = jax.tree.map(lambda x: jax.lax.bitcast_convert_type(jnp.asarray(x, float), np.uint32), values)
    result = jax.pure_callback(of_words, jax.tree.map(as_words, shapes), words, vmap_method=vmap_method)
    return jax.tree.map(
        lambda x, shape: jax.lax.bitcast_convert_type(x, shape.dtype) if _is_wide(shape) else x, result, shapes
    )


def _is_wide(array: Any) -> bool:
    return array.dtype.itemsize == 8


def _as_words_of_32_bits(array: np.ndarray) -> np.ndarray:
    """Return a 64-bit array as pairs of 32-bit words along a new last axis, and other arrays unchanged."""
    return np.array(array[..., None], order="C").view(np.uint32) if _is_wide(array) else array


def compute_under_own_settings(subpackage: str) -> None:
    """Have all public functions of a subpackage, and all classes of its modules, compute in double precision.

    This includes private classes, since results are instances of them, and classes of lower subpackages whose modules
    this one imports first. Each ``__init__.py`` ends with this call, so that everything added to the subpackage is
    included.
    """
    _packages.append(subpackage)
    offered = vars(sys.modules[subpackage])
    for name, value in list(offered.items()):
        if _is_open(value, subpackage) and not name.startswith("_"):
            home = vars(sys.modules[value.__module__])
            offered[name] = wrapper = under_own_settings(value)
            if home.get(value.__name__) is value:
                home[value.__name__] = wrapper  # where pickle finds it
    cover_new_modules()


def cover_new_modules() -> None:
    """Have the classes of newly imported modules of the registered subpackages compute in double precision.

    A higher subpackage may be the first to import a module of a lower one.
    """
    prefixes = tuple(f"{subpackage}." for subpackage in _packages)
    for name in [name for name in list(sys.modules) if name.startswith(prefixes) and name not in _modules]:
        _modules.add(name)
        for value in list(vars(sys.modules[name]).values()):
            if inspect.isclass(value) and value.__module__ == name:
                _compute_under_own_settings(value)
    alterations.note(_packages)


def _is_open(value: Any, subpackage: str) -> bool:
    """Return whether a value is a function of a subpackage without a wrapper."""
    inside = inspect.isfunction(value) and f"{value.__module__}.".startswith(f"{subpackage}.")
    return inside and not hasattr(value, "own_settings")


def _compute_under_own_settings(kind: type[Any]) -> None:
    """Have the methods and properties of a class compute in double precision."""
    for name, member in list(vars(kind).items()):
        if name in LEFT_ALONE or (name.startswith("_") and name not in OPERATORS and not name.startswith("_repr_")):
            continue
        if (wrapper := _decorated_member(member)) is not None:
            setattr(kind, name, wrapper)


def _decorated_member(member: Any) -> Any:
    """Return a wrapped method or property; None for other members, and for those that have a wrapper."""
    if isinstance(member, types.FunctionType):
        generated = member.__code__.co_filename == "<string>"  # by dataclasses, without computation
        return None if generated or hasattr(member, "own_settings") else under_own_settings(member)
    if isinstance(member, staticmethod | classmethod):
        inner = _decorated_member(member.__func__)
        return None if inner is None else type(member)(inner)
    if isinstance(member, property):
        inner = _decorated_member(member.fget)
        return None if inner is None else member.getter(inner)
    if isinstance(member, functools.cached_property):
        inner = _decorated_member(member.func)
        if inner is not None:
            member.func = inner
    return None
