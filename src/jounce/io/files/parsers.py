"""YAML, JSON and TOML text into plain data with the line of every entry.

None of the three recurses over the data: an input nested without end is refused at the limit, not at the bottom of
the stack.
"""

from __future__ import annotations

import json
import re
from typing import Any

from jounce.errors import MechanismFileError
from jounce.io.files.located_data import MAX_DEPTH, TOO_DEEP, Builder, Location, Source

# The core schema of YAML 1.2 (section 10.3.2 of its specification).
_NULL = {"", "~", "null", "Null", "NULL"}
_BOOLEANS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INTEGER = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


def plain_scalar(text: str) -> Any:
    """Resolve a plain scalar by the core schema of YAML 1.2: 1e-3 is a number, yes is text."""
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


def read_yaml(path: str, text: str) -> Source:
    """Read YAML 1.2 through the events of ruamel.yaml.

    Aliases, tags and more than one document are refused: a mechanism file does not need them, and they are the usual
    way to make a small file unfold without end.
    """
    from ruamel.yaml import YAML, events as kinds
    from ruamel.yaml.error import YAMLError

    builder = Builder(path)
    documents = 0
    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            line = event.start_mark.line + 1
            if isinstance(event, kinds.ScalarEvent):
                _refuse_tag(builder, event, line)
                value = plain_scalar(event.value) if event.implicit[0] else event.value
                if builder.wants_key:
                    builder.key(value, line)
                else:
                    builder.value(value, line)
            elif isinstance(event, (kinds.MappingStartEvent, kinds.SequenceStartEvent)):
                _refuse_tag(builder, event, line)
                if builder.wants_key:
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
                if documents > 1:
                    raise MechanismFileError("a second YAML document starts (---)", path=path, line=line)
    except YAMLError as error:
        raise _yaml_error(path, error) from None
    except (RecursionError, ValueError, IndexError, OverflowError) as error:
        raise MechanismFileError(f"the YAML cannot be read: {error}", path=path) from None
    return builder.source


def _refuse_tag(builder: Builder, event: Any, line: int) -> None:
    if event.ctag is not None:
        tag = str(event.ctag).encode("ascii", "backslashreplace").decode("ascii")[:60]
        raise builder.fail(f"the YAML tag {tag} is not allowed", line)


def _yaml_error(path: str, error: Exception) -> MechanismFileError:
    """Word an error of the YAML scanner in one line."""
    start = getattr(error, "context_mark", None)
    mark = getattr(error, "problem_mark", None) or start
    problem = getattr(error, "problem", None) or str(error).split("\n")[0]
    context = getattr(error, "context", None)
    text = f"{context}: {problem}" if context else str(problem)
    if "'\\t'" in text:
        text = "a tab stands where YAML wants spaces"
    elif "mapping values are not allowed" in text:
        text += " (a second ':' in one line, or a line indented too far)"
    if start is not None and mark is not None and start.line != mark.line:
        text += f" (started in line {start.line + 1})"
    return MechanismFileError(
        f"the YAML cannot be read: {' '.join(text.split())}", path=path, line=None if mark is None else mark.line + 1
    )


