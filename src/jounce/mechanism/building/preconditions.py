"""Preconditions of computations: no values that JAX traces, no fork of a process that used JAX."""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any, ParamSpec, TypeVar

import numpy as np
from jax.core import Tracer, eval_context

from jounce.base.jax_internals import core
from jounce.errors import UnsupportedError
from jounce.settings import check_process
from jounce.trajectory import Expression
from jounce.units.dimensions import Dimension

P = ParamSpec("P")
R = TypeVar("R")
PLAIN = frozenset({float, int, bool, str, type(None), np.ndarray, Expression, Dimension})  # never traced

WHAT_IS_NOT_TRACED = (
    "jn.{} is differentiated by values of the mechanism only: instants, their number, orders, tolerances and names "
    "cannot be traced by jax.jit, jax.grad or jax.vmap; the derivative by an instant is the next time derivative"
)


def concrete(
    function: Callable[P, R], traced: Callable[[Callable[P, R], Mapping[str, Any]], R] | None = None
) -> Callable[P, R]:
    """Return a function that refuses traced arguments, and a fork of a process that used JAX.

    It guards functions that branch on values. Within `jax.jit` the guarded function runs eagerly, since no argument is
    traced: the result is a constant.

    Parameters
    ----------
    function : callable
        Function to be guarded.
    traced : callable, optional
        Replacement, called if only the first argument holds traced values, with the guarded function and the arguments
        by name.

    Raises
    ------
    UnsupportedError
        If an argument holds a value that `jax.jit`, `jax.grad` or `jax.vmap` traces.
    """
    names = tuple(inspect.signature(function).parameters)

    @functools.wraps(function)
    def wrapper(*arguments: P.args, **keywords: P.kwargs) -> R:
        check_process()
        given = dict(zip(names, arguments, strict=False)) | keywords
        if (location := _traced(given)) is not None and traced is not None:
            other_arguments = {name: value for name, value in given.items() if name != names[0]}
            if (location := _traced(other_arguments)) is None:
                return traced(wrapper, given)
            raise UnsupportedError(WHAT_IS_NOT_TRACED.format(function.__name__), name=location)
        if location is not None:
            raise UnsupportedError(
                f"jn.{function.__name__} cannot yet be used with values that jax.jit, jax.grad or jax.vmap trace, "
                "because it decides by values; call it with numbers, one design after another",
                name=location,
            )
        with eval_context():  # ensure_compile_time_eval would compile each constant inside on its own
            return function(*arguments, **keywords)

    return wrapper


def concrete_or(
    traced: Callable[[Callable[..., Any], Mapping[str, Any]], Any],
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator like `concrete` with a replacement for traced values; editors see the parameters."""
    return partial(concrete, traced=traced)


def check_holonomic(mechanism: Any, request: str, remedy: str = "simulate the motion") -> None:
    """Raise UnsupportedError if a mechanism has a nonholonomic joint; `request` names what is requested."""
    for name, joint in mechanism.joints.items():
        if getattr(joint, "nonholonomic", False):
            message = (
                f"{request} follows from positions, and a {joint.type_name} that rolls restricts velocities alone, so "
                f"that where it is depends on the way there: {remedy}"
            )
            raise UnsupportedError(message, name=f"joints.{name}")


def _traced(given: Mapping[str, Any]) -> str | None:
    """Return the dotted name of the first traced value; None if there is none."""
    if core.trace_state_clean() or not holds_tracer(given):  # nearly always: within no transformation
        return None
    pending: list[tuple[tuple[str | int, ...], Any]] = [((), given)]
    while pending:
        location, value = pending.pop()
        if isinstance(value, Tracer):
            return "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in location).removeprefix(".")
        entries = _entries(value)
        pending += [((*location, name), entry) for name, entry in reversed(entries) if type(entry) not in PLAIN]
    return None


def holds_tracer(given: Mapping[str, Any]) -> bool:
    """Return whether arguments hold a value that JAX traces."""
    pending: list[Any] = [given]
    while pending:
        value = pending.pop()
        kind = type(value)
        if kind in PLAIN:
            continue
        names = fields_of(kind)
        if names is None:
            pending += value.values()
        elif names:
            fields = getattr(value, "__dict__", None)
            pending += [getattr(value, name, None) for name in names] if fields is None else map(fields.get, names)
        elif isinstance(value, list | tuple):
            pending += value
        elif isinstance(value, Tracer):
            return True
    return False


def _entries(value: Any) -> list[tuple[str | int, Any]]:
    """Return the entries of an object, a mapping or a list, by name or index."""
    names = fields_of(type(value))
    if names is None:
        return list(value.items())
    if names:  # read from the dictionary of the object: attribute access of Equinox modules is slow
        fields = getattr(value, "__dict__", None)
        read = partial(getattr, value) if fields is None else fields.get
        return [(name, read(name, None)) for name in names]
    return list(enumerate(value)) if isinstance(value, list | tuple) else []


@lru_cache(maxsize=1000)
def fields_of(kind: type[Any]) -> tuple[str, ...] | None:
    """Return the names of the fields of a class that may be traced; None for a mapping."""
    if issubclass(kind, Tracer):
        return ()
    if issubclass(kind, Mapping):
        return None
    if dataclasses.is_dataclass(kind):
        return tuple(field.name for field in dataclasses.fields(kind))
    return getattr(kind, "may_be_traced", ())
