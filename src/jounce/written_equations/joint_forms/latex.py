"""The equations of joints in the notation of Sommer 2024, as LaTeX."""

import inspect
import re
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from jounce.constraints.facts import value_fields
from jounce.errors import MechanismError, check_name
from jounce.kinematics import Motion
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.building.builder import named_groups
from jounce.mechanism.system import Group
from jounce.version import __version__
from jounce.written_equations.joint_forms.axial_forms import PREMISE, axial_equations, is_axial
from jounce.written_equations.joint_forms.component_forms import component_jacobian, in_coordinates, without_unknown
from jounce.written_equations.joint_forms.latex_words import Words, escaped, in_brackets, local, of_vector, skew, total
from jounce.written_equations.joint_forms.polynomials import Atom, Polynomial, TooManyTermsError, without
from jounce.written_equations.joint_forms.symbolic_joint import SymbolicJoint, symbolic_joint
from jounce.written_equations.joint_forms.vector_forms import in_angles, recognized, right_side
from jounce.written_equations.models.mechanism_equations import model_of_equations
from jounce.written_equations.operations.reading import UnwritableOperationError

LONGEST_VALUE = 200  # characters of a value
MOST_TERMS = 400  # terms of a readable right side
SOURCE = re.compile(r"Sommer 2024, ((?:equations?|section) [0-9][0-9 ,and-]*)")


def source_of(kind: type) -> str:
    """Return the equations of Sommer 2024 that the docstring of a class cites, or an empty text."""
    for base in kind.__mro__:
        text = " ".join(inspect.cleandoc(vars(base).get("__doc__") or "").split())
        if match := SOURCE.search(text):
            return match[1].strip(" ,-").removesuffix(" and")
    return ""


def latex_document(given: Mechanism | Motion, joint: str | None, order: int) -> str:
    """Return the text of a document with the equations of the joints and drivers of a mechanism."""
    mechanism = given.mechanism if isinstance(given, Motion) else given
    if joint is not None:
        check_name("joint or driver", joint, (*mechanism.joints, *mechanism.drivers), MechanismError, name="joint")
    model = given.model if isinstance(given, Motion) else model_of_equations(mechanism)
    body = []
    for group, names in _groups(model):
        chosen = [name for name in names if joint in (None, name)]
        if chosen:
            body += _section(mechanism, model, group, names, chosen, order, is_only=joint is not None)
    planar = mechanism.space == "planar"
    head = [
        f"% written by jounce {__version__}", r"\documentclass{article}", r"\usepackage{amsmath,amssymb}",
        r"\allowdisplaybreaks", r"\begin{document}", rf"\section*{{{escaped(mechanism.title or 'A mechanism')}}}",
    ]  # fmt: skip
    return "\n".join([*head, *(_PLANE if planar else _SPACE), *body, r"\end{document}"]) + "\n"


_COMMON = r"""Each joint is $\Phi = 0$, and each time derivative of it
$\Phi_{q}\,q^{(k)} = \mathbf{v}, \boldsymbol{\gamma}, \boldsymbol{\eta}, \boldsymbol{\sigma}$ for
$k = 1, \dots, 4$, as in Sommer, Mechanism and Machine Theory 196, 2024, 105613. The ground has
$\mathbf{r} = \mathbf{0}$, $\mathbf{A} = \mathbf{I}$. A law is $f(t)$, $f_t$ its derivative; angles are given
without whole turns.
"""
_PLANE = [
    *_COMMON.splitlines(),
    r"Bodies $i$, $j$, $m$ have origins $\mathbf{r}_i$ and angles $\phi_i$; $\mathbf{B}_i = \mathbf{R}\mathbf{A}_i$,",
    r"$\mathbf{d}_{ij} = \mathbf{r}_j + \mathbf{A}_j\mathbf{s}_j'^{P} - \mathbf{r}_i - \mathbf{A}_i\mathbf{s}_i'^{P}$,",
    r"$\mathbf{a}_i = \mathbf{A}_i\mathbf{a}_i'$; $\boldsymbol{\gamma}^{r}$ and so on are those of a revolute.",
]
_SPACE = [
    *_COMMON.splitlines(),
    r"Bodies $i$, $j$, $m$ have origins $\mathbf{r}_i$ and, along their axes, angular velocities",
    r"$\boldsymbol{\omega}_i'$, of which $\tilde{\boldsymbol{\omega}}_i'$ is the matrix; $\pi_i$ are their turns;",
    r"$\mathbf{d}_{ij} = \mathbf{r}_j + \mathbf{A}_j\mathbf{s}_j'^{P} - \mathbf{r}_i - \mathbf{A}_i\mathbf{s}_i'^{P}$,",
    r"$\mathbf{a}_i = \mathbf{A}_i\mathbf{a}_i'$; $\boldsymbol{\gamma}^{s}$ and so on are those of a spherical joint,",
    r"and",
    r"$\mathbf{A}_i^{(n)} = \mathbf{A}_i\bigl(\mathbf{M}_{i,n}' + \tilde{\boldsymbol{\omega}}_i'^{(n-1)}\bigr)$, with",
    r"$\mathbf{M}_{i,n+1}' = \sum_{j=1}^{n} \binom{n}{j}",
    r"\bigl(\mathbf{M}_{i,j}' + \tilde{\boldsymbol{\omega}}_i'^{(j-1)}\bigr)",
    r"\tilde{\boldsymbol{\omega}}_i'^{(n-j)}$, $\mathbf{M}_{i,1}' = \mathbf{0}$,",
    r"$\mathbf{H}_i' = \mathbf{M}_{i,3}'$, $\mathbf{W}_i' = \mathbf{M}_{i,4}'$.",
]


