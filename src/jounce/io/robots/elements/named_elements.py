"""Which element of a robot file has a name that the robot's own checks report."""

from __future__ import annotations

from jounce.errors import RobotError, RobotFileError
from jounce.io.robots.elements.xml_elements import Element


class NamedElements:
    """The elements of a file by dotted name, such as ``joints.elbow.axis``.

    Parameters
    ----------
    root : Element
        Stands for what has no element of its own.
    """

    def __init__(self, root: Element):
        self.root = root
        self.elements: dict[str, Element] = {}

    def add(self, element: Element | None, *name: str) -> None:
        """Note the element behind a name given in steps, unless there is one, or none is given."""
        if element is not None:
            self.elements.setdefault(".".join(name), element)

    def located(self, error: RobotError) -> RobotFileError:
        """Return an error of the robot with the file and the line that it is about."""
        name = error.name or ""
        if isinstance(error.value, list) and name in ("links", "joints") and error.value:
            name = f"{name}.{error.value[-1]}"
        while name and name not in self.elements:
            name = name.rpartition(".")[0]
        element = self.elements.get(name, self.root)
        shown = None if error.name is None else ascii(error.name)[1:-1]
        return RobotFileError(error.message, path=element.path, line=element.line, name=shown, value=error.value)
