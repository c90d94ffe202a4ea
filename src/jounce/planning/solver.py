"""The solver of cone programs, which is an extra."""

import importlib
from importlib.util import find_spec
from typing import Any

from jounce.errors import UnsupportedError


def require_solver() -> None:
    """Raise UnsupportedError where the solver of cone programs is not installed."""
    if find_spec("clarabel") is None:
        message = "retiming needs Clarabel, which is not installed; install it with: pip install 'jounce[planning]'"
        raise UnsupportedError(message, name="clarabel")


def cone_solver() -> Any:
    """Return Clarabel, whose names are those of a compiled module.

    Raises
    ------
    UnsupportedError
        If it is not installed.
    """
    require_solver()
    return importlib.import_module("clarabel")
