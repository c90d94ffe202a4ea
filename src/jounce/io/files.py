"""Files written whole or not at all, and asked about before a long computation."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike, fspath
from pathlib import Path

from jounce.errors import OutputError
from jounce.interrupts import undoing

__all__ = ["check_target", "reason_of", "replacing"]


def check_target(path: str | PathLike[str], suffixes: tuple[str, ...] = (), kind: str = "output") -> None:
    """Raise OutputError unless a file can be written; one there already is left as it is.

    Parameters
    ----------
    path
        The file, in a folder that exists.
    suffixes
        Endings that it may have; any when there are none.
    kind
        What the file holds, for the message.

    Raises
    ------
    OutputError
        The ending is another, the folder does not exist, or nothing may be written there.
    """
    name = fspath(path)
    if suffixes and Path(name).suffix.lower() not in suffixes:
        raise OutputError(f"the kind of {kind} is told by its ending; valid: {', '.join(suffixes)}", path=name)
    try:
        target = Path(os.path.realpath(name))
        if target.is_dir():
            raise OutputError("is a directory, the name of a file is needed", path=name)
        if not target.parent.is_dir():
            raise OutputError(f"the folder {target.parent} does not exist", path=name)
        if target.exists() and not (target.is_file() and os.access(target, os.W_OK)):
            raise OutputError("the file there may not be replaced", path=name)
        probe = _beside(target)
        with undoing(lambda: probe.unlink(missing_ok=True)):
            probe.touch(exist_ok=False)
            probe.unlink()
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot be written: {reason_of(error)}", path=name) from None


@contextmanager
def replacing(path: str | PathLike[str]) -> Iterator[Path]:
    """Give a file beside the target to write to, and put it in the place of the target only when that went well.

    Raises
    ------
    OutputError
        The file cannot be written; what was there before is unchanged.
    """
    target = Path(os.path.realpath(path))
    scratch = _beside(target)
    try:
        with undoing(lambda: scratch.unlink(missing_ok=True)):
            scratch.touch(exist_ok=False)
            yield scratch
            scratch.replace(target)
    except OutputError as error:
        raise error.located(path=fspath(path)) from None
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot be written: {reason_of(error)}", path=fspath(path)) from error
    finally:
        with suppress(OSError):
            scratch.unlink()


def reason_of(error: Exception) -> str:
    """Word the reason of a failure by the operating system."""
    return getattr(error, "strerror", None) or str(error)


def _beside(target: Path) -> Path:
    """Return the path of a new file beside the target."""
    return target.with_name(f".jounce-{secrets.token_hex(6)}{target.suffix}")
