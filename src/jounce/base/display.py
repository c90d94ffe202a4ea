"""Display of objects of this package in a notebook."""

from collections.abc import Callable

_shown: "Callable[[Displayed], str | None]" = lambda _: None  # noqa: E731 - until `show_by` is called


class Displayed:
    """Base class of objects that a notebook shows as tables.

    The function that makes the tables knows all kinds of objects, so a higher subpackage registers it by `show_by`.
    """

    __slots__ = ()

    def _repr_html_(self) -> str | None:
        return _shown(self)


def show_by(function: Callable[[Displayed], str]) -> None:
    """Register the function that returns the HTML of an object for notebooks."""
    global _shown
    _shown = function
