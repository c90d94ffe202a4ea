"""One case: a text is read, and what comes of it is judged."""

from __future__ import annotations

import contextlib
import io
import os
import pathlib
import random
import re
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

from jounce.errors import LONGEST, JounceError
from tests.fuzz.mutations import mutated, swollen
from tests.fuzz.readers import READERS
from tests.fuzz.results import changed_table

__all__ = ["ALLOWED", "Outcome", "case", "clocked", "is_clocked", "judged", "shrunk"]

ALLOWED = ("result", "error")
TIME_LIMIT = 10.0  # s of the processor, for one case; they take milliseconds
WAIT = 6  # times as long on the clock on the wall, where other processes take the processor
LEAST = 0.5  # s; what takes less is no trouble
MOST = 10.0  # of the time for four times the size; 4 is in proportion, 16 the square
SIZE = 10_000  # characters of a text that is timed; then it has four times as many
EVERY = 100  # cases, of which one is timed
WHOLE = re.compile(
    # what is said of a file as a whole, or by MuJoCo, which names no line then
    r"the file is empty|the file of samples is empty|has \d+ lines, at most|has \d+(\.\d+)? MB|MuJoCo cannot use|"
    r"is in no encoding|needs? at least \d+ samples|at least two samples are needed|no spline goes through|"
    r"the JSON cannot be read: a number has too many digits|The (YAML|TOML) cannot be read|is not a table of results"
)


class TooLong(BaseException):
    """A case takes longer than any should."""


@dataclass(frozen=True)
class Outcome:
    """What came of a case: a kind, and the words that go with it; ``place`` tells failures apart."""

    kind: str
    words: str = ""
    place: str = ""


def case(reader: str, seed: int, index: int) -> bytes:
    """Return the text of a case, the same ever after."""
    chance = random.Random(f"{seed}/{reader}/{index}")
    if is_clocked(reader, index):
        return swollen(chance, READERS[reader].texts)(4 * SIZE)
    return READERS[reader].change(chance, READERS[reader].texts)


def is_clocked(reader: str, index: int) -> bool:
    """Tell whether a case is one that is timed: a piece of a good text many times over."""
    return index % EVERY == EVERY - 1 and READERS[reader].change in (mutated, changed_table)


def clocked(reader: str, seed: int, index: int, folder: pathlib.Path) -> Outcome:
    """Read a long text, and where it takes a while another one of a quarter of the size, and compare the times."""
    content, started = case(reader, seed, index), time.process_time()
    found = judged(reader, content, folder)
    took = time.process_time() - started
    if found.kind not in ALLOWED or took < LEAST:
        return found
    small = swollen(random.Random(f"{seed}/{reader}/{index}"), READERS[reader].texts)(SIZE)
    started = time.process_time()
    judged(reader, small, folder)
    share = took / (time.process_time() - started)
    words = f"{took:.2f} s, {share:.1f} times as long as for a quarter of the text"
    return found if share < MOST else Outcome("out of proportion", words, f"out of proportion: {reader}")


def judged(reader: str, content: bytes, folder: pathlib.Path, limit: float = TIME_LIMIT) -> Outcome:
    """Read a text and tell what came of it."""
    subject = READERS[reader]
    given: pathlib.Path | str
    if subject.ending is None:
        given = content.decode("utf-8", "replace")
    else:
        given = folder / f"case{subject.ending}"
        given.write_bytes(content)
        for name, text in subject.beside.items():
            if not (folder / name).exists():
                (folder / name).write_text(text)
    before = {path.name for path in folder.iterdir()}
    printed = io.StringIO()
    said: list[bytes] = []
    try:
        with _heard(said), _limited(limit), warnings.catch_warnings(), contextlib.redirect_stdout(printed):
            warnings.simplefilter("error", RuntimeWarning)  # a user would be shown lines of our source
            warnings.simplefilter("ignore", UserWarning)
            subject.read(given)
    except JounceError as error:
        if not said:
            return _judged_error(error, subject.ending is not None, subject.lines)
    except TooLong as error:
        return _failure("hang", error)
    except Exception as error:  # noqa: BLE001 - the very question
        return _failure(type(error).__name__, error)
    finally:
        left = {path.name for path in folder.iterdir()} - before
        for name in left:
            (folder / name).unlink()
    if left or said or printed.getvalue():
        words = f"{sorted(left)} {printed.getvalue()[:200]} {b''.join(said)[:500]!r}"
        return Outcome("leaves or prints something", words, f"leaves or prints something: {reader}")
    return Outcome("result")


@contextlib.contextmanager
def _heard(said: list[bytes]) -> Iterator[None]:
    """Put what is written to standard error meanwhile, by Python or by a library below, into a list."""
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with tempfile.TemporaryFile() as file:
            os.dup2(file.fileno(), 2)
            try:
                yield
            finally:
                sys.stderr.flush()
                os.dup2(kept, 2)
                if file.seek(0, os.SEEK_END):
                    file.seek(0)
                    said.append(file.read(2000))
    finally:
        os.close(kept)


def _judged_error(error: JounceError, from_file: bool, with_line: bool) -> Outcome:
    """Tell whether an error of the family says what a user needs."""
    try:
        words = str(error)
    except Exception as inner:  # noqa: BLE001 - the very question
        return _failure("message fails", inner)
    kind = "error"
    if not words.isprintable() or len(words) > LONGEST + 1000:  # the message, and its place
        kind = "message is no line of text"
    elif from_file and error.path is None:
        kind = "names no file"
    elif from_file and with_line and error.line is None and not WHOLE.search(words):
        kind = "names no line"
    return Outcome(kind, words, kind if kind == "error" else f"{kind}: {re.sub(r'[0-9]+', '0', error.message)[:60]}")


def _failure(kind: str, error: BaseException) -> Outcome:
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "jounce" in frame.filename]
    place = f"{frames[-1].filename.rpartition('jounce/')[2]}:{frames[-1].lineno}" if frames else ""
    return Outcome(kind, "".join(traceback.format_exception(error)), f"{kind} at {place}")


@contextlib.contextmanager
def _limited(seconds: float) -> Iterator[None]:
    def stop(_number: int, _frame: object) -> None:
        raise TooLong

    clocks = ((signal.SIGVTALRM, signal.ITIMER_VIRTUAL, seconds), (signal.SIGALRM, signal.ITIMER_REAL, WAIT * seconds))
    before = [signal.signal(number, stop) for number, _, _ in clocks]
    for _, clock, limit in clocks:
        signal.setitimer(clock, limit)
    try:
        yield
    finally:
        for (number, clock, _), handler in zip(clocks, before, strict=True):
            signal.setitimer(clock, 0)
            signal.signal(number, handler)


def shrunk(reader: str, content: bytes, folder: pathlib.Path, seconds: float = 5.0) -> bytes:
    """Return a shorter text that fails in the same place: lines, then characters are left out while it does."""
    place, end = judged(reader, content, folder).place, time.monotonic() + seconds
    for joint in (b"\n", b""):
        parts = content.split(joint) if joint else [content[k : k + 1] for k in range(len(content))]
        size = max(1, len(parts) // 2)
        while size:
            start = 0
            while start < len(parts) and time.monotonic() < end:
                fewer = parts[:start] + parts[start + size :]
                if judged(reader, joint.join(fewer), folder).place == place:
                    parts = fewer
                else:
                    start += size
            size //= 2
        content = joint.join(parts)
    return content
