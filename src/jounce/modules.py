"""Objects whose values JAX sees, and copies of them with other values, made without the checks of a construction.

A model is put together of modules that were checked already, and of each several copies are made for every solution:
`dataclasses.replace` and `equinox.tree_at` take longer for one than Newton's method for a step.
"""

import dataclasses
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypeVar

import equinox as eqx


class Module(eqx.Module):
    """A module whose attributes are looked up as those of any object.

    Equinox looks at every attribute for bound methods, of which it makes modules, so that JAX takes them as arguments:
    a tenth of the time of a short solution, for what no function here is given.
    """

    __getattribute__ = object.__getattribute__


M = TypeVar("M", bound=eqx.Module)


def with_fields(module: M, **values: Any) -> M:
    """Return a module with other values in some of its fields; neither converters nor checks are called.

    Examples
    --------
    >>> import equinox as eqx
    >>> from jounce.modules import with_fields
    >>> class Spring(eqx.Module):
    ...     stiffness: float
    ...     length: float
    >>> with_fields(Spring(3.0, 0.1), length=0.2)
    Spring(stiffness=3.0, length=0.2)
    """
    names = field_names(type(module))
    if not values.keys() <= set(names):
        raise TypeError(f"{type(module).__name__} has no field {sorted(values.keys() - set(names))}")
    held = vars(module)
    return unchecked(type(module), {name: held[name] for name in names if name in held} | values)


def unchecked(kind: type[M], values: Mapping[str, Any]) -> M:
    """Return a module with these values of all its fields; neither converters nor checks are called."""
    module = object.__new__(kind)
    vars(module).update(values)
    return module


@lru_cache(maxsize=1000)
def field_names(kind: type[Any]) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass."""
    return tuple(field.name for field in dataclasses.fields(kind))
