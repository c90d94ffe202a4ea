"""Redundant constraints, from the rank of the Jacobian at several positions, and the joints that repeat others.

At a dead point, or where bodies happen to be aligned, the rank is low at that position only. The rank is therefore
taken at nearby general positions that fulfill the joints, with the drivers released.
"""

import dataclasses
import itertools
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jounce.kinematics.assembly.constraint_series import ReducedConstraints
from jounce.kinematics.assembly.initial_revolutions import Coordinates, Displace
from jounce.kinematics.assembly.tangent_cone import curves
from jounce.linear_algebra.host_jacobian import HostJacobian
from jounce.mechanism import Model

SWAYS = (0.1, 0.01)  # rad or sizes of the mechanism: distances of general positions from the assembled one
POSITIONS = 3
MOST_STEPS = 50
OPEN = 1e-7  # in vanishing combinations of rows: smaller parts count as zero
KINDS = {"joints": "joint", "drivers": "driver", "initial": "initial condition"}
CURVE_ORDER = 4  # of the curves that are sought away from a singular position
CLOSED = 1e-9  # rad or sizes of the mechanism: largest residual of joints at a general position
ROUNDING = 1e-14  # of scaled residuals: smaller differences do not distinguish two positions
STEP = 1e-3  # rad or sizes of the mechanism, over which the change of the Jacobian is measured


class Repetition(NamedTuple):
    """Redundant equations of one joint or driver.

    Attributes
    ----------
    kind : str
        ``"joint"`` or ``"driver"``.
    name : str
        Name of the joint or driver.
    equations : int
        Number of its equations that follow from those of others.
    of : tuple of str
        Names of the others; empty if its own equations repeat each other.
    """

    kind: str
    name: str
    equations: int
    of: tuple[str, ...]

    def __str__(self) -> str:
        noun = "equation" if self.equations == 1 else "equations"
        return f"{self.kind} {self.name} repeats {self.equations} {noun} of {', '.join(self.of) or 'its own'}"


@dataclasses.dataclass(frozen=True)
class Redundancy:
    """The rank of the equations of a mechanism, and the redundant ones among them.

    Attributes
    ----------
    rows : tuple of str
        Joint or driver of each row, as in a model.
    rank : int
        Rank of the Jacobian at general positions.
    at_assembly : HostJacobian
        Scaled Jacobian at the assembled position.
    jacobian : HostJacobian
        Scaled Jacobian at a position with the general rank.
    """

    rows: tuple[str, ...]
    rank: int
    at_assembly: HostJacobian
    jacobian: HostJacobian

    @property
    def count(self) -> int:
        """Number of equations that follow from others at general positions."""
        return len(self.rows) - self.rank

    @property
    def is_singular(self) -> bool:
        """Whether the assembled position is singular: its rank is below the general rank."""
        return self.at_assembly.rank < self.rank

    @cached_property
    def repetitions(self) -> tuple[Repetition, ...]:
        """Joints and drivers with redundant equations, and the ones they repeat."""
        return repetitions(self.rows, self.jacobian.dependences) if self.count else ()

    @property
    def among(self) -> tuple[str, ...]:
        """Joints and drivers whose equations depend on each other, named as in `rows`."""
        if not self.count:
            return ()
        weights = np.linalg.norm(self.jacobian.dependences, axis=1)
        return tuple(dict.fromkeys(itertools.compress(self.rows, weights > OPEN)))

    def __str__(self) -> str:
        return "; ".join(map(str, self.repetitions))


def redundancy(model: Model, coordinates: Coordinates, jacobian: HostJacobian, displace: Displace) -> Redundancy:
    """Return the redundancy of the equations of an assembled mechanism.

    Parameters
    ----------
    model : Model
        The mechanism.
    coordinates : dict of str to array
        Assembled coordinates of all bodies.
    jacobian : HostJacobian
        Jacobian at these coordinates, rows scaled to one size.
    displace : callable
        Maps coordinates and an increment to coordinates, residual and Jacobian, rows scaled alike.
    """
    at_assembly = _next_to_singular(coordinates, jacobian, displace)
    best, rank = jacobian, jacobian.rank
    if at_assembly.rank < min(at_assembly.shape) or at_assembly.shape[0] > at_assembly.shape[1]:
        for nearby in _nearby(model, coordinates, at_assembly, displace):
            if nearby.rank >= rank:
                best, rank = nearby, nearby.rank
    return Redundancy(model.rows, rank, at_assembly, best)


