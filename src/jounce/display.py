"""How objects of this package show themselves in a notebook."""

import importlib


class Displayed:
    """What a notebook shows as tables.

    The room that makes them knows all kinds of objects, and so stands above them: it is imported by its name, when a
    notebook asks.
    """

    __slots__ = ()

    def _repr_html_(self) -> str:
        return importlib.import_module("jounce.reporting.notebook").shown(self)
