"""Texts of any size for each reader, and a clock: what takes more than its share of a longer text is told.

``python -m tests.fuzz --growth 20000`` reads each text at a size and at four times it. Most are refused, and that must
not take longer, either.
"""

from __future__ import annotations

import contextlib
import pathlib
import tempfile
import time
import warnings
from collections.abc import Callable

import jounce as jn
from jounce.errors import JounceError

LEAST = 0.5  # s; what takes less is no trouble
MOST = 10.0  # of the time for four times the size; 4 is in proportion, 16 the square
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def _robot(content: str) -> str:
    return f'<robot name="r"><link name="b"/>{content}</robot>'


def _chain(count: int, *, followers: bool) -> str:
    parts = []
    for k in range(count):
        parent = "b" if followers or k == 0 else f"l{k - 1}"
        mimic = f'<mimic joint="j{k - 1}"/>' if followers and k else ""
        joint = (
            f'<joint name="j{k}" type="revolute"><parent link="{parent}"/><child link="l{k}"/>{LIMIT}{mimic}</joint>'
        )
        parts.append(f'<link name="l{k}">{INERTIAL}</link>{joint}')
    return _robot("".join(parts))


TEXTS: dict[str, Callable[[int], str]] = {
    "a string.toml": lambda n: f'title = "{"a" * n}"\n',
    "escapes in a string.toml": lambda n: 'title = "' + '\\"' * (n // 2) + '"\n',
    "quotes in a string.toml": lambda n: 'title = "' + "'a" * (n // 2) + '"\n',
    "commas and quotes.toml": lambda n: "title = '" + ',"' * (n // 2) + "'\n",
    "words in a string.toml": lambda n: 'title = "' + ", aaaaaaa" * (n // 9) + '"\n',
    "an open string.toml": lambda n: 'title = "' + "a" * n,
    "several lines.toml": lambda n: 'title = """\n' + "a . \\\" '\n" * (n // 9) + '"""\n',
    "spaces.toml": lambda n: "a" + " " * n + "\n",
    "keys.toml": lambda n: "[parameters]\n" + "".join(f"p{k} = 1\n" for k in range(n // 8)),
    "an inline table.toml": lambda n: "parameters = {" + ", ".join(f"p{k} = 1" for k in range(n // 9)) + "}\n",
    "an array.toml": lambda n: "x = [" + "1,\n" * (n // 3) + "]\n",
    "tables.toml": lambda n: "".join(f"[bodies.b{k}]\nangle = 1\n" for k in range(n // 24)),
    "a string.yaml": lambda n: f'title: "{"a" * n}"\n',
    "words.yaml": lambda n: "title: " + "a " * (n // 2) + "\n",
    "a block.yaml": lambda n: "title: |\n" + "  a\n" * (n // 4),
    "keys.yaml": lambda n: "parameters:\n" + "".join(f"  p{k}: 1\n" for k in range(n // 9)),
    "a list.yaml": lambda n: "x: [" + "1, " * (n // 3) + "]\n",
    "a comment.yaml": lambda n: "#" * n + "\na: 1\n",
    "parameters of parameters.yaml": lambda n: (
        "space: planar\nparameters:\n  p0: 1\n" + "".join(f"  p{k + 1}: p{k}\n" for k in range(n // 14))
    ),
    "a sum.yaml": lambda n: "space: planar\nparameters: {b: " + "1+" * (n // 2) + "1}\n",
    "keys.json": lambda n: '{"parameters": {' + ",\n".join(f'"p{k}": 1' for k in range(n // 11)) + "}}",
    "a string.json": lambda n: '{"title": "' + "a" * n + '"}',
    "text between elements.urdf": lambda n: _robot("aaaa<x/>" * (n // 8)),
    "an attribute.urdf": lambda n: _robot(f'<link name="a" x="{"1 " * (n // 2)}"/>'),
    "a chain.urdf": lambda n: _chain(n // 250, followers=False),
    "followers.urdf": lambda n: _chain(n // 280, followers=True),
    "comments.urdf": lambda n: _robot("<!-- a -->" * (n // 10)),
    "text between elements.sdf": lambda n: f'<sdf version="1.9"><model name="m">{"aaaa<x/>" * (n // 8)}</model></sdf>',
    "numbers.csv": lambda n: "time,a\n" + "".join(f"{k},1\n" for k in range(n // 8)),
    "a row.csv": lambda n: "time," + ",".join(f"c{k}" for k in range(n // 6)) + "\n",
}


def seconds(name: str, size: int) -> float:
    """Return the least time of two readings of a text."""
    kind = name.rpartition(".")[2]
    read = {"urdf": jn.load_robot, "sdf": jn.load_robot, "csv": jn.load_trajectory}.get(kind, jn.load)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = pathlib.Path(folder, f"text.{kind}")
        path.write_text(TEXTS[name](size), encoding="utf-8")
        found = []
        for _ in range(2):
            started = time.process_time()
            with contextlib.suppress(JounceError):
                read(path)
            found.append(time.process_time() - started)
    return min(found)


def grows(name: str, size: int) -> tuple[float, float, bool]:
    """Return the times at a size and at four times it, and whether the second is out of proportion."""
    small, large = seconds(name, size), seconds(name, 4 * size)
    return small, large, large > LEAST and large > MOST * small


def report(size: int) -> int:
    """Print the times of all texts, and return 1 if one grows out of proportion."""
    failed = 0
    for name in TEXTS:
        small, large, out = grows(name, size)
        failed |= out
        print(
            f"{name:32}{small:9.3f} s{large:9.3f} s{large / small:7.1f}{'  out of proportion' if out else ''}",
            flush=True,
        )
    return int(failed)
