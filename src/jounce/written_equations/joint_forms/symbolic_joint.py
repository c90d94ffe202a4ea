"""A joint on symbols: its residual on jets of the vectors of Sommer 2024, as polynomials of their components."""

import dataclasses
import math
from fractions import Fraction
from typing import Any

import jax
import numpy as np
from jax.ad_checkpoint import checkpoint_name
from jax.extend.core import JaxprEqn

from jounce.base.modules import with_fields
from jounce.constraints.facts import field_kinds, value_fields
from jounce.jet import Jet
from jounce.jet.programs.reader import inner_program
from jounce.jet.turns import ROUNDING_OF_TURNS
from jounce.mechanism.system import Group, with_rows
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.spatial import quaternion_spins
from jounce.trajectory import AbstractMotion
from jounce.written_equations.joint_forms.polynomials import Atom, Polynomial
from jounce.written_equations.operations.graph import FUNCTIONS, Graph, Node
from jounce.written_equations.operations.reading import Entries, GraphReader, UnwritableOperationError

SLOTS = "ijmn"
DERIVED = "fghbcke"  # letters of vectors computed from fields
MARK = "vector of body "


class GivenLaw(AbstractMotion):
    """A law with only its Taylor coefficients known."""

    coefficients: Any
    time: Any

    def __call__(self, time: Jet) -> Jet:
        """Return the law at its own time, the only one with known coefficients."""
        if time is not self.time:
            raise UnwritableOperationError("its law is one of a coordinate, not of time alone")
        return Jet(self.coefficients[: time.order + 1])


@dataclasses.dataclass(frozen=True)
class SymbolicJoint:
    """A joint on symbols.

    Parameters
    ----------
    rows : list of list of Polynomial
        Derivative of the residual, in the atoms below, for each order and row.
    vectors : dict of str to str
        Body whose frame holds a vector (i, j or m), by the field of the vector.
    planar : bool
        Whether the joint is planar.
    slots : str
        Bodies of the joint.
    constants : list of list of float
        Numbers that depend on the values of the joint only, for each joint of the group: ("c", k) is the k-th.
    derived : list of dict of str to tuple of float
        Vectors among `vectors` that are computed from fields, for each joint of the group.
    """

    rows: list[list[Polynomial]]
    vectors: dict[str, str]
    planar: bool
    slots: str
    constants: list[list[float]] = dataclasses.field(default_factory=list)
    derived: list[dict[str, tuple[float, ...]]] = dataclasses.field(default_factory=list)


# Atoms, by kind: ("r", body, n, c) component of the n-th derivative of a position, ("A", body, n, row, column) entry of
# a derivative of the attitude matrix, ("phi", body, n) angle, ("e", body, n, c) Euler parameter, ("w", body, n, c)
# angular velocity about body axes, ("f", n) law, ("t",) time, ("v", field, c) component of a vector of the joint,
# ("k", field) number of the joint, ("c", k) constant that follows from vectors and numbers of the joint.


def symbolic_joint(group: Group, pose_type: type, order: int) -> SymbolicJoint:
    """Return the residual of the joints of a group, and its derivatives to an order, on symbols."""
    planar, graph = pose_type is PlanarPose, Graph()
    count = 2 if planar else 3
    element = jax.tree.map(lambda v: np.asarray(v)[..., :1, :] if np.ndim(v) > 1 else v, group.element)
    fields, vectors, law = {}, {}, None
    for name in value_fields(type(element)):
        kind, value = field_kinds(type(element))[name], getattr(element, name)
        if kind == "motion":
            law = [scaled(graph, ("f", n), n, (1, 1)) for n in range(order + 1)]
        elif value is not None and kind == "scalar":
            fields[name] = _entries(graph, [("k", name)], (1, 1))
        elif value is not None and kind == "vector":
            fields[name] = _entries(graph, [("v", name, c) for c in range(count)], (count, 1, 1))
            vectors[name] = name.rpartition("_")[2] if name[-2:] in ("_i", "_j", "_m") else "i"
    slots = SLOTS[: len(group.bodies)]
    poses = [_coefficients(graph, body, order, planar=planar) for body in slots]

    def residual(fields: Any, law: Any, poses: Any, instant: Any) -> Any:
        time = Jet((instant, np.ones((1, 1)), *[None] * (order - 1)))
        values = {**fields} if law is None else {**fields, "motion": GivenLaw(tuple(law), time)}
        bodies = [
            (planar_pose if planar else spatial_pose)(slot, pose) for slot, pose in zip(slots, poses, strict=True)
        ]
        return with_rows(with_fields(element, **values).residual(*bodies, time)).dense().coefficients

    reader = NamingReader(graph)
    levels_of_rows = reader.function(residual, fields, law, poses, _entries(graph, [("t",)], (1, 1)))
    read = Expansion(graph)
    rows = [
        [read.of(int(x)) * math.factorial(n) for x in level.numbers.reshape(len(level.numbers), -1)[:, 0]]
        for n, level in enumerate(levels_of_rows)
    ]
    values = [_values(group, fields, vectors, k) for k in range(group.instances)]
    derived = [
        {name: tuple(evaluated(graph, n, values_here) for n in parts) for parts, name in reader.derived.items()}
        for values_here in values
    ]
    for values_here, derived_vectors in zip(values, derived, strict=True):
        values_here |= {("v", name, c): part for name, parts in derived_vectors.items() for c, part in enumerate(parts)}
    constants = [[evaluated(graph, number, values_here) for number in read.constants] for values_here in values]
    vectors |= {name: name[-1] for name in reader.derived.values()}
    return SymbolicJoint(rows, vectors, planar, slots, constants, derived)


