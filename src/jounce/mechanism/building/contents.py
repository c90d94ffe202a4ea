"""The contents of a mechanism as one value that can be compared, and the models of the last ones that were solved.

Whoever solves a mechanism twice has it read twice, as any number in it may have changed. Reading numbers off is fast,
and making a model of them is not; so a model is made again only where one of its values is another one. What a user
wrote, functions and classes, is not compared but read each time: it may compute something else than before.
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
"""Of a mechanism: those that a model is built of, beside the values of parameters."""
PLAIN = frozenset({float, int, bool, str, type(None)})
CHECKED = frozenset({Friction, GearFriction})  # with code of the joint that has it, each time
LARGE = 10_000  # entries of an array: comparing more takes as long as a model
MOST = 4  # models that are kept
_results: OrderedDict[Contents, Any] = OrderedDict()  # None where contents were seen once


def contents_of(mechanism: Mechanism, *more: Any) -> Contents | None:
    """Return all that the model of a mechanism depends on, and `more`; None where values do not determine it.

    Values are distinguished with their types, and to the last bit: 0.0 from -0.0, and 1 from 1.0.
    """
    values: list[Any] = []
    kinds: list[type] = []
    pending: list[Any] = [mechanism.parameter_values, *more, *(getattr(mechanism, name) for name in FIELDS)]
    while pending:
        value = pending.pop()
        kind = type(value)
        if kind in PLAIN:
            values.append(value)
        elif kind is list or kind is tuple:
            if set(map(type, value)) <= PLAIN:
                values.append(value)
            else:
                values += (..., kind is list, len(value))  # no value of a user is an ellipsis
                pending += value
        elif (kind is dict or kind is ReadOnlyDict) and set(map(type, value)) <= {str}:
            values += (..., tuple(value))
            pending += value.values()
        elif kind is np.ndarray and value.dtype.kind in "fiu" and value.size <= LARGE:
            values += (..., value.dtype.str, value.shape, value.tobytes())
        elif kind is Expression:
            values += (..., "expression", value.text)
        elif (read := _given_fields(kind)) is None:
            return None  # of a user
        else:
            values += (..., "fields", len(kinds))
            kinds.append(kind)
            try:
                pending += read(vars(value))
            except KeyError:  # values are elsewhere than usual
                return None
    different = set(kinds)
    if not different.isdisjoint(CHECKED) or any(map(has_own_methods, different)):
        return None
    return tuple(kinds), marshal.dumps(values, 2)  # in later versions, bytes depend on who else has a value


@lru_cache(maxsize=1000)
def _given_fields(kind: type) -> Callable[[Mapping[str, Any]], Sequence[Any]] | None:
    """Return what reads the fields of a class that are given, in their order; None for a class of a user.

    The other fields are found later.
    """
    if not belongs_to_package(kind) or not dataclasses.is_dataclass(kind):
        return None
    names = [field.name for field in dataclasses.fields(kind) if field.init]
    return itemgetter(*names) if len(names) > 1 else lambda own: [own[name] for name in names]


def made_or_stored(contents: Contents | None, make: Callable[[], T], owned: Callable[[T], T | None]) -> T:
    """Return what is made of contents, which is kept from the second time on.

    Parameters
    ----------
    contents : tuple, optional
        See `contents_of`; None for what is made each time.
    make : callable
        Makes it.
    owned : callable
        Returns a copy that shares no values with the contents; None where there is none.
    """
    if contents is None:
        return make()
    if (known := _results.get(contents)) is not None:
        return known
    result = make()
    if contents in _results and (copy := owned(result)) is not None:
        _results[contents] = result = copy
    else:
        _results.setdefault(contents, None)
    while len(_results) > MOST:
        _results.popitem(last=False)
    return result


def owned_arrays(tree: T) -> T:
    """Return copies of the arrays in a pytree, which nobody writes to; other leaves as they are."""

    def owned(leaf: Any) -> Any:
        if type(leaf) is not np.ndarray:
            return leaf
        copy = leaf.copy()
        copy.setflags(write=False)
        return copy

    return jax.tree.map(owned, tree)


def holds_numbers_only(element: Any) -> bool:
    """Tell whether the values of an element are arrays, words, or formulas of them, all of which `owned_arrays` copies.

    Curves, and what was read of a user's code, hold more than JAX sees.
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
