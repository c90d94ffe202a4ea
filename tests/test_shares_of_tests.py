"""Shares of the slow tests leave none out, and the dear examples are those of docstrings that are there."""

import argparse
import importlib
import pathlib

import pytest

from tests.shares_of_tests import SLOW_EXAMPLES, elsewhere, share


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


@pytest.mark.parametrize("name", sorted(SLOW_EXAMPLES))
def test_slow_examples_are_there(name):
    room, _, thing = name.rpartition(".")
    assert ">>> " in getattr(importlib.import_module(room), thing).__doc__
