"""What a command shows: tables, a progress bar, messages; in colour on a terminal, plain text elsewhere."""

from __future__ import annotations

import math
import os
import sys
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jounce.errors import RobotWarning, SampleWarning, UnitWarning
from jounce.interrupts import undoing
from jounce.reporting.peaks import Peak

if TYPE_CHECKING:
    from jounce.dynamics.limits import LimitReport

__all__ = [
    "Bar",
    "caution",
    "cautions",
    "complain",
    "say",
    "say_json",
    "show_columns",
    "show_limits",
    "show_peaks",
    "show_rows",
    "unexpected",
]

OURS = (RobotWarning, SampleWarning, UnitWarning)  # warnings of this package, which nobody may turn off by mistake
WIDTH = 80  # of tables that do not go to a terminal
NARROWEST, WIDEST = 40, 9999
SHOW_CURSOR = b"\r\x1b[2K\x1b[?25h"  # on a cleared line; a progress bar hides it
PATIENCE = 1.0  # s, before a progress bar is shown
ROUNDING = 1e-15  # of the other components; what is smaller is shown as 0
HEADINGS = ("output", "derivative", "unit", "minimum", "at t/s", "maximum", "at t/s")
LIMIT_HEADINGS = ("joint", "quantity", "unit", "worst", "limit", "ratio", "at t/s")


def show_peaks(found: list[Peak]) -> None:
    """Print a table of peaks."""
    if not found:
        say("\nNo outputs are defined, so there is nothing to tabulate.")
        return
    latest = max((abs(at) for p in found for at in (p.minimum_at, p.maximum_at) if math.isfinite(at)), default=1.0)
    decimals = 3 - math.floor(math.log10(latest or 1.0))  # of times: a table is read, not computed with
    table = [_cells(peak, decimals) for peak in found]
    marks = [[k for k, largest in zip((3, 5), peak.largest, strict=True) if largest] for peak in found]
    _show_table(HEADINGS, table, marks, "largest magnitude", (3, 5))


def show_limits(report: LimitReport) -> None:
    """Print a table of the worst instant of each joint and quantity that has a limit."""
    table, marks = [], []
    for row in report.limited:
        numbers = (_shown(x) for x in (row.value, row.limit or 0.0))
        table.append([row.joint, row.quantity, row.unit, *numbers, f"{row.ratio or 0.0:.4f}", f"{row.time:.5g}"])
        marks.append([5] if row.broken else [])
    _show_table(LIMIT_HEADINGS, table, marks, "broken" if any(marks) else "", (5,), "bold red")


def _shown(number: float) -> str:
    return "-" if math.isnan(number) else f"{number:.6g}"


def _cells(peak: Peak, decimals: int) -> list[str]:
    low, high = (0.0 if abs(x) < ROUNDING * peak.size else x for x in (peak.minimum, peak.maximum))
    times = peak.minimum_at, peak.maximum_at
    early, late = (x if float(f"{x:.3g}") == x else round(x, decimals) for x in times)
    extremes = (_shown(x) for x in (low, early, high, late))
    return [peak.output, peak.derivative, peak.unit, *extremes]


def _show_table(
    headings: Sequence[str],
    table: list[list[str]],
    marks: list[list[int]],
    meaning: str,
    markable: Sequence[int],
    style: str = "bold",
) -> None:
    """Print rows grouped by their first cell; the next two are text, the rest numbers, of which some are marked."""
    if sys.stdout.isatty() and _print_table(headings, table, marks, meaning, style):
        return
    starred = [
        [cell + ("*" if k in marked else " ") if k in markable else cell for k, cell in enumerate(cells)]
        for cells, marked in zip(table, marks, strict=True)
    ]
    say("\n" + "\n".join([*_plain_table(headings, starred), *(["", f"* {meaning}"] if meaning else [])]))


def _plain_table(headings: Sequence[str], table: list[list[str]]) -> list[str]:
    """Return the lines of a table in plain text; where names are too long for it, they stand on lines of their own."""
    columns = list(zip(headings, *table, strict=True))
    widths = [max(map(len, column)) for column in columns]
    first = 0 if sum(widths) + 2 * (len(widths) - 1) <= WIDTH else 1

    def line(cells: Sequence[str]) -> str:
        parts = [c.ljust(w) if k < 3 else c.rjust(w) for k, (c, w) in enumerate(zip(cells, widths, strict=True))]
        return "  ".join(parts[first:]).rstrip()

    lines = [line(headings), line(["-" * w for w in widths])]
    before = ""
    for cells in table:
        if cells[0] != before:
            lines += [""] * bool(before) + [cells[0]] * first
        before = cells[0]
        lines.append(line(cells))
    return lines


