"""Atomic writing of files: checked before a long computation, and never onto an input."""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import stat
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from jounce.base.interrupts import cleanup_on_signal
from jounce.errors import OutputError
from jounce.io.files.reading import is_input, name_of, note_result, reason_of

_scratches: set[Path] = set()
"""Temporary files that have not yet replaced their targets."""


def check_target(
    path: str | PathLike[str], suffixes: tuple[str, ...] = (), kind: str = "output", *, overwrite: bool = False
) -> None:
    """Raise OutputError unless a file can be written; an existing file is left unchanged.

    Parameters
    ----------
    path
        File in an existing folder.
    suffixes
        Permitted endings; any ending if empty.
    kind
        Kind of content, for the message.
    overwrite
        Whether the file may be one that this process has read as an input.

    Raises
    ------
    OutputError
        If the ending is not permitted, the folder does not exist, the file is an input, or it cannot be written.
    """
    name = name_of(path, OutputError)
    if suffixes and Path(name).suffix.lower() not in suffixes:
        raise OutputError(f"the kind of {kind} is given by its extension; valid: {', '.join(suffixes)}", path=name)
    try:
        target = Path(os.path.realpath(name))
        _check_replaceable(target, overwrite)
        if not target.parent.is_dir():
            raise OutputError(f"the folder {target.parent} does not exist")
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OutputError as error:
        raise error.located(path=name) from None
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot be written: {reason_of(error)}", path=name) from None


def _check_replaceable(target: Path, overwrite: bool) -> None:
    if target.is_dir():
        raise OutputError("is a directory, the name of a file is needed")
    if target.is_symlink():  # a link in spite of realpath
        raise OutputError("is a circle of symbolic links")
    if not target.exists():
        return
    if not target.is_file():
        raise OutputError("the file there may not be replaced")
    if not os.access(target, os.W_OK):
        raise OutputError("the file there is read-only; give another name, or make it writable")
    if not overwrite and is_input(target):
        message = "was read as an input; give another name, or replace it with --overwrite (in Python overwrite=True)"
        raise OutputError(message)


@contextmanager
def replacing(path: str | PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary file beside the target, which replaces the target after success.

    The new file gets the permissions and the owner of the file that it replaces. It is synchronized to the disk before
    it replaces the target, and removed otherwise, also if SIGTERM ends the process.

    Parameters
    ----------
    path
        Target; a symbolic link is kept, and the file to which it points is replaced.
    overwrite
        Whether the target may be a file that this process has read as an input.

    Raises
    ------
    OutputError
        If the file cannot be written; an existing file is unchanged.
    """
    try:
        target = Path(os.path.realpath(path))
        _check_replaceable(target, overwrite)
        # the leading dot hides the file, and the ending tells programs the format
        scratch = target.with_name(f".jounce-{secrets.token_hex(6)}{target.suffix}")
        with cleanup_on_signal(lambda: scratch.unlink(missing_ok=True)), _removed(scratch):
            before = target.stat() if target.exists() else None
            os.close(os.open(scratch, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666 if before is None else 0o600))
            yield scratch
            _replace_target(scratch, target, before)
        note_result(target)
    except OutputError as error:
        raise error.located(path=fspath(path)) from None
    except (OSError, ValueError) as error:
        message = f"cannot be written: {reason_of(error)}"
        raise OutputError(message, while_writing=isinstance(error, OSError), path=fspath(path)) from error


def _replace_target(scratch: Path, target: Path, before: os.stat_result | None) -> None:
    """Move a complete file onto the target, with the owner and permissions of the existing one."""
    _sync(scratch)
    if before is not None and not _copy_ownership(scratch, before):
        shutil.copyfile(scratch, target)  # a file of another owner is overwritten, because only that keeps the owner
        _sync(target)
        return
    scratch.replace(target)
    with suppress(OSError):  # not every system can open folders
        _sync(target.parent)


def _copy_ownership(scratch: Path, before: os.stat_result) -> bool:
    """Give a file the owner and permissions of another; return whether the owner could be set."""
    if hasattr(os, "chown"):
        scratch_status = scratch.stat()
        if (scratch_status.st_uid, scratch_status.st_gid) != (before.st_uid, before.st_gid):
            try:
                os.chown(scratch, before.st_uid, before.st_gid)
            except OSError:
                return False
    scratch.chmod(stat.S_IMODE(before.st_mode))
    return True


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _removed(scratch: Path) -> Iterator[None]:
    """Remove a file at the end of the context, also if an unhandled signal ends the process."""

    def stop(number: int, _frame: Any) -> None:
        for path in tuple(_scratches):
            with suppress(OSError):
                path.unlink()
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)

    signals = []
    if threading.current_thread() is threading.main_thread():  # other threads cannot set handlers
        ends = [getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")]
        signals = [number for number in ends if number is not None and signal.getsignal(number) is signal.SIG_DFL]
    try:
        _scratches.add(scratch)
        for number in signals:
            signal.signal(number, stop)
        yield
    finally:
        with suppress(OSError):
            scratch.unlink()
        _scratches.discard(scratch)
        for number in signals:
            signal.signal(number, signal.SIG_DFL)
