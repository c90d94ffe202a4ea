"""Exact time derivatives of any order of mechanisms and robots: jerk, jounce and beyond, torques and their rates.

The only side effect of importing this package is the detection of forks (`jounce.base.interrupts`). The settings of JAX
are not changed; everything is computed in double precision all the same, see `jounce.settings`. The stub beside this
file, ``__init__.pyi``, lists the public names, which are imported at first use: importing the package takes no time,
and a command that computes nothing, such as ``jounce --help``, does not wait for JAX. Names of release 0.4 work for one
release, with a DeprecationWarning.
"""

import functools
import importlib
import importlib.util
import os
import re
import sys
import warnings
from pathlib import Path
from typing import Any

from jounce import errors as errors
from jounce.base import alterations as _alterations, importing as _importing
from jounce.base.display import Displayed as _Displayed, show_by as _show_by
from jounce.base.interrupts import (
    end_on_signals as _end_on_signals,
    is_command as _is_command,
    mark_forks as _mark_forks,
)
from jounce.base.jax_options import OPTIONS as _OPTIONS
from jounce.base.moved_names import new_name as _new_name
from jounce.version import __version__ as __version__

if _is_command():
    _end_on_signals()  # before the libraries, which take a second
    # The process belongs to the command; JAX reads its options from the environment at import.
    os.environ.update({name.upper(): str(value) for name, value in _OPTIONS.items() if value is not None})
_mark_forks()


def __getattr__(name: str) -> Any:
    """Return a public object or a subpackage by name, imported at its first use."""
    if name == "__all__":
        return [*(name for name, source in _offered().items() if source != "."), "__version__"]
    subpackage = None if name.startswith("_") else _offered().get(name)
    if subpackage is None and (moved := _new_name(name)) is not None:
        warnings.warn(f"jounce.{name} is jounce.{moved} from release 0.5 on", DeprecationWarning, stacklevel=2)
        return functools.reduce(getattr, moved.split("."), sys.modules[__name__])
    if subpackage is None and (name.startswith("_") or importlib.util.find_spec(f"{__name__}.{name}") is None):
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message, name=name, obj=sys.modules[__name__])  # for Python's suggestions
    with _importing.lock, _importing.without_garbage_collection():
        if subpackage in (None, ".", __name__):
            value = importlib.import_module(f"{__name__}.{name}")
        else:
            value = getattr(importlib.import_module(subpackage), name)
        if "jounce.settings" in sys.modules:
            from jounce.settings import cover_new_modules

            cover_new_modules()
        globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*_offered(), *(name for name in globals() if name.startswith("__"))})


@functools.lru_cache(maxsize=1)
def _offered() -> dict[str, str]:
    """Return the names in the stub, each with its subpackage."""
    stub = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    imports = re.findall(r"^from (\S+) import (\([^)]*\)|.*)", stub, re.MULTILINE)
    return {name: subpackage for subpackage, names in imports for name in re.findall(r"(\w+) as \w+", names)}


def _in_a_notebook(thing: _Displayed) -> str:
    from jounce.reporting.notebook import shown

    return shown(thing)


_show_by(_in_a_notebook)
