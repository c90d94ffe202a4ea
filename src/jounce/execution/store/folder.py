"""Compiled programs in files of a private folder, for all processes of this user."""

import hashlib
import os
import sys
import time
from pathlib import Path

from jounce.base.private_folder import PrivateFolder

VARIABLE = "JOUNCE_CACHE_DIR"
ENDING = ".program"
LARGEST = 2**29  # bytes of programs in a folder
LOOKED_AT = 2**26  # bytes that a process adds between two checks of the size of the folder
ABANDONED = 3600.0  # s, after which an unfinished file counts as abandoned


def chosen_folder() -> Path | None:
    """Return the folder of compiled programs: JOUNCE_CACHE_DIR, or the user's cache folder; None to store nothing.

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
    """Compiled programs in files of a folder, each behind its digest; damaged files are removed.

    Programs are not stored if the disk is full. Beyond the size limit, the least recently used ones are removed.

    Parameters
    ----------
    folder : PrivateFolder
        A private folder, since programs run with the rights of the user who reads them.
    """

    def __init__(self, folder: PrivateFolder):
        self._folder = folder
        self._path = folder.path  # an attribute that JAX reads
        self._added = LOOKED_AT  # bytes added since the last check of the size

    def get(self, key: str) -> bytes | None:
        """Return the program of this key, or None."""
        content, size = self._folder.read(key + ENDING), hashlib.sha256().digest_size
        if content is not None and hashlib.sha256(content[size:]).digest() == content[:size]:
            return content[size:]
        if content is not None:
            self.drop(key)
        return None

    def put(self, key: str, value: bytes) -> None:
        """Store a program atomically: other processes find all of it or nothing."""
        self._folder.write(key + ENDING, hashlib.sha256(value).digest() + value)
        self._added += len(value)
        if self._added >= LOOKED_AT:
            self._added = 0
            self._remove_oldest()

    def drop(self, key: str) -> None:
        """Remove an unusable program."""
        self._folder.remove(key + ENDING)

    def _remove_oldest(self) -> None:
        """Remove the least recently used programs beyond the size limit."""
        result = sorted(self._folder.files(ENDING))
        total = sum(size for _, size, _ in result)
        for _, size, name in result:
            if total <= LARGEST:
                break
            total -= size
            self._folder.remove(name)
        for modified, _, name in self._folder.files(PrivateFolder.SCRATCH):
            if modified < time.time() - ABANDONED:
                self._folder.remove(name)
