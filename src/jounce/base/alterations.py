"""Detection of differences between this package in memory and its files.

Cache keys of stored programs depend on the text of the files, so that nothing has to be traced to find them. That text
does not show a function, method or constant that was replaced in this process; programs then have no keys, and none is
stored or loaded. The contents of modules and classes are recorded at import, and compared for each key, in a
millisecond or two.
"""

import sys
import time
import types
from collections.abc import Collection
from typing import Any

IMPORT_TIME = time.time()  # before other modules of this package are imported
PACKAGE = __name__.partition(".")[0]
TABLES = dict, list, set  # types of constants that can be changed in place
REGISTERED = ("_REGISTRY",)  # tables of user classes, which have no cache keys anyway
_held: dict[str, tuple[Any, dict[str, Any], dict[str, Any]]] = {}  # modules and classes, their contents and tables


def note(ready: Collection[str] = ()) -> None:
    """Record the contents of the imported modules of this package, and of their classes.

    Parameters
    ----------
    ready : collection of str, optional
        Subpackages that are at the end of their ``__init__.py``; the contents of others still change during import.
    """
    modules = sys.modules
    for name in [name for name in list(modules) if name.startswith(f"{PACKAGE}.") and name not in _held]:
        module, package = modules[name], ".".join(name.split(".", 2)[:2])
        if (_is_loading(module) and name not in ready) or (_is_loading(modules.get(package)) and package not in ready):
            continue
        space = vars(module)
        _held[name] = module, dict(space), _tables(space)
        for value in list(space.values()):
            if isinstance(value, type) and value.__module__ == name:
                held = dict(vars(value))
                _held[f"{name}.{value.__qualname__}"] = value, held, _tables(held)


def altered() -> str | None:
    """Return the name of an object that was replaced since its module was imported; None if there is none.

    Examples
    --------
    >>> from jounce.base.alterations import altered
    >>> altered() is None
    True
    """
    note()
    for name_of, (holder, contents, tables) in list(_held.items()):
        space = dict(vars(holder))
        for name, value in contents.items():
            if space.get(name) is not value and _counts(holder, name, value):
                return f"{name_of}.{name}"
        for name, entries in tables.items():
            if not _same(entries, _entries(space[name])):
                return f"{name_of}.{name}"
        if isinstance(holder, type) and len(space) != len(contents):
            for name, value in space.items():
                if name not in contents and _counts(holder, name, value):
                    return f"{name_of}.{name}"
    return None


def _is_loading(module: Any) -> bool:
    """Return whether the import of a module has begun but not ended."""
    return getattr(getattr(module, "__spec__", None), "_initializing", False)


def _counts(holder: Any, name: str, value: Any) -> bool:
    """Return whether an entry of a module or class determines its behavior, and is no mere state."""
    return _acts(value) or name.isupper() or (isinstance(holder, type) and not name.startswith("_"))


def _acts(value: Any) -> bool:
    return callable(value) or isinstance(value, property | staticmethod | classmethod | types.ModuleType)


def _tables(space: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of the tables among the constants."""
    names = [name for name, value in space.items() if isinstance(value, TABLES) and name.isupper()]
    return {name: _entries(space[name]) for name in names if name not in REGISTERED}


def _entries(table: Any) -> list[Any]:
    return [*table, *table.values()] if isinstance(table, dict) else list(table)


def _same(before: list[Any], after: list[Any]) -> bool:
    return len(before) == len(after) and all(a is b for a, b in zip(before, after, strict=True))
