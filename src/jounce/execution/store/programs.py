"""The store of compiled programs for other processes, and the storage of machine code.

The store is a folder of the user, unless the environment or `keep_programs` selects another one.
"""

import io
import os
import pickle
import sys
import threading
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from jounce.base.private_folder import PrivateFolder
from jounce.errors import OutputError, ProgramFolderWarning, warn_caller
from jounce.execution.store.folder import VARIABLE, ProgramFolder, chosen_folder

PACKAGES = "jounce", "jax", "jaxlib", "numpy"
PLAIN = ("ndarray", "dtype")  # NumPy classes that may be read


@runtime_checkable
class Store(Protocol):
    """A store of programs by name, which returns them whole and unchanged."""

    def get(self, key: str) -> bytes | None:
        """Return the program of this name, or None."""
        ...

    def put(self, key: str, value: bytes) -> None:
        """Store a program."""
        ...

    def drop(self, key: str) -> None:
        """Remove an unusable program."""
        ...


FEW = 100_000  # instants of a command: for fewer, optimized code takes longer to compile than it saves
_undecided: Any = object()
_store: Store | None = _undecided
_soon = _many = False
_lock = threading.Lock()


def keep_programs(folder: str | Path | None) -> None:
    """Store programs that are compiled from now on in a folder, and reuse those in it; None to store nothing.

    By default the folder is that of the environment variable ``JOUNCE_CACHE_DIR`` (none if it is empty), or one for
    jounce among the user's caches, so that a second process starts with the programs of the first. Stored programs do
    not change results. Up to half a gigabyte is stored; the least recently used programs are removed first.

    Parameters
    ----------
    folder : str or Path, or None
        The folder, created if it does not exist. Programs run with the rights of the user who reads them, so nobody
        else may be able to write to it.

    Raises
    ------
    OutputError
        If the folder belongs to another user, others can write to it or to a folder above it, or it cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import jounce as jn
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     jn.keep_programs(folder)
    ...     jn.keep_programs(None)  # not any more
    """
    use_store(None if folder is None else ProgramFolder(PrivateFolder(folder)))


def use_store(store: Store | None) -> None:
    """Store programs that are compiled from now on in a store, and reuse those in it; None to store nothing."""
    global _store
    _store = store


def current_store() -> Store | None:
    """Return the current store of programs; the first call opens the default folder."""
    if _store is _undecided:
        with _lock:
            if _store is _undecided:
                use_store(_usual_store())
    return _store


def _usual_store() -> Store | None:
    """Return the store in the folder set by the environment, or in the user's; None if it cannot be used.

    A warning is given only if the folder was set: a home that cannot be written is no concern of this package.
    """
    try:
        folder = chosen_folder()
        return None if folder is None else ProgramFolder(PrivateFolder(folder))
    except OutputError as error:
        if VARIABLE in os.environ:
            warn_caller(ProgramFolderWarning(f"compiled programs are not stored: {error}"))
    except (RuntimeError, ValueError):  # no home, or an invalid file name
        pass
    return None


def expect(instants: int) -> None:
    """Record the number of instants that this process is about to solve."""
    global _many
    _many = _many or instants > FEW


def run_one_command() -> None:
    """Record that this process runs one command, whose user waits for it."""
    global _soon
    _soon = True


def is_in_haste() -> bool:
    """Return whether programs are compiled fast: for one command with few instants, whose user waits for it."""
    return _soon and not _many


class Descriptions(pickle.Unpickler):
    """Unpickler of the data stored beside code, restricted to classes of this package, of JAX and of NumPy.

    Raises
    ------
    pickle.UnpicklingError
        If anything else is named.
    """

    def find_class(self, module: str, name: str) -> Any:
        """Return the class of a name."""
        package = module.partition(".")[0]
        if package in PACKAGES and module in sys.modules:
            result = super().find_class(module, name)
            if isinstance(result, type) and (package != "numpy" or name in PLAIN):
                return result
        raise pickle.UnpicklingError(f"{module}.{name} is no part of a program")


def packed(parts: tuple[Any, ...]) -> bytes:
    """Return parts as bytes, for `unpacked`."""
    return zlib.compress(pickle.dumps(parts), level=1)


def unpacked(content: bytes) -> Any:
    """Return the parts of bytes from `packed`."""
    return Descriptions(io.BytesIO(zlib.decompress(content))).load()


def loaded_or_made(key: str | None, make: Callable[[], tuple[Any, ...]], load: Callable[..., Any]) -> Any:
    """Return a program loaded from stored parts, or from new parts, which are stored under the key.

    Parameters
    ----------
    key : str or None
        Key in the store; None to store nothing.
    make : callable
        Function that returns the parts, which can be pickled.
    load : callable
        Function from the parts to the program.
    """
    store = None if key is None else current_store()
    if store is not None and key is not None and (stored := store.get(key)) is not None:
        try:
            return load(*unpacked(stored))
        except Exception:  # noqa: BLE001 - a program with any fault is made again
            store.drop(key)
    parts = make()
    if store is not None and key is not None:
        with suppress(pickle.PicklingError, TypeError, AttributeError):
            store.put(key, packed(parts))
    return load(*parts)
