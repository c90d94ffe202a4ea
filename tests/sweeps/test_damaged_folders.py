"""Sweeps whose folder was altered: each is computed again with a warning, or refused by name; none ends otherwise.

The folder is that of a small sweep, whose designs are solved once; what is computed again is the same to the last bit.
"""

import json
import os
import pathlib
import shutil

import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError, OutputError
from jounce.sweeps import manifest
from jounce.sweeps.problems import Motions
from jounce.sweeps.sweep import prepare, run

LONG = {"BC": [0.10, 0.11, 0.12], "AB": [0.03]}
PROBLEM = Motions(jn.load("examples/four_bar.yaml"), np.linspace(0.0, 1.0, 3), 1)


def swept(folder, problem=PROBLEM, vary=LONG, **given):
    return run(prepare(problem, vary, folder, "four-bar", {}, **{"chunk": 2} | given), workers=0)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A sweep of two chunks."""
    folder = tmp_path_factory.mktemp("whole") / "a.zarr"
    return folder, swept(folder)


@pytest.fixture
def solved(monkeypatch):
    """Solve each chunk once in this file: what is computed again is taken from there."""
    plain = Motions.histories

    def histories(self, designs, threads):
        key = tuple(values.tobytes() for values in designs.values())
        if key not in _solved:
            _solved[key] = plain(self, designs, threads)
        return _solved[key]

    monkeypatch.setattr(Motions, "histories", histories)


_solved = {}


def content_of(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def remove(path):
    path.unlink()


def empty(path):
    path.write_bytes(b"")


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def lengthen(path):
    path.write_bytes(path.read_bytes() + b"\0" * 40)


def scramble(path):
    path.write_bytes(bytes(range(256)) * 4)


def turn_bits(path):
    path.write_bytes(bytes(byte ^ 0x10 for byte in path.read_bytes()))


def nest(path):
    path.write_bytes(b"[" * 100_000)


def number(path):
    path.write_bytes(b"17")


def make_folder(path):
    path.unlink()
    path.mkdir()


def fill_folder(path):
    make_folder(path)
    (path / "mine").write_text("mine")


def link_to_nothing(path):
    path.unlink()
    path.symlink_to(path.parents[len(path.parents) - 2] / "outside" / "planted")


def link_to_itself(path):
    path.unlink()
    path.symlink_to(path)


def link_to_copy(path):
    kept = path.with_name("moved")
    path.rename(kept)
    path.symlink_to(kept)


def link_to_device(path):
    path.unlink()
    path.symlink_to("/dev/zero")


def pipe(path):
    path.unlink()
    os.mkfifo(path)


CHANGES = [
    remove, empty, cut, lengthen, scramble, turn_bits, nest, number, make_folder, fill_folder, link_to_nothing,
    link_to_itself, link_to_copy, link_to_device, pipe,
]  # fmt: skip
FILES = [
    "zarr.json",
    "psi_peak/zarr.json",
    "psi_peak/c/0/0",
    "BC/c/1",
    "time/zarr.json",
    "time/c/0",
    "component/c/0",
    "chunks/zarr.json",
    "chunks/digest/zarr.json",
    "chunks/digest/c/0",
]


def judged(folder, whole, recwarn):
    """Go on with a sweep; return whether it was refused, mended with a warning, or is what it was."""
    recwarn.clear()
    before = content_of(folder)
    try:
        with pytest.warns(jn.DamageWarning) if _differs(folder, whole[0]) else _nothing():
            checksum = swept(folder)
    except OutputError as error:
        assert str(folder) in str(error)
        assert content_of(folder).keys() == before.keys()
        return "refused"
    assert checksum == whole[1]
    wanted = content_of(whole[0])
    found = content_of(folder)
    for name in wanted:
        assert found[name] == wanted[name] or json.loads(found[name]) == json.loads(wanted[name]), name
    return "mended"


def _differs(folder, whole):
    wanted = content_of(whole)
    found = {name: (folder / name).read_bytes() for name in wanted if (folder / name).is_file() and _small(folder / name)}
    return found != wanted


def _small(path):
    return path.resolve().is_file()


class _nothing:
    def __enter__(self):
        pass

    def __exit__(self, *_):
        pass
