"""Mobility at a position: by count of equations, by their rank, and by finite motions.

Equations of higher order may block a velocity that all joints allow. The series of the constraints show which
velocities can be continued, and where they branch (`constraint_series`, `tangent_cone`).
"""

import dataclasses
from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.errors import MechanismError, whole_number
from jounce.kinematics.assembly.assemble import check_assembled, find_assembly, redundancy_of
from jounce.kinematics.assembly.constraint_series import SINGULAR, ReducedConstraints
from jounce.kinematics.assembly.gauss_newton import AssemblyAttempt, Displacements, assemble_from_guess
from jounce.kinematics.assembly.initial_revolutions import Displace
from jounce.kinematics.assembly.redundancy import Repetition, closed_nearby
from jounce.kinematics.assembly.tangent_cone import LocalCurve, curves
from jounce.mechanism import Mechanism, Model, build, check_mechanism
from jounce.mechanism.building.builder import with_reference
from jounce.mechanism.building.preconditions import check_holonomic, concrete
from jounce.mechanism.time import first_instant

Kind = Literal["regular", "rigid", "shaky", "cusp", "singular", "change point"]
HIGHEST_ORDER = 20
TOLERANCE = 1e-12
NEARBY = 0.02  # rad or sizes of the mechanism: distance along a branch at which its degrees of freedom are counted
FARTHER = 0.05
SAME_BRANCH = 0.3  # rad, between tangent spaces
RANDOM_CURVES = 4
ADVICE = "no motion is found by series, but one by trial"


@dataclasses.dataclass(frozen=True)
class Branch:
    """A family of motions through a position.

    Attributes
    ----------
    freedom : int
        Degrees of freedom of the branch, counted at a position a little way along it.
    tangents : dict of str to array of shape (freedom, coordinates)
        Initial motion of each body along the branch: velocity of its origin, m, and angle (in space the angular
        velocity in its own axes), rad, up to a common factor.
    cusp : bool
        Whether the motion comes to rest at the position and turns back.
    """

    freedom: int
    tangents: dict[str, np.ndarray]
    cusp: bool = False

    def __str__(self) -> str:
        rates = {name: _turn(vectors[0]) for name, vectors in self.tangents.items()}
        largest = max(rates.values(), key=abs, default=0.0)
        if self.freedom == 1 and largest:
            phrases = [f"{name} {turn / largest + 0.0:.3g}" for name, turn in rates.items()]
            return ", ".join(phrases[:6]) + (", ..." if len(phrases) > 6 else "")
        moving = [name for name, vectors in self.tangents.items() if np.abs(vectors).max(initial=0.0) > 1e-9]
        return f"{_freedom(self.freedom)} of {', '.join(moving[:6])}{', ...' if len(moving) > 6 else ''}"


@dataclasses.dataclass(frozen=True)
class Mobility:
    """The mobility of a mechanism at a position, with its drivers released.

    Attributes
    ----------
    coordinates, equations : int
        Number of coordinates of the bodies, and of equations of the joints.
    instantaneous : int
        Degrees of freedom by the rank of the equations at the position: velocities that the joints allow.
    finite : int
        Degrees of freedom of the branch with most of them.
    order : int, optional
        Order to which motions were continued; None if the equations are independent, so that all velocities continue.
    kind : str
        ``"regular"``; ``"rigid"``, without any velocity; ``"shaky"``, with velocities that are all blocked; ``"cusp"``,
        ``"singular"`` or ``"change point"``, where only some velocities continue, along one branch or several.
    blocked : int, optional
        Order at which the last of the blocked velocities is blocked.
    branches : tuple of Branch
        Families of motions through the position.
    repetitions : tuple of Repetition
        Joints with redundant equations, and the joints whose equations they repeat.
    """

    coordinates: int
    equations: int
    instantaneous: int
    finite: int
    order: int | None
    kind: Kind
    blocked: int | None = None
    branches: tuple[Branch, ...] = ()
    repetitions: tuple[Repetition, ...] = ()

    @property
    def count(self) -> int:
        """Degrees of freedom by the Gruebler-Kutzbach count: coordinates minus equations."""
        return self.coordinates - self.equations

    def __str__(self) -> str:
        finite = _freedom(self.finite) + (f", finite to order {self.order}" if self.order else "")
        noun = "infinitesimal motion" + ("" if self.instantaneous == 1 else "s")
        if self.kind == "rigid":
            return _freedom(0)
        if self.kind == "regular":
            return finite
        if self.kind == "shaky":
            return f"shaky: {self.instantaneous} {noun}, blocked at order {self.blocked}"
        if self.kind == "change point":
            tangents = "; ".join(map(str, self.branches))
            return f"change point with {len(self.branches)} branches to order {self.order}, tangents: {tangents}"
        if not self.branches:
            return f"singular position with {self.instantaneous} {noun}: {ADVICE}"
        place = "at a cusp, where the motion comes to rest and turns back" if self.kind == "cusp" else "singular here"
        return f"{finite}, {place}: of {self.instantaneous} {noun} the others are blocked at order {self.blocked}"


