"""Integration methods by name, for the commands: those of the library, and those that users register."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from jounce.errors import MechanismError, check_name
from jounce.integrate.steps.methods import AbstractMethod, Taylor
from jounce.integrate.steps.obreshkov import Obreshkov

_methods: dict[str, Callable[[float | None], AbstractMethod]] = {
    "taylor": lambda step: Taylor(step=step),
    **{f"obreshkov-{order}": partial(Obreshkov, order) for order in (4, 6, 8)},
}
"""Functions that return a method, by name; each takes the length of all steps, s, or None for error control."""


def register_method(name: str, make: Callable[[float | None], AbstractMethod]) -> None:
    """Register an integration method by name, so that ``jounce simulate --method NAME --import FILE.py`` finds it.

    Parameters
    ----------
    name : str
        Name on the command line; an existing name is replaced.
    make : callable
        Function that returns the method from the length of all steps, s, or None for error control.

    Raises
    ------
    MechanismError
        If the name is empty.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.integrate.register_method("taylor-12", lambda step: jn.integrate.Taylor(order=12, step=step))
    >>> jn.integrate.method_named("taylor-12")
    Taylor(order=12)
    """
    if not isinstance(name, str) or not name:
        raise MechanismError("a method needs a name", name="name", value=name)
    _methods[name] = make


def method_named(name: str, step: float | None = None) -> AbstractMethod:
    """Return the integration method of a name.

    Parameters
    ----------
    name : str
        ``taylor``, ``obreshkov-4``, ``obreshkov-6``, ``obreshkov-8``, or a registered name.
    step : float, optional
        Length of all steps, s; by default from error control.

    Raises
    ------
    MechanismError
        If no method has this name, or the step is not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.integrate.method_named("obreshkov-6", step=0.01).step
    0.01
    """
    check_name("method", name, _methods, MechanismError, name="method")
    return _methods[name](step)
