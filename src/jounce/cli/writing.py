"""Results written at the end of a command."""

from typing import Any

from jounce.errors import OutputError


class WritingError(Exception):
    """A result that was computed could not be written."""


def written(write: Any) -> None:
    """Call a function that writes a result; what fails then is no bad input."""
    try:
        write()
    except OutputError as error:
        raise WritingError(error) from None
