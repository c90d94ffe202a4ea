"""Plain data from a text file, with the line of every entry remembered for the error messages."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from jounce.errors import MechanismFileError
from jounce.io.files.reading import named_file

__all__ = ["Builder", "Location", "Source", "dotted"]

MAX_VALUES = 200_000
MAX_DEPTH = 50

Location = tuple[str | int, ...]
"""Where an entry is: keys and indices from the top, such as ``("joints", "BC", "points", 1)``."""


def dotted(location: Location) -> str:
    """Word a location for a reader.

    Examples
    --------
    >>> dotted(("joints", "BC", "points", 1, 0))
    'joints.BC.points[1][0]'
    """
    text = ""
    for step in location:
        word = f"[{step}]" if isinstance(step, int) else ascii(step[:100])[1:-1]
        text += f".{word}" if text and isinstance(step, str) else word
    return text


@dataclass
class Source:
    """Plain data from a file, and the line of every entry."""

    path: str
    data: Any
    lines: dict[Location, int] = field(default_factory=dict)
    allow: tuple[str, ...] = ()

    def line(self, location: Location) -> int | None:
        """Return the line of an entry, or of the nearest entry around it whose line is known."""
        for length in range(len(location), -1, -1):
            if location[:length] in self.lines:
                return self.lines[location[:length]]
        return None

    def error(self, message: str, location: Location = (), **value: Any) -> MechanismFileError:
        """Return an error that names the file, the line and the dotted name of an entry."""
        return MechanismFileError(
            message, path=self.path, line=self.line(location), name=dotted(location) or None, **value
        )

    def named_file(self, name: str, location: Location) -> str:
        """Return the path of a file that an entry names, below the folder of this one or one that is allowed."""
        try:
            return named_file(name, self.path, self.allow)
        except MechanismFileError as error:
            raise self.error(error.message, location, value=name) from None


class Builder:
    """Builds nested data from a stream of small steps, without recursion, within the limits.

    ``open`` a mapping or a list, ``key`` inside a mapping, ``value`` for a leaf, ``close``.
    """

    def __init__(self, path: str) -> None:
        self.source = Source(path, None)
        self._stack: list[tuple[dict[str, Any] | list[Any], Location]] = []
        self._key: str | None = None
        self._count = 0

    @property
    def wants_key(self) -> bool:
        """Whether the next step must be a key of a mapping, or its close."""
        return bool(self._stack) and isinstance(self._stack[-1][0], dict) and self._key is None

    def fail(self, message: str, line: int) -> MechanismFileError:
        """Return an error at a line, named after the entry being built."""
        return MechanismFileError(message, path=self.source.path, line=line, name=dotted(self._here()) or None)

    def _here(self) -> Location:
        if not self._stack:
            return ()
        container, location = self._stack[-1]
        if isinstance(container, list):
            return (*location, len(container))
        return location if self._key is None else (*location, self._key)

    def key(self, name: Any, line: int) -> None:
        """Start an entry of the mapping that is open."""
        self._check_text(name, line)
        container, location = self._stack[-1]
        if not isinstance(name, str):
            raise self.fail(f"a key must be a name, got {name!r}; put it in quotes to make it one", line)
        if name in container:
            first = self.source.lines[(*location, name)]
            message = f"duplicate name, already given in line {first}"
            raise MechanismFileError(message, path=self.source.path, line=line, name=dotted((*location, name)))
        self._key = name
        self.source.lines[(*location, name)] = line

    def open(self, container: dict[str, Any] | list[Any], line: int) -> None:
        """Start a mapping or a list."""
        location = self._here()
        if len(location) >= MAX_DEPTH:
            raise MechanismFileError(
                f"nested more than {MAX_DEPTH} deep; a mechanism file needs 6", path=self.source.path, line=line
            )
        self._put(container, line)
        self._stack.append((container, location))

    def close(self) -> None:
        """End the mapping or list opened last."""
        self._stack.pop()

    def value(self, value: Any, line: int) -> None:
        """Add a leaf."""
        self._check_text(value, line)
        self._put(value, line)

    def _check_text(self, value: Any, line: int) -> None:
        """Refuse halves of surrogate pairs, which escapes can write but no output can show."""
        if isinstance(value, str) and not value.isascii():
            try:
                value.encode()
            except UnicodeEncodeError:
                raise self.fail("is not text in UTF-8", line) from None

    def _put(self, value: Any, line: int) -> None:
        self._count += 1
        if self._count > MAX_VALUES:
            raise MechanismFileError(f"more than {MAX_VALUES} values", path=self.source.path, line=line)
        location = self._here()
        self.source.lines.setdefault(location, line)
        if not self._stack:
            self.source.data = value
            return
        container = self._stack[-1][0]
        if isinstance(container, list):
            container.append(value)
        else:
            container[str(location[-1])] = value
            self._key = None
