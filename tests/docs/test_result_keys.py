"""The table of docs/command_line.md lists every key that commands print with ``--json``."""

import pathlib
import re

import pytest
from typing_extensions import get_type_hints

from jounce.reporting.json.result_schema import RESULTS

PAGE = (pathlib.Path(__file__).parents[2] / "docs" / "command_line.md").read_text()
EVERYWHERE = {"jounce", "record", "command"}


@pytest.mark.parametrize("name", RESULTS)
def test_the_table_lists_every_key_of_a_result(name):
    command = name.split("_")[0]
    rows = re.findall(rf"^\| `{command}`.*$", PAGE, re.MULTILINE)
    if any("those of `run`" in row for row in rows):
        rows += re.findall(r"^\| `run`.*$", PAGE, re.MULTILINE)
    listed = set(re.findall(r"`(\w+)`", " ".join(rows)))
    assert set(get_type_hints(RESULTS[name])) - EVERYWHERE <= listed
