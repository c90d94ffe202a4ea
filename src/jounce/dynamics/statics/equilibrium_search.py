"""The search for an equilibrium of a mechanism: a damped Newton method along the constraints."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.dynamics.forward.accelerations import Equations
from jounce.dynamics.masses import gravity_of, masses_of
from jounce.dynamics.statics.operating_point import OperatingPoint, changes_of_coordinates
from jounce.dynamics.statics.variations import at_rest, clock_at, residuals_at
from jounce.errors import SolveError
from jounce.jet import Jet
from jounce.kinematics import Status
from jounce.kinematics.assembly.initial_revolutions import Coordinates
from jounce.linear_algebra.host_jacobian import RANK_TOLERANCE
from jounce.mechanism import Mechanism, Model
from jounce.mechanism.building.builder import with_reference
from jounce.mechanism.building.element_indices import force_names
from jounce.mechanism.building.starting_guess import pose_at

MAX_STEPS = 300
LONGEST = 0.25  # rad or sizes of the mechanism: bound of a step
ADRIFT = 50  # longest steps in a row without resisting stiffness, after which the search has diverged
CLOSED = 1e-11  # rad or sizes of the mechanism: a shorter step ends the search
BALANCED = 1e-9  # fraction of the loads: largest residual of an equilibrium
FLAT = 1e-10  # fraction of the stiffness: less counts as zero in a step
WORTH = 1e-14  # fraction of the loads: less is rounding


class SearchResult(NamedTuple):
    """The end of a search.

    Attributes
    ----------
    point : OperatingPoint
        The mechanism at rest at the end of the search.
    left : array of shape (directions,)
        Unbalanced generalized forces, in free directions of the scaled coordinates.
    balanced : bool
        Whether the unbalanced forces are zero up to rounding.
    """

    point: OperatingPoint
    left: Float[np.ndarray, " direction"]
    balanced: bool


def rest_point(mechanism: Mechanism, model: Model, coordinates: Coordinates, instant: float) -> OperatingPoint:
    """Return the operating point of a mechanism at rest, with the laws of drivers and forces frozen at an instant."""
    system = with_fields(model.system, outputs=())
    equations = Equations(system, masses_of(mechanism), gravity_of(mechanism), 1.0, model.pose_type)
    return OperatingPoint(mechanism, model, equations, at_rest(coordinates), clock_at(instant, stopped=True))


def driven(point: OperatingPoint) -> OperatingPoint:
    """Return a fully driven operating point with the velocities and accelerations that the driver laws prescribe."""
    coordinates = {name: x.copy() for name, x in point.coordinates.items()}
    clock, shifts = clock_at(point.instant, stopped=False), point.model.pose_type.shifts
    for level in (1, 2):  # the residual of each order is affine in the coordinates of that order
        gaps = np.asarray(residuals_at(point.equations, coordinates, clock))[level]
        column = np.linalg.lstsq(point.jacobian, -gaps, rcond=RANK_TOLERANCE)[0]
        change = point.changes(column[None, :, None])[0]
        coordinates["position"][level] = change[:shifts]
        if "angle" in coordinates:
            coordinates["angle"][level] = change[shifts]
        else:
            coordinates["angular_velocity"][level - 1] = level * change[shifts:]
    return dataclasses.replace(point, coordinates=coordinates, clock=clock)


def search(start: OperatingPoint, *, settle: bool) -> SearchResult:
    """Return the equilibrium that a search from a position finds, or its last position without success.

    Parameters
    ----------
    start : OperatingPoint
        The mechanism at rest, with its constraints satisfied.
    settle : bool
        Descend along the work of the forces, as a mechanism that creeps to rest: this finds stable equilibria, or the
        start itself if it is one. Otherwise Newton's method finds any equilibrium nearby.
    """
    point, drifted, scale = start, 0, 1.0
    for _ in range(MAX_STEPS):
        free_directions = point.free
        residual = free_directions.T @ point.loads.sum(axis=0)
        if not free_directions.shape[1]:
            return SearchResult(point, residual, True)
        stiffness = _stiffness(point)
        scale = _scale(point, stiffness)
        step = free_directions @ _step(residual, stiffness, scale, settle=settle)
        size = float(np.max(np.abs(step), initial=0.0))
        if size <= CLOSED:
            return _ended(_moved(point, step) or point, scale)
        following = _shortened(point, step * min(1.0, LONGEST / size), residual, settle=settle)
        flat = size > LONGEST and _is_flat(stiffness, free_directions.T @ step, residual)
        drifted = drifted + 1 if flat else 0
        if following is None or drifted > ADRIFT:
            break
        point = following
    return _ended(point, scale)


def _is_flat(stiffness: np.ndarray, step: np.ndarray, left: np.ndarray) -> bool:
    """Return whether the unbalanced forces hardly change along the longest permitted step."""
    change = stiffness @ step * (LONGEST / np.abs(step).max())
    return bool(np.linalg.norm(change) < 1e-3 * np.linalg.norm(left))


def _ended(point: OperatingPoint, scale: float) -> SearchResult:
    left = point.free.T @ point.loads.sum(axis=0)
    return SearchResult(point, left, bool(np.abs(left).max(initial=0.0) <= BALANCED * scale))


def load_scale(point: OperatingPoint) -> float:
    """Return the size of the largest load, or of the load of a unit displacement if it is larger, N m."""
    return _scale(point, _stiffness(point) if point.free.shape[1] else np.zeros((0, 0)))


def _scale(point: OperatingPoint, stiffness: np.ndarray) -> float:
    return max(_largest_load(point), float(np.abs(stiffness).max(initial=0.0)), 1e-300)


def _stiffness(point: OperatingPoint) -> Float[np.ndarray, "direction direction"]:
    directions = point.free
    return directions.T @ point.varied(changes_of_coordinates(directions))[0].sum(axis=0)


def _largest_load(point: OperatingPoint) -> float:
    """Return the size of the largest load: weight, an applied force, or a constraint force, N m."""
    borne = point.jacobian.T @ point.multipliers
    return float(max(np.abs([*point.loads, borne]).max(initial=0.0), point.pushed.max(initial=0.0)))


def _step(
    residual: Float[np.ndarray, " direction"],
    stiffness: Float[np.ndarray, "direction direction"],
    scale: float,
    *,
    settle: bool,
) -> Float[np.ndarray, " direction"]:
    """Return the Newton step; to settle, a step along which the forces do positive work for any stiffness."""
    values, vectors = np.linalg.eigh((stiffness + stiffness.T) / 2)
    floor = FLAT * scale
    if values[0] > floor or not settle:
        left_vectors, sizes, right_vectors = np.linalg.svd(stiffness)
        terms = left_vectors.T @ residual
        steps = np.where((sizes > floor) | (np.abs(terms) > WORTH * scale), terms / np.maximum(sizes, floor), 0.0)
        return -right_vectors.T @ steps
    terms = vectors.T @ residual
    curved = np.maximum(np.abs(values), floor)
    return -vectors @ np.where((np.abs(values) > floor) | (np.abs(terms) > WORTH * scale), terms / curved, 0.0)


def _shortened(
    point: OperatingPoint, step: Float[np.ndarray, " column"], residual: Any, *, settle: bool
) -> OperatingPoint | None:
    """Return the point after a step, halved until the forces do work or balance better; None if they never do."""
    size = float(np.max(np.abs(step)))
    for _ in range(30):
        trial = _moved(point, step)
        if trial is not None:
            force_after = trial.free @ (trial.free.T @ trial.loads.sum(axis=0))
            force_before = point.free @ residual
            if not np.isfinite(force_after).all():
                pass
            elif size <= 1e-7:
                return trial
            elif settle:
                if 0.5 * (force_before + force_after) @ step < 0 or not force_before @ step < 0:
                    return trial
            elif np.linalg.norm(force_after) < np.linalg.norm(force_before):
                return trial
        step, size = step * 0.5, size * 0.5
    return None


def _moved(point: OperatingPoint, step: Float[np.ndarray, " column"]) -> OperatingPoint | None:
    """Return the mechanism assembled after a step of the scaled coordinates; None if it cannot be assembled.

    Angles about axes continue from those before the step, and so count their revolutions.
    """
    coordinates = point.closed(point.displaced(point.changes(step[None, :, None])[0]))
    if coordinates is None:
        return None
    model, _ = with_reference(point.model, coordinates, point.instant, point.model.prescribed, keep=True)
    system = with_fields(model.system, outputs=())
    equations = dataclasses.replace(point.equations, system=system)
    return dataclasses.replace(point, model=model, equations=equations, coordinates=at_rest(coordinates))


def check_forces(point: OperatingPoint) -> None:
    """Raise SolveError if an applied force has no finite value at rest."""
    system = point.equations.system
    if not system.forces:
        return
    pose = pose_at(point.place, point.model.pose_type).extended(None, None)
    fit = np.asarray(system.finite_forces(pose, Jet([np.full((1, 1), point.instant), np.zeros((1, 1))])))[:, 0]
    unfit = [f"forces.{name}" for name, is_finite in zip(force_names(point.model), fit, strict=True) if not is_finite]
    if unfit:
        message = (
            f"{', '.join(unfit)}: the force has no finite value at rest, where an equilibrium is looked for; check its "
            "law: a division by a velocity, as of friction, must be smoothed, for example by tanh"
        )
        raise SolveError(message, status=Status.INADMISSIBLE)


def remains(result: SearchResult) -> str:
    """Return a text on the largest unbalanced force and moment at the end of a search, and its body."""
    point = result.point
    model, shifts = point.model, point.model.pose_type.shifts
    by_body = -(point.free @ result.left).reshape(len(model.bodies), -1)
    body = int(np.argmax(np.linalg.norm(by_body, axis=1)))
    force, moment = by_body[body, :shifts], by_body[body, shifts:]
    phrases = []
    if np.abs(force).max() > 0.05 * np.abs(by_body[body]).max():
        phrases.append(f"a force of ({', '.join(f'{x / model.length + 0.0:.4g}' for x in force)}) N")
    if np.abs(moment).max() > 0.05 * np.abs(by_body[body]).max():
        inner = ", ".join(f"{x + 0.0:.4g}" for x in moment)
        phrases.append(f"a moment of {inner if len(moment) == 1 else f'({inner})'} N m")
    return f"{' and '.join(phrases)} on {model.bodies[body]}"