def _print_table(
    headings: Sequence[str], found: list[list[str]], marks: list[list[int]], meaning: str, style: str
) -> bool:
    """Print a table in colour, unless the terminal cannot show marks or is so narrow that rich would cut numbers."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k < 3 else "right", no_wrap=k > 0, style="cyan" if k == 0 else "")
    before = ""
    for row, marked in zip(found, marks, strict=True):
        cells = [Text(cell) for cell in row]
        for column in marked:
            cells[column].stylize(style)
        cells[0] = Text("" if row[0] == before else _clean(row[0]))
        if before not in ("", row[0]):
            table.add_section()
        before = row[0]
        table.add_row(*cells)
    notes = [f"{style}: {meaning}"] if meaning else []
    console = Console()
    if console.is_dumb_terminal or Console(width=WIDEST).measure(table).minimum > console.width:
        return False
    console.print(table, *notes, sep="\n")
    return True


def show_columns(pairs: Sequence[tuple[str, str]]) -> None:
    """Print names and what they mean, in two columns."""
    width = max(len(name) for name, _ in pairs)
    coloured = sys.stdout.isatty()
    if coloured:
        from rich.console import Console
        from rich.text import Text

        for name, meaning in pairs:
            Console(soft_wrap=True).print(Text.assemble((name.ljust(width), "cyan"), f"  {meaning}"))
        return
    say("\n".join(f"{name:{width}}  {meaning}" for name, meaning in pairs))


def show_rows(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> None:
    """Print a table below a title; columns that are empty throughout are left out, the last one may be long."""
    kept = [k for k in range(len(headings)) if any(row[k] for row in rows)] or [0]
    if sys.stdout.isatty():
        from rich import box
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold", title=title, title_justify="left")
        table.title_style = "bold"
        for k in kept:
            justify, style = ("right" if k in numbers else "left"), ("cyan" if k == 0 else "")
            table.add_column(headings[k], justify=justify, style=style, overflow="fold")
        for row in rows:
            table.add_row(*(Text(_clean(row[k])) for k in kept))
        console = Console()
        console.width = max(console.width, NARROWEST)  # narrower, rich leaves columns out
        console.print("", table)
        return
    widths = {k: max(len(row[k]) for row in [headings, *rows]) for k in kept}
    lines = ["", title]
    for row in [headings, ["-" * len(heading) for heading in headings], *rows]:
        cells = [row[k].rjust(widths[k]) if k in numbers else row[k].ljust(widths[k]) for k in kept]
        lines.append("  " + "  ".join(cells).rstrip())
    say("\n".join(lines))


class Bar:
    """A progress bar on the terminal's standard error, shown only when work goes on for more than a moment."""

    def __init__(self, task: str):
        self._task = task
        self._started: float | None = None
        self._bar: Any = None
        self._shown = ExitStack()

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        self._shown.close()

    def __call__(self, done: int, total: int) -> None:
        """Tell how much is done; compiling, before the first call, does not count as work."""
        if self._bar is None:
            now = time.monotonic()
            self._started = now if self._started is None else self._started
            if done >= total or now - self._started < PATIENCE or not sys.stderr.isatty():
                return
            from rich.console import Console
            from rich.progress import Progress

            self._bar = Progress(console=Console(stderr=True), transient=True)
            self._shown.enter_context(undoing(lambda: os.write(2, SHOW_CURSOR)))
            self._shown.enter_context(self._bar)
            self._id = self._bar.add_task(self._task, total=total)
        self._bar.update(self._id, completed=done, total=total)


def _clean(text: str) -> str:
    """Replace control characters, with which a file could steer the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)


def say(text: str) -> None:
    """Print text on standard output."""
    sys.stdout.write(_clean(text) + "\n")
    sys.stdout.flush()


def say_json(command: str, data: Mapping[str, Any]) -> None:
    """Print the result of a command as JSON on standard output."""
    from jounce.reporting.records import record

    sys.stdout.write(record(command, data) + "\n")
    sys.stdout.flush()


def complain(error: object, *, json: bool = False) -> None:
    """Print an error on standard error, in one line: of words, or of JSON."""
    _tell("error", "bold red", error, json)


def caution(warning: object, *, json: bool = False) -> None:
    """Print a warning on standard error, in one line: of words, or of JSON."""
    _tell("warning", "bold yellow", warning, json)


@contextmanager
def cautions(*, json: bool = False) -> Iterator[None]:
    """Print warnings as the command prints its errors, each once and without its place in the code."""
    told: set[str] = set()

    def show(message: Any, *_: Any, **__: Any) -> None:
        if str(message) not in told:
            told.add(str(message))
            caution(message, json=json)

    with warnings.catch_warnings():
        for category in OURS:
            warnings.simplefilter("always", category)
        warnings.showwarning = show
        yield


def _tell(kind: str, style: str, message: object, json: bool) -> None:
    if json:
        from jounce.reporting.records import complaint

        sys.stderr.write(complaint(kind, message) + "\n")
        return
    text = _clean(" ".join(str(message).split()))
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.text import Text

        Console(stderr=True, soft_wrap=True).print(Text.assemble((f"{kind}: ", style), text))
    else:
        sys.stderr.write(f"{kind}: {text}\n")


def unexpected(error: Exception) -> str:
    """Word an error that no check foresaw, with the innermost line that is the user's or this package's own."""
    import traceback

    words = f"unexpected {type(error).__name__}: {str(error).strip().partition(chr(10))[0]}".rstrip(": ")
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "site-packages" not in f.filename]
    return f"{words} ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else words
