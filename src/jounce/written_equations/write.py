"""The equations of a mechanism or a robot as text: NumPy, SymPy and C code, and LaTeX."""

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jounce.errors import JounceError, MechanismError, RobotError, check_choice, flag, whole_number
from jounce.kinematics import Motion
from jounce.mechanism import Mechanism
from jounce.mechanism.building.preconditions import concrete
from jounce.robot import Robot
from jounce.written_equations.joint_forms.latex import latex_document
from jounce.written_equations.languages.c_code import c_file
from jounce.written_equations.languages.python_code import python_module
from jounce.written_equations.languages.sympy_code import sympy_module
from jounce.written_equations.models import mechanism_equations, robot_equations
from jounce.written_equations.operations.functions import Code

HIGHEST_ORDER = 12
DEFAULT_NAME = "mechanism"


class Language(NamedTuple):
    """A language of written equations.

    Attributes
    ----------
    write : callable
        Function that returns the text from code and a name.
    ending : str
        Ending of files.
    most : int
        Largest number of operations in a file.
    """

    write: Callable[[Code, str], str]
    ending: str
    most: int


LANGUAGES = {
    "python": Language(lambda code, _: python_module(code), ".py", 200_000),
    "sympy": Language(lambda code, _: sympy_module(code), ".py", 20_000),
    "c": Language(c_file, ".c", 200_000),
}
LATEX_ENDING, MOST_LATEX = ".tex", 8  # the highest order
FORMATS = (*LANGUAGES, "latex")


def ending_of(format: str) -> str:  # noqa: A002 - the name of the option
    """Return the ending of files of a format."""
    return LANGUAGES[format].ending if format in LANGUAGES else LATEX_ENDING


@concrete
def equations(
    model: Mechanism | Motion | Robot,
    joint: str | None = None,
    *,
    format: str = "python",  # noqa: A002 - the name of the option
    order: int = 4,
    name: str = DEFAULT_NAME,
    quantities: Sequence[str] = (),
    drives: bool = True,
) -> str:
    """Return the equations of a mechanism or a robot as code. Sommer 2024, 1-8; Negrean 2025, 65-122 and 144-146.

    The equations of a mechanism are residual, Jacobian and right sides as in `constraint_equations`, with the same
    labels, including user-defined joints; the equations of a robot are its torques and their rates as in
    `inverse_dynamics`. They come from the same residuals on jets, in SI units, and the code shares common
    subexpressions. The code does not need this package.

    Parameters
    ----------
    model : Mechanism, Motion or Robot
        A mechanism, with angles about axes in space relative to its assembled position at the start of its time grid; a
        motion, with its angles; or a robot.
    joint : str, optional
        Name of a joint or driver, to write its equations only.
    format : {"python", "sympy", "c", "latex"}, default "python"
        ``python`` is a module that needs only NumPy, with ``COORDINATES``, ``COLUMNS``, ``ROWS`` and ``ORDER``, and
        ``residual(t, q)``, ``jacobian(t, q)`` and ``right_side(t, q, velocities)``. ``sympy`` is a module whose
        functions return SymPy expressions. ``c`` is a C99 file with the same functions and the prefix `name`. Each
        heading describes the arguments. ``latex`` is a document with the equations of each type of joint in the vectors
        of the paper, or by coordinates for a joint without a vector form.
    order : int, default 4
        Highest derivative with a right side, from 1 to 12; to 8 for LaTeX.
    name : str, default "mechanism"
        Prefix of the names of C functions.
    quantities : sequence of str, optional
        Quantities to write. For a mechanism: ``constraints``, the default; ``forces``, that is ``mass_matrix(t, q)``
        and ``forces(t, q, velocities, multipliers)``, which with the constraints give accelerations and multipliers,
        and their rates; ``outputs``, that is ``outputs(t, q, velocities)``, the outputs that follow from the motion of
        bodies, with derivatives. LaTeX has the constraints only. For a robot: ``torque``, the default, with
        ``torque(q)`` for q of shape (order + 1, joint); ``mass_matrix``; ``regressor``, the matrix that multiplies the
        inertial parameters; ``energies``, of acceleration and of velocity, with rates.
    drives : bool, default True
        Whether to include armature, damping, friction and springs of the joints of a robot.

    Returns
    -------
    str
        Text of a file.

    Raises
    ------
    MechanismError, RobotError
        If the joint does not exist; if a residual, law or force contains an operation that is not one on numbers, such
        as a loop of unknown length, or too large a table; or if the order needs too many operations for the format.

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
    error = RobotError if isinstance(model, Robot) else MechanismError
    check_choice("format", format, FORMATS, error)
    if not isinstance(model, Mechanism | Motion | Robot):
        raise MechanismError("must be a jn.Mechanism, a jn.Motion or a jn.Robot", name="model", value=model)
    order = whole_number("order", order, 1, MOST_LATEX if format == "latex" else HIGHEST_ORDER, error=error)
    drives = flag("drives", drives, error=error)
    if not isinstance(name, str) or not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
        raise error("must be a name of C: letters, digits and _", name="name", value=name)
    if isinstance(model, Robot):
        if joint is not None or format == "latex":
            argument = ("joint", joint) if joint is not None else ("format", format)
            raise RobotError("is for mechanisms; a robot has code of all joints", name=argument[0], value=argument[1])
        chosen = _quantities(quantities, robot_equations.QUANTITIES, error)
        code = robot_equations.robot_code(model, order, chosen, drives=drives)
    else:
        chosen = _quantities(quantities, mechanism_equations.QUANTITIES, error)
        other = next((x for x in chosen if x != mechanism_equations.CONSTRAINTS), None)
        if other and joint is not None:
            raise error("is of the whole mechanism; leave out the joint", name="quantities", value=other)
        if other and format == "latex":
            raise error("is not written as LaTeX; take python, sympy or c", name="quantities", value=other)
        if format == "latex":
            return latex_document(model, joint, order)
        code = mechanism_equations.mechanism_code(model, joint, order, chosen)
    return _text(code, format, name, error)


def _quantities(given: Sequence[str], names: tuple[str, ...], error: type[JounceError]) -> tuple[str, ...]:
    """Return the quantities to write, in their usual order; the first known quantity unless given."""
    given = (given,) if isinstance(given, str) else tuple(given)
    for quantity in given:
        check_choice("quantities", quantity, names, error)
    return tuple(quantity for quantity in names if quantity in given) or names[:1]


def _text(code: Code, format: str, name: str, error: type[JounceError]) -> str:  # noqa: A002
    """Return code in a language.

    Raises
    ------
    MechanismError, RobotError
        If the code is too long, or SymPy has no expression for an operation.
    """
    language = LANGUAGES[format]
    if code.size > language.most:
        message = f"takes {code.size} operations, more than the {language.most} of a file of {format}"
        raise error(f"{message}; lower it, or write less", name="order", value=code.order)
    if format == "sympy" and (owner := owner_of_table(code)):
        message = "reads a table of numbers, which SymPy has no expression for; take python or c"
        raise error(message, name=owner)
    return language.write(code, name)


def owner_of_table(code: Code) -> str:
    """Return the joint, driver or function that reads a table of numbers, or an empty text."""
    for function in code.functions:
        for place in np.ndindex(*function.results.shape):
            visited = code.graph.reached([int(function.results[place])])
            if any(code.graph.nodes[n].operation == "lookup" for n in visited):
                row = dict(zip(function.axes, place, strict=True)).get("row")
                return function.name if row is None else code.labels["ROWS"][row].rpartition(".")[0]
    return ""