def _values(group: Group, fields: dict[str, Any], vectors: dict[str, str], instance: int) -> dict[Atom, float]:
    """Return the values of the atoms of the fields of one joint of a group."""
    values = {}
    for name in fields:
        value = np.asarray(getattr(group.element, name))[..., instance, 0]
        parts = value.tolist() if name in vectors else [float(value)]
        values |= {(("v", name, c) if name in vectors else ("k", name)): part for c, part in enumerate(parts)}
    return values


def evaluated(graph: Graph, root: int, known: dict[Atom, float]) -> float:
    """Return the value of an operation for values of its inputs."""
    values: dict[int, Any] = {}
    for number in graph.reached([root]):
        node = graph.nodes[number]
        if node.operation == "constant":
            values[number] = node.detail
        elif node.operation == "input":
            values[number] = known[node.detail]
        else:
            values[number] = FUNCTIONS[node.operation][0](*(values[x] for x in node.operands))
    return float(values[root])


def _entries(graph: Graph, atoms: list[Atom], shape: tuple[int, ...]) -> Entries:
    return Entries(np.array([graph.input(atom) for atom in atoms]).reshape(shape), float)


def scaled(graph: Graph, atom: Atom, n: int, shape: tuple[int, ...]) -> Entries:
    """Return the Taylor coefficient of the n-th derivative that an atom stands for."""
    number = graph.apply("div", graph.input(atom), graph.constant(float(math.factorial(n))))
    return Entries(np.full(shape, number), float)


def _coefficients(graph: Graph, body: str, order: int, *, planar: bool) -> dict[str, list[Entries]]:
    """Return the Taylor coefficients of the components of a pose."""
    count = 2 if planar else 3

    def jet(kind: str, tails: list[tuple], shape: tuple[int, ...], last: int = order) -> list[Entries]:
        levels = []
        for n in range(last + 1):
            parts = [scaled(graph, (kind, body, n, *tail), n, ()) for tail in tails]
            levels.append(Entries(np.array([int(x.numbers) for x in parts]).reshape(shape), float))
        return levels

    jets = {"position": jet("r", [(c,) for c in range(count)], (count, 1, 1))}
    if planar:
        jets["angle"] = jet("phi", [()], (1, 1))
        return jets | {"cosine": jet("A", [(0, 0)], (1, 1)), "sine": jet("A", [(1, 0)], (1, 1))}
    jets["quaternion"] = jet("e", [(c,) for c in range(4)], (4, 1, 1))
    jets["angular_velocity"] = jet("w", [(c,) for c in range(3)], (3, 1, 1), order - 1)
    return jets | {f"axis_{k}": jet("A", [(c, k) for c in range(3)], (3, 1, 1)) for k in range(3)}


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class _NamedPlanarPose(PlanarPose):
    """A planar pose that marks the constant vectors of its body in a residual."""

    slot: str = dataclasses.field(default="i", metadata={"static": True})

    def direction(self, local: Any) -> Jet:
        return super().direction(_marked(local, self.slot))


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class _NamedSpatialPose(SpatialPose):
    """A spatial pose that marks the constant vectors of its body in a residual."""

    slot: str = dataclasses.field(default="i", metadata={"static": True})

    def direction(self, local: Any) -> Jet:
        return super().direction(_marked(local, self.slot))


def _marked(local: Any, slot: str) -> Any:
    return local if isinstance(local, Jet) else checkpoint_name(local, MARK + slot)


