"""Whether this package is in memory what its files say.

The names of kept programs are made of the text of the files, so that nothing has to be traced to find them. A function,
a method or a constant that somebody has replaced in this process is not in that text: then programs have no names, and
none is kept or taken. What modules and classes hold is noted when they are imported, and compared whenever a name is
made, in a millisecond or two.
"""

import sys
import time
import types
from collections.abc import Collection
from typing import Any

BEGUN = time.time()  # before other modules of this package are imported
PACKAGE = __name__.partition(".")[0]
TABLES = dict, list, set  # which may be changed in their places
REGISTERED = ("_REGISTRY",)  # users' own classes, which have no names in any case
_held: dict[str, tuple[Any, dict[str, Any], dict[str, Any]]] = {}  # modules and classes: what is in them, and in tables


def note(ready: Collection[str] = ()) -> None:
    """Note what the modules of this package hold that are imported, and the classes that they define.

    Parameters
    ----------
    ready : collection of str, optional
        Rooms that are imported but for the end of their ``__init__.py``; what is in others changes until that.
    """
    modules = sys.modules
    for name in [name for name in list(modules) if name.startswith(f"{PACKAGE}.") and name not in _held]:
        module, package = modules[name], ".".join(name.split(".", 2)[:2])
        if (_is_begun(module) and name not in ready) or (_is_begun(modules.get(package)) and package not in ready):
            continue
        space = vars(module)
        _held[name] = module, dict(space), _tables(space)
        for value in list(space.values()):
            if isinstance(value, type) and value.__module__ == name:
                held = dict(vars(value))
                _held[f"{name}.{value.__qualname__}"] = value, held, _tables(held)


def altered() -> str | None:
    """Return the name of something that is not what it was when its module was imported; None where nothing is.

    Examples
    --------
    >>> from jounce.base.alterations import altered
    >>> altered() is None
    True
    """
    note()
    for name_of, (thing, held, tables) in list(_held.items()):
        space = dict(vars(thing))
        for name, value in held.items():
            if space.get(name) is not value and _counts(thing, name, value):
                return f"{name_of}.{name}"
        for name, entries in tables.items():
            if not _same(entries, _entries(space[name])):
                return f"{name_of}.{name}"
        if isinstance(thing, type) and len(space) != len(held):
            for name, value in space.items():
                if name not in held and _counts(thing, name, value):
                    return f"{name_of}.{name}"
    return None


def _is_begun(module: Any) -> bool:
    """Tell whether the import of a module has not come to its end."""
    return getattr(getattr(module, "__spec__", None), "_initializing", False)


def _counts(thing: Any, name: str, value: Any) -> bool:
    """Tell whether what a module or a class holds under a name says what it does, and is not what it remembers."""
    return _acts(value) or name.isupper() or (isinstance(thing, type) and not name.startswith("_"))


def _acts(value: Any) -> bool:
    return callable(value) or isinstance(value, property | staticmethod | classmethod | types.ModuleType)


def _tables(space: dict[str, Any]) -> dict[str, Any]:
    """Return what is in the tables among constants."""
    names = [name for name, value in space.items() if isinstance(value, TABLES) and name.isupper()]
    return {name: _entries(space[name]) for name in names if name not in REGISTERED}


def _entries(table: Any) -> list[Any]:
    return [*table, *table.values()] if isinstance(table, dict) else list(table)


def _same(before: list[Any], after: list[Any]) -> bool:
    return len(before) == len(after) and all(one is other for one, other in zip(before, after, strict=True))
