"""How the figures and tables of papers are written: whole files or none, into a directory that is tried first."""

import io
import tempfile
from pathlib import Path
from typing import Any

from jounce.errors import OutputError
from jounce.io.files.writing import replacing

FORMATS = ("png", "svg")


def write(path: Path, content: bytes) -> Path:
    """Write a whole file or nothing.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    with replacing(path) as beside:
        beside.write_bytes(content)
    return path


def writable(directory: Path) -> Path:
    """Make the directory, and try a file in it.

    Raises
    ------
    OutputError
        If files cannot be written there.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"files cannot be written there: {reason}", path=directory) from None
    return directory


def rendered(figure: Any, kind: str) -> bytes:
    """Return a figure as the bytes of a PNG or SVG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=200, metadata={"Date": None} if kind == "svg" else None)
    return buffer.getvalue()
