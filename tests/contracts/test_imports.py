"""No two files import one another, by whatever way: imports within functions and of packages count too.

An import by a name that is made up while the program runs is seen by no such check, so there is none of own modules.
"""

import ast
import pathlib

import grimp
import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

SOURCE = pathlib.Path(__file__).parents[2] / "src" / "jounce"


def circles(graph):
    """Return the sets of modules each of which leads to all others."""
    modules = sorted(graph.modules)
    number = {module: k for k, module in enumerate(modules)}
    matrix = np.zeros((len(modules), len(modules)), bool)
    for module in modules:
        for imported in graph.find_modules_directly_imported_by(module):
            matrix[number[module], number[imported]] = True
    count, labels = connected_components(matrix, directed=True, connection="strong")
    sizes = np.bincount(labels, minlength=count)
    return [[m for m in modules if labels[number[m]] == k] for k in np.flatnonzero(sizes > 1)]


def test_no_files_import_one_another():
    graph = grimp.build_graph("jounce", cache_dir=None)
    assert len(graph.modules) == len(list(SOURCE.rglob("*.py")))
    assert circles(graph) == []


def test_a_circle_would_be_found():
    graph = grimp.ImportGraph()
    for module in ("a", "a.b", "a.c"):
        graph.add_module(module)
    graph.add_import(importer="a", imported="a.b")
    graph.add_import(importer="a.b", imported="a.c")
    assert circles(graph) == []
    graph.add_import(importer="a.c", imported="a")
    assert circles(graph) == [["a", "a.b", "a.c"]]


def test_nothing_imports_the_package_that_offers_everything():
    graph = grimp.build_graph("jounce", cache_dir=None)
    assert graph.find_modules_that_directly_import("jounce") == set()
    assert "jounce.reporting.notebook" in graph.find_modules_directly_imported_by("jounce")


BY_NAME = ("__import__", "import_module", "reload")


def unseen_imports(text):
    """Return the lines of a program that import by a name, unless it is written there and that of another package."""
    calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
    for call in calls:
        if getattr(call.func, "attr", getattr(call.func, "id", "")) in BY_NAME:
            name = call.args[0].value if call.args and isinstance(call.args[0], ast.Constant) else ""
            if name.split(".")[0] in ("", "jounce"):
                yield call.lineno


def test_own_modules_are_imported_by_statements():
    found = {file: [*unseen_imports(file.read_text(encoding="utf-8"))] for file in SOURCE.rglob("*.py")}
    assert len(found.pop(SOURCE / "__init__.py")) == 2  # the names of its stub, each when it is first used
    assert {file: lines for file, lines in found.items() if lines} == {}


@pytest.mark.parametrize(
    "line, unseen",
    [
        ("importlib.import_module('jounce.jet')", True),
        ("import_module(name)", True),
        ("__import__('jounce')", True),
        ("importlib.import_module('.jet', __package__)", True),
        ("importlib.import_module('mujoco')", False),
        ("from jounce import jet", False),
    ],
)
def test_what_counts_as_unseen(line, unseen):
    assert [*unseen_imports(line)] == [1] * unseen
