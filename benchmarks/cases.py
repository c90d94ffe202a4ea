"""What a benchmark consists of: cases, each with contestants that do the same work."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"


class Reported(NamedTuple):
    """A measurement taken elsewhere, as in another process: seconds or bytes, and what came out."""

    value: float
    outcome: Any = None


class CannotRunError(Exception):
    """Raised by a contestant that this machine has something missing for; the message is in the table."""


@dataclass(frozen=True)
class Contestant:
    """One way to do the work of a case.

    Attributes
    ----------
    name : str
        Who does it, and how.
    build : callable
        Makes everything ready, and returns the function that is timed.
    error : callable, optional
        Returns the error of what that function returned, against the reference of the case.
    needs : str, optional
        Package without which it is left out, with a message.
    extra : str
        The extra of the library that brings this package.
    count : int, optional
        Units of work that it does, where they are not those of the case.
    aim : float, optional
        Most that the library should take, as a multiple of what this one takes.
    """

    name: str
    build: Callable[[], Callable[[], Any]]
    error: Callable[[Any], float] | None = None
    needs: str = ""
    extra: str = "bench"
    count: int | None = None
    aim: float | None = None


@dataclass(frozen=True)
class Case:
    """Work that each contestant does, the library first.

    Attributes
    ----------
    name : str
        What is done.
    contestants : sequence of Contestant
        They take turns.
    count, unit
        How many units of work a run is, and what they are.
    reference : str
        What errors are errors against.
    clock : str
        Processor time, which other work on the machine does not add to; wall time, where several cores or processes
        are at work; or the peak of memory.
    rounds : int
        How often each contestant runs after a first time, unless the command says less; 0 measures the first time.
    at : mapping
        Where a case stands in a figure.
    """

    name: str
    contestants: Sequence[Contestant]
    count: int = 1
    unit: str = "run"
    reference: str = ""
    clock: Literal["processor time", "wall time", "memory"] = "processor time"
    rounds: int = 15
    at: Mapping[str, float] = field(default_factory=dict)


Cases = Iterator[Case]


def ready(run: Callable[[], Any]) -> Callable[[], Callable[[], Any]]:
    """Return a `build` for a function that needs none."""
    return lambda: run
