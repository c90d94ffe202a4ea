"""What a test uses: the objects that its source leads to, with its helpers, fixtures and tables, without running it.

Names are resolved to the objects that they stand for, so that an alias is no obstacle and a name that only looks alike
is no help. Helpers in `tests` are followed, the library is not: what it calls itself does not count. What is only
imported, asked for by `isinstance`, expected by `pytest.raises`, or written as an annotation, is not used. A method
counts where the class of the object before the dot is known.
"""

import ast
import builtins
import functools
import importlib
import inspect
import types
import typing

NOT_USED_BY = ("isinstance", "issubclass", "hasattr", "raises", "warns")
MISSING = object()


@functools.cache
def module_of(name):
    """Return a module and its syntax tree."""
    module = importlib.import_module(name)
    return module, ast.parse(inspect.getsource(module))


def is_ours(name):
    return name is not None and name.partition(".")[0] == "tests"


def plain(value):
    """Return the function or the class below a cache or a wrapper of it; anything else as it is."""
    wrapped = getattr(value, "__wrapped__", None)
    return plain(wrapped) if inspect.isroutine(wrapped) or inspect.isclass(wrapped) else value


def among(one, used):
    """Tell whether an object is among those that are used."""
    return any(plain(other) is plain(one) for other in used)


def used_by(module, test):
    """Return the objects of the library that a test uses; `test` is a function, or Class::function."""
    walk = Walk(module)
    owner, _, name = test.rpartition("::")
    body = walk.tree.body if not owner else walk.definition(owner).body
    node = next(n for n in body if isinstance(n, ast.FunctionDef) and n.name == name)
    walk.function(node, owner=walk.module.__dict__[owner] if owner else None)
    return list(walk.found.values())


class Walk:
    """A walk through a module of tests; `found` and `seen` are shared by those that it leads to."""

    def __init__(self, module, found=None, seen=None):
        self.module, self.tree = module_of(module)
        self.found = {} if found is None else found
        self.seen = set() if seen is None else seen

    def definition(self, name):
        return next((n for n in self.tree.body if getattr(n, "name", None) == name), None)

    def in_module(self, name):
        return self if name == self.module.__name__ else Walk(name, self.found, self.seen)

    def function(self, node, owner=None):
        if (key := (self.module.__name__, node.lineno, owner)) in self.seen:
            return
        self.seen.add(key)
        scope = Scope(self, node, owner)
        for part in (*node.decorator_list, *node.body, *node.args.defaults):
            scope.visit(part)
        for parameter in scope.parameters:
            self.fixture(parameter)

    def fixture(self, name):
        for module in (self.module.__name__, "tests.conftest"):
            walk = self.in_module(module)
            node = walk.definition(name)
            if isinstance(node, ast.FunctionDef) and any("fixture" in ast.dump(d) for d in node.decorator_list):
                walk.function(node)
                return

    def use(self, value, name):
        """Take an object that is used under a name of this module."""
        value = plain(value)
        home = getattr(value, "__module__", None)
        if isinstance(value, types.ModuleType):
            return
        if inspect.isclass(value) and is_ours(home):
            self.in_module(home).whole_class(value)
        elif inspect.isfunction(value) and is_ours(home):
            walk = self.in_module(home)
            if (node := walk.node_of(value)) is not None:
                walk.function(node, walk.owner_of(value))
        elif inspect.isclass(value) or inspect.isroutine(value) or not self.constant(name):
            self.found[id(value)] = value

    def constant(self, name):
        """Visit what a name of the module is assigned; a name from another module of tests is looked up there."""
        for node in self.tree.body:
            if isinstance(node, ast.ImportFrom) and is_ours(node.module):
                for alias in node.names:
                    if (alias.asname or alias.name) == name:
                        return self.in_module(node.module).constant(alias.name)
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            if any(isinstance(t, ast.Name) and t.id == name for target in targets if target for t in ast.walk(target)):
                if (key := (self.module.__name__, node.lineno, None)) not in self.seen:
                    self.seen.add(key)
                    Scope(self, None, None).visit(node.value)
                return True
        return False

    def whole_class(self, kind):
        """Visit how a class of tests is made; its methods are visited where they are called."""
        for base in kind.__mro__:
            if is_ours(base.__module__):
                walk = self.in_module(base.__module__)
                node = walk.definition(base.__name__)
                for part in node.body if node else ():
                    if isinstance(part, ast.FunctionDef) and part.name in ("__init__", "__post_init__"):
                        walk.function(part, kind)

    def node_of(self, function):
        first_line = function.__code__.co_firstlineno
        for node in ast.walk(self.tree):
            named = isinstance(node, ast.FunctionDef) and node.name == function.__name__
            if named and first_line in (node.lineno, *(d.lineno for d in node.decorator_list)):
                return node
        return None

    def owner_of(self, function):
        owner = function.__qualname__.rpartition(".")[0]
        return None if "<" in owner else self.module.__dict__.get(owner)


