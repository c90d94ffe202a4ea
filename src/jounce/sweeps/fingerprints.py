"""Digests of models and files, which distinguish sweeps."""

import dataclasses
import enum
import hashlib
import types
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np


def fingerprint(thing: Any) -> str:
    """Return a digest of all values in an object: the same in every process, and different for different values.

    Examples
    --------
    >>> fingerprint({"AB": 0.04}) == fingerprint({"AB": 0.04}), fingerprint([1.0]) == fingerprint([1])
    (True, False)
    """
    digest = hashlib.sha256()
    _add(thing, digest.update, ())
    return digest.hexdigest()


def _add(thing: Any, put: Callable[[bytes], object], above: tuple[int, ...]) -> None:
    """Add the bytes of an object to a digest; `above` are the objects that contain it, to end cycles."""
    put(f"<{type(thing).__module__}.{type(thing).__qualname__}>".encode())
    if thing is None or isinstance(thing, bool | int | str | bytes | enum.Enum):
        put(repr(thing).encode())
    elif isinstance(thing, float | complex):
        put(np.asarray(thing).tobytes())
    elif isinstance(thing, type | types.BuiltinFunctionType | np.ufunc):
        put(f"{getattr(thing, '__module__', '')}.{getattr(thing, '__qualname__', repr(thing))}".encode())
    elif id(thing) in above:
        put(f"circle {above[::-1].index(id(thing))}".encode())
    else:
        for part in _parts(thing):
            _add(part, put, (*above, id(thing)))
    put(b";")


def _parts(thing: Any) -> list[Any]:
    """Return the parts of an object."""
    if isinstance(thing, Mapping):
        return [part for pair in thing.items() for part in pair]
    if isinstance(thing, list | tuple):
        return [*thing]
    if isinstance(thing, set | frozenset):
        return sorted(thing, key=repr)
    if isinstance(thing, np.ndarray | np.generic) or hasattr(thing, "__array__"):
        array = np.asarray(thing)
        return [array.dtype.str, array.shape, array.tobytes()]
    if isinstance(thing, types.FunctionType):
        cells = [cell.cell_contents for cell in thing.__closure__ or ()]
        return [thing.__module__, thing.__qualname__, thing.__defaults__, thing.__kwdefaults__, cells, thing.__code__]
    if isinstance(thing, types.CodeType):
        return [thing.co_code, thing.co_consts, thing.co_names]
    if dataclasses.is_dataclass(thing):
        return [getattr(thing, field.name, None) for field in dataclasses.fields(thing)]
    made = thing.__reduce_ex__(4)
    return [made] if isinstance(made, str) else list(made[:3])
