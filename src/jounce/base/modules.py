"""Objects whose values JAX sees, and copies of them with other values, made without the checks of a construction.

A model is built of modules that were checked already, and of each several copies are made for every solution:
`dataclasses.replace` and `equinox.tree_at` take longer for one than Newton's method for a step.
"""

import dataclasses
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any, TypeVar, dataclass_transform

import equinox as eqx

_ModuleType: Any = type(eqx.Module)


@dataclass_transform(field_specifiers=(dataclasses.field, eqx.field))
class _OrdinaryType(_ModuleType):
    """The class of classes of which no others are registered as virtual: `isinstance` need not look for such."""

    __instancecheck__ = type.__instancecheck__


class Module(eqx.Module, metaclass=_OrdinaryType):
    """A module whose attributes and classes are looked up as those of any object.

    Equinox looks at every attribute for bound methods, of which it makes modules, so that JAX takes them as arguments:
    a tenth of the time of a short solution, for what no function here is given.
    """

    __getattribute__ = object.__getattribute__


@dataclasses.dataclass(unsafe_hash=True)
class Untraced:
    """Data of a module that JAX is not to see: all are equal, so that what is compiled does not depend on them."""

    value: Any = dataclasses.field(compare=False)
    derived: Any = dataclasses.field(default=None, compare=False)


M = TypeVar("M")


def with_fields(module: M, **values: Any) -> M:
    """Return a module, or a dataclass, with other values in some fields; neither converters nor checks are called.

    Examples
    --------
    >>> import equinox as eqx
    >>> from jounce.base.modules import with_fields
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


def is_ours(thing: Any) -> bool:
    """Tell whether a class or a function is one of this package, by the name of its module.

    Examples
    --------
    >>> from jounce.base.modules import Module, is_ours
    >>> is_ours(Module), is_ours(print)
    (True, False)
    """
    module = getattr(thing, "__module__", None)
    return type(module) is str and (module.startswith("jounce.") or module == "jounce")


def changes_parts(kind: type, general: tuple[type, ...], known: Iterable[str] = ()) -> bool:
    """Tell whether a user's class has anything else in the place of what methods of this package may use.

    Parameters
    ----------
    kind : type
        A class derived from one of this package.
    general : tuple of type
        Classes of this package that say only what there may be.
    known : iterable of str, optional
        Names that do not count.
    """
    if is_ours(kind):
        return False
    ours = [base for base in kind.__mro__ if is_ours(base) and base not in (*general, Module)]
    named = {name for base in ours for name in vars(base) if name[:2] != "__" and name[:4] != "_abc"}
    return any(name in named.difference(known) for base in kind.__mro__ if not is_ours(base) for name in vars(base))
