"""Exact time derivatives of any order of mechanisms and robots: jerk, jounce and beyond, torques and their rates.

Importing this package has no side effect but a mark that a process gets when it is forked, see `jounce.interrupts`.
The settings of JAX are left alone; everything is computed in double precision all the same, see `jounce.settings`.
What the package offers stands in the stub beside this file, ``__init__.pyi``, and is imported when a name of it is
first used: importing the package alone takes no time, and a command that computes nothing, such as ``jounce --help``,
does not wait for JAX either.
"""

import importlib
import os
import sys
import threading
from pathlib import Path
from typing import Any

from jounce import errors as errors
from jounce.interrupts import end_on_signals as _end_on_signals, is_command as _is_command, mark_forks as _mark_forks
from jounce.jax_options import OPTIONS as _OPTIONS

__version__ = "0.4.0"

if _is_command():
    _end_on_signals()  # before the libraries, which take a second
    # The process is the command's own; JAX reads its options there when it is imported.
    os.environ.update({name.upper(): str(value) for name, value in _OPTIONS.items() if value is not None})
_mark_forks()

_lock = threading.RLock()  # threads that import several rooms at once may get each other's half imported
_begun = False


def __getattr__(name: str) -> Any:
    """Return what the package offers under a name; the first time, all of it is imported, at once."""
    if name == "__all__" or not name.startswith("__"):
        _import_all()
        if name in globals():
            return globals()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    _import_all()
    return sorted({*globals()["__all__"], *(name for name in globals() if name.startswith("__"))})


def _import_all() -> None:
    """Import what the stub names, unless that was done or is being done further up."""
    global _begun
    with _lock:
        if _begun:
            return
        _begun = True
        try:
            offered = _offered()
            for name, room in offered.items():
                if room != __name__:  # a room itself is bound to its name where it is imported
                    globals()[name] = getattr(importlib.import_module(room), name)
            globals()["__all__"] = [*offered, "__version__"]
        except BaseException:
            _begun = False
            raise


def _offered() -> dict[str, str]:
    """Return the names in the stub, each with the room that it is imported from."""
    import ast

    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [line for line in stub.body if isinstance(line, ast.ImportFrom)]
    return {alias.name: str(line.module) for line in imports for alias in line.names}