def pairs(target, value):
    """Yield what is assigned to what; the parts of a tuple that is assigned one by one."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        for one, what in zip(target.elts, value.elts, strict=True):
            yield from pairs(one, what)
    else:
        yield target, value


class Scope(ast.NodeVisitor):
    """The names of one function, or of the module where there is none."""

    def __init__(self, walk, node, owner):
        self.walk, self.owner, self.locals = walk, owner, {}
        arguments = node.args if node else None
        every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs] if arguments else []
        self.parameters = [a.arg for a in every]
        self.locals |= {a.arg: [] for a in every}
        for extra in (arguments.vararg, arguments.kwarg) if arguments else ():
            self.locals |= {extra.arg: []} if extra else {}
        for inner in ast.walk(node) if node else ():
            if isinstance(inner, ast.Assign) and len(inner.targets) == 1:
                self.assign(inner.targets[0], inner.value)
            elif isinstance(inner, ast.NamedExpr):
                self.assign(inner.target, inner.value)
        for inner in ast.walk(node) if node else ():
            if isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store):
                self.locals.setdefault(inner.id, [])
            elif isinstance(inner, ast.Lambda | ast.FunctionDef) and inner is not node:
                self.locals |= {a.arg: [] for a in inner.args.args if a.arg not in self.locals}

    def assign(self, target, value):
        for one, what in pairs(target, value):
            if isinstance(one, ast.Name):
                self.locals.setdefault(one.id, []).append(what)

    # what an expression stands for

    def value(self, node):
        """Return the object that a dotted name leads to, or MISSING."""
        if isinstance(node, ast.Name):
            if node.id in self.locals:
                return MISSING
            return self.walk.module.__dict__.get(node.id, getattr(builtins, node.id, MISSING))
        if isinstance(node, ast.Attribute) and (before := self.value(node.value)) is not MISSING:
            return getattr(before, node.attr, MISSING)
        return MISSING

    def kinds(self, node, depth=0):
        """Return the classes that an expression is known to be of."""
        if depth > 8:
            return set()
        found = self.value(node)
        if found is not MISSING:
            return set() if inspect.isclass(found) or inspect.isroutine(found) else {type(found)}
        if isinstance(node, ast.Name):
            if node.id == "self" and self.owner:
                return {self.owner}
            return set().union(*(self.kinds(v, depth + 1) for v in self.locals.get(node.id, ())))
        if isinstance(node, ast.IfExp):
            return self.kinds(node.body, depth + 1) | self.kinds(node.orelse, depth + 1)
        if isinstance(node, ast.Attribute):
            return set().union(*(self.field(kind, node.attr, depth) for kind in self.kinds(node.value, depth + 1)))
        if isinstance(node, ast.Call):
            return self.returned(node.func, depth)
        return set()

    def returned(self, func, depth):
        called = self.value(func)
        if called is not MISSING:
            return self.result(called if inspect.ismethod(called) else plain(called), None, depth)
        if isinstance(func, ast.Attribute):
            before = self.kinds(func.value, depth + 1)
            return set().union(*(self.result(getattr(kind, func.attr, MISSING), kind, depth) for kind in before))
        return set()

    def result(self, called, kind, depth):
        """Return the classes of what a function or a class gives; a method is that of `kind`."""
        if inspect.isclass(called):
            return {called}
        function = inspect.unwrap(getattr(called, "__func__", getattr(called, "fget", called)))
        if is_ours(getattr(function, "__module__", None)) and inspect.isfunction(function):
            walk = self.walk.in_module(function.__module__)
            if (node := walk.node_of(function)) is None:
                return set()
            scope = Scope(walk, node, kind)
            values = [n.value for n in ast.walk(node) if isinstance(n, ast.Return) and n.value is not None]
            return set().union(*(scope.kinds(v, depth + 1) for v in values))
        hint = getattr(function, "__annotations__", {}).get("return")
        if type(hint).__module__.startswith("beartype"):  # its stand-in for a name that was not yet known
            hint = hint.__name__
        if isinstance(hint, str):
            hint = getattr(inspect.getmodule(function), hint, getattr(kind, "__name__", None) == hint and kind)
        owner = getattr(called, "__self__", kind)
        if hint is typing.Self or (inspect.isclass(owner) and hint is None):
            hint = owner
        return {hint} if inspect.isclass(hint) else set()

    def field(self, kind, name, depth):
        """Return the classes of an attribute that instances of a class have."""
        there = inspect.getattr_static(kind, name, None)
        if isinstance(there, property | functools.cached_property):
            return self.result(getattr(there, "fget", None) or there.func, kind, depth)
        if not is_ours(kind.__module__):
            return set()
        found = set()
        for base in kind.__mro__:
            if is_ours(base.__module__):
                walk = self.walk.in_module(base.__module__)
                body = getattr(walk.definition(base.__name__), "body", ())
                for method in (part for part in body if isinstance(part, ast.FunctionDef)):
                    scope = Scope(walk, method, kind)
                    for node in ast.walk(method):
                        if isinstance(node, ast.Assign) and len(node.targets) == 1:
                            for target, value in pairs(node.targets[0], node.value):
                                if ast.unparse(target) == f"self.{name}":
                                    found |= scope.kinds(value, depth + 1)
        return found

    # what is used

    def visit_Name(self, node):
        if isinstance(node.ctx, ast.Load) and (found := self.value(node)) is not MISSING:
            self.walk.use(found, node.id)

    def visit_Attribute(self, node):
        found = self.value(node)
        if found is not MISSING:
            before = self.value(node.value)
            if not isinstance(before, types.ModuleType):
                self.visit(node.value)  # a class whose method it is, say
            if isinstance(before, types.ModuleType) and is_ours(before.__name__):
                self.walk.in_module(before.__name__).use(found, node.attr)
            else:
                self.walk.use(found, ast.unparse(node))
            return
        for kind in self.kinds(node.value):
            method = inspect.getattr_static(kind, node.attr, None)
            function = getattr(method, "fget", None) or getattr(method, "func", method)
            function = getattr(function, "__func__", function)
            if function is not None:
                self.member(function, method, kind)
        self.visit(node.value)

    def member(self, function, method, kind):
        if inspect.isfunction(function) and is_ours(function.__module__):
            walk = self.walk.in_module(function.__module__)
            if (node := walk.node_of(inspect.unwrap(function))) is not None:
                walk.function(node, kind)
        elif not is_ours(getattr(function, "__module__", None)):
            self.walk.found[id(method)] = method

    def visit_Call(self, node):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name not in NOT_USED_BY:
            self.generic_visit(node)

    def visit_FunctionDef(self, node):
        for part in (*node.decorator_list, *node.body):
            self.visit(part)

    def visit_AnnAssign(self, node):
        if node.value is not None:
            self.visit(node.value)

    def visit_ImportFrom(self, node):
        for alias in node.names:
            raise NotImplementedError(f"an import inside a test: {alias.name}; import it at the top of the module")