def independent(coordinates: int, equations: int) -> Mobility:
    """Return the mobility of a mechanism whose equations are independent at a position."""
    freedom = coordinates - equations
    return Mobility(coordinates, equations, freedom, freedom, None, "regular" if freedom else "rigid")


@concrete
def mobility(mechanism: Mechanism, time: float | None = None, order: int = 10) -> Mobility:
    """Return the mobility of a mechanism at its assembled position: by count, by rank, and by finite motions.

    Drivers and initial conditions determine the position, and are then released.

    Parameters
    ----------
    mechanism : Mechanism
        A mechanism that can be assembled.
    time : float, optional
        Instant at which the drivers are evaluated, s; by default the first of the mechanism's own grid, or 0.
    order : int, default 10
        Order from 2 to 20 to which motions are continued where equations are dependent.

    Raises
    ------
    MechanismError
        If a value is not valid.
    AssemblyError
        If the bodies cannot be assembled.

    Examples
    --------
    Three hinges in a line allow a velocity but no motion; a four-bar moves:

    >>> import jounce as jn
    >>> hinge = jn.planar.Revolute
    >>> line = jn.Mechanism(
    ...     space="planar",
    ...     bodies={"left": jn.Body([0, 0]), "right": jn.Body([1, 0])},
    ...     joints={
    ...         "A": hinge(("ground", "left"), [0, 0], [0, 0]),
    ...         "B": hinge(("left", "right"), [1, 0], [0, 0]),
    ...         "C": hinge(("right", "ground"), [1, 0], [2, 0]),
    ...     },
    ... )
    >>> print(jn.mobility(line))
    shaky: 1 infinitesimal motion, blocked at order 2
    >>> print(jn.mobility(jn.load("examples/four_bar.yaml")))
    1 degree of freedom
    """
    check_mechanism(mechanism)
    check_holonomic(mechanism, "mobility to a finite extent")
    order = whole_number("order", order, 2, HIGHEST_ORDER, error=MechanismError)
    if time is None:
        time = first_instant(mechanism.time, mechanism.parameter_values)
    model, attempt = _released(mechanism, time)
    rows, columns = model.system.shape
    if attempt is None:
        return independent(columns, 0)
    matrix = attempt.jacobian.dense()
    sizes = np.linalg.svd(matrix, compute_uv=False)
    if np.sum(sizes > SINGULAR * sizes.max()) == rows:
        return independent(columns, rows)
    constraints = ReducedConstraints.at(model, attempt.coordinates, matrix, order)
    redundant = redundancy_of(model, attempt, time)[1]
    return dataclasses.replace(_analyzed(constraints, Displacements(model, time)), repetitions=redundant.repetitions)


def _released(mechanism: Mechanism, time: float) -> tuple[Model, AssemblyAttempt | None]:
    """Return the model of the joints alone, rows scaled, and its assembly, if any, as the drivers hold it."""
    driven = dataclasses.replace(mechanism, drivers={**mechanism.drivers, **mechanism.initial}, initial={}, outputs={})
    model = build(driven)
    coordinates = model.guess
    if model.rows:
        model, attempt = find_assembly(model, time, TOLERANCE)
        check_assembled(model, attempt, time, free=True)
        coordinates = attempt.coordinates
    model = build(dataclasses.replace(driven, drivers={}, forces={}))
    if not model.rows:
        return model, None
    model, _ = with_reference(model, coordinates, time)
    attempt = assemble_from_guess(model, time, TOLERANCE, coordinates)
    system = with_fields(model.system, row_scale=attempt.scale[:, None])
    return dataclasses.replace(model, system=system), attempt


