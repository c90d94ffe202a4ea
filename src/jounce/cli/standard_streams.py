"""Standard output and standard error that may be closed, full, or read by nobody, while the work goes on."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any


class FailSafeStream:
    """A stream whose first failure is kept, not raised: what else a command does is done all the same.

    Parameters
    ----------
    stream : file object, optional
        None is one that was closed before the process began.

    Attributes
    ----------
    failure : Exception or None
        Why text was lost. That nobody reads any more (``| head``) is no failure.
    """

    def __init__(self, stream: Any):
        self._given = stream
        self._stream = stream
        self.failure: Exception | None = None

    def write(self, text: str) -> int:
        """Write text, or lose it."""
        if self._given is None and text:
            self.failure = OSError(errno.EBADF, os.strerror(errno.EBADF))
        self._attempt("write", text)
        return len(text)

    def writelines(self, lines: Any) -> None:
        """Write pieces of text."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Write what is waiting to be written."""
        self._attempt("flush")

    def isatty(self) -> bool:
        """Tell whether it goes to a terminal."""
        return self._given is not None and self._given.isatty()

    def _attempt(self, method: str, *arguments: Any) -> None:
        if self._stream is None:
            return
        try:
            getattr(self._stream, method)(*arguments)
        except (OSError, ValueError) as error:  # ValueError: closed by the program itself
            if not isinstance(error, BrokenPipeError):
                self.failure = error
            self._stream = None
            with suppress(OSError, ValueError, AttributeError):  # or the interpreter tries again when it ends
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self._given.fileno())
                os.close(nowhere)

    def __getattr__(self, name: str) -> Any:
        if self._given is None:
            raise AttributeError(name)
        return getattr(self._given, name)


@contextmanager
def failsafe_streams() -> Iterator[FailSafeStream]:
    """Give standard output, which lasts meanwhile; characters that cannot be encoded are written as codes."""
    before: tuple[Any, Any] = (sys.stdout, sys.stderr)
    for stream in before:
        with suppress(AttributeError, ValueError):
            stream.reconfigure(errors="backslashreplace")
    output, messages = FailSafeStream(before[0]), FailSafeStream(before[1])
    sys.stdout, sys.stderr = output, messages
    try:
        yield output
    finally:
        output.flush()
        messages.flush()
        sys.stdout, sys.stderr = before
