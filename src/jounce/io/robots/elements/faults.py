"""Faults of robot files, and their parts that are left out: the file is read all the same, with one warning."""

from __future__ import annotations

from collections.abc import Iterable

from jounce.errors import RobotFileError, RobotWarning
from jounce.rigid.inertia import ADVICE, NEGATIVE, TRIANGLE, WITHOUT_MASS, Inertia

MASSLESS = "these links move but have no mass"
IDLE = "these links move and neither have nor carry mass, so that a simulation has no answer unless they are driven"
FOLLOWS_NONE = "these joints follow one that the file does not have, and are taken as free"
BELOW_ZERO = "limits of velocity or effort are below zero, which in SDF means none, and are read as none"
REVERSED = "lower limits exceed upper ones, and are read as no range"
ONE_END = "these joints have one end of a range, beyond the zero that stands for the other, which is taken for none"
NOT_UNIT = "these quaternions do not have the length 1, and are divided by their length"
WITHOUT_INERTIAL = "these links have no inertia of their own, which SDF takes for 1 kg with moments of 1 kg m^2"
PARTLY_INERTIAL = "these links lack their mass or moments of inertia, which SDF takes for 1 kg and 1 kg m^2"
DEFAULT_DENSITY = "shapes give these links their mass without a density, for which SDF takes 1000 kg/m^3"
OVERWRITTEN = "poses or moments of inertia are given besides those of shapes, which are used"
HEADINGS = {
    NEGATIVE: "a principal moment of inertia is negative",
    TRIANGLE: "a principal moment of inertia exceeds the sum of the others",
    WITHOUT_MASS: "moments of inertia have no mass beside them",
}
UNKNOWN = "elements that their formats do not have"
TWICE = "elements that are given twice, of which the first counts"
FLUID_MASS = "the mass of the fluid that links move (<fluid_added_mass>)"
MACROS = "macros of xacro that are not expanded"
LOOSE = "these links are joined to the base by nothing, and move freely, each by six coordinates"
NO_MOMENTS = "links have a mass without <inertia>, which is taken for a point mass"
SAME_NAME = "closures have the name of a joint, and are called NAME_closure"
RENAMED = "joints have the name of a link, and are called NAME_joint, as the reference library of SDF does"
FIXED_ALREADY = "closures of links that are fixed to one another"
NOT_XML = "text that is not XML, read as other readers do"
MOCAP = "motion of mocap bodies, which stand still, with what closures hold to them"
JOINT_SPRINGS = "springs of joints"
BUSHINGS = "<drake:linear_bushing_rpy> between links"
PLUGINS = "joints that follow others by a plugin"
FLUID_PLUGINS = "forces of air and water by plugins"
ROTORS = "inertia of the rotors of drives"
MASS_OF_SHAPES = "masses that follow from shapes, or from a total mass"
LEAVE = "motions and forces are computed without {}; take it out of the file, or read it without strict"
SHOWN = 200  # names listed for each fault
FEW = 6  # names listed for each part that is left out


def left_out(heading: str, unless: str = "zero") -> str:
    """Return the message of an error about a part that is left out unless it has a neutral value."""
    return f"motions and forces are computed without {heading}; set it to {unless}, or read the file without strict"


class Faults:
    """Collects the faults of a file and the parts that are left out; in a strict reading, the first one is an error.

    Parameters
    ----------
    path : str
        Path of the file.
    strict : bool
        Whether faults are errors.
    """

    def __init__(self, path: str, strict: bool = False):
        self.path, self.strict = path, strict
        self.names: dict[str, dict[str, None]] = {}  # names under each heading, each once
        self.unread: dict[str, dict[str, None]] = {}

    def add(self, heading: str, name: str, error: RobotFileError) -> None:
        """Record a fault of a link or joint.

        Raises
        ------
        RobotFileError
            The given error, if faults are errors.
        """
        self._note(self.names, heading, name, error)

    def leave_out(self, heading: str, name: str, error: RobotFileError) -> None:
        """Record a part of a link, joint or other element that affects motions or forces and is not read.

        Raises
        ------
        RobotFileError
            The given error, if faults are errors.
        """
        self._note(self.unread, heading, name, error)

    def _note(self, names: dict[str, dict[str, None]], heading: str, name: str, error: RobotFileError) -> None:
        if self.strict:
            raise error
        line = "" if error.line is None else f" (line {error.line})"
        names.setdefault(heading, {})[ascii(name)[1:-1] + line] = None

    def check(self, inertia: Inertia, link: str, line: int | None) -> None:
        """Record the fault of the inertia of a link, if any."""
        if fault := inertia.fault:
            location = {"path": self.path, "line": line, "name": f"links.{ascii(link)[1:-1]}.inertia"}
            self.add(
                HEADINGS[fault.words], link, RobotFileError(f"{fault.words}; {ADVICE}", **location, value=fault.value)
            )

    def warning(self) -> RobotWarning | None:
        """Return the warning that names links, joints and other parts; None if there is nothing to report."""
        parts = []
        if self.names:
            parts.append("values that no real robot has are used as they are in the file")
            parts += [f"{heading}: {_listed(names, SHOWN)}" for heading, names in self.names.items()]
        if self.unread:
            parts.append("what follows is left out, and motions and forces are computed without it")
            parts += [f"{heading}: {_listed(names, FEW)}" for heading, names in self.unread.items()]
        if not parts:
            return None
        advice = "correct the file, or make this an error" if self.names else "make this an error"
        return RobotWarning(f"{self.path}: {'; '.join(parts)}; {advice} with strict=True (--strict)")


def _listed(texts: Iterable[str], limit: int) -> str:
    names = list(texts)
    excess = len(names) - limit
    return ", ".join(names if excess <= 0 else [*names[:limit], f"and {excess} more"])
