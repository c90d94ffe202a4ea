"""One case: a text is read, and what comes of it is judged."""

from __future__ import annotations

import contextlib
import io
import pathlib
import random
import re
import signal
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

from jounce.errors import JounceError
from tests.fuzz.mutations import mutated
from tests.fuzz.readers import READERS

__all__ = ["ALLOWED", "Outcome", "case", "judged", "shrunk"]

ALLOWED = ("result", "error")
TIME_LIMIT = 10.0  # s, for one case; they take milliseconds
WHOLE = re.compile(
    # what is said of a file as a whole, or by MuJoCo, which names no line then
    r"the file is empty|the file of samples is empty|has \d+ lines, at most|has \d+(\.\d+)? MB|MuJoCo cannot use|"
    r"is in no encoding|needs? at least \d+ samples|at least two samples are needed|no spline goes through|"
    r"the JSON cannot be read: a number has too many digits|The (YAML|TOML) cannot be read"
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
    return mutated(random.Random(f"{seed}/{reader}/{index}"), READERS[reader].texts)


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
    try:
        with _limited(limit), warnings.catch_warnings(), contextlib.redirect_stdout(printed):
            warnings.simplefilter("error", RuntimeWarning)  # a user would be shown lines of our source
            warnings.simplefilter("ignore", UserWarning)
            subject.read(given)
    except JounceError as error:
        return _judged_error(error, subject.ending is not None)
    except TooLong as error:
        return _failure("hang", error)
    except Exception as error:  # noqa: BLE001 - the very question
        return _failure(type(error).__name__, error)
    finally:
        left = {path.name for path in folder.iterdir()} - before
        for name in left:
            (folder / name).unlink()
    if left or printed.getvalue():
        return Outcome("leaves or prints something", f"{sorted(left)} {printed.getvalue()[:200]}")
    return Outcome("result")


def _judged_error(error: JounceError, from_file: bool) -> Outcome:
    """Tell whether an error of the family says what a user needs."""
    try:
        words = str(error)
    except Exception as inner:  # noqa: BLE001 - the very question
        return _failure("message fails", inner)
    kind = "error"
    if not words.isprintable() or len(words) > 2000:
        kind = "message is no line of text"
    elif from_file and error.path is None:
        kind = "names no file"
    elif from_file and error.line is None and not WHOLE.search(words):
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

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def shrunk(reader: str, content: bytes, folder: pathlib.Path, seconds: float = 5.0) -> bytes:
    """Return a shorter text that fails in the same place: lines, then characters are left out while it does."""
    wanted, end = judged(reader, content, folder).place, time.monotonic() + seconds
    for joint in (b"\n", b""):
        parts = content.split(joint) if joint else [content[k : k + 1] for k in range(len(content))]
        size = max(1, len(parts) // 2)
        while size:
            start = 0
            while start < len(parts) and time.monotonic() < end:
                fewer = parts[:start] + parts[start + size :]
                if judged(reader, joint.join(fewer), folder).place == wanted:
                    parts = fewer
                else:
                    start += size
            size //= 2
        content = joint.join(parts)
    return content
