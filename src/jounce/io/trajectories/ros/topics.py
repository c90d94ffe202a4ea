"""Messages with the names of their topics around them, as rosbridge sends them and mcap prints them."""

from __future__ import annotations

import dataclasses
from typing import Any

from jounce.errors import check_name
from jounce.io.files.located_data import Source
from jounce.io.trajectories.ros.messages import is_message

CONTENTS = ("msg", "data")
"""Keys of the message itself, of rosbridge (``op: publish``) and of ``mcap cat --json``."""


def is_published(data: Any) -> bool:
    """Return whether data are messages, or the first of them is one, within the names of their topics."""
    return any(_content(entry) for entry in (data[:20] if isinstance(data, list) else [data]))


def _content(entry: Any) -> str:
    """Return the key of the message within an entry; empty if it has none, as that of a subscription."""
    has_topic = isinstance(entry, dict) and isinstance(entry.get("topic"), str)
    return next((key for key in CONTENTS if isinstance(entry.get(key), dict)), "") if has_topic else ""


def published(source: Source, topic: str | None = None) -> Source:
    """Return the source of the messages of one topic alone: the given one, or the only one that can be read.

    Raises
    ------
    TrajectoryError
        If there is no such topic, or there are several that can be read.
    """
    entries = source.data if isinstance(source.data, list) else [source.data]
    keys = [_content(entry) for entry in entries]
    topics: dict[str, bool] = {}
    for key, entry in zip(keys, entries, strict=True):
        if key:
            topics[entry["topic"]] = topics.get(entry["topic"], False) or is_message(entry[key])
    readable = [name for name, is_read in topics.items() if is_read]
    if not readable:
        raise source.error("the file has no topic of joint states or a trajectory", value=list(topics))
    if topic is not None:
        check_name("topic of joint states or trajectories", topic, readable, source.error_type, path=source.path)
    elif len(readable) > 1:
        names = ", ".join(readable)
        raise source.error(f"the file has several topics of joint states or trajectories; choose one: {names}")
    chosen = topic or readable[0]
    rows = [k for k, key in enumerate(keys) if key and entries[k]["topic"] == chosen]
    numbers = {row: number for number, row in enumerate(rows)}
    data, lines = [entries[row][keys[row]] for row in rows], {}
    for location, line in source.lines.items():
        row, *inner = (location or (None,)) if isinstance(source.data, list) else (0, *location)
        if row in numbers and inner[:1] == [keys[row]]:
            lines[numbers[row], *inner[1:]] = line
    if len(rows) == 1:
        data, lines = data[0], {location[1:]: line for location, line in lines.items()}
    return dataclasses.replace(source, data=data, lines=lines)
