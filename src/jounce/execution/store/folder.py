"""Compiled programs in the files of a folder of this user, for all of their processes."""

import hashlib
import os
import sys
import time
from pathlib import Path

from jounce.base.private_folder import PrivateFolder

VARIABLE = "JOUNCE_CACHE_DIR"
ENDING = ".program"
LARGEST = 2**29  # bytes of programs in a folder
LOOKED_AT = 2**26  # bytes that a process adds between two looks at how much there is
ABANDONED = 3600.0  # s, after which a file that is being written has no writer any more


def chosen_folder() -> Path | None:
    """Return where compiled programs are kept: JOUNCE_CACHE_DIR, or the user's cache folder; None where nowhere.

    Raises
    ------
    RuntimeError
        If this user has no home.
    """
    given = os.environ.get(VARIABLE)
    if given is not None:
        return Path(given).expanduser() if given.strip() else None
    home = Path.home()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "jounce" / "cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "jounce"
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else home / ".cache") / "jounce"


class ProgramFolder:
    """Compiled programs in the files of a folder, each after a digest of itself: what is damaged is removed.

    Where the disk is full, programs are not kept; of more than are allowed, those go that were not used for longest.

    Parameters
    ----------
    folder : PrivateFolder
        Programs run with the rights of who reads them.
    """

    def __init__(self, folder: PrivateFolder):
        self._folder = folder
        self._path = folder.path  # the name by which JAX asks for it
        self._added = LOOKED_AT  # bytes since this process has looked at how much there is

    def get(self, key: str) -> bytes | None:
        """Return the program of this key, or None."""
        whole, size = self._folder.read(key + ENDING), hashlib.sha256().digest_size
        if whole is not None and hashlib.sha256(whole[size:]).digest() == whole[:size]:
            return whole[size:]
        if whole is not None:
            self.drop(key)
        return None

    def put(self, key: str, value: bytes) -> None:
        """Keep a program, in one step: other processes find all of it or nothing."""
        self._folder.write(key + ENDING, hashlib.sha256(value).digest() + value)
        self._added += len(value)
        if self._added >= LOOKED_AT:
            self._added = 0
            self._remove_oldest()

    def drop(self, key: str) -> None:
        """Remove a program that is of no use."""
        self._folder.remove(key + ENDING)

    def _remove_oldest(self) -> None:
        """Remove the programs that were not used for longest, until no more is kept than is allowed."""
        result = sorted(self._folder.files(ENDING))
        total = sum(size for _, size, _ in result)
        for _, size, name in result:
            if total <= LARGEST:
                break
            total -= size
            self._folder.remove(name)
        for written, _, name in self._folder.files(PrivateFolder.SCRATCH):
            if written < time.time() - ABANDONED:
                self._folder.remove(name)
