"""The folder of a sweep: edits of its files made up by chance, and what the same command makes of them.

A case is a text with an edit on each line, as JSON: the file, what is done, and with what.
"""

from __future__ import annotations

import functools
import json
import os
import pathlib
import random
import shutil
import tempfile
from collections.abc import Callable
from typing import Any

from jounce.errors import JounceError, OutputError
from jounce.sweeps import manifest
from jounce.sweeps.sweeping import opened
from tests.fuzz.mutations import HOSTILE
from tests.problems.waves import ROOT, contents, swept

__all__ = ["edits", "grown_sweep", "read_sweep", "sweeps"]

KINDS = ("remove empty cut append flip word swap copy rename folder filled link pipe text json manifest new").split()
JSON: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 3, 2**31, 2**63, 10**30, 1e308, 0.5, float("nan"), float("inf"), "", "x", "NaN"),
    *("x" * 5000, "\x1b[31m\u202e", "\ud800", "/dev/zero", "..", "float64", "c", [], [[]], [0], [1, 2], [10**15, 2]),
    *([-1], ["design"], ["design", "derivative"], {}, {"a": {"b": [None]}}, {"name": "x"}, [{"name": "bytes"}]),
    *([{"name": "gzip", "configuration": {"level": 5}}], [{"name": "blosc"}], [[[[[]]]]] * 3),
)
NAMES = (
    "other",
    "zarr.json",
    "c/0",
    "wave_peak/c/9/9",
    "chunks/digest/c/77",
    "a.zarr/zarr.json",
    ".scratch-x",
    "x.partial",
)


@functools.cache
def _whole() -> tuple[tempfile.TemporaryDirectory[str], pathlib.Path, str, dict[str, Any], Any]:
    """Return a sweep of two chunks: where it is, its checksum, its files, and what it says."""
    kept = tempfile.TemporaryDirectory()
    folder = pathlib.Path(kept.name, "whole.zarr")
    checksum = swept(folder)
    return kept, folder, checksum, contents(folder), opened(folder).load()


def sweeps() -> list[str]:
    """Return the names of all files."""
    return sorted(_whole()[3])


def edits(chance: random.Random, files: list[str]) -> bytes:
    """Return one to four edits."""
    return "\n".join(json.dumps(_edit(chance, files)) for _ in range(chance.choice([1, 1, 1, 2, 4]))).encode()


def _edit(chance: random.Random, files: list[str]) -> list[Any]:
    name, kind = chance.choice([*files, ROOT, ROOT]), chance.choice(KINDS)
    if chance.random() < 0.1:
        name = str(pathlib.Path(name).parent)  # a folder
    if kind in ("cut", "flip", "word"):
        return [name, kind, chance.random(), chance.randrange(256)]
    if kind in ("swap", "copy", "rename"):
        return [name, kind, chance.choice([*files, *NAMES])]
    if kind == "append":
        return [name, kind, chance.choice([1, 40, 5000])]
    if kind == "link":
        return [name, kind, chance.choice(["../planted", "loop", "/dev/zero", "/dev/null", *files[:3], ".", ".."])]
    if kind == "text":
        return [name, kind, chance.random(), chance.choice(HOSTILE)]
    if kind in ("json", "manifest"):
        name = ROOT if kind == "manifest" else chance.choice([n for n in files if n.endswith(ROOT)])
        return [name, kind, chance.random(), chance.choice(JSON), chance.random() < 0.5]
    if kind == "new":
        return [chance.choice(NAMES), kind]
    return [name, kind]


def read_sweep(path: pathlib.Path) -> None:
    """Go on with a sweep whose files were edited: the result is the same as before, or it is refused by its name."""
    with tempfile.TemporaryDirectory() as above:
        folder = pathlib.Path(above, "a.zarr")
        shutil.copytree(_whole()[1], folder)
        for line in path.read_text().splitlines():
            try:
                name, kind, *given = json.loads(line)
                _change(folder, name, kind, given)
            except (OSError, ValueError, TypeError, LookupError):
                continue  # what an edit before has taken away
        try:
            checksum = swept(folder)
        except JounceError as error:
            if not isinstance(error, OutputError) or str(folder) not in str(error):
                raise AssertionError("an error of another kind, or one that does not name the folder") from error
            raise
        finally:
            beside = {path.name for path in pathlib.Path(above).iterdir()} - {folder.name}
            assert not beside, f"made {beside}"
        _compare(folder, checksum)