def _groups(model: Model) -> Iterator[tuple[Group, list[str]]]:
    for group, members in named_groups(model):
        yield group, [name.partition(".")[2] for name in members]


def _section(
    mechanism: Mechanism, model: Model, group: Group, members: list[str], names: list[str], order: int, *, is_only: bool
) -> list[str]:
    elements = {**mechanism.joints, **mechanism.drivers}
    kind = type(elements[names[0]])
    source = source_of(kind)
    title = (kind.type_name or kind.__name__).replace("_", " ")
    lines = ["", rf"\subsection*{{{escaped(title)}{f' (S {source})' if source else ''}}}", r"\begin{itemize}"]
    try:
        if is_axial(group):
            lines += [rf"\item {escaped(name)}: {_instance(elements[name])}" for name in names]
            rows = axial_equations(group, order)
            return [*lines, r"\end{itemize}", PREMISE, r"\begin{align*}", *_aligned(rows), r"\end{align*}"]
        joint = symbolic_joint(group, model.pose_type, order)
        rows = joint_equations(joint)
    except (UnwritableOperationError, TooManyTermsError) as error:
        reason = str(error) if isinstance(error, UnwritableOperationError) else f"it takes {error}"
        if is_only:
            message = f"cannot be written out: {reason}; lower the order, or take python or c"
            raise MechanismError(message, name=names[0]) from None
        lines += [rf"\item {escaped(name)}: {_instance(elements[name])}" for name in names]
        return [
            *lines,
            r"\end{itemize}",
            escaped(f"Omitted, because it is too long to read: {reason}. The formats of code contain it."),
        ]
    used = {atom for level in joint.rows for row in level for m in row.terms for atom in m if atom[0] == "c"}
    for name in names:
        constants = enumerate(joint.constants[members.index(name)], 1)
        values = "".join(f", $c_{{{k}}} = {value:.17g}$" for k, value in constants if ("c", k) in used)
        for vector, parts in joint.derived[members.index(name)].items():
            values += f", ${local(vector, vector[-1])} = [{', '.join(f'{part:.17g}' for part in parts)}]$"
        lines.append(rf"\item {escaped(name)}: {_instance(elements[name])}{values}")
    return [*lines, r"\end{itemize}", r"\begin{align*}", *_aligned(rows), r"\end{align*}"]


def _aligned(rows: list[tuple[str, str]]) -> list[str]:
    return [rf"{left} &= {right}" + ("" if k == len(rows) - 1 else r" \\") for k, (left, right) in enumerate(rows)]


def _instance(element: object) -> str:
    bodies = getattr(element, "bodies", ())
    parts = [f"${slot}$ is {escaped(body)}" for slot, body in zip("ijmn", bodies, strict=False)]
    for name in value_fields(type(element)):
        value = getattr(element, name)
        if value is not None:
            parts.append(f"{escaped(name)} {escaped(_shown(value)[:LONGEST_VALUE])}")
    return ", ".join(parts)


def _shown(value: object) -> str:
    """Return a value as in a mechanism file."""
    if isinstance(value, tuple | list | np.ndarray):
        return f"[{', '.join(map(_shown, value))}]"
    return str(getattr(value, "text", value))


def joint_equations(joint: SymbolicJoint) -> list[tuple[str, str]]:
    """Return the equations of a joint as pairs of left and right sides in LaTeX.

    Raises
    ------
    UnwritableOperationError
        If a right side has too many terms for a reader.
    """
    symbols, vector_rows = Words(joint.planar), recognized(joint)
    if vector_rows is None:
        return _in_components(joint, symbols)
    equations = []
    for k, (_, levels) in enumerate(vector_rows, 1):
        mark, suffix = (f"_{{{k}}}", f",{k}") if len(vector_rows) > 1 else ("", "")
        equations.append((rf"\Phi{mark}", symbols.polynomial(_turned(joint, levels[0]))))
        for body in joint.slots:
            blocks = ", ".join(total(x) for x in _jacobian(joint, symbols, levels[1], body))
            equations.append((rf"\Phi_{{q{body}{suffix}}}", rf"\left[ {blocks} \right]"))
        for n in range(1, len(levels)):
            side = _turned(joint, right_side(levels[n], n))
            equations.append((symbols.side(n) + mark, symbols.polynomial(_checked(side, n))))
    if any(
        v[0] == "d"
        for _, levels in vector_rows
        for m in levels[0].terms
        for a in m
        for v in a[1:]
        if isinstance(v, tuple)
    ):
        equations += _of_points(joint, symbols, len(joint.rows))
    return equations


