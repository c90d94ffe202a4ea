"""YAML, TOML and JSON files as plain data, read by the parser of their ending."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from jounce.errors import JounceError, MechanismFileError
from jounce.io.files import DATA_FILES, parsers
from jounce.io.files.located_data import Source
from jounce.io.files.reading import check_allowed, name_of, read_file

MAX_LINES = 1_000_000
LINES = (".jsonl", ".ndjson")
"""Endings of JSON lines."""
_DOCUMENT = re.compile(r"^---(?=\s|$)", re.MULTILINE)
MAX_LINE_LENGTH = 100_000


def _decode(path: str, content: bytes) -> str:
    """Return UTF-8 text within the limits on lines; raise an error for anything that is not text."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise MechanismFileError("is not text in UTF-8; save it in that encoding", path=path, line=line) from None
    line = 0
    for line, row in enumerate(text.split("\n"), start=1):
        if len(row) > MAX_LINE_LENGTH:
            raise MechanismFileError(f"a line has more than {MAX_LINE_LENGTH} characters", path=path, line=line)
        if not row.isprintable() and any((ord(c) < 32 and c not in "\t\r") or 127 <= ord(c) < 160 for c in row):
            raise MechanismFileError("holds a control character, it is not a text file", path=path, line=line)
    if line > MAX_LINES:
        raise MechanismFileError(f"has {line} lines, at most {MAX_LINES} are read", path=path)
    if not text.strip():
        raise MechanismFileError("the file is empty", path=path)
    return text


def read_source(
    path: str | PathLike[str],
    allow: Iterable[str | PathLike[str]] = (),
    *,
    kind: str = "mechanism",
    error_type: type[JounceError] = MechanismFileError,
    many: bool = False,
) -> Source:
    """Read a YAML, TOML or JSON file, chosen by its suffix, into plain data with line numbers.

    Parameters
    ----------
    path
        A file ending in .yaml, .yml, .toml or .json.
    allow
        Folders besides its own below which files named in it may lie.
    kind : str
        Kind of content, for messages.
    error_type : type
        Type of the exceptions, also of those that the source makes.
    many : bool, default False
        Whether a YAML file may have several documents, and a JSON file several values, as JSON lines: the data are then
        the list of those that are not empty. A last one that ends within a line, or is no YAML or JSON, is left out
        (`unfinished`), as a printout that was interrupted.

    Returns
    -------
    Source
        Mappings, lists, text, numbers, booleans and None, and the line of every entry.

    Raises
    ------
    JounceError
        Of the given type, if the file cannot be read, violates the syntax, has a duplicate name, or exceeds a limit on
        size or nesting.
    """
    name = name_of(path, error_type)
    if not name:
        raise error_type("the name of a file is needed", value=name)
    suffix = Path(name).suffix.lower()
    if suffix not in (*DATA_FILES, *(LINES if many else ())) and not os.path.isdir(name):  # noqa: PTH112 - no error of a long name
        raise error_type(
            f"the kind of a {kind} file is given by its extension; valid: {', '.join(DATA_FILES)}", path=name
        )
    json = dict.fromkeys((".json", *LINES), parsers.read_json)
    reader = {".toml": parsers.read_toml, **json}.get(suffix, parsers.read_yaml)
    try:
        text = _decode(name, read_file(name))
        if many and reader is parsers.read_yaml and _DOCUMENT.search(text):
            source = _documents(name, text)
        elif many and reader is parsers.read_json:
            source = parsers.read_json(name, text, many=True)
        else:
            source = reader(name, text)
        source.allow, source.error_type = check_allowed(allow), error_type
    except MechanismFileError as error:
        raise error_type(error.message, path=error.path, line=error.line, name=error.name, value=error.value) from None
    if source.data is None and not source.lines:  # comments only
        raise error_type("the file is empty", path=name)
    return source


def _documents(path: str, text: str) -> Source:
    """Return the source of several documents; without the last one, if it ends early and another is before it."""
    position = [match.start() for match in _DOCUMENT.finditer(text)][-1]
    head, tail = text[:position], text[position:].partition("\n")[2]
    line = text.count("\n", 0, position) + 2
    try:
        source = _without_empty(parsers.read_yaml(path, text, many=True))
    except MechanismFileError as error:
        if not head.strip() or error.line is None or error.line < line:
            raise
    else:
        if text.endswith("\n") or not head.strip() or not tail.strip():
            return source
    source = _without_empty(parsers.read_yaml(path, head, many=True))
    source.unfinished = line
    return source


def _without_empty(source: Source) -> Source:
    """Return the source of several documents without empty ones; a single document becomes the data itself."""
    nonempty = [k for k, document in enumerate(source.data) if document is not None]
    if len(nonempty) == 1:
        lines = {location[1:]: line for location, line in source.lines.items() if location[:1] == (nonempty[0],)}
        return Source(source.path, source.data[nonempty[0]], lines)
    columns = {old: new for new, old in enumerate(nonempty)}
    lines = {
        (columns[location[0]], *location[1:]): line
        for location, line in source.lines.items()
        if location and location[0] in columns
    }
    return Source(source.path, [source.data[k] for k in nonempty], lines, several=True)
