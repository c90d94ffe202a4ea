"""Texts of any size for each reader, and a clock: what takes more than its share of a longer text is told.

``python -m tests.fuzz --growth 20000`` reads each text at a size and at four times it. Most are refused, and that must
not take longer, either.
"""

from __future__ import annotations

import contextlib
import json
import pathlib
import tempfile
import time
import warnings
from collections.abc import Callable

import jounce as jn
from jounce.errors import JounceError
from tests.fuzz.cases import LEAST, MOST
from tests.fuzz.folders import grown_sweep
from tests.fuzz.forks import forked
from tests.fuzz.results import netcdf_of

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


TEXTS: dict[str, Callable[[int], str | bytes]] = {
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
    "rows of results.csv": lambda n: "time,a,a_d1\n" + "0,1,2\n" * (n // 6),
    "columns of results.csv": lambda n: f"time,{','.join(f'c{k}' for k in range(n // 8))}\n0{',1' * (n // 8)}\n",
    "derivatives of results.csv": lambda n: f"time,a{''.join(f',a_d{k + 1}' for k in range(n // 8))}\n",
    "brackets of results.csv": lambda n: f"time,{'[a' * (n // 2)}]\n0,1\n",
    "blanks of results.csv": lambda n: f"time,a{' ' * n}[m\n0,1\n",
    "quotes of results.csv": lambda n: "time," + '""' * (n // 2) + "\n0,1\n",
    "instants.nc": lambda n: netcdf_of(n // 16),
    "quantities.nc": lambda n: netcdf_of(2, names=n // 500),
    "an attribute.nc": lambda n: netcdf_of(2, attribute="a" * min(n, 60_000)),
    "half of a file.nc": lambda n: (content := netcdf_of(n // 16))[: len(content) // 2],
    "zeros.nc": lambda n: netcdf_of(2)[:200] + bytes(n),
    "chunks.sweep": lambda n: json.dumps({"chunks": n // 500}),
    "an attribute.sweep": lambda n: json.dumps({"comment": "a" * n}),
    "nested attributes.sweep": lambda n: json.dumps({"comment": [[[]]] * (n // 8)}),
    "other files.sweep": lambda n: json.dumps({"files": n // 100}),
}


def _result(path: pathlib.Path) -> None:
    with forked():
        jn.io.read(path)


READS: dict[str, Callable[[pathlib.Path], object]] = {
    "urdf": jn.load_robot,
    "sdf": jn.load_robot,
    "csv": jn.load_trajectory,
    "nc": _result,
}


def seconds(name: str, size: int) -> float:
    """Return the least time of two readings of a text."""
    kind = name.rpartition(".")[2]
    read = jn.io.read if "of results" in name else READS.get(kind, jn.load)
    clock = time.perf_counter if kind == "nc" else time.process_time  # another process reads it first
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = pathlib.Path(folder, f"text.{kind}")
        content = TEXTS[name](size)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        if kind == "sweep":
            path, read = grown_sweep(path)
        found = []
        for _ in range(2):
            started = clock()
            with contextlib.suppress(JounceError):
                read(path)
            found.append(clock() - started)
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
