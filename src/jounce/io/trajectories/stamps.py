"""Stamps of recordings: counted from an epoch, repeated, or out of order."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Sequence
from datetime import datetime
from decimal import Decimal, InvalidOperation

import numpy as np
from jaxtyping import Int

from jounce.errors import TrajectoryError
from jounce.io.trajectories.recordings import Recording
from jounce.trajectory.sample_errors import BRIDGED, longest_gap

NANO = 10**9  # ns in a second
EPOCH = 1e8
"""Largest duration of a recording, s; larger stamps are counted from an epoch, possibly in ms, us or ns."""
SCALES = ((1e17, 9, "ns"), (1e14, 6, "us"), (1e11, 3, "ms"), (EPOCH, 0, "s"))
"""Least stamp of each unit of a second that counts from an epoch."""
MOST_REPEATED = 0.5  # largest share of repeated stamps
BACK = 40  # number of steps by which a row may be late
ROUGHER = 1.5  # largest ratio of the path lengths in the order of stamps and in that of the file
_DATE = re.compile(
    r"(?P<date>[0-9]{4}-[0-9]{2}-[0-9]{2})[T ](?P<time>[0-9]{2}:[0-9]{2}:[0-9]{2})(?P<part>[.,][0-9]+)?"
    r"\s*(?P<zone>Z|[-+][0-9]{2}:?[0-9]{2})?"
)
SAME = 1.5  # times the largest neighboring step, within which positions at one stamp must agree


def relative(
    texts: Sequence[str],
    fail: Callable[[str, int], TrajectoryError],
    per_second: int = 1,
    unit: str | None = None,
) -> tuple[np.ndarray, str]:
    """Return stamps, relative to the first one if they are counted from an epoch, and a description of that.

    They are subtracted before rounding: in double precision, a stamp of this century has a resolution of 0.2 us.

    Parameters
    ----------
    texts : sequence of str
        Stamps as in the file.
    fail : callable
        Returns the error for a message and a row.
    per_second : int, default 1
        Units of the stamps in a second; see `epoch`.
    unit : str, optional
        Unit of the stamps; see `epoch`.

    Raises
    ------
    TrajectoryError
        If a stamp is no finite number.
    """
    texts = [_seconds_of_date(text) or text for text in texts]
    values = np.empty(len(texts))
    for k, text in enumerate(texts):
        try:
            values[k] = float(text) if "_" not in text else np.nan
        except ValueError:
            values[k] = np.nan
    invalid = np.flatnonzero(~np.isfinite(values))
    if len(invalid):
        raise fail("must be a finite number", int(invalid[0]))
    try:
        exact = [Decimal(text.strip()) for text in texts[:1]]
        epoch_unit = epoch(exact[0], per_second, unit) if exact else None
        if epoch_unit is None:
            return values, ""
        exact = [Decimal(text.strip()) for text in texts]
    except InvalidOperation:  # a form that only float can read
        return values, ""
    digits, phrase = epoch_unit
    return np.array([float((stamp - exact[0]).scaleb(-digits)) for stamp in exact]), phrase


def _seconds_of_date(text: str) -> str | None:
    """Return the seconds since 1970 of a date with a time, as ISO 8601 has it, without loss of digits; None if none.

    Without a zone it is taken for Greenwich time: only differences count.
    """
    match = _DATE.fullmatch(text.strip())
    if match is None:
        return None
    try:
        date = datetime.fromisoformat(f"{match['date']}T{match['time']}{match['zone'] or '+00:00'}")
    except ValueError:  # no such day
        return None
    return f"{int(date.timestamp())}{(match['part'] or '').replace(',', '.')}"


def epoch(first: Decimal, per_second: int = 1, unit: str | None = None) -> tuple[int, str] | None:
    """Return the digits of the unit of stamps that count from an epoch, and a description; None for other stamps.

    Parameters
    ----------
    first : Decimal
        First stamp.
    per_second : int, default 1
        Units of the stamps in a second, if known to be ns: small stamps are then those of a simulated clock.
    unit : str, optional
        Unit of the stamps, if the file states one.

    Examples
    --------
    >>> from decimal import Decimal
    >>> epoch(Decimal("1732686000123000000"))
    (9, 'stamps are counted from an epoch, in ns: t = 0 is 1732686000.123000000 s')
    >>> epoch(Decimal("12.5")) is None
    True
    """
    scales = SCALES[:1] if per_second == NANO else SCALES
    if unit is not None:
        scales = [(EPOCH * 10**digits, digits, name) for _, digits, name in SCALES if name == unit]
    scale = next(((digits, unit) for lower, digits, unit in scales if abs(first) >= lower), None)
    if scale is None:
        return None
    digits, unit = scale
    return digits, f"stamps are counted from an epoch, in {unit}: t = 0 is {first.scaleb(-digits):f} s"


def in_sequence(recording: Recording) -> Recording:
    """Return a recording with increasing stamps: rows sorted and repeated ones merged, as its notes state.

    Raises
    ------
    TrajectoryError
        If most stamps are repeated, the recording starts again, or positions at one stamp contradict each other.
    """
    steps = np.diff(recording.times)
    if (steps > 0).all():
        return recording
    repeated = np.flatnonzero(steps == 0)
    if len(repeated) > MOST_REPEATED * len(recording.times):
        row = int(repeated[0]) + 1
        message = (
            f"{len(repeated)} of {len(recording.times)} stamps repeat the one before, as where they were written with "
            "too few digits; write them in full"
        )
        raise recording.error(message, row, name="time")
    if (steps < 0).any():
        recording = _sorted(recording, steps)
    return _merged(recording)


def gaps(recording: Recording) -> list[str]:
    """Return descriptions of the longest gap between the samples of each joint; empty if there is no gap."""
    notes: dict[str, list[str]] = {}
    for joint, name in enumerate(recording.names):
        rows = np.flatnonzero(~np.isnan(recording.values[:, 0, joint]))
        lines = np.asarray(recording.lines)[rows].tolist() if len(recording.lines) else ()
        if phrase := longest_gap(recording.times[rows], lines):
            notes.setdefault(phrase, []).append(name)
    return [f"{phrase}, of {', '.join(names)}: {BRIDGED}" for phrase, names in notes.items()]


def _sorted(recording: Recording, steps: np.ndarray) -> Recording:
    rows = np.flatnonzero(steps < 0) + 1
    row, typical = int(rows[0]), float(np.median(np.abs(steps[steps != 0])))
    latest = np.maximum.accumulate(recording.times)
    back = float((latest - recording.times).max())
    order = np.argsort(recording.times, kind="stable")
    message = (
        f"comes before that of line {recording.lines[row - 1]}" if len(recording.lines) else "comes before another"
    )
    value = {"name": "time", "value": float(recording.times[row])}
    if back > BACK * typical or _path_length(recording.values[order, 0]) > ROUGHER * _path_length(
        recording.values[:, 0]
    ):
        advice = "times start again, or stamps and rows do not belong together; give one recording"
        raise recording.error(f"the stamp {message}: {advice}", row, **value)
    note = f"{len(rows)} rows were out of order, and are sorted by their stamps"
    return _taken(recording, order, f"{note}{_at(recording, row)}")


def _path_length(positions: np.ndarray) -> float:
    steps = np.abs(np.diff(positions, axis=0))
    return float(np.nansum(steps))


def _merged(recording: Recording) -> Recording:
    """Return a recording with one row for each stamp: the mean of rows that differ by less than a step."""
    times, positions = recording.times, recording.values[:, 0]
    repeats = np.flatnonzero(np.diff(times) == 0) + 1
    if not len(repeats):
        return recording
    if recording.points:
        are_equal = np.array_equal(recording.values[repeats], recording.values[repeats - 1], equal_nan=True)
        if not are_equal:
            differing = [k for k in repeats if not np.array_equal(*recording.values[k - 1 : k + 1], equal_nan=True)]
            message = "must come after that of the point before, which is another one"
            raise recording.error(message, differing[0], name="time", value=float(times[differing[0]]))
    differences = np.abs(positions[repeats] - positions[repeats - 1])
    is_different = np.nan_to_num(differences) > 0
    if is_different.any():
        steps = np.abs(np.diff(positions, axis=0))
        neighbors = np.concatenate(
            [repeats - 2, repeats - 1, repeats]
        )  # steps to and from repeated rows are not typical
        steps[neighbors[(neighbors >= 0) & (neighbors < len(steps))]] = 0.0
        allowed = SAME * np.nan_to_num(steps).max(axis=0)
        conflicts = np.argwhere(np.nan_to_num(differences) > allowed)
        if len(conflicts):
            row, joint = int(repeats[conflicts[0][0]]), int(conflicts[0][1])
            fact = f"{positions[row - 1, joint]:.9g} and {positions[row, joint]:.9g}"
            message = f"times must increase; this one repeats the one before, and this joint is at {fact} then"
            raise recording.error(message, row, name=recording.names[joint], value=float(times[row]))
    group = np.cumsum(np.append(True, np.diff(times) > 0)) - 1
    first = np.flatnonzero(np.append(True, np.diff(times) > 0))
    values = np.zeros((len(first), *recording.values.shape[1:]))
    counts = np.zeros_like(values)
    present = ~np.isnan(recording.values)
    np.add.at(values, group, np.where(present, recording.values, 0.0))
    np.add.at(counts, group, present)
    with np.errstate(invalid="ignore"):
        values = np.where(counts > 0, values / counts, np.nan)
    rows = int(is_different.any(axis=1).sum())
    outcome = "left out" if not rows else f"merged, {rows} of them by the mean of different values"
    note = f"{len(repeats)} repeated stamps are {outcome}{_at(recording, int(repeats[0]))}"
    merged = _taken(recording, first, note)
    return dataclasses.replace(merged, values=values)


def _at(recording: Recording, row: int) -> str:
    return f" (the first in line {recording.lines[row]})" if len(recording.lines) else ""


def _taken(recording: Recording, rows: Int[np.ndarray, " row"], note: str) -> Recording:
    lines = np.asarray(recording.lines)[rows] if len(recording.lines) else ()
    return dataclasses.replace(
        recording,
        times=recording.times[rows],
        values=recording.values[rows],
        lines=lines,
        notes=(*recording.notes, note),
    )
