"""The map of the papers' equations leads to code that exists and tests that exist."""

import ast
import functools
import importlib
import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).parents[2]
PAGE = ROOT / "docs" / "equations.md"
ROW = re.compile(r"^\| (?P<number>[SN] A?\d+) \| `(?P<name>[\w.]+)` \| `(?P<test>[^`]+)` \|$")
SOMMER = [f"S {k}" for k in range(1, 112)] + [f"S A{k}" for k in range(1, 35)]
NEGREAN = [f"N {k}" for k in range(1, 147)]


def table_rows():
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith(("| S ", "| N "))]
    matches = [(line, ROW.match(line)) for line in lines]
    malformed = [line for line, match in matches if match is None]
    assert not malformed, f"rows that are not '| S or N number | `name` | `file::test` |': {malformed}"
    return [match.groupdict() for _, match in matches if match]


@functools.cache
def functions_of_tests(path):
    """Names of the test functions of a file, those in classes as Class::name."""
    if not (ROOT / path).is_file():
        return set()
    tree = ast.parse((ROOT / path).read_text())
    found = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            found.add(node.name)
        elif isinstance(node, ast.ClassDef):
            found |= {f"{node.name}::{inner.name}" for inner in node.body if isinstance(inner, ast.FunctionDef)}
    return {name for name in found if name.rpartition("::")[2].startswith("test_")}


def find_name(dotted):
    """The object that a dotted name leads to: a module, then attributes."""
    parts = dotted.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for attribute in parts[cut:]:
            found = getattr(found, attribute)
        return found
    raise ModuleNotFoundError(dotted)


def test_every_equation_has_exactly_one_row():
    assert [row["number"] for row in table_rows()] == SOMMER + NEGREAN


def test_every_name_exists_and_is_public():
    names = sorted({row["name"] for row in table_rows()})
    assert all(name.startswith("jounce.") for name in names)
    assert not [name for name in names if any(part.startswith("_") for part in name.split("."))]
    assert all(find_name(name) is not None for name in names)


def test_every_test_exists():
    named = sorted({row["test"].partition("::")[::2] for row in table_rows()})
    assert not [f"{path}::{name}" for path, name in named if name not in functions_of_tests(path)]


def test_a_row_that_points_at_nothing_is_found():
    with pytest.raises(AttributeError):
        find_name("jounce.constraints.planar.Revolver")
    with pytest.raises(ModuleNotFoundError):
        find_name("jounced.planar")
    assert "test_no_such_test" not in functions_of_tests("tests/contracts/test_equation_map.py")
    assert "test_every_test_exists" in functions_of_tests("tests/contracts/test_equation_map.py")


def test_errata_name_tests_that_exist():
    named = re.findall(r"`(tests/[\w/]+\.py)::([\w:]+)`", (ROOT / "docs" / "errata.md").read_text())
    assert named
    missing = [f"{path}::{name}" for path, name in named if name not in functions_of_tests(path)]
    assert not missing
