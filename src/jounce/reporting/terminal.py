"""Output of commands: tables and messages, in color on a terminal, as plain text elsewhere."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.errors import (
    AssemblyWarning,
    DamageWarning,
    IdleMotionWarning,
    MachineCodeWarning,
    PrecisionWarning,
    ProgramFolderWarning,
    RecordingWarning,
    ReplacedTypeWarning,
    RobotWarning,
    SampleWarning,
    UnitWarning,
    shortened,
)
from jounce.reporting.progress import pause

if TYPE_CHECKING:
    from jounce.reporting.peaks import Peak
    from jounce.reporting.text.tables import Table

OURS = (
    AssemblyWarning,
    DamageWarning,
    IdleMotionWarning,
    MachineCodeWarning,
    PrecisionWarning,
    ProgramFolderWarning,
    RecordingWarning,
    ReplacedTypeWarning,
    RobotWarning,
    SampleWarning,
    UnitWarning,
)  # warnings of this package, which filters of the user do not hide
WIDTH = 80  # of tables in plain text
WIDEST = 9999


def show_peaks(given: Sequence[Peak]) -> None:
    """Print a table of peaks."""
    if given:
        from jounce.reporting.text.tables import peaks_table

        show_table(peaks_table(given))
    else:
        print_text("\nNo outputs are defined, so there is nothing to tabulate.")


def show_table(table: Table, style: str = "bold") -> None:
    """Print a table, in color and with styled marks on a terminal that is wide enough for its numbers."""
    pause()
    if not (sys.stdout.isatty() and _show_colored(table, style)):
        print_text("\n" + "\n".join(_plain_lines(table)))


def _plain_lines(table: Table) -> list[str]:
    """Return the lines of a table in plain text, with names on separate lines if they are too long."""
    starred = [
        [cell + ("*" if k in marked else " ") if k in table.markable else cell for k, cell in enumerate(cells)]
        for cells, marked in zip(table.rows, table.marks or [[]] * len(table.rows), strict=True)
    ]
    columns = list(zip(table.headings, *starred, strict=True))
    widths = [max(map(len, column)) for column in columns]
    fits = not table.grouped or sum(widths) + 2 * (len(widths) - 1) <= WIDTH
    indent, first = "  " * bool(table.title), 0 if fits else 1

    def line(cells: Sequence[str]) -> str:
        padded = enumerate(zip(cells, widths, strict=True))
        parts = [c.rjust(w) if k in table.numbers else c.ljust(w) for k, (c, w) in padded]
        return (indent + "  ".join(parts[first:])).rstrip()

    lines = [*[table.title] * bool(table.title), line(table.headings), line(["-" * w for w in widths])]
    before = ""
    for cells in starred:
        if table.grouped and cells[0] != before:
            lines += [""] * bool(before) + [cells[0]] * first
        before = cells[0]
        lines.append(line(cells))
    return [*lines, *(["", f"* {table.meaning}"] if table.meaning else [])]


def _show_colored(table: Table, style: str) -> bool:
    """Print a table in color and return True, unless the terminal cannot show marks or is too narrow for numbers."""
    from rich import box
    from rich.console import Console
    from rich.table import Table as Grid
    from rich.text import Text

    title = table.title or None
    grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold", title=title, title_justify="left")
    grid.title_style = "bold"
    for k, heading in enumerate(table.headings):
        whole = k > 0 if table.grouped else k in table.numbers
        justify, color = ("right" if k in table.numbers else "left"), ("cyan" if k == 0 else "")
        grid.add_column(heading, justify=justify, no_wrap=whole, style=color, overflow="fold")
    before = ""
    for row, marked in zip(table.rows, table.marks or [[]] * len(table.rows), strict=True):
        cells = [Text(_clean(cell)) for cell in row]
        for column in marked:
            cells[column].stylize(style)
        if table.grouped and row[0] == before:
            cells[0] = Text("")
        elif table.grouped and before:
            grid.add_section()
        before = row[0]
        grid.add_row(*cells)
    notes = [f"{style}: {table.meaning}"] if table.meaning else []
    console = Console()
    if console.is_dumb_terminal or Console(width=WIDEST).measure(grid).minimum > console.width:
        return False
    console.print(*[""] * bool(title), grid, *notes, sep="\n")
    return True


def show_columns(pairs: Sequence[tuple[str, str]]) -> None:
    """Print names and their descriptions in two columns."""
    pause()
    width = max(len(name) for name, _ in pairs)
    colored = sys.stdout.isatty()
    if colored:
        from rich.console import Console
        from rich.text import Text

        for name, meaning in pairs:
            Console(soft_wrap=True).print(Text.assemble((name.ljust(width), "cyan"), f"  {meaning}"))
        return
    print_text("\n".join(f"{name:{width}}  {meaning}" for name, meaning in pairs))


def _clean(text: str) -> str:
    """Return text with control characters replaced, with which a file could control the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)


def print_text(text: str) -> None:
    """Print text on standard output."""
    pause()
    sys.stdout.write(_clean(text) + "\n")
    sys.stdout.flush()


def say_json(command: str, data: Mapping[str, Any]) -> None:
    """Print the result of a command as JSON on standard output."""
    pause()
    from jounce.reporting.json.results import result_json

    sys.stdout.write(result_json(command, data) + "\n")
    sys.stdout.flush()


def print_error(error: object, *, json: bool = False) -> None:
    """Print an error on standard error in one line, as text or JSON."""
    _write_message("error", "bold red", error, json)


def detail(phrase: str, *, json: bool = False) -> None:
    """Print a detail of an error on standard error in one line; with JSON, nothing is printed."""
    if not json:
        _write_message("note", "bold", phrase, json)


def print_warning(warning: object, *, json: bool = False) -> None:
    """Print a warning on standard error in one line, as text or JSON."""
    _write_message("warning", "bold yellow", warning, json)


def recorded_cautions(caught: Sequence[warnings.WarningMessage], *, json: bool = False) -> None:
    """Print recorded warnings, each once."""
    for message in {str(warning.message): warning.message for warning in caught}.values():
        print_warning(message, json=json)


@contextmanager
def cautions(*, json: bool = False) -> Iterator[None]:
    """Print warnings like the errors of the command, each once and without its place in the code."""
    messages: set[str] = set()

    def show(message: Any, *_: Any, **__: Any) -> None:
        if str(message) not in messages:
            messages.add(str(message))
            print_warning(message, json=json)

    with warnings.catch_warnings():
        for category in OURS:
            warnings.simplefilter("always", category)
        warnings.showwarning = show
        yield


def _write_message(kind: str, style: str, message: object, json: bool) -> None:
    pause()
    if json:
        from jounce.reporting.json.results import error_as_json

        sys.stderr.write(error_as_json(kind, message) + "\n")
        return
    text = _clean(" ".join(str(message).split()))
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.text import Text

        Console(stderr=True, soft_wrap=True).print(Text.assemble((f"{kind}: ", style), text))
    else:
        sys.stderr.write(f"{kind}: {text}\n")


def unexpected(error: Exception) -> str:
    """Return an unexpected error as text, with the innermost line in code of the user or of this package."""
    import traceback

    message = shortened(str(error).strip().partition("\n")[0])
    text = f"unexpected {type(error).__name__}: {message}".rstrip(": ")
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "site-packages" not in f.filename]
    return f"{text} ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else text
