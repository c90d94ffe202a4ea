"""The exceptions and warnings of the package, and helpers that word their messages.

Every error carries what a reader needs to correct the input: the file and line (if it came from a file), the dotted
name of the entry, the problem with a remedy, and the value received. ``str(error)`` joins these to one sentence.
"""

from __future__ import annotations

import copy
import difflib
import numbers
import operator
import sys
import warnings
from collections.abc import Collection, Hashable, Iterable
from typing import Any


class _Unset:
    """Marker of a value that was not given, so that ``None`` can be reported as a value."""

    def __repr__(self) -> str:
        return "<not given>"

    def __reduce__(self) -> str:
        return "UNSET"


UNSET = _Unset()
LONGEST = 4000
"""Characters of a message; the middle of a message that is longer by names and texts of a file is left out."""
MOST_LIKENED = 2000
"""Largest number of names that are searched for one similar to the given name."""


def shortened(text: str, limit: int = LONGEST) -> str:
    """Return a text with its middle left out if it is longer than a limit.

    Examples
    --------
    >>> shortened("abcdefghijklmnop", limit=8)
    'abcd ... (8 characters) ... mnop'
    """
    half, left_out = limit // 2, len(text) - limit
    return text if left_out <= 0 else f"{text[:half]} ... ({left_out} characters) ... {text[-half:]}"


def show_value(value: object, limit: int = 80) -> str:
    """Return a received value as one line of at most ``limit`` characters.

    Examples
    --------
    >>> show_value([0.0, -9.81])
    '[0.0, -9.81]'
    >>> show_value(None)
    'nothing'
    >>> show_value("x" * 200, limit=12)
    "'xxxxxxx..."
    """
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (dict, list, tuple)) and not value:
        return "an empty mapping" if isinstance(value, dict) else "an empty list"
    text = _represent(value, limit)
    text = text.encode("ascii", "backslashreplace").decode("ascii")
    return text if len(text) <= limit else text[: limit - 3] + "..."


def _represent(value: object, limit: int, depth: int = 3) -> str:
    """Return the `repr` of a value, without visiting more than will be shown."""
    if isinstance(value, str):
        return repr(value[: limit + 1])
    if isinstance(value, dict):
        if depth == 0:
            return "{...}"
        items = list(value.items())[:10]
        inside = ", ".join(
            f"{_printable(str(key)[:limit])}: {_represent(item, limit, depth - 1)}" for key, item in items
        )
        return "{" + inside + (", ...}" if len(value) > 10 else "}")
    if isinstance(value, (list, tuple)):
        if depth == 0:
            return "[...]"
        inside = ", ".join(_represent(item, limit, depth - 1) for item in value[:10])
        return "[" + inside + (", ...]" if len(value) > 10 else "]")
    try:
        text = repr(value)
    except ValueError:  # an integer with too many digits to be written
        return "a number with too many digits"
    return " ".join(text.split())


def _printable(text: str) -> str:
    """Return a text with unprintable characters escaped, since it may come from an untrusted file."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def no_such(kind: str, name: object, known: Iterable[str], what: str = "name") -> str:
    """Return a message that nothing of a kind has a name, or another word such as a type, with the valid ones.

    Examples
    --------
    >>> print(no_such("body", "rokcer", ["crank", "rocker"]))
    no body has this name; did you mean 'rocker'? valid: crank, rocker
    """
    return f"no {kind} has this {what}; {did_you_mean(name, known)}"


def unknown(what: str, given: object, valid: Iterable[str]) -> str:
    """Return a message that a word is not valid, with the valid ones.

    Examples
    --------
    >>> print(unknown("frame", "bodi", ["global", "body"]))
    unknown frame; did you mean 'body'? valid: body, global
    """
    return f"unknown {what}; {did_you_mean(given, valid)}"


def check_name(
    kind: str, given: object, known: Collection[str], error: type[JounceError], what: str = "name", **location: Any
) -> None:
    """Raise an error unless something of a kind has the given name; `location` is the place of the name."""
    if not isinstance(given, Hashable) or given not in known:
        raise error(no_such(kind, given, known, what), value=given, **location)


def check_choice(field: str, value: object, valid: Collection[str], error: type[JounceError], **location: Any) -> None:
    """Raise an error unless a word, such as the name of a frame, is valid; `location` is the field's name."""
    if not isinstance(value, Hashable) or value not in valid:
        raise error(unknown(field, value, valid), value=value, **{"name": field, **location})