def grown_sweep(text: pathlib.Path) -> tuple[pathlib.Path, Callable[[pathlib.Path], object]]:
    """Make a sweep as a text says: so many chunks, so many other files, or a comment; return it, and what reads it."""
    request = json.loads(text.read_text())
    folder, vary = text.with_suffix(".zarr"), {"size": list(range(2 * request.get("chunks", 2))), "phase": [0.25]}
    swept(folder, vary)
    for k in range(request.get("files", 0)):
        (folder / "chunks/digest/c" / f"{k}.old").write_bytes(b"")
    root = json.loads((folder / ROOT).read_text())
    root["attributes"] |= {"comment": request.get("comment", "")}
    (folder / ROOT).write_text(json.dumps(root))
    return folder, lambda path: swept(path, vary)


def _compare(folder: pathlib.Path, checksum: str) -> None:
    """Check that a folder holds what it held."""
    _, _, expected, files, said = _whole()
    assert checksum == expected, "another checksum"
    there: dict[str, Any] = {name: (folder / name).read_bytes() for name in files}
    there |= {name: json.loads(content) for name, content in there.items() if name.endswith(ROOT)}
    own, others = files[ROOT]["attributes"], there[ROOT]["attributes"]
    assert others == others | own, "attributes of the whole differ"
    there[ROOT] = there[ROOT] | {"attributes": own}
    for name in files:  # of arrays the numbers count: bytes may differ where what they say does not
        assert there[name] == files[name] or not name.endswith(ROOT), f"{name} differs"
    with opened(folder) as found:
        assert said.equals(found.load()), "other values"


def _change(folder: pathlib.Path, name: str, kind: str, given: list[Any]) -> None:
    """Make one edit."""
    path = folder / name
    others = [folder / given[0]] if kind in ("swap", "copy", "rename") else []
    if any(x.exists() and not (x.is_file() or x.is_dir()) for x in (path, *others)):
        raise OSError("a pipe or a device, of which nothing is read here")
    if kind == "new":
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x" * 32)
    elif kind in ("swap", "copy", "rename"):
        _exchange(path, folder / given[0], kind)
    elif kind in ("remove", "folder", "filled", "link", "pipe"):
        _replace(path, kind, given)
    elif kind in ("json", "manifest"):
        _set(path, kind, *given)
    else:
        path.write_bytes(_bytes(path.read_bytes(), kind, given))


def _exchange(path: pathlib.Path, other: pathlib.Path, kind: str) -> None:
    other.parent.mkdir(parents=True, exist_ok=True)
    if kind == "rename":
        path.rename(other)
    else:
        content, before = path.read_bytes(), other.read_bytes() if other.is_file() else b""
        other.write_bytes(content)
        if kind == "swap":
            path.write_bytes(before)


def _replace(path: pathlib.Path, kind: str, given: list[Any]) -> None:
    shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    if kind in ("folder", "filled"):
        path.mkdir()
        (path / "mine").write_text("mine") if kind == "filled" else None
    elif kind == "link":
        path.symlink_to(path if given[0] == "loop" else given[0])
    elif kind == "pipe":
        os.mkfifo(path)


def _bytes(content: bytes, kind: str, given: list[Any]) -> bytes:
    changed, place = bytearray(content), int(given[0] * len(content)) if given and len(content) else 0
    if kind == "empty":
        return b""
    if kind == "cut":
        return content[:place]
    if kind == "append":
        return content + b"\0" * given[0]
    if kind == "text":
        return content[:place] + given[1].encode("utf-8", "surrogatepass") + content[place:]
    if kind == "flip":
        changed[place] ^= 1 << given[1] % 8
    else:
        changed[place : place + 8] = bytes([given[1]]) * 8
    return bytes(changed)


def _set(path: pathlib.Path, kind: str, at: float, value: Any, sign: bool) -> None:
    """Set a value somewhere in a description; in the manifest also as one who knows how its digest is computed."""
    content = json.loads(path.read_text())
    record = json.loads(content["attributes"]["manifest"]) if kind == "manifest" else content
    places = list(_places(record))
    holder, key = places[int(at * len(places))]
    holder[key] = value
    if kind == "manifest":
        if sign:
            record["identity"] = manifest._identity(record)
        content["attributes"]["manifest"] = json.dumps(record)
    path.write_text(json.dumps(content))


def _places(node: Any) -> Any:
    """Yield all places in plain data: what holds each, and its key."""
    for key, entry in list(node.items() if isinstance(node, dict) else enumerate(node)):
        yield node, key
        if isinstance(entry, dict | list):
            yield from _places(entry)
