"""Integration methods by name, as commands take them: those of the library, and those that users register."""

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
    """Make an integration method known by name, so that ``jounce simulate --method NAME --import FILE.py`` finds it.

    Parameters
    ----------
    name : str
        As on the command line; a name that is there is replaced.
    make : callable
        Returns the method; it takes the length of all steps, s, or None for error control.

    Raises
    ------
    MechanismError
        The name is empty.

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
        ``taylor``, ``obreshkov-4``, ``obreshkov-6``, ``obreshkov-8``, or one that was registered.
    step : float, optional
        Length of all steps, s; the error is controlled unless given.

    Raises
    ------
    MechanismError
        No method has this name, or the step is not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.integrate.method_named("obreshkov-6", step=0.01).step
    0.01
    """
    check_name("method", name, _methods, MechanismError, name="method")
    return _methods[name](step)
