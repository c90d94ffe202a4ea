"""Cache keys of compiled programs: descriptions of their structure that are the same in all processes.

Equal descriptions must imply equal programs, since a wrong program would silently give wrong numbers. Every kind of
value that may make a difference is therefore handled explicitly, and other values have no description: above all
functions and classes of users, whose names do not determine their text.
"""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import os
import platform
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jounce.base.alterations import IMPORT_TIME, altered
from jounce.base.jax_internals import trace_settings as settings
from jounce.execution.llvm import machine

PACKAGE = Path(__file__).parents[1]
LIBRARIES = ("jax", "jaxlib", "numpy")  # whose releases determine traced and compiled programs
OPTIONS = ("jax_disable_most_optimizations",)  # of JAX, in addition to its trace context
MARGIN = 2.0  # s, between the clocks of files and of processes
CONTAINERS = (tuple, list, dict, type(None))


class UndescribedError(Exception):
    """A value has no description that is the same in all processes."""


def description(value: Any) -> str:
    """Return a description that distinguishes a static value from all values that are not equal to it.

    Raises
    ------
    UndescribedError
        If there is none that is the same in all processes.
    """
    kind = type(value)
    if value is None or kind in (bool, int, float, complex, str, bytes):
        return f"{kind.__name__} {value!r}"
    if kind in (tuple, list):
        return f"{kind.__name__}({_several(value)})"
    if kind is frozenset:
        return f"frozenset({', '.join(sorted(map(description, value)))})"
    if kind is dict:
        return f"dict({_several(value)}; {_several(value.values())})"
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biufc":
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return f"{kind.__name__} {value.dtype.str} {value.shape} {digest}"
    if isinstance(value, type | types.FunctionType):
        return _own(value)
    if isinstance(value, jax.tree_util.PyTreeDef):
        return tree_description(value)
    if isinstance(value, enum.Enum):
        return f"{_own(kind)}.{value.name}"
    if dataclasses.is_dataclass(value):  # by the compared fields, as in `jax.jit`
        compared = [field.name for field in dataclasses.fields(value) if field.compare]
        return f"{_own(kind)}({', '.join(f'{name}={description(getattr(value, name))}' for name in compared)})"
    raise UndescribedError(f"{kind.__module__}.{kind.__qualname__}")


def _several(values: Any) -> str:
    return ", ".join(map(description, values))


def _own(definition: type | types.FunctionType) -> str:
    """Return the qualified name of a class or function of this package."""
    result: Any = sys.modules.get(definition.__module__)
    origin = getattr(getattr(result, "__spec__", None), "origin", None)
    inside = origin is not None and Path(origin).is_relative_to(PACKAGE)
    for part in definition.__qualname__.split("."):
        result = getattr(result, part, None)
    if not inside or definition not in (result, getattr(result, "__wrapped__", None)):  # or wrapped by a decorator
        raise UndescribedError(f"{definition.__module__}.{definition.__qualname__}")
    return f"{definition.__module__}.{definition.__qualname__}"


def tree_description(tree: Any) -> str:
    """Return the description of a JAX tree structure, as `description` does for a value.

    Parameters
    ----------
    tree : PyTreeDef
        Structure with static values in its nodes.
    """
    node = tree.node_data()
    if node is None:
        return "leaf" if tree.num_leaves else "none"
    kind, static = node
    name = kind.__name__ if kind in CONTAINERS else _own(kind)
    if issubclass(kind, tuple):
        static = None  # the class again
    return f"{name}<{description(static)}>({', '.join(map(tree_description, tree.children()))})"


def cache_key(
    functions: tuple[Callable[..., Any], ...], tree: Any, leaves: Sequence[Any], static: Mapping[str, Any]
) -> str:
    """Return the cache key of the program of functions for arguments of a structure, on this machine.

    Parameters
    ----------
    functions : tuple of callable
        Functions of this package.
    tree, leaves
        The structure of the arguments, and the shape and type of each leaf.
    static : mapping
        Arguments that are compiled in.

    Raises
    ------
    UndescribedError
        If the structure contains user code, or this package in memory differs from its files.
    """
    if (alteration := altered() or _changed_file()) is not None:
        raise UndescribedError(alteration)
    parts = [
        description(functions),
        tree_description(tree),
        description(tuple(leaves)),
        description(dict(static)),
        _described_settings(),
        _surroundings(),
    ]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _described_settings() -> str:
    parts = [repr(x) for x in settings() if type(x).__name__ != "AxisEnv"]  # of axis names, which are not used
    parts += [repr(getattr(jax.config, name, None)) for name in OPTIONS]
    if any(" at 0x" in x for x in parts):
        raise UndescribedError("a setting of JAX")
    return ", ".join(parts)


def _files() -> list[Path]:
    """Return the source files of this package."""
    return sorted(PACKAGE.rglob("*.py"))


@lru_cache(maxsize=1)
def _changed_file() -> str | None:
    """Return a file that was written after this process began, and so may differ from memory; otherwise None."""
    result = {str(file): file.stat() for file in _files()}
    return next((n for n, x in result.items() if max(x.st_mtime, x.st_ctime) > IMPORT_TIME - MARGIN), None)


@lru_cache(maxsize=1)
def _surroundings() -> str:
    """Return the common part of all cache keys: the text of this package, the libraries, and the machine."""
    text = hashlib.sha256()
    for file in _files():
        text.update(f"{file.relative_to(PACKAGE).as_posix()} {file.stat().st_size}\n".encode())
        text.update(file.read_bytes())
    releases = [f"{name} {sys.modules[name].__version__}" for name in LIBRARIES]  # as loaded
    flags = [os.environ.get(name, "") for name in ("XLA_FLAGS", "JAX_PLATFORMS")]
    devices = [f"{device.platform} {device.device_kind}" for device in jax.devices()]
    devices.append(getattr(jax.devices()[0].client, "platform_version", ""))
    compiler = machine.processor() if find_spec("llvmlite") else ()
    return "\n".join([text.hexdigest(), sys.version, *releases, *flags, *devices, *compiler, _processor()])


def _processor() -> str:
    """Return a description of the processor, for whose features code is compiled."""
    parts = [platform.machine(), platform.processor(), platform.system(), str(os.cpu_count())]
    listing = Path("/proc/cpuinfo")
    if listing.exists():
        first, _, _ = listing.read_text(encoding="utf-8", errors="replace").partition("\n\n")
        kinds = ("vendor_id", "cpu family", "model", "flags", "Features", "CPU")
        parts += [line for line in first.splitlines() if line.startswith(kinds)]
    elif sys.platform == "darwin":
        import subprocess

        parts.append(subprocess.check_output(["/usr/sbin/sysctl", "-n", "machdep.cpu.brand_string"], text=True))
    return "\n".join(parts)