class NamingReader(GraphReader):
    """A reader that names constant vectors computed from fields of a joint, and drops whole turns of angles."""

    def __init__(self, graph: Graph):
        super().__init__(graph)
        self.derived: dict[tuple[int, ...], str] = {}

    def results(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        """Return the results of one operation, without the whole turns of an angle."""
        called = equation.params.get("name") if inner_program(equation.params) is not None else None
        if called == ROUNDING_OF_TURNS:
            shape = equation.outvars[0].aval.shape  # pyright: ignore[reportAttributeAccessIssue] - of an array
            return [Entries(np.full(shape, self.graph.constant(0.0)), float)]
        given = operands[0] if equation.primitive.name == "name" else None
        if not isinstance(given, Entries) or not str(equation.params["name"]).startswith(MARK):
            return super().results(equation, operands)
        return [self._vector(given, str(equation.params["name"])[-1])]

    def _vector(self, given: Entries, slot: str) -> Entries:
        """Return a constant vector of a body, with a name of its own if it is computed from fields."""
        numbers = tuple(int(x) for x in given.numbers.ravel())
        is_of_fields = all(self._is_of_fields(x) for x in numbers)
        if not is_of_fields or all(self.graph.nodes[x].operation in ("input", "constant") for x in numbers):
            return given
        if numbers not in self.derived:
            letters = iter(DERIVED)
            names = set(self.derived.values())
            self.derived[numbers] = next(name for x in letters if (name := f"{x}_{slot}") not in names)
        name = self.derived[numbers]
        parts = [self.graph.input(("v", name, c)) for c in range(len(numbers))]
        return Entries(np.array(parts, np.int64).reshape(given.shape), given.dtype)

    def _is_of_fields(self, number: int) -> bool:
        inputs = (self.graph.nodes[x] for x in self.graph.reached([number]))
        return all(node.operation != "input" or node.detail[0] in ("v", "k") for node in inputs)


def planar_pose(slot: str, pose: dict[str, Any]) -> PlanarPose:
    """Return a planar pose of coefficients that marks constant vectors of its body."""
    return _NamedPlanarPose(*(Jet(pose[name]) for name in ("position", "angle", "sine", "cosine")), slot=slot)


def spatial_pose(slot: str, pose: dict[str, Any]) -> SpatialPose:
    """Return a spatial pose of coefficients that marks constant vectors of its body."""
    spins = zip(*map(quaternion_spins, pose["quaternion"]), strict=True)
    axes = tuple(Jet(pose[f"axis_{k}"]) for k in range(3))
    velocity = Jet(pose["angular_velocity"]) if pose["angular_velocity"] else None
    parts = Jet(pose["position"]), Jet(pose["quaternion"]), tuple(map(Jet, spins)), axes, velocity
    return _NamedSpatialPose(*parts, slot=slot)


class Expansion:
    """Operations as polynomials; other operations are atoms, ("function", name, polynomials)."""

    def __init__(self, graph: Graph):
        self._graph = graph
        self._known: dict[int, Polynomial] = {}
        self._fixed: set[int] = set()  # nodes that depend on the values of the joint only
        self.constants: list[int] = []

    def of(self, root: int) -> Polynomial:
        """Return the polynomial of an operation."""
        for number in self._graph.reached([root]):
            if number not in self._known:
                self._known[number] = self._expanded(number)
        return self._known[root]

    def _expanded(self, number: int) -> Polynomial:
        node = self._graph.nodes[number]
        is_constant = all(x in self._fixed for x in node.operands)
        if is_constant and (node.operation != "input" or node.detail[0] in ("v", "k")):
            self._fixed.add(number)
        row = self._operation(node)
        if number not in self._fixed or all(_is_plain(atom) for m in row.terms for atom in m):
            return row
        self.constants.append(number)
        return Polynomial.atom(("c", len(self.constants)))

    def _operation(self, node: Node) -> Polynomial:
        parts = [self._known[x] for x in node.operands]
        if node.operation == "constant":
            return Polynomial.number(as_fraction(float(node.detail)))
        if node.operation == "input":
            return Polynomial.atom(node.detail)
        if node.operation == "add":
            return parts[0] + parts[1]
        if node.operation == "sub":
            return parts[0] + parts[1] * -1
        if node.operation == "neg":
            return parts[0] * -1
        if node.operation == "mul":
            return parts[0] * parts[1]
        if node.operation == "div":
            return parts[0] * parts[1].inverse()
        if node.operation == "hypot":
            return Polynomial.atom(("function", "sqrt", ((parts[0] * parts[0] + parts[1] * parts[1]).frozen(),)))
        return Polynomial.atom(("function", node.operation, tuple(part.frozen() for part in parts)))


def _is_plain(atom: Atom) -> bool:
    """Tell whether an atom is a value of a joint, the length of a vector of the joint, or an inverse of these."""
    if atom[0] == "inverse":
        return _is_plain(atom[1])
    return atom[0] in ("v", "k", "c") or bool(
        atom[:2] == ("function", "sqrt") and length_of(Polynomial(dict(atom[2][0])))
    )


def length_of(row: Polynomial) -> str:
    """Return the vector whose squared length a polynomial is; nothing for other polynomials."""
    names = {a[1] for m in row.terms for a in m if a[0] == "v"}
    if len(names) != 1 or any(len(m) != 2 or m[0] != m[1] or c != 1 for m, c in row.terms.items()):
        return ""
    return str(names.pop()) if len(row.terms) in (2, 3) else ""


def as_fraction(value: float) -> Fraction:
    """Return the simple fraction whose nearest double is a number, or the number itself.

    Raises
    ------
    UnwritableOperationError
        If the number is not finite.
    """
    if not math.isfinite(value):
        raise UnwritableOperationError(f"it has the number {value}, or compares with it")
    simple = Fraction(value).limit_denominator(40320)
    return simple if float(simple) == value else Fraction(value)
