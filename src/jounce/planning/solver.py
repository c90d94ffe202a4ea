"""The solver of cone programs, an optional dependency."""

import importlib
from importlib.util import find_spec
from typing import Any

from jounce.errors import UnsupportedError


def require_solver() -> None:
    """Raise UnsupportedError if the solver of cone programs is not installed."""
    if find_spec("clarabel") is None:
        message = "retiming needs Clarabel, which is not installed; install it with: pip install 'jounce[planning]'"
        raise UnsupportedError(message, name="clarabel")


def cone_solver() -> Any:
    """Return the module Clarabel, untyped as it is compiled.

    Raises
    ------
    UnsupportedError
        If Clarabel is not installed.
    """
    require_solver()
    return importlib.import_module("clarabel")
