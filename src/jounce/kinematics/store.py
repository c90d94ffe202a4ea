"""Where compiled programs are kept for other processes, and how machine code goes there."""

import pickle
import zlib
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class Store(Protocol):
    """Where programs are kept, by their names: what it gives back was put there, whole and unchanged."""

    def get(self, key: str) -> bytes | None:
        """Return the program of this name, or None."""
        ...

    def put(self, key: str, value: bytes) -> None:
        """Keep a program."""
        ...

    def drop(self, key: str) -> None:
        """Forget a program that is of no use."""
        ...


FEW = 100_000  # instants of one command: for fewer, faster code takes longer to compile than it saves
_store: Store | None = None
_many = False


def keep_programs(store: Store | None) -> None:
    """Keep what is compiled from here on in a store, and take it from there; None for not."""
    global _store
    _store = store


def current_store() -> Store | None:
    """Return the store that programs go to."""
    return _store


def expect(instants: int) -> None:
    """Take note of how many instants this process is about to solve."""
    global _many
    _many = _many or instants > FEW


def is_wanted_soon() -> bool:
    """Tell whether code is compiled for one command, whose user waits for it: programs are kept, instants are few."""
    return _store is not None and not _many


def made_or_kept(key: str | None, make: Callable[[], tuple[Any, ...]], load: Callable[..., Any]) -> Any:
    """Return what is loaded from parts that the store has, or that are made, and kept there if they have a name.

    Parameters
    ----------
    key : str or None
        The name.
    make : callable
        Returns the parts, which `pickle` can write.
    load : callable
        Of the parts.
    """
    store = None if key is None else current_store()
    if store is not None and key is not None and (kept := store.get(key)) is not None:
        try:
            return load(*pickle.loads(zlib.decompress(kept)))
        except Exception:  # noqa: BLE001 - whatever is wrong with it, it is made again
            store.drop(key)
    made = make()
    if store is not None and key is not None:
        with suppress(pickle.PicklingError, TypeError, AttributeError):
            store.put(key, zlib.compress(pickle.dumps(made), level=1))
    return load(*made)
