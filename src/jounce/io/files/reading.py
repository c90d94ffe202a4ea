"""Safe reading of files: regular files of bounded size, below the folder of the file that names them.

Input files are recorded, so that no result replaces them unasked (`jounce.io.files.writing`).
"""

from __future__ import annotations

import csv
import hashlib
import io
import math
import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from os import PathLike
from pathlib import Path

from jounce.errors import JounceError, MechanismFileError, did_you_mean

MAX_BYTES = 10_000_000
MAX_SAMPLES = 100_000_000
"""Largest size of a table of samples, bytes."""
MAX_ROWS, MAX_ENTRIES = 2_000_000, 8_000_000
"""Limits of a table of samples, which as text take less than 1 GB of memory."""
LARGEST_NUMBER = 1e75  # in SI units; products of a few larger quantities overflow
FORMULA = ("=", "+", "-", "@", "\t", "\r", "'")
"""Characters with which spreadsheets begin a formula, and the apostrophe that makes it text."""

_inputs: dict[str, tuple[int, int]] = {}
"""Device and inode of the files read by this process, by their real paths."""
_recorded: ContextVar[dict[str, str] | None] = ContextVar("_recorded", default=None)
_results: dict[str, tuple[int, ...]] = {}
"""Device, inode, size and time of the files written by this process, by their real paths."""


def name_of(path: str | PathLike[str], error: type[JounceError] = MechanismFileError) -> str:
    """Return the name of a file as text, or raise an error of the given type."""
    try:
        return os.fsdecode(path)
    except TypeError:
        raise error("must be the name of a file", name="path", value=path) from None


