"""Look-up of the elements of a robot file by the names that errors of the robot report."""

from __future__ import annotations

from jounce.errors import RobotError, RobotFileError
from jounce.io.robots.elements.xml_elements import Element


class NamedElements:
    """The elements of a file by dotted name, such as ``joints.elbow.axis``.

    Parameters
    ----------
    root : Element
        Element for names without an element of their own.
    """

    def __init__(self, root: Element):
        self.root = root
        self.elements: dict[str, Element] = {}

    def add(self, element: Element | None, *name: str) -> None:
        """Record the element of a name given in steps, unless the name has one or the element is None."""
        if element is not None:
            self.elements.setdefault(".".join(name), element)

    def located(self, error: RobotError) -> RobotFileError:
        """Return an error of the robot as an error of the file, with the line of the named element."""
        name = error.name or ""
        if isinstance(error.value, list) and name in ("links", "joints") and error.value:
            name = f"{name}.{error.value[-1]}"
        while name and name not in self.elements:
            name = name.rpartition(".")[0]
        element = self.elements.get(name, self.root)
        label = None if error.name is None else ascii(error.name)[1:-1]
        return RobotFileError(error.message, path=element.path, line=element.line, name=label, value=error.value)
