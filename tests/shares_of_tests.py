"""Which of the collected tests run: the cases of a list are slow tests, of which a run may take a share.

The slow tests take hours, nine tenths of them in JAX and XLA, which compile each mechanism anew. A check before
each submission has not that long: it runs the share of the day, and the tests of what changed as far as another share
goes. Whoever changes what slow tests cover runs all.
"""

import argparse
import math
import pathlib
import subprocess
from collections import Counter

import pytest

LIST = pathlib.Path(__file__).with_name("slow_cases.txt")
SLOW_CASES = frozenset(LIST.read_text().splitlines())
"""Examples of docstrings, and some cases of tests with parameters, that take more than two seconds."""


def share(text):
    """Return which share is meant by K/N."""
    try:
        which, count = map(int, text.split("/"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"a share is K/N, such as 1/3, got {text!r}") from None
    if not 1 <= which <= count:
        raise argparse.ArgumentTypeError(f"of {count} shares, K is 1 to {count}, got {which}")
    return which, count


def pytest_addoption(parser):
    """Add the options of a share and of what changed."""
    parser.addoption("--share", type=share, default=(1, 1), metavar="K/N", help="the K-th of N shares of the tests")
    parser.addoption(
        "--changed-since",
        metavar="COMMIT",
        help="also the slow tests of the files that changed most since a commit, as many files as a share has",
    )


@pytest.hookimpl(tryfirst=True)  # before pytest selects by marks
def pytest_collection_modifyitems(config, items):
    """Mark cases of the list, and leave out the files of other shares: those of one file share compiled programs."""
    found = {item.nodeid for item in items}
    for item in items:
        if item.nodeid in SLOW_CASES:
            item.add_marker(pytest.mark.slow)
    if not any("::" in word for word in config.args) and (gone := missing(found)):
        raise pytest.UsageError(f"{LIST.name}: {gone[0]} is no test of its file: correct the list")
    slow = {item for item in items if item.get_closest_marker("slow")}
    which, count = config.getoption("share")
    left_out = slow & elsewhere(slow, which, count)
    if left_out and (commit := config.getoption("changed_since")):
        files = {item.path for item in slow}
        changed = most_changed(changed_lines(config.rootpath, commit), files, config.rootpath, count)
        left_out = {item for item in left_out if item.path not in changed}
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
        items[:] = [item for item in items if item not in left_out]


def missing(found):
    """Return the cases of the list that the files of the found ones do not have."""
    files = {name.partition("::")[0] for name in found}
    return sorted(name for name in SLOW_CASES - found if name.partition("::")[0] in files)


def elsewhere(items, which, count):
    """Return the tests of other shares: the files are dealt out in the order of their names."""
    files = sorted({item.path for item in items})
    return {item for item in items if files.index(item.path) % count != which - 1}


def most_changed(lines, files, root, count):
    """Return the test files of what changed, those of most changed lines first, at most one in so many of all files.

    A test file is that of itself, and of the module that it mirrors: ``tests/a/test_b.py`` of ``src/jounce/a/b.py``.
    """
    in_order = sorted(files)  # or processes would choose differently among files of as many changed lines
    sizes = Counter({file: sum(lines[name] for name in covered(file.relative_to(root))) for file in in_order})
    return {file for file, size in sizes.most_common(math.ceil(len(files) / count)) if size}


def covered(file):
    """Return the paths of which a test file is the test: its own, and that of the module that it mirrors."""
    module = pathlib.Path("src/jounce", *file.parts[1:-1], file.name.removeprefix("test_"))
    return {file.as_posix(), module.as_posix()}


def changed_lines(root, commit):
    """Return how many lines of each file changed since a commit."""
    done = subprocess.run(
        ["git", "diff", "--numstat", "--no-renames", commit, "--", "src", "tests"],
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    rows = (line.split("\t") for line in done.stdout.splitlines())
    return Counter({name: int(added) + int(removed) for added, removed, name in rows if added != "-"})