def _of_points(joint: SymbolicJoint, symbols: Words, levels: int) -> list[tuple[str, str]]:
    """Return the equations of the right sides of a pin or a ball."""
    points = {frame: field for field, frame in joint.vectors.items() if field.startswith("point")}
    equations = []
    for n in range(2, levels):
        parts = {(("vector", ("h", body, n, points[body])),): Fraction(1 if body == "i" else -1) for body in "ij"}
        equations.append((symbols.side(n, own=True), symbols.polynomial(_turned(joint, Polynomial(parts)))))
    return equations


def _turned(joint: SymbolicJoint, row: Polynomial) -> Polynomial:
    return in_angles(row) if joint.planar else row


def _checked(side: Polynomial, n: int) -> Polynomial:
    if len(side.terms) > MOST_TERMS:
        raise UnwritableOperationError(
            f"its right side of order {n} has {len(side.terms)} terms, more than {MOST_TERMS}"
        )
    return side


def _in_components(joint: SymbolicJoint, symbols: Words) -> list[tuple[str, str]]:
    equations = []
    for k in range(len(joint.rows[0])):
        mark, suffix = (f"_{{{k + 1}}}", f",{k + 1}") if len(joint.rows[0]) > 1 else ("", "")
        levels = [in_coordinates(joint, _checked(level[k], n)) for n, level in enumerate(joint.rows)]
        equations.append((rf"\Phi{mark}", symbols.polynomial(levels[0])))
        for body in joint.slots:
            blocks = [symbols.polynomial(x) for x in component_jacobian(levels[1], body, planar=joint.planar)]
            equations.append((rf"\Phi_{{q{body}{suffix}}}", rf"\left[ {', '.join(blocks)} \right]"))
        for n in range(1, len(levels)):
            side = _checked(without_unknown(levels[n], n) * -1, n)
            equations.append((symbols.side(n) + mark, symbols.polynomial(side)))
    return equations


def _jacobian(joint: SymbolicJoint, symbols: Words, rate: Polynomial, body: str) -> tuple[list, list]:
    """Return the terms of the block of a body: for its position, and for its angle or rotation."""
    shifts, turns = [], []
    points = {frame: field for field, frame in joint.vectors.items() if field.startswith("point")}
    for monomial, factor in rate.terms.items():
        for atom in monomial:
            remainder = Polynomial({without(monomial, atom): factor})
            if atom[:3] == ("phi", body, 1):
                turns.append((remainder, ""))
            if atom[0] not in ("dot", "cross", "vector"):
                continue
            for k, coordinate in enumerate(atom[1:], 1):
                if coordinate[0] == "d" and coordinate[1] == 1 and body in "ij":
                    sign = remainder * (1 if body == "j" else -1)
                    shifts.append(_column(atom, k, sign, None, joint.planar))
                    turns.append(_column(atom, k, sign, (body, points[body]), joint.planar))
                elif coordinate[:3] == ("r", body, 1):
                    shifts.append(_column(atom, k, remainder, None, joint.planar))
                elif coordinate[0] == "u" and coordinate[1:3] == (body, 1):
                    turns.append(_column(atom, k, remainder, (body, coordinate[3]), joint.planar))
    return symbols.terms(shifts), symbols.terms(turns)


def _column(
    atom: Atom, k: int, remainder: Polynomial, turned: tuple[str, str] | None, planar: bool
) -> tuple[Polynomial, str]:
    """Return a term of a block: its factor, and the other vector times the derivative of the moving vector."""
    kind, *vectors = atom
    unit = rf"\mathbf{{I}}_{2 if planar else 3}"
    if turned is None:
        column = ""
    elif planar:
        column = rf"\mathbf{{B}}_{turned[0]}{local(turned[1], turned[0])}"
    else:
        column, remainder = rf"\mathbf{{A}}_{turned[0]}{skew(local(turned[1], turned[0]))}", remainder * -1
    if kind == "vector":
        return remainder, column or unit
    other = in_brackets(of_vector(vectors[2 - k], planar)) + "^T"
    if kind == "dot":
        return remainder, f"{other} {column}".strip()
    remainder = remainder if k == 2 else remainder * -1
    if turned is not None:  # R^T B = A
        return remainder, f"{other} {of_vector(('u', turned[0], 0, turned[1]), planar)}"
    return remainder, rf"{other} \mathbf{{R}}^T"
