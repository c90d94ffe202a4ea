"""Files of the figures and tables of papers: whole files or none, in a directory that is tested first."""

import io
import tempfile
from collections.abc import Callable, Iterable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from jounce.errors import OutputError
from jounce.io.files.writing import replacing

FORMATS = ("png", "svg")
Progress = Callable[[int, int], None]
"""Function called with the number of finished steps and their total."""


def write(path: Path, content: bytes) -> Path:
    """Write a whole file or nothing.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(content)
    return path


def write_texts(directory: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write texts to files of the given names."""
    return [write(directory / name, text.encode("ascii")) for name, text in texts.items()]


def write_figures(directory: Path, figures: Mapping[str, Callable[[Any], Any]], results: Any) -> Iterable[list[Path]]:
    """Draw the figures of some results, and yield the paths of each figure when it is written."""
    from jounce.plot.style import style

    for name, draw in figures.items():
        with style():
            figure = draw(results)
            yield [write(directory / f"{name}.{kind}", rendered(figure, kind)) for kind in FORMATS]


def writable(directory: Path) -> Path:
    """Make a directory and test it with a file.

    Raises
    ------
    OutputError
        If files cannot be written to the directory.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"files cannot be written there: {reason}", path=directory) from None
    return directory


def counter(total: int, progress: Progress | None) -> Callable[[], None]:
    """Return the function that reports the progress, to be called after each step."""
    done = 0

    def advanced() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, total)

    return advanced


def rendered(figure: Any, kind: str) -> bytes:
    """Return a figure as the bytes of a PNG or SVG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=200, metadata={"Date": None} if kind == "svg" else None)
    return buffer.getvalue()


def csv_table(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    r"""Return a table as CSV, numbers with 17 significant digits.

    Examples
    --------
    >>> csv_table(["name", "error"], [["a", 0.5]])
    'name,error\na,5.0000000000000000e-01\n'
    """
    cells = ([cell if isinstance(cell, str) else f"{cell:.16e}" for cell in row] for row in rows)
    return "\n".join(",".join(line) for line in ([*columns], *cells)) + "\n"


def markdown_table(columns: str, rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown; ``|`` separates the names of its columns.

    Examples
    --------
    >>> print(markdown_table("name | error", [["a", "0.5"]]))
    | name | error |
    |---|---|
    | a | 0.5 |
    """
    lines = [f"| {columns} |", "|" + "---|" * (1 + columns.count("|"))]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def page(package: str | None, name: str, **values: Any) -> str:
    """Return a text file of a package, with values for the names in braces."""
    return (files(str(package)) / name).read_text(encoding="ascii").format(**values)
