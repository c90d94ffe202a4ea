"""The settings of JAX and NumPy under which this package computes, however they are set up around it.

JAX computes in single precision by default, stops at numbers that are not finite where its settings ask it to
look for them, and takes hours where it is not to compile. Its settings hold for a thread or for the whole process,
which belongs to the program that imports this package. So the settings of the process are left alone: what a subpackage
offers, and all that its objects can do, computes in a context of its own, entered at the first of nested calls.
Threads, which inherit no context, enter it for themselves.
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

_packages: list[str] = []  # of which all that they offer computes in double precision
_modules: set[str] = set()  # of them, whose classes do

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
"""Special methods that may compute. JAX and Python call the others for their own ends: `__eq__` and `__hash__`, say."""

LEFT_ALONE = frozenset({"tree_flatten", "tree_unflatten", "mro"})
"""Methods that JAX calls within transformations of any precision; they compute nothing."""


FLOATING_POINT = {"divide": "warn", "over": "warn", "invalid": "warn", "under": "ignore"}
"""What NumPy does by default where numbers are not finite; operations where that is no error ignore it."""


class _Thread(threading.local):
    """What a thread is at."""

    computing = False  # within a context of this package


_states = [(getattr(config, name.removeprefix("jax_")), value) for name, value in OPTIONS.items()]
_thread, _double = _Thread(), config.enable_x64


class _OwnSettings:
    """The context in which this package computes: what is set up as usual is left as it is."""

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
    """Raise UnsupportedError in a process that was forked after JAX had started: it would wait for ever.

    XLA computes in threads, and a fork has none of them, only the locks that they held.
    """
    if is_forked_after_jax():
        raise UnsupportedError(
            "this process was forked after JAX had already computed, and would wait forever for threads that a fork "
            "does not have; start processes by 'spawn' or 'forkserver' (multiprocessing.get_context), or fork "
            "before the first computation"
        )


def _check_device(error: BaseException) -> None:
    """Raise UnsupportedError if JAX failed because its settings name a device that this machine does not have.

    Looking beforehand would start the device, and JAX's threads with it, where nothing computes, as on import.
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
    """Return the context in which this package computes, in this thread; nothing to do where it is in force.

    Raises
    ------
    UnsupportedError
        Within a transformation of JAX in single precision: its values are rounded already, and so would results be.
        Where JAX is set to compute on a device that this machine does not have.

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
    """Have a function compute in double precision, a generator at each of its steps."""
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
    """Return an array of double precision where one of lower precision is given; others as they are.

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
    """Have a compiled program call a function on the host, as `jax.pure_callback` does, in double precision.

    Where a program waits for its operands, JAX calls it in a thread of its own, where only the setting of the process
    holds: it rounds what it hands over to single precision there, and refuses what it gets back. So numbers go both
    ways as words of 32 bits.

    Parameters
    ----------
    function : callable
        Maps a pytree of NumPy arrays to one of arrays.
    shapes : pytree of jax.ShapeDtypeStruct
        Of what it returns.
    values : pytree of array
        Of floats in double precision.
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
    """Return an array whose numbers of 64 bits are two words each, along a new last axis; others as they are."""
    return np.array(array[..., None], order="C").view(np.uint32) if _is_wide(array) else array


def compute_under_own_settings(subpackage: str) -> None:
    """Have all public functions of a subpackage, and all classes of its modules, compute in double precision.

    Classes that are not public count too, since results are objects of them, and so do those of modules of lower
    subpackages that this one is the first to import. Each ``__init__.py`` ends with a call, so that whatever is added
    to the subpackage is included.
    """
    _packages.append(subpackage)
    offered = vars(sys.modules[subpackage])
    for name, value in list(offered.items()):
        if _is_open(value, subpackage) and not name.startswith("_"):
            home = vars(sys.modules[value.__module__])
            offered[name] = wrapper = under_own_settings(value)
            if home.get(value.__name__) is value:
                home[value.__name__] = wrapper  # by which pickle finds it
    cover_new_modules()


def cover_new_modules() -> None:
    """Have the classes of modules that were imported since compute in double precision, in the subpackages so far.

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
    """Tell whether a value is a function of a subpackage that has no wrapper yet."""
    inside = inspect.isfunction(value) and f"{value.__module__}.".startswith(f"{subpackage}.")
    return inside and not hasattr(value, "own_settings")


def _compute_under_own_settings(kind: type[Any]) -> None:
    """Have the methods and properties that a class defines compute in double precision."""
    for name, member in list(vars(kind).items()):
        if name in LEFT_ALONE or (name.startswith("_") and name not in OPERATORS and not name.startswith("_repr_")):
            continue
        if (wrapper := _decorated_member(member)) is not None:
            setattr(kind, name, wrapper)


def _decorated_member(member: Any) -> Any:
    """Return a method or property that computes in double precision; None for what is none, or has a wrapper."""
    if isinstance(member, types.FunctionType):
        generated = member.__code__.co_filename == "<string>"  # by dataclasses: it stores values, or shows them
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