def whole_number(name: str, value: object, least: int = 0, most: int | None = None, *, error: type[JounceError]) -> int:
    """Return a whole number within bounds, or raise an error."""
    whole = operator.index(value) if isinstance(value, numbers.Integral) and not isinstance(value, bool) else None
    if whole is None or whole < least or (most is not None and whole > most):
        bounds = f", {least} or greater" if most is None else f" from {least} to {most}"
        raise error(f"must be a whole number{bounds}", name=name, value=value)
    return whole


def flag(name: str, value: object, *, error: type[JounceError]) -> bool:
    """Return True or False, or raise an error for any other value, such as "no", which is truthy."""
    if type(value).__name__ != "bool":  # also the name of NumPy's type, without its import
        raise error("must be True or False", name=name, value=value)
    return bool(value)


def did_you_mean(name: object, valid: Iterable[str], limit: int = 20) -> str:
    """Return a suggestion: the most similar valid name, and all valid names if they are few.

    Examples
    --------
    >>> did_you_mean("revolut", ["revolute", "prismatic"])
    "did you mean 'revolute'? valid: prismatic, revolute"
    >>> did_you_mean("zzz", ["revolute", "prismatic"])
    'valid: prismatic, revolute'
    """
    names = sorted(set(valid))
    words = [ascii(candidate[:80])[1:-1] for candidate in names]
    parts = []
    likened = names if len(names) <= MOST_LIKENED else []
    near = difflib.get_close_matches(str(name)[:100], likened, n=1, cutoff=0.6)
    if not near:
        near = [candidate for candidate in names if candidate.lower() == str(name).lower()]
    if near:
        parts.append(f"did you mean '{words[names.index(near[0])]}'?")
    if 0 < len(names) <= limit:
        parts.append(f"valid: {', '.join(words)}")
    elif not names:
        parts.append("none is defined")
    elif limit and not near:
        parts.append(f"there are {len(names):,}, such as {', '.join(words[:3])}")
    return " ".join(parts)


class JounceError(Exception):
    """Base of every error that the package raises on purpose.

    Parameters
    ----------
    message
        The problem and a remedy, without the place and the value.
    path
        The file, as the user named it.
    line
        The line in that file, counted from 1.
    name
        The dotted name of the entry, such as ``joints.BC.length``.
    value
        The value received; left out of the message if not given.

    Examples
    --------
    >>> print(JounceError("must be greater than zero", path="a.yaml", line=12, name="joints.BC.length", value=-0.1))
    a.yaml, line 12, joints.BC.length: must be greater than zero, got -0.1
    """

    def __init__(
        self,
        message: str,
        *,
        path: object = None,
        line: int | None = None,
        name: str | None = None,
        value: Any = UNSET,
    ) -> None:
        message = shortened(message)
        super().__init__(message)
        self.message = message
        self.path = path
        self.line = line
        self.name = name
        self.value = value

    def __str__(self) -> str:
        location = [] if self.path is None else [_printable(shortened(str(self.path)))]
        if self.line is not None:
            location.append(f"line {self.line}")
        if self.name:
            location.append(_printable(shortened(self.name, 400)))
        message = "\n".join(map(_printable, self.message.split("\n")))
        if self.value is not UNSET:  # the problem, got the value; the remedy
            problem, semicolon, advice = message.partition("; ")
            message = f"{problem}, got {show_value(self.value)}{semicolon}{advice}"
        return f"{', '.join(location)}: {message}" if location else message

    def located(
        self, *, path: object = None, line: int | None = None, name: str | None = None, value: Any = UNSET
    ) -> JounceError:
        """Return the same error with missing parts of its location and value filled in."""
        error = copy.copy(self)
        error.__traceback__ = None
        error.path = self.path if self.path is not None else path
        error.line = self.line if self.line is not None else line
        error.name = self.name if self.name is not None else name
        error.value = self.value if self.value is not UNSET else value
        return error


class ExpressionError(JounceError):
    """An expression contains something that is not allowed, or cannot be evaluated.

    ``column`` counts from 1 within the expression; it is None if no single position is at fault.
    """

    def __init__(self, message: str, *, column: int | None = None, **location: Any) -> None:
        super().__init__(message, **location)
        self.column = column


class UnitError(JounceError):
    """A value has an unknown unit, or a unit of the wrong dimension."""


class UnsupportedError(JounceError):
    """A valid request is not supported, such as with values that JAX traces, or in a forked process."""


