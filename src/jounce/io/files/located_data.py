"""Plain data from a text file, with the line of every entry for error messages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jounce.errors import UNSET, ExpressionError, JounceError, MechanismFileError, unknown
from jounce.io.files.reading import named_file

MAX_VALUES, MAX_KEYS = 200_000, 20_000  # of a file, and of one mapping in it
MAX_DEPTH = 50
TOO_DEEP = f"nested more than {MAX_DEPTH} deep; 6 are enough for any file"
TOO_WIDE = "more than {} names in one mapping"
TOO_MANY = "more than {} entries; long tables of samples belong in a CSV file"

Location = tuple[str | int, ...]
"""Location of an entry: keys and indices from the top, such as ``("joints", "BC", "points", 1)``."""


def dotted(location: Location) -> str:
    """Return a location as text for a reader.

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
    """Plain data from a file, with the line of every entry; errors name the file, the line and the entry."""

    path: str
    data: Any
    lines: dict[Location, int] = field(default_factory=dict)
    allow: tuple[str, ...] = ()
    error_type: type[JounceError] = MechanismFileError
    several: bool = False  # whether the data are a list of several documents
    unfinished: int | None = None  # line of a last document that ends early, and is not among the data

    def line(self, location: Location) -> int | None:
        """Return the line of an entry, or of the innermost enclosing entry with a known line."""
        for length in range(len(location), -1, -1):
            if location[:length] in self.lines:
                return self.lines[location[:length]]
        return None

    def error(self, message: str, location: Location = (), **value: Any) -> JounceError:
        """Return an error that names the file, the line and the dotted name of an entry."""
        return self.error_type(message, **self.error_fields(location), **value)

    def error_fields(self, location: Location = ()) -> dict[str, Any]:
        """Return the location of an entry as fields of an error: file, line and dotted name."""
        return {"path": self.path, "line": self.line(location), "name": dotted(location) or None}

    def at(self, location: Location) -> Any:
        """Return the value at a location; None if there is none."""
        entry = self.data
        for step in location:
            entry = entry.get(step) if isinstance(entry, dict) else None
        return entry

    def mapping(
        self, location: Location = (), keys: Iterable[str] | None = None, *, others: Mapping[str, str] | None = None
    ) -> dict[str, Any]:
        """Return the mapping at a location; raise an error if it is empty, or has keys other than `keys`.

        `others` maps words that users may write instead of a key to that key, for the message.
        """
        entry = self.at(location)
        if not isinstance(entry, dict) or not entry:
            raise self.error("must be a mapping with at least one entry", location, value=entry)
        for key in entry:
            if keys is not None and key not in keys:
                replacement = (others or {}).get(key)
                phrase = unknown("key", key, keys) if replacement is None else f"the key for that is '{replacement}'"
                raise self.error(phrase, (*location, key))
        return entry

    def value(
        self,
        location: Location,
        raw: Any,
        kind: str = "any",
        names: Iterable[str] = (),
        dimensions: Mapping[str, Any] | None = None,
    ) -> Any:
        """Return a value in SI units with its dimension, as parsed by `parse_value`."""
        from jounce.units.values import parse_value  # local, so that a wrong key need not wait for JAX

        try:
            return parse_value(raw, kind, names, dimensions)
        except JounceError as error:
            raise self.error(error.message, location, value=UNSET if shows_value(error) else raw) from None

    def number(self, location: Location, raw: Any, kind: str = "any") -> float:
        """Return a number in SI units; expressions without names are evaluated."""
        value = self.value(location, raw, kind).value
        assert isinstance(value, float)
        return value

    def named_file(self, name: str, location: Location) -> str:
        """Return the path of a file that an entry names, below the folder of this file or an allowed one."""
        try:
            return named_file(name, self.path, self.allow)
        except MechanismFileError as error:
            raise self.error(error.message, location, value=name) from None

    def read_named(self, name: str, location: Location, read: Callable[[str], Any]) -> Any:
        """Return the result of reading a file that an entry names; errors show its path as the entry gives it."""
        path = self.named_file(name, location)
        try:
            return read(path)
        except JounceError as error:
            if error.path == path:
                error.path = Path(self.path).parent / name
            raise self.error(str(error), location) from None


def shows_value(error: JounceError) -> bool:
    """Return whether the message of an error shows the value itself, as for an expression with a column."""
    return isinstance(error, ExpressionError) and error.column is not None


class Builder:
    """Builds nested data from a stream of events, without recursion, within limits.

    The events are ``open`` for a mapping or a list, ``key`` in a mapping, ``value`` for a leaf, and ``close``.
    """

    def __init__(self, path: str) -> None:
        self.source = Source(path, None)
        self._stack: list[tuple[dict[str, Any] | list[Any], Location]] = []
        self._key: str | None = None
        self._count = 0

    @property
    def expects_key(self) -> bool:
        """Whether the next event must be a key of a mapping, or its end."""
        return bool(self._stack) and isinstance(self._stack[-1][0], dict) and self._key is None

    def fail(self, message: str, line: int) -> MechanismFileError:
        """Return an error at a line, named after the entry being built."""
        return MechanismFileError(message, path=self.source.path, line=line, name=dotted(self._location()) or None)

    def _location(self) -> Location:
        if not self._stack:
            return ()
        container, location = self._stack[-1]
        if isinstance(container, list):
            return (*location, len(container))
        return location if self._key is None else (*location, self._key)

    def key(self, name: Any, line: int) -> None:
        """Start an entry of the open mapping."""
        self._check_text(name, line)
        container, location = self._stack[-1]
        if not isinstance(name, str):
            raise self.fail(f"a key must be a name, got {name!r}; put it in quotes to make it one", line)
        if name in container:
            first = self.source.lines[(*location, name)]
            message = f"duplicate name, already given in line {first}"
            raise MechanismFileError(message, path=self.source.path, line=line, name=dotted((*location, name)))
        if len(container) >= MAX_KEYS:
            raise MechanismFileError(TOO_WIDE.format(MAX_KEYS), path=self.source.path, line=line, name=dotted(location))
        self._key = name
        self.source.lines[(*location, name)] = line

    def open(self, container: dict[str, Any] | list[Any], line: int) -> None:
        """Start a mapping or a list."""
        location = self._location()
        if len(location) >= MAX_DEPTH:
            raise MechanismFileError(TOO_DEEP, path=self.source.path, line=line)
        self._put(container, line)
        self._stack.append((container, location))

    def close(self) -> None:
        """End the mapping or the list that was opened last."""
        self._stack.pop()

    def value(self, value: Any, line: int) -> None:
        """Add a leaf."""
        self._check_text(value, line)
        self._put(value, line)

    def _check_text(self, value: Any, line: int) -> None:
        """Raise an error for unpaired surrogates, which escapes can write but no output can show."""
        if isinstance(value, str) and not value.isascii():
            try:
                value.encode()
            except UnicodeEncodeError:
                raise self.fail("is not text in UTF-8", line) from None

    def _put(self, value: Any, line: int) -> None:
        self._count += 1
        if self._count > MAX_VALUES:
            raise MechanismFileError(TOO_MANY.format(MAX_VALUES), path=self.source.path, line=line)
        location = self._location()
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
