"""Files in the folder of a sweep: read with checks, written atomically, and without following links."""

import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from jounce.base.interrupts import cleanup_on_signal
from jounce.errors import JounceError, OutputError
from jounce.io.files.reading import read_file, reason_of

ROOT = "zarr.json"
LARGEST_ROOT = 200_000_000  # bytes of the metadata of all arrays
REMOVE = "remove it, and what it held is computed again"


def attributes_in(path: Path) -> dict[str, Any]:
    """Return the attributes in the metadata of a group.

    Raises
    ------
    OutputError
        If the metadata cannot be read.
    """
    attributes = parsed(read_file(path, LARGEST_ROOT, error=OutputError, is_input=False), path).get("attributes", {})
    if not isinstance(attributes, dict):
        raise OutputError("is no description of a group", path=str(path))
    return attributes


def parsed(text: Any, path: Path) -> dict[str, Any]:
    """Return the mapping in a JSON text, or raise OutputError."""
    try:
        data = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        raise OutputError("is no JSON", path=str(path)) from None
    if not isinstance(data, dict):
        raise OutputError("is no description of a group", path=str(path))
    return data


def is_sweep(folder: Path) -> bool:
    """Return whether the metadata of a folder is that of a sweep."""
    try:
        return "manifest" in attributes_in(folder / ROOT)
    except JounceError:
        return False


def is_blank(folder: Path) -> bool:
    """Return whether the folder of an array or a group contains nothing but metadata and coordinates."""
    paths = [path.relative_to(folder) for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    other_paths = [path for path in paths if path.name != ROOT]
    if not other_paths:
        return True
    try:
        names = parsed(read_file(folder / ROOT, LARGEST_ROOT, error=OutputError, is_input=False), folder)
    except JounceError:
        return False
    return names.get("dimension_names") == [folder.name] and other_paths == [Path("c", "0")]


@contextmanager
def naming_path(path: Path) -> Iterator[None]:
    """Raise OutputError for an OSError, with the file that the system names, or else a given path."""
    try:
        yield
    except (IsADirectoryError, NotADirectoryError) as error:
        message = f"something else takes the place of a file of the sweep; {REMOVE}"
        raise OutputError(message, path=os.fsdecode(error.filename2 or error.filename or path)) from error
    except OSError as error:
        failed_path = error.filename2 or error.filename or path
        message = f"cannot be written: {reason_of(error)}"
        raise OutputError(message, while_writing=True, path=os.fsdecode(failed_path)) from error


def put(path: Path, content: bytes) -> None:
    """Write a file atomically, without following links; a folder in its place is an error."""
    scratch = path.with_name(f"{path.name}.{secrets.token_hex(6)}.partial")
    try:
        with cleanup_on_signal(lambda: scratch.unlink(missing_ok=True)):
            scratch.write_bytes(content)
            sync(scratch)
            scratch.replace(path)
            sync(path.parent)
    finally:
        scratch.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Synchronize a file, or the entries of a folder, with the disk; chunks of fill values have no file."""
    with suppress(FileNotFoundError, PermissionError):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
