"""What robot files hold that no real robot has: read all the same, and told of in one warning."""

from __future__ import annotations

from jounce.errors import RobotFileError, RobotWarning
from jounce.rigid.inertia import ADVICE, NEGATIVE, TRIANGLE, WITHOUT_MASS, Inertia

MASSLESS = "these links move but have no mass"
IDLE = "these links move and neither have nor carry mass, so that a simulation has no answer unless they are driven"
FOLLOWS_NONE = "these joints follow one that the file does not have, and are taken as free"
WITHOUT_INERTIAL = "these links have no inertia of their own, which SDF takes for 1 kg with moments of 1 kg m^2"
PARTLY_INERTIAL = "these links lack their mass or moments of inertia, which SDF takes for 1 kg and 1 kg m^2"
HEADINGS = {
    NEGATIVE: "a principal moment of inertia is negative",
    TRIANGLE: "a principal moment of inertia exceeds the sum of the others",
    WITHOUT_MASS: "moments of inertia have no mass beside them",
}
SHOWN = 200  # names for each fault


class Faults:
    """Gathers the faults of a file; if it is strict, the first one is an error.

    Parameters
    ----------
    path : str
        The file.
    strict : bool
        Whether faults are errors.
    """

    def __init__(self, path: str, strict: bool = False):
        self.path, self.strict = path, strict
        self.names: dict[str, list[str]] = {}

    def add(self, heading: str, name: str, error: RobotFileError) -> None:
        """Note a fault of a link or joint.

        Raises
        ------
        RobotFileError
            The error given, if faults are errors.
        """
        if self.strict:
            raise error
        line = "" if error.line is None else f" (line {error.line})"
        self.names.setdefault(heading, []).append(ascii(name)[1:-1] + line)

    def check(self, inertia: Inertia, link: str, line: int | None) -> None:
        """Note what is wrong with the inertia of a link."""
        if fault := inertia.fault:
            place = {"path": self.path, "line": line, "name": f"links.{ascii(link)[1:-1]}.inertia"}
            self.add(
                HEADINGS[fault.words], link, RobotFileError(f"{fault.words}; {ADVICE}", **place, value=fault.value)
            )

    def warning(self) -> RobotWarning | None:
        """Return the warning that names the links, None if there is no fault."""
        if not self.names:
            return None
        parts = [f"{heading}: {_listed(names)}" for heading, names in self.names.items()]
        message = (
            f"{self.path}: values that no real robot has are used as they are in the file; "
            f"{'; '.join(parts)}; correct the file, or make this an error with strict=True (--strict)"
        )
        return RobotWarning(message)


def _listed(names: list[str]) -> str:
    more = len(names) - SHOWN
    return ", ".join(names if more <= 0 else [*names[:SHOWN], f"and {more} more"])
