"""Parsers of YAML, JSON and TOML text into plain data with the line of every entry.

None of them recurses over the data: too deeply nested input is refused at a limit, before the stack overflows.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from typing import Any

from jounce.errors import MechanismFileError
from jounce.io.files.located_data import (
    MAX_DEPTH,
    MAX_KEYS,
    MAX_VALUES,
    TOO_DEEP,
    TOO_MANY,
    TOO_WIDE,
    Builder,
    Location,
    Source,
)

# The core schema of YAML 1.2 (section 10.3.2 of its specification).
_NULL = {"", "~", "null", "Null", "NULL"}
_BOOLEANS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INTEGER = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
ANGLE_TAGS = {"!degrees": math.pi / 180, "!radians": 1.0}
"""Tags of YAML for xacro, which say of numbers only that they are to be converted to SI units."""
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


def plain_scalar(text: str) -> Any:
    """Return the value of a plain scalar by the core schema of YAML 1.2: 1e-3 is a number, yes is text."""
    if text in _NULL:
        return None
    if text in _BOOLEANS:
        return _BOOLEANS[text]
    if _INTEGER.fullmatch(text):
        return int(text) if len(text) < 300 else float(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _BASED.fullmatch(text):
        return int(text, 0)
    if _SPECIAL.fullmatch(text):
        return float(text.replace(".", ""))
    return text


def read_yaml(path: str, text: str, *, many: bool = False) -> Source:
    """Return the data of YAML 1.2 text, from the events of ruamel.yaml.

    Aliases, tags and more than one document are refused: no mechanism file needs them, and aliases can expand a small
    file without bound. With `many`, the data are the list of the documents.
    """
    from ruamel.yaml import YAML, events as kinds
    from ruamel.yaml.error import YAMLError

    builder = _builder(path, many=many)
    documents = 0
    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            line = event.start_mark.line + 1
            if isinstance(event, kinds.ScalarEvent):
                value = _scalar(builder, event, line)
                if builder.expects_key:
                    builder.key(value, line)
                else:
                    builder.value(value, line)
            elif isinstance(event, (kinds.MappingStartEvent, kinds.SequenceStartEvent)):
                _refuse_tag(builder, event, line)
                if builder.expects_key:
                    raise builder.fail("a key must be a name, not a mapping or a list", line)
                builder.open({} if isinstance(event, kinds.MappingStartEvent) else [], line)
            elif isinstance(event, (kinds.MappingEndEvent, kinds.SequenceEndEvent)):
                builder.close()
            elif isinstance(event, kinds.AliasEvent):
                raise builder.fail(
                    f"the YAML alias *{event.anchor} is not allowed; give the value a name under parameters", line
                )
            elif isinstance(event, kinds.DocumentStartEvent):
                documents += 1
                if documents > 1 and not many:
                    raise MechanismFileError("a second YAML document starts (---)", path=path, line=line)
    except YAMLError as error:
        raise _yaml_error(path, error, text.splitlines()) from None
    except (RecursionError, ValueError, IndexError, OverflowError) as error:
        raise MechanismFileError(f"the YAML cannot be read: {error}", path=path) from None
    return builder.source


def _builder(path: str, *, many: bool) -> Builder:
    builder = Builder(path)
    if many:
        builder.open([], 1)
    return builder


def _scalar(builder: Builder, event: Any, line: int) -> Any:
    """Return what a scalar stands for, in SI units where a tag of xacro is before it, as in ``!degrees 120``."""
    number, size = plain_scalar(event.value), ANGLE_TAGS.get(str(event.ctag))
    if size is not None and isinstance(number, int | float) and not isinstance(number, bool):
        return float(number * size)
    _refuse_tag(builder, event, line)
    return number if event.implicit[0] else event.value


def _refuse_tag(builder: Builder, event: Any, line: int) -> None:
    if event.ctag is not None:
        tag = str(event.ctag).encode("ascii", "backslashreplace").decode("ascii")[:60]
        raise builder.fail(f"the YAML tag {tag} is not allowed", line)


def _yaml_error(path: str, error: Exception, lines: list[str]) -> MechanismFileError:
    """Return an error of the YAML scanner as an error of one line."""
    start = getattr(error, "context_mark", None)
    mark = getattr(error, "problem_mark", None) or start
    problem = getattr(error, "problem", None) or str(error).split("\n")[0]
    context = getattr(error, "context", None)
    text = f"{context}: {problem}" if context else str(problem)
    if "'\\t'" in text:
        text = "a tab is where YAML requires spaces"
    elif (
        "block mapping" in text
        and "expected <block end>" in text
        and start is not None
        and mark is not None
        and mark.column > start.column
    ):
        before = [len(x) - len(x.lstrip()) for x in lines[: mark.line] if x.strip() and x.strip()[0] != "#"]
        phrase, column = "further than the entries beside it", start.column
        if before and mark.column < before[-1]:
            phrase, column = "less than those before it", before[-1]
        text = (
            f"the line is indented {phrase} ({mark.column} space{'s' * (mark.column != 1)}, not {column}); entries of "
            "one mapping begin in one column"
        )
    elif "mapping values are not allowed" in text:
        text += " (a second ':' in one line, or a line indented too far)"
    if start is not None and mark is not None and start.line != mark.line:
        text += f" (started in line {start.line + 1})"
    return MechanismFileError(
        f"the YAML cannot be read: {' '.join(text.split())}", path=path, line=None if mark is None else mark.line + 1
    )


_SPACE = re.compile(r"\s*")
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\]:,]|[^\s{}\[\]:,"]+')


def read_json(path: str, text: str, *, many: bool = False) -> Source:
    """Return the data of JSON text; the standard library checks the syntax, a pass over the tokens finds the lines.

    With `many`, several values may follow one another, as in JSON lines: the data are then their list.
    """
    _check_depth(path, text)
    try:
        count, end = _json_values(text) if many else (len([json.loads(text)]), len(text))
    except json.JSONDecodeError as error:
        raise MechanismFileError(
            f"the JSON cannot be read at column {error.colno}: {error.msg}", path=path, line=error.lineno
        ) from None
    except (ValueError, RecursionError):
        raise MechanismFileError("the JSON cannot be read: a number has too many digits", path=path) from None
    builder = _builder(path, many=count > 1)
    builder.source.several = count > 1
    if end < len(text):
        builder.source.unfinished = text.count("\n", 0, end) + 1
        text = text[:end]
    line, position = 1, 0
    for token in _TOKEN.finditer(text):
        line += text.count("\n", position, token.start())
        position = token.start()
        match token.group():
            case "{":
                builder.open({}, line)
            case "[":
                builder.open([], line)
            case "}" | "]":
                builder.close()
            case ":" | ",":
                pass
            case leaf if builder.expects_key:
                builder.key(json.loads(leaf), line)
            case leaf:
                builder.value(json.loads(leaf), line)
    return builder.source


def _json_values(text: str) -> tuple[int, int]:
    """Return the number of values that follow one another, and their end, before a last one that is not whole.

    Raises
    ------
    JSONDecodeError
        If another one is not valid.
    """
    decoder, count = json.JSONDecoder(), 0
    begin = _SPACE.match(text).end()  # type: ignore[union-attr] - it matches anything
    while begin < len(text) or not count:
        try:
            end = decoder.raw_decode(text, begin)[1]
        except json.JSONDecodeError:
            if count < 2 or "\n" in text[begin:].rstrip("\n"):
                raise
            return count, begin
        count, begin = count + 1, _SPACE.match(text, end).end()  # type: ignore[union-attr]
    return count, begin


def _check_depth(path: str, text: str) -> None:
    """Raise an error for brackets nested too deeply, before a recursive parser reads them."""
    depth = 0
    for bracket in re.finditer(r'[\[\]{}]|"(?:\\.|[^"\\\n])*+"?', text):
        if bracket.group() in "[{":
            depth += 1
            if depth > MAX_DEPTH:
                line = text.count("\n", 0, bracket.start()) + 1
                raise MechanismFileError(TOO_DEEP, path=path, line=line)
        elif bracket.group() in "]}":
            depth -= 1


# Unterminated strings are tokens too, so that no character is scanned twice.
_TOML_TOKEN = re.compile(
    r"""
    "{3}(?:[^"\\]|\\.|"(?!""))*+(?:"{3,5})?   # strings of several lines
    |'{3}(?:[^']|'(?!''))*+(?:'{3,5})?
    |"(?:[^"\\\n]|\\.)*+"?                    # strings of one line
    |'[^'\n]*+'?
    |\#[^\n]*+
    |[][{}=,.\n]
    |[^][{}=,.\s"'#]++
    """,
    re.DOTALL | re.VERBOSE,
)


def read_toml(path: str, text: str) -> Source:
    """Return the data of TOML text, read by the standard library; a pass over the tokens finds the lines."""
    import tomllib

    _check_nesting(path, text)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        match = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        reason = re.sub(r"\s*\(at .*\)$", "", str(error)).encode("ascii", "backslashreplace").decode("ascii")
        reason = re.sub(r"^Cannot (overwrite a value|declare .* twice).*", r"duplicate name (\g<0>)", reason)
        line = int(match[1]) if match else text.count("\n") + 1
        raise MechanismFileError(f"the TOML cannot be read: {reason}", path=path, line=line) from None
    except (RecursionError, ValueError) as error:
        raise MechanismFileError(f"the TOML cannot be read: {error}", path=path) from None
    _check_size(path, data)
    return Source(path, data, _TomlLines().lines_of(text))


def _toml_tokens(text: str) -> Iterator[tuple[str, int]]:
    """Yield the tokens of a text except comments, each with its line."""
    line = position = 0
    for token in _TOML_TOKEN.finditer(text):
        line += text.count("\n", position, token.start())
        position = token.start()
        if text[position] != "#":
            yield token.group(), line + 1


def _check_nesting(path: str, text: str) -> None:
    """Raise an error for brackets nested too deeply, or dotted keys with too many parts."""
    depth = dots = 0
    for token, line in _toml_tokens(text):
        if token in ("[", "{"):
            depth += 1
        elif token in ("]", "}"):
            depth -= 1
        dots = dots + 1 if token == "." else 0 if token in ("\n", "=", ",") else dots
        if max(depth, dots) > MAX_DEPTH:
            raise MechanismFileError(TOO_DEEP, path=path, line=line)


def _check_size(path: str, data: Any) -> None:
    """Raise an error for too many entries, or tables nested too deeply."""
    pending, count = [(data, 0)], 0
    while pending:
        value, depth = pending.pop()
        count += 1
        if depth > MAX_DEPTH:
            raise MechanismFileError(TOO_DEEP, path=path)
        if count > MAX_VALUES:
            raise MechanismFileError(TOO_MANY.format(MAX_VALUES), path=path)
        if isinstance(value, dict) and len(value) > MAX_KEYS:
            raise MechanismFileError(TOO_WIDE.format(MAX_KEYS), path=path)
        if isinstance(value, (dict, list)):
            pending.extend((item, depth + 1) for item in (value.values() if isinstance(value, dict) else value))


class _TomlLines:
    """Finds the line of every table, key and array entry of valid TOML text."""

    def __init__(self) -> None:
        self.lines: dict[Location, int] = {(): 1}
        self.counts: dict[Location, int] = {}  # numbers of tables in arrays of tables
        self.table: Location = ()  # current table
        self.open: list[Location] = []  # locations of the enclosing arrays and inline tables
        self.parts: list[str] | None = []  # parts of the current key; None within a value
        self.location: Location = ()  # location of the current value

    def lines_of(self, text: str) -> dict[Location, int]:
        """Return the line of every location of a text."""
        header = 0  # brackets of the header of a table
        for token, line in _toml_tokens(text):
            if token == "\n":
                if not self.open:
                    self.parts, header = [], 0
            elif header:
                header = self._in_header(token, header, line)
            elif self.parts is None:
                self._in_value(token, line)
            elif token == "[" and not self.parts and not self.open:
                header = 1
            elif token == "=":
                outer = self.open[-1] if self.open else self.table
                self.location, self.parts = self._note((*outer, *self.parts), line), None
            elif token == "}":
                self._close()
            elif token != ".":
                self.parts.append(_unquoted(token))
        return self.lines

    def _in_header(self, token: str, brackets: int, line: int) -> int:
        assert self.parts is not None
        if token == "[":
            return 2
        if token == "]" and self.parts:
            location: Location = ()
            for part in self.parts:  # a table within the last table of an array
                location = (*location, part)
                if location in self.counts and (brackets == 1 or location != tuple(self.parts)):
                    location = (*location, self.counts[location] - 1)
            if brackets == 2:
                self.counts[location] = self.counts.get(location, 0) + 1
                self.lines.setdefault(location, line)
                location = (*location, self.counts[location] - 1)
            self.table, self.parts = self._note(location, line), []
        elif token not in ("]", "."):
            self.parts.append(_unquoted(token))
        return brackets

    def _in_value(self, token: str, line: int) -> None:
        if token in ("]", "}"):
            self._close()
            return
        if token == ",":
            outer, last = self.open[-1], self.location[-1]
            if len(self.location) > len(outer) and isinstance(last, int):  # in an array
                self.location = (*outer, last + 1)
            else:
                self.parts = []
            return
        self.lines.setdefault(self.location, line)
        if token in ("[", "{"):
            self.open.append(self.location)
            self.location, self.parts = ((*self.location, 0), None) if token == "[" else (self.location, [])

    def _close(self) -> None:
        self.location, self.parts = self.open.pop(), None

    def _note(self, location: Location, line: int) -> Location:
        for length in range(1, len(location)):
            self.lines.setdefault(location[:length], line)
        self.lines[location] = line
        return location


def _unquoted(key: str) -> str:
    return key.strip("\"'")
