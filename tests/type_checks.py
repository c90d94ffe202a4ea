"""Types are checked while tests run: in the functions, methods and dataclasses of jounce, by beartype.

Functions within functions are left out. They would be given checks anew at each call of the function around them,
which took half of the time of all tests; their values are checked where they are handed on. This is imported before
anything of jounce.
"""

import argparse
import ast
import builtins
import dataclasses
import functools
import inspect
import os
import sys
import types
from importlib.machinery import PathFinder, SourceFileLoader
from importlib.util import decode_source
from typing import get_args

import jaxtyping
from beartype import BeartypeConf, beartype

PACKAGE = "jounce"
BUILTIN = "_checked_by_the_tests"  # by which modules find `checked`, wherever they import from
bare = beartype(conf=BeartypeConf(violation_type=TypeError))  # as Python itself says it


axes = jaxtyping.jaxtyped("context")  # within it, axes of one name are equally long


def checked(thing):
    """Check types at each call of a function, or when an instance of a dataclass is made."""
    if not isinstance(thing, type):
        return _checked_function(thing)
    start = vars(thing).get("__init__")
    if dataclasses.is_dataclass(thing) and isinstance(start, types.FunctionType):
        thing.__init__ = _checked_start(start)
    return thing


def _checked_start(start):
    """Check the types of a dataclass's fields; text among them may name what only other modules know."""
    if hasattr(start, BUILTIN):
        return start
    if any(isinstance(annotation, str) for annotation in start.__annotations__.values()):
        return jaxtyping.jaxtyped(start, typechecker=bare)
    return _checked_function(start)


def _among_axes_of_its_own(function):
    @functools.wraps(function)
    def result(*args, **kwargs):
        with axes:
            return function(*args, **kwargs)

    return result


def _checked_function(function):
    """Compare axes of one name in functions whose annotations hold shapes; the others go without the cost of that.

    The decorator of jaxtyping binds the arguments and checks them twice, which takes twenty times as long as the checks
    themselves. It is needed for axes that are as long as an argument says, such as ``{order}+1``, and for generators,
    whose arguments are checked when they first run.
    """
    shapes = [shape for annotation in function.__annotations__.values() for shape in _shapes(annotation)]
    if any("{" in shape for shape in shapes) or (shapes and inspect.isgeneratorfunction(function)):
        result = jaxtyping.jaxtyped(function, typechecker=bare)
    else:
        result = _among_axes_of_its_own(bare(function)) if shapes else bare(function)
    setattr(result, BUILTIN, True)
    return result


def _shapes(annotation):
    """Yield the shapes that an annotation holds."""
    annotation = getattr(annotation, "__value__", annotation)  # of an alias
    if getattr(annotation, "__module__", "") == "jaxtyping":
        yield annotation.dim_str
    else:
        for part in get_args(annotation):
            yield from _shapes(part)


class Decorated(ast.NodeTransformer):
    """A module whose outermost functions and methods, before other decorators, and classes, after them, are checked.

    What it imports for annotations only is imported too, at its end.
    """

    def visit_Module(self, node):
        self.generic_visit(node)
        for part in list(node.body):
            if isinstance(part, ast.If) and ast.unparse(part.test) == "TYPE_CHECKING" and not part.orelse:
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


def only_deals_out(words, environment):
    """Return whether pytest, called with these words, leaves all tests to other processes, which check the types.

    Where the words do not tell, it is taken to run tests itself: that costs seconds, and not the checks.
    """
    if "PYTEST_XDIST_WORKER" in environment:
        return False
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("-n", "--numprocesses", default="0")
    try:
        count = parser.parse_known_args(words)[0].numprocesses
    except argparse.ArgumentError:
        return False
    if count in ("auto", "logical"):
        return "--pdb" not in words  # with which pytest-xdist starts none
    return count.isdecimal() and int(count) > 0


if PACKAGE in sys.modules:
    raise RuntimeError(f"{PACKAGE} was imported before its types could be checked")
wanted = not jaxtyping.config.jaxtyping_disable  # JAXTYPING_DISABLE=1, as for the slow tests
installed = wanted and not only_deals_out(sys.argv[1:], os.environ)
if installed:
    setattr(builtins, BUILTIN, checked)
    sys.meta_path.insert(0, Finder)
