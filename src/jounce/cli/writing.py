"""Results written at the end of a command."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from jounce.errors import JounceError, OutputError

Overwrite = Annotated[bool, Parameter(alias="--force")]
"""The option of commands that replace no file unasked; --force is what it was called first."""


class WritingError(Exception):
    """A result that was computed could not be written."""


def allowed(folders: Sequence[Path] | None) -> Sequence[Path]:
    """Return the folders that named files may be in, each of which must exist."""
    from jounce.io.files.reading import check_allowed

    try:
        check_allowed(folders or ())
    except JounceError as error:
        error.name = "--allow"
        raise
    return folders or ()


def spared(out: Path | None, overwrite: bool) -> None:
    """Raise OutputError where a result would replace what has been read; meant to be asked once all is read."""
    if out is not None:
        from jounce.io.files.writing import check_target

        check_target(out, overwrite=overwrite)


def written(write: Any) -> None:
    """Call a function that writes a result; what fails then is no bad input."""
    try:
        write()
    except OutputError as error:
        raise WritingError(error) from None