def _next_to_singular(coordinates: Coordinates, jacobian: HostJacobian, displace: Displace) -> HostJacobian:
    """Return the Jacobian with a tolerance that zeroes singular values that vanish within rounding of the position.

    Along the velocity v of a small singular value s, the residual combined with the left singular vector u grows as ``s
    x + c x^2 / 2``, where c is the rate of change of the Jacobian along v, projected on u and v. The position at ``x =
    -s / c`` is singular, and its residual differs from the present one by ``s^2 / 2 c``.
    """
    rows, sizes, columns = jacobian.smallest
    if not sizes.size:
        return jacobian
    zero = 0.0
    for k in np.flatnonzero(sizes > jacobian.tolerance * jacobian.largest):
        size, velocity = sizes[k], columns[:, k]
        ahead, behind = (displace(coordinates, sign * STEP * velocity).jacobian for sign in (1.0, -1.0))
        change = rows.T @ (ahead.times(columns) - behind.times(columns)) / (2 * STEP)
        if size**2 <= 2 * ROUNDING * np.linalg.norm(change):
            zero = max(zero, float(size))
    return dataclasses.replace(jacobian, tolerance=1.01 * zero / jacobian.largest) if zero else jacobian


def _nearby(model: Model, coordinates: Coordinates, jacobian: HostJacobian, displace: Displace) -> list[HostJacobian]:
    """Return the Jacobians at general positions nearby; random displacements that do not close are skipped."""
    joints = np.array([name.startswith("joints.") for name in model.rows], bool)
    directions = jacobian.take(joints).free_directions
    if not len(directions):
        return []
    random, jacobians = np.random.default_rng(1), []  # any directions will do, as long as they are reproducible
    for _ in range(POSITIONS):
        shift = random.normal(size=len(directions)) @ directions
        for size in SWAYS:
            nearby = closed_nearby(coordinates, size * shift / np.abs(shift).max(), joints, displace)
            if nearby is not None:
                jacobians.append(nearby)
                break
    return jacobians or _along_curves(model, coordinates, jacobian, joints, displace)


def _along_curves(
    model: Model, coordinates: Coordinates, jacobian: HostJacobian, joints: Bool[np.ndarray, " row"], displace: Displace
) -> list[HostJacobian]:
    """Return the Jacobians a little way along the curves that leave a singular position."""
    if not joints.any() or jacobian.is_large:
        return []
    constraints = ReducedConstraints.at(model, coordinates, jacobian.dense(), CURVE_ORDER, joints)
    full_curves = [curve for curve in curves(constraints) if curve.order == CURVE_ORDER]
    jacobians = []
    for curve in full_curves:
        coefficients = constraints.along(curve.series[None])[2][0]
        shift = constraints.placed(coefficients, SWAYS[-1] ** (1.0 / curve.multiplicity))
        nearby = closed_nearby(coordinates, shift, joints, displace)
        jacobians += [] if nearby is None else [nearby]
    return jacobians


def closed_nearby(
    coordinates: Coordinates, shift: Float[np.ndarray, " column"], joints: Bool[np.ndarray, " row"], displace: Displace
) -> HostJacobian | None:
    """Return the Jacobian at a position near a displaced one that fulfills the joints; None if it falls back.

    Parameters
    ----------
    coordinates : dict of str to array
        Coordinates of all bodies.
    shift : array of shape (columns,)
        Displacement, rad and sizes of the mechanism.
    joints : array of bool, shape (rows,)
        Rows that must hold.
    displace : callable
        As in `redundancy`.
    """
    displaced, total = displace(coordinates, shift), shift
    for _ in range(MOST_STEPS):
        correction = displaced.jacobian.take(joints).step(displaced.residual[joints])
        if correction is None or np.abs(correction).max(initial=0.0) > 1.0:
            return None
        displaced, total = displace(displaced.coordinates, correction), total + correction
        if np.abs(correction).max(initial=0.0) < 1e-12:
            break
    distance = np.abs(total).max(initial=0.0)
    open_ = np.abs(displaced.residual[joints]).max(initial=0.0)
    return displaced.jacobian if open_ <= CLOSED and distance > 0.1 * np.abs(shift).max() else None


def repetitions(rows: tuple[str, ...], combinations: Float[np.ndarray, "row combination"]) -> tuple[Repetition, ...]:
    """Return the joints and drivers with redundant equations, and the ones they repeat.

    Parameters
    ----------
    rows : tuple of str
        Joint or driver of each row.
    combinations : array of shape (rows, combinations)
        Orthonormal basis of the vanishing combinations of rows.
    """
    names = list(dict.fromkeys(rows))
    parts = {name: combinations[[k for k, row in enumerate(rows) if row == name]] for name in names}
    repeated = []
    while combinations.shape[1]:
        ranks = {name: _rank(part) for name, part in parts.items()}
        rank = max(ranks.values())
        # among joints that repeat equally many, the last one; a driver comes after all joints
        name = [name for name in names if ranks[name] == rank][-1]
        _, _, basis = np.linalg.svd(parts[name])
        used, unused = basis[:rank].T, basis[rank:].T
        others = [other for other in names if other != name and np.linalg.norm(parts[other] @ used) > OPEN]
        kind, _, short_name = name.partition(".")
        repeated.append(Repetition(KINDS.get(kind, kind), short_name, rank, tuple(x.partition(".")[2] for x in others)))
        combinations = combinations @ unused
        parts = {name: part @ unused for name, part in parts.items()}
    return tuple(repeated)


def _rank(part: Float[np.ndarray, "row combination"]) -> int:
    return int(np.linalg.matrix_rank(part, tol=OPEN)) if part.size else 0
