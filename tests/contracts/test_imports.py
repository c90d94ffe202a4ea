"""No two files import one another, by whatever way: imports within functions and of packages count too."""

import pathlib

import grimp
import numpy as np
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
