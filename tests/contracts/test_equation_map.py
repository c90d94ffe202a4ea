"""The map of the papers' equations leads to public names, and to tests that use these names."""

import ast
import functools
import importlib
import inspect
import pathlib
import re

import pytest

from tests.contracts.calls import among, used_by

ROOT = pathlib.Path(__file__).parents[2]
PAGE = ROOT / "docs" / "equations.md"
ROW = re.compile(r"^\| (?P<number>[SN] A?\d+) \| `(?P<name>[\w.]+)` \| (?P<test>definition|`[^`]+`) \|$")
SOMMER = [f"S {k}" for k in range(1, 112)] + [f"S A{k}" for k in range(1, 35)]
NEGREAN = [f"N {k}" for k in range(1, 147)]
SYMBOLS = ["S 20", "S 60", "S 72", *(f"N {k}" for k in (1, 2, 4, 5, 9, 10, 27, 28, 74))]  # what a symbol means
DEFINITIONS = [*SYMBOLS, "N 80", "N 108"]  # and which numbers are meant


def table_rows():
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith(("| S ", "| N "))]
    matches = [(line, ROW.match(line)) for line in lines]
    malformed = [line for line, match in matches if match is None]
    assert not malformed, f"rows that are not '| S or N number | `name` | `file::test` |': {malformed}"
    return [{key: part.strip("`") for key, part in match.groupdict().items()} for _, match in matches if match]


def checked_rows():
    return [row for row in table_rows() if row["test"] != "definition"]


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
            found = inspect.getattr_static(found, attribute) if inspect.isclass(found) else getattr(found, attribute)
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
    named = sorted({row["test"].partition("::")[::2] for row in checked_rows()})
    assert not [f"{path}::{name}" for path, name in named if name not in functions_of_tests(path)]


def test_definitions_are_those_that_define_a_symbol():
    assert [row["number"] for row in table_rows() if row["test"] == "definition"] == DEFINITIONS


@functools.cache
def uses(test):
    path, _, name = test.partition("::")
    return used_by(path.removesuffix(".py").replace("/", "."), name)


def test_every_test_uses_the_name_beside_it():
    assert not [row for row in checked_rows() if not among(find_name(row["name"]), uses(row["test"]))]


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
