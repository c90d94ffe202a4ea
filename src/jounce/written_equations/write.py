"""The equations of a mechanism as text: code of Python and of C, and LaTeX."""

import re
from collections.abc import Callable
from typing import NamedTuple

from jounce.errors import MechanismError, check_choice, whole_number
from jounce.kinematics import Motion
from jounce.mechanism import Mechanism
from jounce.written_equations.c_code import c_file
from jounce.written_equations.latex import latex_document
from jounce.written_equations.mechanism_equations import MechanismEquations, equations_of
from jounce.written_equations.python_code import python_module

HIGHEST_ORDER = 12
DEFAULT_NAME = "mechanism"


class Language(NamedTuple):
    """A language that equations are written in.

    Attributes
    ----------
    write : callable
        Of equations and a name: the text.
    ending : str
        Of its files.
    most : int
        Operations that a file of it may hold.
    """

    write: Callable[[MechanismEquations, str], str]
    ending: str
    most: int


LANGUAGES = {
    "python": Language(lambda equations, _: python_module(equations), ".py", 200_000),
    "c": Language(c_file, ".c", 200_000),
}
LATEX_ENDING, MOST_LATEX = ".tex", 8  # the highest order
FORMATS = (*LANGUAGES, "latex")


def ending_of(format: str) -> str:  # noqa: A002 - the name of the option
    """Return the ending of files of a format."""
    return LANGUAGES[format].ending if format in LANGUAGES else LATEX_ENDING


def equations(
    mechanism: Mechanism | Motion,
    joint: str | None = None,
    *,
    format: str = "python",  # noqa: A002 - the name of the option
    order: int = 4,
    name: str = DEFAULT_NAME,
) -> str:
    """Return the constraint equations of a mechanism as code: residual, Jacobian and right sides. Sommer 2024, 1-8.

    They are those of `constraint_equations`, with its labels and in SI units, read off the same residuals on jets, own
    joints included; what is computed twice is shared. The code needs nothing of this package.

    Parameters
    ----------
    mechanism : Mechanism or Motion
        A mechanism: angles about axes in space are counted from where its bodies are put together, at the start of its
        grid of time. Or a motion: they are counted as along it.
    joint : str, optional
        Name of the joint or driver whose equations alone are written.
    format : {"python", "c", "latex"}, default "python"
        ``python`` is a module that needs NumPy alone, with ``COORDINATES``, ``COLUMNS``, ``ROWS`` and ``ORDER``, and
        ``residual(t, q)``, ``jacobian(t, q)`` and ``right_side(t, q, velocities)``. ``c`` is a file of C99 with the
        same functions, their names begun by `name`. Both state in their headings what the arguments are. ``latex`` is a
        document with the equations of each type of joint in the
        vectors of the paper; a joint that is not made of them has its equations by coordinates.
    order : int, default 4
        The highest derivative that has a right side, from 1 to 12, of LaTeX to 8.
    name : str, default "mechanism"
        With which the names of the functions of C begin.

    Returns
    -------
    str
        The text of a file.

    Raises
    ------
    MechanismError
        If there is no such joint; if a residual or a law holds what is no operation on numbers, such as a loop of
        unknown length, or a table of too many of them; or if the order takes more operations than the format holds.

    Examples
    --------
    >>> import jounce as jn
    >>> four_bar = jn.load("examples/four_bar.yaml")
    >>> code = jn.equations(four_bar, "BC", order=2)
    >>> module = {}
    >>> exec(code, module)
    >>> module["ROWS"], module["COLUMNS"][:3]
    (('BC.1',), ('crank.x', 'crank.y', 'crank.angle'))
    >>> q = [0, 0, 1.5, 0.1321, 0, 2.0]
    >>> module["jacobian"](0.5, q).round(6).tolist()
    [[-0.089502, -0.289557, 0.002752, 0.089502, 0.289557, -0.041002]]
    """
    check_choice("format", format, FORMATS, MechanismError)
    if not isinstance(mechanism, Mechanism | Motion):
        raise MechanismError("must be a jn.Mechanism or a jn.Motion", name="mechanism", value=mechanism)
    most = MOST_LATEX if format == "latex" else HIGHEST_ORDER
    order = whole_number("order", order, 1, most, error=MechanismError)
    if not isinstance(name, str) or not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
        raise MechanismError("must be a name of C: letters, digits and _", name="name", value=name)
    if format == "latex":
        return latex_document(mechanism, joint, order)
    language, found = LANGUAGES[format], equations_of(mechanism, joint, order)
    if found.size > language.most:
        message = f"takes {found.size} operations, more than the {language.most} of a file of {format}"
        raise MechanismError(f"{message}; lower it, or name a joint", name="order", value=order)
    return language.write(found, name)
