"""Shares of the slow tests leave none out, and the list of slow cases names tests that are there."""

import argparse
import pathlib
import subprocess
from collections import Counter

import pytest

from tests.shares_of_tests import LIST, SLOW_CASES, changed_lines, elsewhere, missing, most_changed, share


class Item:
    def __init__(self, path):
        self.path = path


def test_each_test_is_in_one_share_with_the_others_of_its_file():
    items = [Item(pathlib.Path(f"test_{name}.py")) for name in "aabbbcdeffg"]
    for count in (1, 2, 3, 10):
        shares = [set(items) - elsewhere(items, which, count) for which in range(1, count + 1)]
        assert sum(map(len, shares)) == len(items)
        assert set().union(*shares) == set(items)
        files = [{item.path for item in part} for part in shares]
        assert sum(map(len, files)) == len(set("aabbbcdeffg"))


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "a/b", "1/0", "1/2/3", ""])
def test_what_is_no_share_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError):
        share(text)


def test_shares():
    assert share("2/3") == (2, 3)


def test_the_tests_of_what_changed_most_are_added():
    root = pathlib.Path("/r")
    files = {root / "tests" / name for name in ("a/test_b.py", "a/test_c.py", "test_d.py", "e/test_f.py")}
    lines = Counter({"src/jounce/a/b.py": 3, "tests/test_d.py": 5, "src/jounce/e/f.py": 1, "docs/x.md": 99})
    assert most_changed(lines, files, root, 1) == files - {root / "tests/a/test_c.py"}
    assert most_changed(lines, files, root, 2) == {root / "tests/test_d.py", root / "tests/a/test_b.py"}
    assert most_changed(lines, files, root, 4) == {root / "tests/test_d.py"}
    assert most_changed(Counter(), files, root, 1) == set()


def test_of_files_of_as_many_changed_lines_every_process_chooses_the_same():
    root = pathlib.Path("/root")
    files = [root / f"tests/test_{name}.py" for name in "abcdefgh"]
    lines = Counter({f"tests/test_{name}.py": 3 for name in "abcdefgh"})
    for order in (files, files[::-1], files[4:] + files[:4]):
        assert most_changed(lines, order, root, 4) == set(files[:2])


def test_lines_are_counted_since_a_commit(tmp_path):
    def git(*words):
        who = ["-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "core.hooksPath=/dev/null"]
        subprocess.run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True)

    (tmp_path / "src").mkdir()
    file = tmp_path / "src" / "a.py"
    git("init", "-q")
    file.write_text("1\n2\n")
    git("add", ".")
    git("commit", "-qm", "first")
    file.write_text("1\n3\n4\n")
    assert changed_lines(tmp_path, "HEAD") == {"src/a.py": 3}


def test_a_case_of_the_list_that_its_file_no_longer_has_is_found():
    name = min(SLOW_CASES)
    file = name.partition("::")[0]
    assert missing({f"{file}::another"})[0] == name
    assert missing({name for name in SLOW_CASES if name.startswith(file)}) == []


def test_files_of_the_list_are_there():
    assert [name for name in SLOW_CASES if not (LIST.parents[1] / name.partition("::")[0]).is_file()] == []
