"""How objects of this package show themselves in a notebook."""

from collections.abc import Callable

_shown: "Callable[[Displayed], str | None]" = lambda _: None  # noqa: E731 - until `show_by` is called


class Displayed:
    """What a notebook shows as tables.

    What makes the tables knows all kinds of objects, so it is in a higher subpackage, which registers it by `show_by`.
    """

    __slots__ = ()

    def _repr_html_(self) -> str | None:
        return _shown(self)


def show_by(function: Callable[[Displayed], str]) -> None:
    """Have a notebook show objects of this package by the HTML that a function returns of each."""
    global _shown
    _shown = function
