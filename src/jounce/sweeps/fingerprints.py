"""Digests of models and files, which distinguish sweeps."""

import dataclasses
import enum
import hashlib
import types
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np


def fingerprint(value: Any) -> str:
    """Return a digest of all values in an object: the same in every process, and different for different values.

    Examples
    --------
    >>> fingerprint({"AB": 0.04}) == fingerprint({"AB": 0.04}), fingerprint([1.0]) == fingerprint([1])
    (True, False)
    """
    digest = hashlib.sha256()
    _add(value, digest.update, ())
    return digest.hexdigest()


def _add(value: Any, update: Callable[[bytes], object], containers: tuple[int, ...]) -> None:
    """Add the bytes of an object to a digest; `containers` are the objects that contain it, to end cycles."""
    update(f"<{type(value).__module__}.{type(value).__qualname__}>".encode())
    if value is None or isinstance(value, bool | int | str | bytes | enum.Enum):
        update(repr(value).encode())
    elif isinstance(value, float | complex):
        update(np.asarray(value).tobytes())
    elif isinstance(value, type | types.BuiltinFunctionType | np.ufunc):
        update(f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', repr(value))}".encode())
    elif id(value) in containers:
        update(f"circle {containers[::-1].index(id(value))}".encode())
    else:
        for part in _parts(value):
            _add(part, update, (*containers, id(value)))
    update(b";")


def _parts(value: Any) -> list[Any]:
    """Return the parts of an object."""
    if isinstance(value, Mapping):
        return [part for pair in value.items() for part in pair]
    if isinstance(value, list | tuple):
        return [*value]
    if isinstance(value, set | frozenset):
        return sorted(value, key=repr)
    if isinstance(value, np.ndarray | np.generic) or hasattr(value, "__array__"):
        array = np.asarray(value)
        return [array.dtype.str, array.shape, array.tobytes()]
    if isinstance(value, types.FunctionType):
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        return [value.__module__, value.__qualname__, value.__defaults__, value.__kwdefaults__, cells, value.__code__]
    if isinstance(value, types.CodeType):
        return [value.co_code, value.co_consts, value.co_names]
    if dataclasses.is_dataclass(value):
        return [getattr(value, field.name, None) for field in dataclasses.fields(value)]
    reduced = value.__reduce_ex__(4)
    return [reduced] if isinstance(reduced, str) else list(reduced[:3])
