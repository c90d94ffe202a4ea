"""Types are checked while tests run: in the functions, methods and dataclasses of jounce, by beartype.

Functions within functions are left out. They would be given checks anew at each call of the function around them,
which took half of the time of all tests; their values are checked where they are handed on. This is imported before
anything of jounce.
"""

import ast
import builtins
import os
import sys
from importlib.machinery import PathFinder, SourceFileLoader
from importlib.util import decode_source
from typing import get_args

import jaxtyping
from beartype import BeartypeConf, beartype

PACKAGE = "jounce"
BUILTIN = "_checked_by_the_tests"  # by which modules find `checked`, wherever they import from
bare = beartype(conf=BeartypeConf(violation_type=TypeError))  # as Python itself says it


def checked(thing):
    """Check types at each call of a function, or when an instance of a dataclass is made.

    Axes of one name are compared in functions whose annotations hold shapes; the others go without the cost of that.
    """
    if isinstance(thing, type) or any(map(_holds_shape, getattr(thing, "__annotations__", {}).values())):
        return jaxtyping.jaxtyped(thing, typechecker=bare)
    return bare(thing)


def _holds_shape(annotation):
    return getattr(annotation, "__module__", "") == "jaxtyping" or any(map(_holds_shape, get_args(annotation)))


class Decorated(ast.NodeTransformer):
    """A module whose outermost functions and methods, before other decorators, and classes, after them, are checked.

    What it imports for annotations only is imported too, at its end.
    """

    def visit_Module(self, node):
        self.generic_visit(node)
        for part in list(node.body):
            if isinstance(part, ast.If) and ast.unparse(part.test) == "TYPE_CHECKING":
                node.body += part.body
        return node

    def visit_FunctionDef(self, node):
        node.decorator_list.append(_checked(node))
        return node

    visit_AsyncFunctionDef = visit_FunctionDef  # noqa: N815 - the name is Python's

    def visit_ClassDef(self, node):
        self.generic_visit(node)
        node.decorator_list.insert(0, _checked(node))
        return node


def _checked(node):
    return ast.copy_location(ast.Name(BUILTIN, ast.Load()), node)


class Loader(SourceFileLoader):
    """A loader that leaves no compiled files behind, which others would load."""

    def get_code(self, fullname):
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)

    def source_to_code(self, data, path, **_):
        tree = Decorated().visit(ast.parse(decode_source(data), path))
        return compile(tree, path, "exec", dont_inherit=True)


class Finder:
    """Finds the modules of the package."""

    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] != PACKAGE:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = Loader(spec.loader.name, spec.loader.path)
        return spec


if PACKAGE in sys.modules:
    raise RuntimeError(f"{PACKAGE} was imported before its types could be checked")
only_deals_out = "PYTEST_XDIST_WORKER" not in os.environ and any(word.startswith("-n") for word in sys.argv)
if not jaxtyping.config.jaxtyping_disable and not only_deals_out:  # JAXTYPING_DISABLE=1, as for the slow tests
    setattr(builtins, BUILTIN, checked)
    sys.meta_path.insert(0, Finder)
