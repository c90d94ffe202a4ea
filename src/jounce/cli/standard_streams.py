"""Standard output and standard error that may be closed, full, or without a reader, while the work continues."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any


class FailSafeStream:
    """A stream that records its first failure instead of raising it, so that the command continues.

    Parameters
    ----------
    stream : file object, optional
        The stream; None if it was closed before the process started.

    Attributes
    ----------
    failure : Exception or None
        The reason why text was lost. A closed pipe (``| head``) is not a failure.
    """

    def __init__(self, stream: Any):
        self._given = stream
        self._stream = stream
        self.failure: Exception | None = None

    def write(self, text: str) -> int:
        """Write text; it is lost after a failure."""
        if self._given is None and text:
            self.failure = OSError(errno.EBADF, os.strerror(errno.EBADF))
        self._attempt("write", text)
        return len(text)

    def writelines(self, lines: Any) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Write buffered text."""
        self._attempt("flush")

    def isatty(self) -> bool:
        """Return whether the stream is a terminal."""
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
            with suppress(OSError, ValueError, AttributeError):  # otherwise the interpreter tries again at exit
                null_device = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null_device, self._given.fileno())
                os.close(null_device)

    def __getattr__(self, name: str) -> Any:
        if self._given is None:
            raise AttributeError(name)
        return getattr(self._given, name)


@contextmanager
def failsafe_streams() -> Iterator[FailSafeStream]:
    """Yield a fail-safe standard output; characters that cannot be encoded are written as codes."""
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
