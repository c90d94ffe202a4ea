"""Drivers of an angle about an axis, for bodies that turn about this axis only: Sommer 2024, equations 101-103.

An angle about an axis does not depend on the choice of frames. So the residual is read in a frame whose z is the axis,
with body i at rest and body j turning about z: terms of the residual for tilting axes are zero there.
"""

from typing import Any

import numpy as np

from jounce.base.modules import with_fields
from jounce.constraints.facts import field_kinds, value_fields
from jounce.jet import Jet
from jounce.mechanism.system import Group, with_rows
from jounce.written_equations.joint_forms.component_forms import component_jacobian
from jounce.written_equations.joint_forms.latex_words import Words
from jounce.written_equations.joint_forms.polynomials import Atom, Polynomial
from jounce.written_equations.joint_forms.symbolic_joint import Expansion, GivenLaw, NamingReader, scaled, spatial_pose
from jounce.written_equations.operations.graph import Graph
from jounce.written_equations.operations.reading import Entries, UnwritableOperationError

PREMISE = (
    r"For bodies that turn against each other about $\hat{\mathbf{u}}$ alone, the axis with unit length, as their "
    r"bearing holds them; $e_0$, $\mathbf{e}$ are the Euler parameters of that turn."
)
_AXIS = r"\hat{\mathbf{u}}^T"
_NAMES: dict[Atom, str] = {
    ("e", "j", 0, 0): "e_{0}",
    ("e", "j", 0, 3): rf"{_AXIS} \mathbf{{e}}",
    ("A", "j", 0, 0, 0): r"\mathbf{a}_i^T \mathbf{a}_j",
    ("A", "j", 0, 1, 0): rf"{_AXIS} \tilde{{\mathbf{{a}}}}_i \mathbf{{a}}_j",
}


class _AxialWords(Words):
    """Words for a view along the axis."""

    def _coordinate(self, kind: str, body: str, n: int, *place: int) -> str:
        return _NAMES.get((kind, body, n, *place)) or super()._coordinate(kind, body, n, *place)


def is_axial(group: Group) -> bool:
    """Tell whether a group drives angles about axes, from the facts of its class and its fields."""
    kind = type(group.element)
    vectors = {name for name in value_fields(kind) if field_kinds(kind)[name] == "vector"}
    return group.is_driver and group.element.periodic and "axis_i" in vectors <= {"axis_i", "vector_i", "vector_j"}


def axial_equations(group: Group, order: int) -> list[tuple[str, str]]:
    """Return the equations of drivers of an angle as pairs of left and right sides in LaTeX.

    Raises
    ------
    UnwritableOperationError
        If the residual is a function of more than the angle in this frame.
    """
    words = _AxialWords(planar=False)
    levels = _derivatives(group, order, turning=False)
    angle = Polynomial({m: c for m, c in levels[0].terms.items() if not any(a[0] == "f" for a in m)})
    pairs = [(r"\Phi", words.polynomial(Polynomial.atom(("theta",)) + levels[0] + angle * -1))]
    pairs.append((r"\theta", words.polynomial(angle)))
    rate = _derivatives(group, 1, turning=True)[1]
    for body in "ij":
        constants = [x.terms.get((), 0) for x in component_jacobian(rate, body, planar=False)]
        if constants[:5] != [0] * 5 or abs(constants[5]) != 1:
            raise UnwritableOperationError("its rate is not that of an angle about its axis")
        pairs.append((rf"\Phi_{{q{body}}}", rf"\left[ \mathbf{{0}}, {'-' if constants[5] < 0 else ''}{_AXIS} \right]"))
    for n in range(1, order + 1):
        side = Polynomial({m: -c for m, c in levels[n].terms.items() if m != (("w", "j", n - 1, 2),)})
        if any(atom[0] != "f" for m in side.terms for atom in m):
            raise UnwritableOperationError("its right sides are not those of an angle about its axis")
        pairs.append((words.side(n), words.polynomial(side)))
    return pairs


def _derivatives(group: Group, order: int, *, turning: bool) -> list[Polynomial]:
    """Return the residual and its derivatives; with `turning`, both bodies have any angular velocity at the place."""
    graph = Graph()
    element = group.element
    law = [scaled(graph, ("f", n), n, (1, 1)) for n in range(order + 1)]
    along, across = np.array([0.0, 0.0, 1.0])[:, None, None], np.array([1.0, 0.0, 0.0])[:, None, None]
    values: dict[str, Any] = {"axis_i": along, "datum": None}
    values |= {name: across for name in ("vector_i", "vector_j") if getattr(element, name, None) is not None}
    poses = {body: _pose(graph, body, order, turning=turning) for body in "ij"}

    def residual(law: Any, poses: Any, instant: Any) -> Any:
        time = Jet((instant, np.ones((1, 1)), *[None] * (order - 1)))
        bodies = [spatial_pose(body, pose) for body, pose in poses.items()]
        variant = with_fields(element, **values, motion=GivenLaw(tuple(law), time))
        return with_rows(variant.residual(*bodies, time)).dense().coefficients

    instant = Entries(np.array([[graph.input(("t",))]]), float)
    coefficients = NamingReader(graph).function(residual, law, poses, instant)
    read = Expansion(graph)
    factorials = [float(np.prod(np.arange(1, n + 1))) for n in range(order + 1)]
    return [read.of(int(x.numbers.ravel()[0])) * int(f) for x, f in zip(coefficients, factorials, strict=True)]


def _pose(graph: Graph, body: str, order: int, *, turning: bool) -> dict[str, list[Entries]]:
    """Return the coefficients of body i, at rest, or of body j, which turns about z."""
    zero, one = graph.constant(0.0), graph.constant(1.0)

    def atom(kind: str, n: int, *place: int) -> int:
        return int(scaled(graph, (kind, body, n, *place), n, ()).numbers)

    def column(numbers: list[int]) -> Entries:
        return Entries(np.array(numbers, np.int64)[:, None, None], float)

    def moved(kind: str, n: int, *place: int, start: int = zero) -> int:
        return atom(kind, n, *place) if body == "j" else start if n == 0 else zero

    def spin(n: int) -> list[int]:
        if turning:
            return [atom("w", n, c) for c in range(3)]
        return [zero, zero, atom("w", n, 2) if body == "j" else zero]

    levels = range(order + 1)
    cosines = [moved("A", n, 0, 0, start=one) for n in levels]
    sines = [moved("A", n, 1, 0) for n in levels]
    return {
        "position": [column([zero] * 3) for _ in levels],
        "quaternion": [column([moved("e", n, 0, start=one), zero, zero, moved("e", n, 3)]) for n in levels],
        "angular_velocity": [column(spin(n)) for n in range(order)],
        "axis_0": [column([c, s, zero]) for c, s in zip(cosines, sines, strict=True)],
        "axis_1": [column([graph.apply("neg", s), c, zero]) for c, s in zip(cosines, sines, strict=True)],
        "axis_2": [column([zero, zero, one if n == 0 else zero]) for n in levels],
    }
