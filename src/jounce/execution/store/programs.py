"""Where compiled programs are kept for other processes, and how machine code goes there.

That is a folder of the user, unless the environment or `keep_programs` says otherwise.
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
_undecided: Any = object()
_store: Store | None = _undecided
_soon = _many = False
_lock = threading.Lock()


def keep_programs(folder: str | Path | None) -> None:
    """Keep what is compiled from here on in a folder, and take from there what is needed again; None for neither.

    Unless this is called, the folder is that of the environment variable ``JOUNCE_CACHE_DIR`` (none where it is empty),
    or one for jounce among the user's caches: a second process then starts with the programs of the first. What is kept
    does not change results; up to half a gigabyte is, those longest without use go first.

    Parameters
    ----------
    folder : str or Path, or None
        Made if it is not there. Programs run with the rights of who reads them, so nobody else may write in it.

    Raises
    ------
    OutputError
        If it belongs to another user, others may write in it or in a folder that it is in, or it cannot be written.

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
    """Keep what is compiled from here on in a store, and take it from there; None for not."""
    global _store
    _store = store


def current_store() -> Store | None:
    """Return the store that programs go to; the first time, the usual folder is opened."""
    if _store is _undecided:
        with _lock:
            if _store is _undecided:
                use_store(_usual_store())
    return _store


def _usual_store() -> Store | None:
    """Return the programs of the folder chosen by the environment, or of the user's; None where it cannot be used.

    A warning says so only where it was chosen: a home that cannot be written is none of this package's business.
    """
    try:
        folder = chosen_folder()
        return None if folder is None else ProgramFolder(PrivateFolder(folder))
    except OutputError as error:
        if VARIABLE in os.environ:
            warn_caller(ProgramFolderWarning(f"compiled programs are not stored: {error}"))
    except (RuntimeError, ValueError):  # there is no home, or a name that no file can have
        pass
    return None


def expect(instants: int) -> None:
    """Take note of how many instants this process is about to solve."""
    global _many
    _many = _many or instants > FEW


def run_one_command() -> None:
    """Take note that this process runs one command, whose user waits for it."""
    global _soon
    _soon = True


def is_in_haste() -> bool:
    """Tell whether code is compiled for one command, whose user waits for it, of few instants."""
    return _soon and not _many


class Descriptions(pickle.Unpickler):
    """Reads what a store holds beside code: classes of this package, of JAX and of NumPy, and nothing that is run.

    Raises
    ------
    pickle.UnpicklingError
        If something else is named.
    """

    def find_class(self, module: str, name: str) -> Any:
        """Return what a name stands for, if it is a class."""
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
    """Return the parts that `packed` made bytes of."""
    return Descriptions(io.BytesIO(zlib.decompress(content))).load()


def loaded_or_made(key: str | None, make: Callable[[], tuple[Any, ...]], load: Callable[..., Any]) -> Any:
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
    if store is not None and key is not None and (stored := store.get(key)) is not None:
        try:
            return load(*unpacked(stored))
        except Exception:  # noqa: BLE001 - whatever is wrong with it, it is made again
            store.drop(key)
    made = make()
    if store is not None and key is not None:
        with suppress(pickle.PicklingError, TypeError, AttributeError):
            store.put(key, packed(made))
    return load(*made)