class ContractError(JounceError):
    """A user-defined class violates a contract of the library's classes; see `jounce.testing`."""


class MechanismError(JounceError):
    """A mechanism is not valid: a missing body, an axis of zero length, a bad time grid."""


class MechanismFileError(MechanismError):
    """A mechanism file cannot be read or breaks the schema."""


class MobilityError(MechanismError):
    """The drivers and joints do not leave exactly zero degrees of freedom.

    ``status`` is that of a singular position, if the start is one. ``idle`` has, by body, the axes in the body frame
    about which bodies can spin freely, if these are the only remaining degrees of freedom.
    """

    def __init__(self, message: str, *, status: Any = None, idle: Any = None, **location: Any) -> None:
        super().__init__(message, **location)
        self.status, self.idle = status, idle or {}


class RobotError(JounceError):
    """A robot is not valid, or values do not fit it: a loop, a link without mass, an unknown joint."""


class RobotFileError(RobotError):
    """A URDF, MJCF or SDF file cannot be read, or does not describe a valid robot."""


class TrajectoryError(JounceError):
    """A trajectory cannot be built or does not fit its robot: times that do not increase, too few samples."""


class SingularityError(JounceError):
    """An orientation or configuration is singular: the requested quantity does not exist or is not unique."""


class _BoundedWarning(UserWarning):
    """A warning whose text is bounded like that of an error."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*(shortened(x) if isinstance(x, str) else x for x in arguments))


def warn_caller(warning: Warning) -> None:
    """Issue a warning at the line of the user's program that called this package, at any call depth."""
    frame, level, caller = sys._getframe(1), 2, 1
    while frame is not None:
        if str(frame.f_globals.get("__name__")).partition(".")[0] == "jounce":
            caller = level + 1
        frame, level = frame.f_back, level + 1
    warnings.warn(warning, stacklevel=caller)


class RobotWarning(_BoundedWarning):
    """A robot file has physically implausible values, or forces that are left out; it is read all the same."""


class SampleWarning(_BoundedWarning):
    """Samples do not determine the requested derivatives to a useful accuracy."""


class RecordingWarning(_BoundedWarning):
    """Samples have gaps, or were changed when read: rows sorted, merged or left out, or time stamps shifted."""


class UnitWarning(_BoundedWarning):
    """A number without a unit is likely not in SI units."""


class ReplacedTypeWarning(_BoundedWarning):
    """A joint, driver or force of a user has a type that mechanism files used for a class of this package."""


class AssemblyWarning(_BoundedWarning):
    """Bodies were assembled with a part reversed in its joint, or on the wrong side of it."""


class IdleMotionWarning(_BoundedWarning):
    """Bodies can spin about an axis of their own without moving anything else, and are held by the least motion."""


class PrecisionWarning(_BoundedWarning):
    """A user's function computes in less than double precision, and so do its derivatives."""


class MachineCodeWarning(_BoundedWarning):
    """XLA computes an operation without machine code: the same results in two to fifty times the time."""


class ProgramFolderWarning(_BoundedWarning):
    """The chosen folder of compiled programs cannot be used: programs are compiled again in each process."""


class DamageWarning(_BoundedWarning):
    """Files of a result were lost or changed after they were written; their contents are computed again."""


class OutputError(JounceError):
    """A file of results cannot be written or read; ``while_writing`` tells that results were being written."""

    def __init__(self, message: str, *, while_writing: bool = False, **location: Any) -> None:
        super().__init__(message, **location)
        self.while_writing = while_writing


class SolveError(JounceError):
    """A solution did not reach its end.

    ``motion`` has the results so far (None if there are none), ``status`` the reason, by the names of
    ``Motion.status``.
    """

    def __init__(self, message: str, *, motion: Any = None, status: Any = None, **location: Any) -> None:
        super().__init__(message, **location)
        self.motion, self.status = motion, status


class AssemblyError(SolveError):
    """The bodies cannot be assembled from the starting guess.

    ``details`` is the full explanation of a short message, which the command shows with ``--verbose``.
    """

    def __init__(self, message: str, *, details: str = "", **location: Any) -> None:
        super().__init__(message, **location)
        self.details = details


class DesignError(SolveError):
    """No design was found that moves and meets the conditions; `design` is the best one found, if any."""

    def __init__(self, message: str, *, design: Any = None, **location: Any) -> None:
        super().__init__(message, **location)
        self.design = design
