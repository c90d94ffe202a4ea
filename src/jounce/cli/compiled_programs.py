"""Compiled programs kept between calls of the command."""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path
from typing import Any

from jounce.errors import OutputError
from jounce.execution import store
from jounce.execution.compilation import compiles_anew
from jounce.private_folder import PrivateFolder

ENDING = ".program"
LARGEST = 2**29  # bytes of programs in a folder, looked at when the first one of a process is added


def cache_directory() -> Path | None:
    """Return where compiled programs are kept: JOUNCE_CACHE_DIR, or the user's cache folder; None where nowhere."""
    given = os.environ.get("JOUNCE_CACHE_DIR")
    if given is not None:
        return Path(given) if given.strip() else None
    home = Path.home()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "jounce" / "cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "jounce"
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else home / ".cache") / "jounce"


class CheckedEntries:
    """Compiled programs in the files of a folder, each after a digest of itself.

    JAX's own files have none: it reads what is there, warns where that fails, and never writes over it; it may run a
    program of which a bit is wrong. Here what is damaged, or cannot be read, is removed.

    Parameters
    ----------
    folder : PrivateFolder
        Programs run with the rights of who reads them.
    """

    def __init__(self, folder: PrivateFolder):
        self._folder = folder
        self._path = folder.path  # the name by which JAX asks for it
        self._bounded = False  # whether this process has looked at how much is kept

    def get(self, key: str) -> bytes | None:
        """Return the program of this key, or None."""
        whole, size = self._folder.read(key + ENDING), hashlib.sha256().digest_size
        if whole is not None and hashlib.sha256(whole[size:]).digest() == whole[:size]:
            return whole[size:]
        self.drop(key)
        return None

    def put(self, key: str, value: bytes) -> None:
        """Keep a program, in one step: other processes find all of it or nothing."""
        self._folder.write(key + ENDING, hashlib.sha256(value).digest() + value)
        if not self._bounded:
            self._bounded = True
            self._remove_oldest()

    def drop(self, key: str) -> None:
        """Remove a program that is of no use."""
        self._folder.remove(key + ENDING)

    def _remove_oldest(self) -> None:
        """Remove the programs that were not used for longest, until no more is kept than is allowed."""
        found = sorted(self._folder.files(ENDING))
        total = sum(size for _, size, _ in found)
        for _, size, name in found:
            if total <= LARGEST:
                break
            total -= size
            self._folder.remove(name)


class JaxEntries(CheckedEntries):
    """The programs that JAX keeps by itself: those that `jounce.execution.store` does not."""

    def get(self, key: str) -> bytes | None:
        """Return the program of this key, or None, as it is where programs are to be compiled anew."""
        return None if compiles_anew() else super().get(key)

    def put(self, key: str, value: bytes) -> None:
        """Keep a program, unless it is kept in another form."""
        if not compiles_anew():
            super().put(key, value)


def keep_programs(folder: PrivateFolder) -> bool:
    """Have JAX keep its programs in checked files; a release of JAX that works otherwise keeps them in its own.

    Returns whether they are in checked files.
    """
    import jax

    from jounce.jax_internals import use_file_cache

    def file_cache(path: str) -> Any:
        return JaxEntries(folder), path

    known = use_file_cache(file_cache)
    jax.config.update("jax_compilation_cache_dir", str(folder.path))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.01)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    jax.config.update("jax_persistent_cache_enable_xla_caches", "none")  # those are for GPUs
    return known


def use_compilation_cache(*, quiet: bool = False) -> None:
    """Keep compiled programs between calls of the command, unless JAX was told where or the folder is out of reach.

    A folder in which others may write is not used, and a line on standard error says so, unless that is to be `quiet`.
    """
    import warnings

    import jax

    if getattr(jax.config, "jax_compilation_cache_dir", None) is not None:
        return
    try:
        directory = cache_directory()
        if directory is None:
            return
        folder = PrivateFolder(directory)
    except OutputError as error:
        if not quiet:
            sys.stderr.write(f"compiled programs are not kept: {error}\n")
        return
    except (RuntimeError, ValueError):  # there is no home, or a name that no file can have
        return
    if keep_programs(folder):
        store.keep_programs(CheckedEntries(folder))
    warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache")
