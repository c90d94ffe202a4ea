"""The choice of backend: machine code by LLVM, or XLA where there is no machine code."""

import os
from collections.abc import Iterable
from typing import Any

import jax
import numpy as np

from jounce.errors import MachineCodeWarning, warn_caller
from jounce.execution.background import is_ahead
from jounce.execution.device import device_name, on_processor
from jounce.execution.llvm import self_test

VARIABLE = "JOUNCE_NATIVE"  # 0 leaves everything to XLA
LLVM, XLA = "llvm", "xla"
_warned: set[str] = set()


def uses_machine_code() -> bool:
    """Return whether machine code is used: a compiler is installed, and nothing forbids it."""
    return os.environ.get(VARIABLE, "") != "0" and self_test.is_usable() and on_processor()


def xla_backend() -> str:
    """Return the name of XLA as a backend, with its device unless it is the processor.

    Examples
    --------
    >>> from jounce.execution.backends import xla_backend
    >>> xla_backend()
    'xla'
    """
    return XLA if on_processor() else f"{XLA} on {device_name()}"


def backend_of(results: Any) -> str:
    """Return the name of the backend of the results of a compiled function: machine code returns NumPy arrays."""
    return LLVM if all(isinstance(x, np.ndarray) for x in jax.tree.leaves(results)) else xla_backend()


def joined(backends: Iterable[str]) -> str:
    """Return the names of the backends of the parts of a result, each once.

    Examples
    --------
    >>> from jounce.execution.backends import joined
    >>> joined(["xla", "llvm", "xla"])
    'llvm, xla'
    """
    return ", ".join(sorted(set(backends)))


def warn_of_missing(feature: str) -> None:
    """Warn, once for each operation and each limit, that XLA computes a program without machine code.

    A program that is compiled ahead may not be needed; its warning waits until it is.
    """
    if feature in _warned or is_ahead():
        return
    _warned.add(feature)
    message = (
        f"there is no machine code for {feature}: XLA computes what needs it, with the same results in two to fifty "
        "times the time; another form of the operation, or a lower order of a long program, may have machine code"
    )
    warn_caller(MachineCodeWarning(message))
