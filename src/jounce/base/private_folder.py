"""A folder that only this user can write to, so that its contents can be trusted.

Stored code runs with the rights of the user who reads it. The folder and each file in it must therefore belong to this
user and not be writable by others. Names are looked up relative to the checked folder, even if another one takes its
place, and links are not followed.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
import sys
import weakref
from collections.abc import Iterator
from pathlib import Path

from jounce.errors import OutputError

_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_READ = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))
_WRITE = (
    os.O_WRONLY | os.O_CREAT | os.O_EXCL | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_CLOEXEC", "O_BINARY"))
)
_POSIX = sys.platform != "win32"


class PrivateFolder:
    """A private folder of this user, created if it does not exist.

    On Windows, where access lists protect the folders of a user's profile, only links are refused.

    Parameters
    ----------
    path : str or Path
        The folder.

    Raises
    ------
    OutputError
        If it belongs to another user, others can write to it or to a folder above it, or it cannot be opened.
    """

    SCRATCH = ".part"  # suffix of unfinished files

    def __init__(self, path: str | Path):
        self.path = Path(os.path.realpath(path))
        try:
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._check_above()
            self._descriptor: int | None = None
            if _POSIX:
                self._descriptor = os.open(self.path, _READ | os.O_DIRECTORY)
                weakref.finalize(self, os.close, self._descriptor)
                self._check(os.fstat(self._descriptor))
                if not os.access(self.path, os.W_OK | os.X_OK):
                    raise OutputError("may not be written", path=self.path)
        except OSError as error:
            raise OutputError(f"cannot be used: {error.strerror}", path=self.path) from None

    def read(self, name: str) -> bytes | None:
        """Return the content of a file; None if there is none, or others may have written it."""
        try:
            with open(self._opened(name, _READ), "rb") as stream:  # noqa: PTH123 - of a descriptor
                status = os.fstat(stream.fileno())
                if not stat.S_ISREG(status.st_mode) or _unsafe_reason(status):
                    return None
                with contextlib.suppress(OSError):
                    os.utime(stream.fileno() if os.utime in os.supports_fd else self.path / name)
                return stream.read()
        except OSError:
            return None

    def write(self, name: str, content: bytes) -> None:
        """Write a file atomically, in place of a file or link of the same name; do nothing if that fails."""
        scratch = f".{secrets.token_hex(8)}{self.SCRATCH}"
        try:
            with open(self._opened(scratch, _WRITE), "wb") as stream:  # noqa: PTH123 - of a descriptor
                stream.write(content)
            self._replace(scratch, name)
        except OSError:  # a full disk, or a folder in the place of the file
            self.remove(scratch)

    def remove(self, name: str) -> None:
        """Remove a file or link, if possible."""
        with contextlib.suppress(OSError):
            os.unlink(*self._at(name), **self._folder_option())

    def files(self, ending: str) -> Iterator[tuple[float, int, str]]:
        """Yield the time of last use, the size in bytes and the name of each file with a suffix."""
        with contextlib.suppress(OSError):
            for name in os.listdir(self.path if self._descriptor is None else self._descriptor):  # noqa: PTH208
                with contextlib.suppress(OSError):  # another process may remove files
                    if name.endswith(ending):
                        status = os.stat(*self._at(name), follow_symlinks=False, **self._folder_option())
                        yield status.st_mtime, status.st_size, name

    def _opened(self, name: str, flags: int) -> int:
        return os.open(*self._at(name), flags, 0o600, **self._folder_option())

    def _replace(self, old: str, new: str) -> None:
        if self._descriptor is None:
            (self.path / old).replace(self.path / new)
        else:
            os.replace(old, new, src_dir_fd=self._descriptor, dst_dir_fd=self._descriptor)

    def _at(self, name: str) -> tuple[str | Path]:
        return (self.path / name,) if self._descriptor is None else (name,)

    def _folder_option(self) -> dict[str, int]:
        return {} if self._descriptor is None else {"dir_fd": self._descriptor}

    def _check(self, status: os.stat_result) -> None:
        if fault := _unsafe_reason(status):
            message = f"{fault}: somebody else may have written its contents; use a folder that only you can write to"
            raise OutputError(message, path=self.path)

    def _check_above(self) -> None:
        """Raise OutputError if others could replace this folder in one of the folders above it."""
        for folder in self.path.parents if _POSIX else ():
            status = folder.stat()
            writable = stat.S_IWOTH if status.st_gid == os.getegid() else _OTHERS
            if status.st_uid not in (0, os.geteuid()) or (
                status.st_mode & writable and not status.st_mode & stat.S_ISVTX
            ):
                raise OutputError(f"is in the folder {folder}, in which others may write", path=self.path)


def _unsafe_reason(status: os.stat_result) -> str:
    """Return the reason why others may have written a folder or file; empty if they cannot have."""
    if not _POSIX:
        return ""
    if status.st_uid != os.geteuid():
        return "belongs to another user"
    return "may be written by others" if status.st_mode & _OTHERS else ""
