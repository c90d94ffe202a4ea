"""Where compiled programs are kept for other processes, and how machine code goes there."""

import io
import pickle
import sys
import zlib
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol, runtime_checkable

OURS = ("jounce",)
LIBRARIES = ("jax", "jaxlib", "numpy")
PLAIN = ("ndarray", "dtype")  # of NumPy's names


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


class Descriptions(pickle.Unpickler):
    """Reads what a store holds beside code: classes of this package, of JAX and of NumPy, and nothing that is run.

    Raises
    ------
    pickle.UnpicklingError
        If something else is named.
    """

    def find_class(self, module: str, name: str) -> Any:
        """Return what a name stands for, if it is a class or what JAX itself makes its own classes with."""
        room = module.partition(".")[0]
        if room in (*OURS, *LIBRARIES) and module in sys.modules:
            found = super().find_class(module, name)
            ours = room in OURS and isinstance(found, type)
            plain = room == "numpy" and name in PLAIN
            of_jax = room.startswith("jax") and (isinstance(found, type) or name.startswith(("_unpickle_", "tracing_")))
            if ours or plain or of_jax:
                return found
        raise pickle.UnpicklingError(f"{module}.{name} is no part of a program")


def packed(parts: tuple[Any, ...]) -> bytes:
    """Return parts as bytes, for `unpacked`."""
    return zlib.compress(pickle.dumps(parts), level=1)


def unpacked(content: bytes) -> Any:
    """Return the parts that `packed` made bytes of."""
    return Descriptions(io.BytesIO(zlib.decompress(content))).load()


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
            return load(*unpacked(kept))
        except Exception:  # noqa: BLE001 - whatever is wrong with it, it is made again
            store.drop(key)
    made = make()
    if store is not None and key is not None:
        with suppress(pickle.PicklingError, TypeError, AttributeError):
            store.put(key, packed(made))
    return load(*made)
