"""Plain data as the readable text of a YAML, TOML or JSON file, checked by reading it back."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from typing import Any

from jounce.errors import OutputError

BLOCKS = ("parameters", "bodies", "joints", "drivers", "forces", "initial", "outputs")  # one line for each entry
WIDTH = 110  # longest entry on one line


def dumped(data: Mapping[str, Any], suffix: str, path: str = "") -> str:
    """Return the text of a mechanism file.

    Parameters
    ----------
    data : mapping
        Data by the keys of the schema: mappings, lists, text and numbers.
    suffix : str
        Ending of the file: .yaml, .yml, .toml or .json.
    path : str
        Name of the file, for messages.

    Raises
    ------
    OutputError
        If the format cannot hold the data.

    Examples
    --------
    >>> print(dumped({"space": "planar", "bodies": {"crank": {"position": [0, "2*AB"]}}}, ".yaml"), end="")
    space: planar
    bodies:
      crank: {position: [0, 2*AB]}
    """
    from jounce.io.files import parsers

    entries = {key: value for key, value in data.items() if value is not None}
    write = {".toml": _toml, ".json": _json}.get(suffix, _yaml)
    read = {".toml": parsers.read_toml, ".json": parsers.read_json}.get(suffix, parsers.read_yaml)
    text = write(entries)
    read_back = read(path, text).data
    if not _same({key: read_back.get(key) for key in entries}, entries) or len(read_back) != len(entries):
        raise OutputError(f"the data cannot be held by a file of the kind {suffix}", path=path)
    return text


def _same(first: Any, second: Any) -> bool:
    """Return whether data are equal; 1 equals 1.0, but not true."""
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return list(first) == list(second) and all(_same(first[key], second[key]) for key in first)
    if isinstance(first, (list, tuple)) and isinstance(second, (list, tuple)):
        return len(first) == len(second) and all(map(_same, first, second))
    return first == second and isinstance(first, str | bool) == isinstance(second, str | bool)


def _json(data: Mapping[str, Any]) -> str:
    parts = []
    for key, value in data.items():
        if key in BLOCKS and isinstance(value, Mapping) and value:
            rows = ",\n".join(f"    {json.dumps(name)}: {json.dumps(entry)}" for name, entry in value.items())
            parts.append(f"  {json.dumps(key)}: {{\n{rows}\n  }}")
        else:
            parts.append(f"  {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _yaml(data: Mapping[str, Any]) -> str:
    from ruamel.yaml import YAML
    from ruamel.yaml.comments import CommentedMap, CommentedSeq
    from ruamel.yaml.scalarstring import DoubleQuotedScalarString

    from jounce.io.files.parsers import plain_scalar

    def styled(value: Any, flow: bool) -> Any:
        if isinstance(value, Mapping):
            node = CommentedMap((styled(key, True), styled(entry, True)) for key, entry in value.items())
        elif isinstance(value, (list, tuple)):
            node = CommentedSeq(styled(entry, True) for entry in value)
        elif isinstance(value, str):
            return value if plain_scalar(value) is value else DoubleQuotedScalarString(value)
        else:
            return value
        if flow:
            node.fa.set_flow_style()
        else:
            node.fa.set_block_style()
        return node

    mapping = CommentedMap()
    for key, value in data.items():
        mapping[key] = styled(value, key not in BLOCKS)
        if key in BLOCKS and isinstance(value, Mapping):
            for name, entry in value.items():
                if isinstance(entry, Mapping) and len(str(entry)) + len(str(name)) > WIDTH:
                    mapping[key][name].fa.set_block_style()
    writer, stream = YAML(), io.StringIO()
    writer.width, writer.allow_unicode = 100_000, False
    writer.dump(mapping, stream)
    return stream.getvalue()


def _toml(data: Mapping[str, Any]) -> str:
    import tomlkit

    def styled(value: Any) -> Any:
        if isinstance(value, Mapping):
            inline = tomlkit.inline_table()
            inline.update({key: styled(entry) for key, entry in value.items()})
            return inline
        if isinstance(value, (list, tuple)):
            array = tomlkit.array()
            array.extend(map(styled, value))
            return array
        return value

    document = tomlkit.document()
    for key, value in data.items():
        if key not in BLOCKS or not isinstance(value, Mapping):
            document.append(key, styled(value))
    for key, value in data.items():  # TOML requires its tables last
        if key in BLOCKS and isinstance(value, Mapping):
            table = tomlkit.table()
            for name, entry in value.items():
                table.append(name, styled(entry))
            document.append(key, table)
    return tomlkit.dumps(document)