_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\]:,]|[^\s{}\[\]:,"]+')


def read_json(path: str, text: str) -> Source:
    """Read JSON; its syntax is checked by the standard library, lines and duplicates by a walk over its tokens."""
    _check_depth(path, text, quotes='"')
    try:
        json.loads(text)
    except json.JSONDecodeError as error:
        raise MechanismFileError(
            f"the JSON cannot be read at column {error.colno}: {error.msg}", path=path, line=error.lineno
        ) from None
    except (ValueError, RecursionError):
        raise MechanismFileError("the JSON cannot be read: a number has too many digits", path=path) from None
    builder = Builder(path)
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
            case leaf if builder.wants_key:
                builder.key(json.loads(leaf), line)
            case leaf:
                builder.value(json.loads(leaf), line)
    return builder.source


def _check_depth(path: str, text: str, quotes: str) -> None:
    """Bound the nesting of brackets outside strings, before a recursive parser sees them."""
    depth = 0
    for bracket in re.finditer(rf"[\[\]{{}}\n]|[{quotes}](?:\\.|[^{quotes}\\\n])*[{quotes}]?", text):
        if bracket.group() in "[{":
            depth += 1
            if depth > MAX_DEPTH:
                line = text.count("\n", 0, bracket.start()) + 1
                raise MechanismFileError(TOO_DEEP, path=path, line=line)
        elif bracket.group() in "]}":
            depth -= 1


_BARE_OR_QUOTED = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*')"""
_TOML_KEY = re.compile(rf"\s*({_BARE_OR_QUOTED}(?:\s*\.\s*{_BARE_OR_QUOTED})*)\s*")
_TOML_PART = re.compile(_BARE_OR_QUOTED)


def read_toml(path: str, text: str) -> Source:
    """Read TOML through the standard library; lines come from a scan of the keys, exact for one key a line."""
    import tomllib

    _check_depth(path, text, quotes="\"'")
    for number, row in enumerate(text.split("\n"), start=1):
        if row.count(".") > MAX_DEPTH and len(_TOML_PART.findall(row.partition("=")[0])) > MAX_DEPTH:
            raise MechanismFileError(TOO_DEEP, path=path, line=number)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        reason = re.sub(r"\s*\(at .*\)$", "", str(error)).encode("ascii", "backslashreplace").decode("ascii")
        reason = re.sub(r"^Cannot (overwrite a value|declare .* twice).*", r"duplicate name (\g<0>)", reason)
        line = int(place[1]) if place else text.count("\n") + 1
        raise MechanismFileError(f"the TOML cannot be read: {reason}", path=path, line=line) from None
    except (RecursionError, ValueError) as error:
        raise MechanismFileError(f"the TOML cannot be read: {error}", path=path) from None
    _check_plain(path, data)
    return Source(path, data, _toml_lines(text))


def _check_plain(path: str, data: Any) -> None:
    """Bound the nesting that dotted keys can make; dates are refused later, where a value is expected."""
    pending = [(data, 0)]
    while pending:
        value, depth = pending.pop()
        if depth > MAX_DEPTH:
            raise MechanismFileError(TOO_DEEP, path=path)
        if isinstance(value, (dict, list)):
            pending.extend((item, depth + 1) for item in (value.values() if isinstance(value, dict) else value))


def _toml_lines(text: str) -> dict[Location, int]:
    """Find the line of every table and key, best effort: inline tables count from the line of their key."""
    lines: dict[Location, int] = {(): 1}
    table: Location = ()
    depth = 0
    for number, row in enumerate(text.split("\n"), start=1):
        stripped = row.strip()
        if depth == 0 and stripped.startswith("[") and (key := _TOML_KEY.match(stripped.lstrip("["))):
            table = _toml_parts(key[1])
            _note(lines, table, number)
            continue
        if depth == 0 and (key := _TOML_KEY.match(row)) and row[key.end() : key.end() + 1] == "=":
            location = table + _toml_parts(key[1])
            _note(lines, location, number)
            for inner in re.finditer(rf"[{{,]\s*({_BARE_OR_QUOTED})\s*=", row[key.end() :]):
                lines.setdefault((*location, *_toml_parts(inner[1])), number)
        bare = re.sub(r""""(?:[^"\\]|\\.)*"|'[^']*'|#.*""", "", row)
        depth = max(0, depth + bare.count("[") + bare.count("{") - bare.count("]") - bare.count("}"))
    return lines


def _toml_parts(key: str) -> Location:
    return tuple(part.strip("\"'") for part in _TOML_PART.findall(key))


def _note(lines: dict[Location, int], location: Location, number: int) -> None:
    for length in range(1, len(location)):
        lines.setdefault(location[:length], number)
    lines[location] = number
