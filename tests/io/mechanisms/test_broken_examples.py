"""The broken examples give the messages that stand in their second line."""

import pathlib

import pytest

from jounce.errors import MechanismFileError
from jounce.io import load

ROOT = pathlib.Path(__file__).parents[3]
BROKEN = sorted((ROOT / "examples" / "broken").glob("*.yaml"))


def test_there_are_thirteen():
    assert len(BROKEN) == 13


@pytest.mark.parametrize("path", BROKEN, ids=lambda path: path.stem)
def test_broken_example_gives_its_message(path, monkeypatch):
    monkeypatch.chdir(ROOT)
    expected = path.read_text().splitlines()[1].removeprefix("# ")
    with pytest.raises(MechanismFileError) as caught:
        load(path.relative_to(ROOT))
    assert str(caught.value) == expected
