"""The contents of a mechanism as one comparable value, and a cache of the models of the mechanisms solved last.

A mechanism is read each time it is solved, because any number in it may have changed. Reading numbers is fast, and
building a model is not: a model is built again only if a value differs. User-defined functions and classes are not
compared but read each time, because they may compute something else than before.
"""

import dataclasses
import marshal
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from operator import itemgetter
from typing import Any, TypeVar

import jax
import numpy as np

from jounce.base.modules import Module, ReadOnlyDict, belongs_to_package
from jounce.constraints.friction import Friction, GearFriction
from jounce.mechanism.mechanism import Mechanism
from jounce.mechanism.user_code import has_own_methods
from jounce.trajectory import Expression

T = TypeVar("T")
Contents = tuple[tuple[type, ...], bytes]
FIELDS = ("space", "bodies", "joints", "drivers", "forces", "initial", "outputs", "gravity")
"""Fields of a mechanism from which its model is built, beside the values of the parameters."""
PLAIN = frozenset({float, int, bool, str, type(None)})
CHECKED = frozenset({Friction, GearFriction})  # checked by code of their joint each time
LARGE = 10_000  # entries of an array: comparing more takes as long as building a model
MOST = 4  # stored models
_results: OrderedDict[Contents, Any] = OrderedDict()  # None for contents that were seen once


def contents_of(mechanism: Mechanism, *extras: Any) -> Contents | None:
    """Return everything that the model of a mechanism depends on, and `extras`; None if values do not determine it.

    Values are distinguished by type, and to the last bit: 0.0 from -0.0, and 1 from 1.0.
    """
    values: list[Any] = []
    kinds: list[type] = []
    pending: list[Any] = [mechanism.parameter_values, *extras, *(getattr(mechanism, name) for name in FIELDS)]
    while pending:
        value = pending.pop()
        kind = type(value)
        if kind in PLAIN:
            values.append(value)
        elif kind is list or kind is tuple:
            if set(map(type, value)) <= PLAIN:
                values.append(value)
            else:
                values += (..., kind is list, len(value))  # an ellipsis is no value of a mechanism
                pending += value
        elif (kind is dict or kind is ReadOnlyDict) and set(map(type, value)) <= {str}:
            values += (..., tuple(value))
            pending += value.values()
        elif kind is np.ndarray and value.dtype.kind in "fiu" and value.size <= LARGE:
            values += (..., value.dtype.str, value.shape, value.tobytes())
        elif kind is Expression:
            values += (..., "expression", value.text)
        elif (read := _given_fields(kind)) is None:
            return None  # a class of a user
        else:
            values += (..., "fields", len(kinds))
            kinds.append(kind)
            try:
                pending += read(vars(value))
            except KeyError:  # a field that is not in the dictionary of the instance
                return None
    classes = set(kinds)
    if not classes.isdisjoint(CHECKED) or any(map(has_own_methods, classes)):
        return None
    return tuple(kinds), marshal.dumps(values, 2)  # later versions depend on the reference counts of values


@lru_cache(maxsize=1000)
def _given_fields(kind: type) -> Callable[[Mapping[str, Any]], Sequence[Any]] | None:
    """Return the function that reads the init fields of a class, in order; None for a class of a user."""
    if not belongs_to_package(kind) or not dataclasses.is_dataclass(kind):
        return None
    names = [field.name for field in dataclasses.fields(kind) if field.init]
    return itemgetter(*names) if len(names) > 1 else lambda values: [values[name] for name in names]


def made_or_stored(contents: Contents | None, make: Callable[[], T], owned: Callable[[T], T | None]) -> T:
    """Return the result for some contents, which is stored from the second call on.

    Parameters
    ----------
    contents : tuple, optional
        See `contents_of`; None to make the result each time.
    make : callable
        Makes the result.
    owned : callable
        Returns a copy of the result that shares no values with the contents; None if there is none.
    """
    if contents is None:
        return make()
    if (stored := _results.get(contents)) is not None:
        return stored
    result = make()
    if contents in _results and (copy := owned(result)) is not None:
        _results[contents] = result = copy
    else:
        _results.setdefault(contents, None)
    while len(_results) > MOST:
        _results.popitem(last=False)
    return result


def owned_arrays(tree: T) -> T:
    """Return a pytree with read-only copies of its arrays; other leaves are unchanged."""

    def owned(leaf: Any) -> Any:
        if type(leaf) is not np.ndarray:
            return leaf
        copy = leaf.copy()
        copy.setflags(write=False)
        return copy

    return jax.tree.map(owned, tree)


def holds_numbers_only(element: Any) -> bool:
    """Return whether `owned_arrays` copies all values of an element: arrays, plain values and expressions.

    Curves and user code hold data that are no leaves of a pytree.
    """
    pending = list(vars(element).values())
    while pending:
        value = pending.pop()
        kind = type(value)
        if kind in PLAIN or kind in (np.ndarray, Expression):
            continue
        if kind in (list, tuple):
            pending += value
        elif kind is dict:
            pending += value.values()
        elif isinstance(value, Module) and belongs_to_package(kind):
            pending += vars(value).values()
        else:
            return False
    return True