def _analyzed(constraints: ReducedConstraints, displace: Displace) -> Mobility:
    """Return the mobility at a position where equations are dependent."""
    columns, rows = constraints.inverse.shape
    freedom, order = constraints.free.shape[1], constraints.order
    if not freedom:
        return Mobility(columns, rows, 0, 0, None, "rigid")
    if _all_go_on(constraints):
        single = Branch(freedom, _by_body(constraints, constraints.free.T))
        return Mobility(columns, rows, freedom, freedom, order, "regular", None, (single,))
    local_curves = curves(constraints)
    full_curves = [curve for curve in local_curves if curve.order == order]
    branches = _branches(constraints, full_curves, displace)
    blocked = max((curve.order + 1 for curve in local_curves if curve.order < order), default=2)
    finite = max((branch.freedom for branch in branches), default=0)
    if not branches:
        moves = _moves_by_trial(constraints, displace)
        kind: Kind = "singular" if moves else "shaky"
        return Mobility(columns, rows, freedom, int(moves), order, kind, blocked)
    only, *others = branches
    kind = "change point" if others else "cusp" if only.cusp else "regular" if only.freedom == freedom else "singular"
    return Mobility(columns, rows, freedom, finite, order, kind, blocked, branches)


def _all_go_on(constraints: ReducedConstraints) -> bool:
    """Return whether all velocities can be continued, judged by a random sample."""
    count = constraints.free.shape[1]
    velocities = np.random.default_rng(2).standard_normal((RANDOM_CURVES, count))
    series = np.zeros((RANDOM_CURVES, constraints.order, count))
    series[:, 0] = velocities / np.linalg.norm(velocities, axis=1, keepdims=True)
    gap, allowed = constraints.gap(series, constraints.order)
    return bool((np.abs(gap) <= allowed).all())


def _branches(
    constraints: ReducedConstraints, full_curves: Sequence[LocalCurve], displace: Displace
) -> tuple[Branch, ...]:
    """Return the branches to which curves belong: curves with the same tangent space a little farther on are one."""
    members: list[tuple[np.ndarray, list[LocalCurve]]] = []
    for curve in full_curves:
        coefficients = constraints.along(curve.series[None])[2][0]
        step = NEARBY ** (1.0 / curve.multiplicity)
        all_rows = np.ones(len(constraints.dependent), bool)
        nearby = closed_nearby(constraints.coordinates, constraints.placed(coefficients, step), all_rows, displace)
        velocity = constraints.free @ curve.tangent
        space = velocity[None] if nearby is None else nearby.free_directions
        for basis, branch_curves in members:
            if len(basis) == len(space) and np.linalg.svd(basis @ space.T, compute_uv=False)[-1] > np.cos(SAME_BRANCH):
                branch_curves.append(curve)
                break
        else:
            members.append((space, [curve]))
    branches = []
    for space, branch_curves in members:
        velocities = np.stack([constraints.free @ curve.tangent for curve in branch_curves])
        tangents = np.linalg.svd(velocities)[2][: len(space)] if len(branch_curves) > 1 else velocities
        cusp = all(curve.multiplicity > 1 for curve in branch_curves)
        branches.append(Branch(len(space), _by_body(constraints, tangents), cusp))
    return tuple(sorted(branches, key=lambda branch: branch.freedom))


def _moves_by_trial(constraints: ReducedConstraints, displace: Displace) -> bool:
    """Return whether bodies displaced along a free velocity can be assembled near the displaced position."""
    all_rows = np.ones(len(constraints.dependent), bool)
    random = np.random.default_rng(3).standard_normal((2 * RANDOM_CURVES, constraints.free.shape[1]))
    directions = np.concatenate([np.eye(random.shape[1]), -np.eye(random.shape[1]), random])
    for direction in directions:
        shift = constraints.free @ direction
        shift *= FARTHER / np.abs(shift).max()
        if closed_nearby(constraints.coordinates, shift, all_rows, displace) is not None:
            return True
    return False


def _by_body(constraints: ReducedConstraints, vectors: Float[np.ndarray, "vector column"]) -> dict[str, np.ndarray]:
    """Return scaled velocities by body, in SI units; the largest scaled component of each vector is one."""
    model = constraints.model
    scale = np.asarray(model.system.column_scale)
    vectors = vectors / np.abs(vectors).max(axis=1, keepdims=True)
    signs = np.sign([row[np.argmax(np.abs(row))] for row in np.round(vectors, 6)])
    parts = (vectors * signs[:, None]).reshape(len(vectors), len(model.bodies), -1) * scale
    return {name: parts[:, k] for k, name in enumerate(model.bodies)}


def _turn(vector: Float[np.ndarray, " coordinate"]) -> float:
    """Return the rotation rate of a body, with the sign of its largest component."""
    turns = vector[2:] if len(vector) == 3 else vector[3:]
    size = float(np.linalg.norm(turns))
    return 0.0 if size < 1e-9 else size * float(np.sign(turns[np.argmax(np.abs(turns))]))


def _freedom(number: int) -> str:
    return f"{number} degree{'' if number == 1 else 's'} of freedom"