def read_file(
    path: str | PathLike[str],
    limit: int | None = MAX_BYTES,
    *,
    what: str = "the file",
    error: type[JounceError] = MechanismFileError,
    is_input: bool = True,
) -> bytes:
    """Return the content of a regular file of bounded size.

    Parameters
    ----------
    path
        The file; symbolic links are followed.
    limit : int or None
        Largest size, bytes; None for files without a limit, which this package wrote.
    what : str
        Kind of the content, for messages.
    error : type
        Type of the exceptions.
    is_input : bool, default True
        Whether results must not replace the file unasked.

    Raises
    ------
    JounceError
        Of the type `error`, if the file does not exist, is a directory, a device or a pipe, is too large, or may not be
        read. No file is opened that could block or have side effects.
    """
    name = os.fsdecode(path)
    try:
        _check_regular(name, Path(name).stat(), limit, what, error)
        # the file may have been replaced since: neither block on a pipe nor acquire a terminal
        flags = os.O_RDONLY | sum(getattr(os, key, 0) for key in ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY"))
        with open(os.open(name, flags), "rb") as stream:  # noqa: PTH123 - a descriptor
            status = os.fstat(stream.fileno())
            _check_regular(name, status, limit, what, error)
            content = stream.read(-1 if limit is None else limit + 1) or b""
    except FileNotFoundError:
        word = what.removeprefix("the ")
        message = f"{word if word == 'file' else f'file of {word}'} not found{_similar_file(name)}"
        raise error(message, path=name) from None
    except (OSError, ValueError) as reason:
        subject = "" if what == "the file" else f"{what} "
        raise error(f"{subject}cannot be read: {reason_of(reason)}", path=name) from None
    if limit is not None and len(content) > limit:
        raise _too_large(name, len(content), limit, what, error)
    if is_input:
        _note_input(name, status)
        if (recorded := _recorded.get()) is not None:
            recorded[os.path.realpath(name)] = hashlib.sha256(content).hexdigest()
    return content


@contextmanager
def recording() -> Iterator[dict[str, str]]:
    """Yield a dictionary that records the digest of every input read within the context, by its real path."""
    texts: dict[str, str] = {}
    before = _recorded.set(texts)
    try:
        yield texts
    finally:
        _recorded.reset(before)


def _check_regular(name: str, status: os.stat_result, limit: int | None, what: str, error: type[JounceError]) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise error("is a directory, a file is needed", path=name)
    if not stat.S_ISREG(status.st_mode):
        raise error("is not a regular file", path=name)
    if limit is not None and status.st_size > limit:
        raise _too_large(name, status.st_size, limit, what, error)


def _too_large(name: str, size: int, limit: int, what: str, error: type[JounceError]) -> JounceError:
    has = "have" if what.endswith("s") else "has"
    return error(f"{what} {has} {size / 1e6:.3g} MB, at most {limit / 1e6:.3g} MB are read", path=name)


def reason_of(error: Exception) -> str:
    """Return the reason of a failure in the words of the operating system."""
    return getattr(error, "strerror", None) or str(error)


def _similar_file(path: str) -> str:
    """Return a suggestion of a file with a similar name in the same folder; an empty text if there is none."""
    requested = Path(path)
    try:
        names = [entry.name for entry in requested.parent.iterdir() if entry.suffix == requested.suffix][:1000]
    except (OSError, ValueError):
        return ""
    suggestion = did_you_mean(requested.name, names, limit=0)
    return f"; {suggestion}" if suggestion.startswith("did") else ""


def fault_of_number(number: float) -> str:
    """Return why a number cannot be used in computations; an empty text if it can."""
    if not math.isfinite(number):
        return "must be a finite number"
    return "" if abs(number) <= LARGEST_NUMBER else f"must be at most {LARGEST_NUMBER:g}"


def named_file(
    name: str,
    holder: str | PathLike[str],
    allow: Iterable[str | PathLike[str]] = (),
    *,
    folder: str | PathLike[str] | None = None,
    error: type[JounceError] = MechanismFileError,
) -> str:
    """Return the path of a file that another file names, which must lie below the folder of the latter.

    Parameters
    ----------
    name : str
        Name as the file gives it: relative to the folder of the holder, or absolute.
    holder
        File that contains the name.
    allow : iterable of path
        Folders besides that of the holder below which the file may lie.
    folder
        Base of a relative name; the folder of the holder by default.
    error : type
        Type of the exceptions.

    Returns
    -------
    str
        Path without symbolic links, for `read_file`.

    Raises
    ------
    JounceError
        Of the type `error`, if the file, after its symbolic links are resolved, lies elsewhere.
    """
    folder_of_holder = Path(os.fsdecode(holder)).parent
    try:
        resolved = os.path.realpath((folder_of_holder if folder is None else Path(folder)) / name)
        bases = [folder_of_holder, Path(os.path.realpath(holder)).parent, *allow]
        is_inside = any(Path(resolved).is_relative_to(os.path.realpath(base)) for base in bases)
    except (OSError, ValueError) as reason:
        raise error(f"cannot be the name of a file: {reason_of(reason)}", value=name) from None
    if not is_inside:
        advice = "put it there, or allow its folder with --allow DIR (in Python allow=[DIR])"
        raise error(f"lies outside the folder of the file that names it; {advice}", value=name)
    return resolved


def check_allowed(folders: Iterable[str | PathLike[str]]) -> tuple[str, ...]:
    """Return the folders below which named files may lie, each of which must exist.

    Raises
    ------
    MechanismFileError
        If a folder does not exist.
    """
    allowed = (folders,) if isinstance(folders, str | PathLike) else tuple(folders)
    for folder in allowed:
        if not Path(folder).is_dir():
            raise MechanismFileError("must be a folder that exists", name="allow", value=os.fsdecode(folder))
    return tuple(os.fsdecode(folder) for folder in allowed)


def read_rows(path: str | PathLike[str], error: type[JounceError]) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of a CSV file of at most 100 MB, 2 million rows and 8 million entries.

    Yields
    ------
    line : int
        Line number, from 1.
    row : list of str
        Entries without surrounding blanks.

    Raises
    ------
    JounceError
        Of the type `error`, if the file cannot be read, is not text in UTF-8, violates the syntax, or is too large.
    """
    name = os.fsdecode(path)
    content = read_file(name, MAX_SAMPLES, what="the samples", error=error)
    reader = csv.reader(io.TextIOWrapper(io.BytesIO(content), newline="", encoding="utf-8-sig"), strict=True)
    rows = entries = 0
    try:
        for row in reader:
            rows, entries = rows + 1, entries + len(row)
            if rows > MAX_ROWS or entries > MAX_ENTRIES:
                message = f"the samples have more than {MAX_ROWS} rows or {MAX_ENTRIES} entries; no more are read"
                raise error(message, path=name, line=reader.line_num)
            yield reader.line_num, [entry.strip() for entry in row]
    except UnicodeDecodeError:
        raise error("the samples cannot be read: no text in UTF-8", path=name, line=bad_line(content)) from None
    except (csv.Error, ValueError) as reason:
        raise error(f"the samples cannot be read: {reason}", path=name, line=reader.line_num + 1) from None


def bad_line(content: bytes) -> int | None:
    """Return the first line that is not text in UTF-8; None if there is none."""
    try:
        content.decode()
    except UnicodeDecodeError as error:
        return content.count(b"\n", 0, error.start) + 1
    return None


def written_name(name: str) -> str:
    """Return the name of a column for a CSV file, escaped so that spreadsheets do not read it as a formula.

    Examples
    --------
    >>> written_name("psi"), written_name("=1+1")
    ('psi', "'=1+1")
    """
    return f"'{name}" if name.startswith(FORMULA) else name


def known_name(entry: str) -> str:
    """Return the name of a column that `written_name` may have escaped."""
    return entry[1:] if entry.startswith("'") and entry[1:].startswith(FORMULA) else entry


def _note_input(name: str, status: os.stat_result) -> None:
    real = os.path.realpath(name)
    if _results.get(real) != _identity(status):
        _inputs[real] = (status.st_dev, status.st_ino)


def note_result(path: str | PathLike[str]) -> None:
    """Record that this process wrote a file, which it may then replace."""
    real = os.path.realpath(path)
    _inputs.pop(real, None)
    _results[real] = _identity(Path(real).stat())


def is_result(path: str | PathLike[str]) -> bool:
    """Return whether this process wrote a file that has not changed since."""
    real = os.path.realpath(path)
    try:
        return _results.get(real) == _identity(Path(real).stat())
    except OSError:
        return False


def _identity(status: os.stat_result) -> tuple[int, ...]:
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def is_input(path: str | PathLike[str]) -> bool:
    """Return whether this process read a file as an input, under any name."""
    real = os.path.realpath(path)
    try:
        status = Path(real).stat()
    except OSError:
        return False
    if real in _inputs:
        return True
    names = [name for name, identity in _inputs.items() if identity == (status.st_dev, status.st_ino)]
    return any(Path(name).exists() and Path(name).samefile(real) for name in names)
