"""One compiled function: from solved neighbours to solved instants, with all their derivatives.

Each lane of the batch is predicted by the Taylor series of a neighbour, corrected by Newton-Raphson, and
differentiated order after order with the last factorisation of its Jacobian (Sommer 2024, equations 1-8).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jounce.jet import Jet
from jounce.jet.algebra import total
from jounce.kinematics.compilation import compiled
from jounce.kinematics.linear import DenseFactor
from jounce.kinematics.status import Status
from jounce.mechanism.system import System

MAX_ITERATIONS = 30
CONVERGED = 1e-9  # a last correction above this is no convergence, however small the tolerance
SAFE_FRACTION = 0.4  # of the time in which some Taylor term would move a body by a radian, or by the mechanism's size
LARGEST_DEPARTURE = 0.05  # from a prediction, rad or sizes of the mechanism
SMALLEST_DEPARTURE = 1e-6  # below this no prediction is called wrong
SINGULAR_PIVOT = 1e-8
FIRST_REFINED_ORDER = 5  # above, derivatives of some bodies are 10^10 times those of others, and lend them their errors
ROUNDING = 4e-15  # a correction this small (in rad, or in sizes of the mechanism) leaves the Jacobian as good as new


class Arrival(NamedTuple):
    """What is known of the instants of a batch; every array has the batch last."""

    coordinates: dict[str, Any]  # jets of the pose, by name, shape (order + 1, ...)
    outputs: tuple[Any, ...]  # jets of each group of outputs
    status: Any  # see Status
    body: Any  # index of the moving body that is farthest from its prediction
    safe_step: Any  # s, over which the motion from here can be predicted
    pivot_ratio: Any  # smallest pivot of the Jacobian over the largest
    admissible: Any  # whether each driver has a permitted value, shape (drivers, batch)


def _size(increment: Any) -> Any:
    return jnp.max(jnp.abs(increment), axis=0)


def newton_raphson(system: System, pose: Any, time: Jet, tolerance: Any, refine: Any) -> tuple[Any, DenseFactor, Any]:
    """Return the assembled pose, the factored Jacobian there, and the size of the last correction.

    An instant is accepted when its correction is at most the tolerance. With `refine` that correction is still made,
    and one more unless it was rounding already, so that quadratic convergence brings the pose to rounding.
    """

    def corrected(pose: Any) -> tuple[Any, DenseFactor, Any]:
        factor = DenseFactor.of(system.jacobian(pose, time))
        step = factor.solve(-system.residual(pose, time).coefficients[0])
        size = _size(step)
        step = jnp.where(refine | ~(size <= tolerance), step, 0.0)
        return pose.displaced(*system.coordinates(step, pose.shifts)), factor, size

    def unfinished(state: Any) -> Any:
        _, _, size, accepted_before, count = state
        done = jnp.where(refine, (size <= ROUNDING) | accepted_before, size <= tolerance)
        hopeful = jnp.isfinite(size) | (count == 0)  # what is not finite never will be
        return jnp.any(~done & hopeful) & (count < MAX_ITERATIONS)

    def iterate(state: Any) -> Any:
        pose, _, size, _, count = state
        return (*corrected(pose), size <= tolerance, count + 1)

    lanes = time.coefficients[0].shape[-1]
    state = (pose, DenseFactor.blank(system.cells.shape, lanes), jnp.full(lanes, jnp.inf), jnp.zeros(lanes, bool), 0)
    pose, factor, size, _, _ = jax.lax.while_loop(unfinished, iterate, state)
    return pose, factor, size


def differentiated(system: System, pose: Any, factor: DenseFactor, time: Jet) -> Any:
    """Return the pose with all derivatives that the time jet has: order after order, one solve each.

    The coefficient of order k of the residual is affine in the unknown (r[k], w'[k-1] / k) with the Jacobian as its
    slope, so that it is found from the coefficient with the unknown set to zero.
    """
    jacobian = system.jacobian(pose, time) if time.order >= FIRST_REFINED_ORDER else None
    for k in range(1, time.order + 1):
        trial = pose.extended(None, None)
        right = -system.residual(trial, time.truncate(k)).dense().coefficients[k]
        solution = factor.solve(right)
        if k >= FIRST_REFINED_ORDER:
            solution += factor.solve(right - jnp.sum(jacobian * solution[None], axis=1))
        pose = pose.extended(*system.coordinates(solution, pose.shifts))
        pose = jax.lax.optimization_barrier(pose)  # or XLA computes it again in everything that uses it
    return pose


def _continued(jet: Jet, expected: Any) -> Jet:
    """Shift an angle by the whole turns that bring it nearest to the one expected."""
    return jet + 2 * jnp.pi * jnp.round((expected - jet.coefficients[0]) / (2 * jnp.pi))


def _departures(system: System, pose: Any, predicted: Any) -> Any:
    """Return how far each moving body is from its prediction, rad or sizes of the mechanism: (bodies, batch)."""
    shift, turn = pose.separation(predicted)
    return jnp.maximum(_size(shift) / system.column_scale[0], _size(turn))[1:]


def _terms(system: System, coordinates: dict[str, Jet], predictor: tuple[str, ...]) -> list[Any]:
    """Return the size of each Taylor coefficient but the first, rad or sizes of the mechanism: order x (batch,)."""
    scales = {"position": system.column_scale[0]}
    return [
        jnp.max(
            jnp.stack([_largest(c) / scales.get(name, 1.0) for name, c in zip(predictor, level, strict=True)]), axis=0
        )
        for level in zip(*(coordinates[name].coefficients[1:] for name in predictor), strict=True)
    ]


def _largest(coefficient: Any) -> Any:
    return jnp.max(jnp.abs(coefficient.reshape(-1, coefficient.shape[-1])), axis=0)


def _safe_step(terms: list[Any]) -> Any:
    """Return the step at which no Taylor term moves a body far.

    All terms count, since those of the highest orders may vanish together (a body at rest, or at a turning point).
    """
    steps = [jnp.power(jnp.maximum(term, 1e-300), -1.0 / k) for k, term in enumerate(terms, 1)]
    return SAFE_FRACTION * jnp.min(jnp.stack(steps), axis=0)


def _predictable(departure: Any, travel: Any) -> Any:
    """Tell whether a departure from a prediction is small enough, for how far the prediction moves."""
    return departure <= jnp.minimum(LARGEST_DEPARTURE, jnp.maximum(0.2 * travel, SMALLEST_DEPARTURE))


def _travel(terms: list[Any], step: Any) -> Any:
    return total(term * jnp.abs(step) ** k for k, term in enumerate(terms, 1))


def _laws_predictable(system: System, instant: Any, step: Any, order: int) -> Any:
    """Tell whether the laws that may skip whole turns unseen keep to their own Taylor series over the step."""
    start, end = Jet.variable((instant - step)[None], order), Jet([instant[None]])
    result = jnp.ones(step.shape, bool)
    for before, after in zip(system.laws(start), system.laws(end), strict=True):
        away = jnp.abs(after.coefficients[0] - before.evaluate(step[None]))
        travel = _travel([jnp.abs(c) for c in before.dense().coefficients[1:]], step[None])
        result &= jnp.all(_predictable(away, travel), axis=0)
    return result


def _status(correction: Any, predictable: Any, pivot_ratio: Any, admissible: Any, tolerance: Any) -> Any:
    """Return the outcome at each instant, the gravest last."""
    outcomes = (
        (~predictable, Status.BRANCH_JUMP),
        (~(correction <= jnp.maximum(tolerance, CONVERGED)), Status.NOT_CONVERGED),
        (pivot_ratio <= SINGULAR_PIVOT, Status.SINGULAR),
        (~jnp.isfinite(correction), Status.NOT_CONVERGED),
        (~admissible, Status.INADMISSIBLE),
    )
    status = jnp.full(correction.shape, int(Status.OK))
    for happened, outcome in outcomes:
        status = jnp.where(happened, int(outcome), status)
    return status


@compiled("pose_type", "order")
def advance(
    system: System,
    coordinates: dict[str, Any],
    angles: tuple[Any, ...],
    step: Any,
    instant: Any,
    tolerance: Any,
    refine: Any,
    *,
    pose_type: type,
    order: int,
) -> Arrival:
    """Solve a batch of instants, each from a neighbour solved before.

    Parameters
    ----------
    system : System
        The mechanism.
    coordinates, angles
        Jets of the neighbours, shape (order + 1, ..., batch): of the pose, by name, and of each group of outputs that
        are angles known up to whole turns.
    step, instant : array of shape (batch,)
        Time from the neighbour, and the time arrived at, s.
    tolerance : float
        Largest correction of an accepted pose, rad or sizes of the mechanism.
    refine : bool
        Whether to correct accepted poses to rounding.
    pose_type, order
        PlanarPose or SpatialPose; derivatives wanted.
    """
    moving = {name: Jet(tuple(c)) for name, c in coordinates.items()}
    predicted = pose_type.predicted_from(moving, step)
    time = Jet.variable(instant[None], order)
    pose, factor, correction = newton_raphson(system, predicted, time.truncate(0), tolerance, refine)
    pose = differentiated(system, pose, factor, time)

    results = []
    known = iter(angles)
    for group in system.outputs:
        result = group.evaluate(pose)
        if group.element.turning:
            result = _continued(result, Jet(tuple(next(known))).evaluate(step))
        results.append(jnp.stack(result.dense().coefficients))
    departures = _departures(system, pose, predicted)
    travel = _travel(_terms(system, moving, pose_type.predictor), step)
    predictable = _predictable(jnp.max(departures, axis=0), travel) & _laws_predictable(system, instant, step, order)
    admissible = system.admissible(time)
    pivot_ratio = factor.pivot_ratio()
    status = _status(correction, predictable, pivot_ratio, jnp.all(admissible, axis=0), tolerance)
    reached = pose.coordinates()
    return Arrival(
        {name: jnp.stack(jet.dense().coefficients) for name, jet in reached.items()},
        tuple(results),
        status,
        jnp.argmax(departures, axis=0),
        _safe_step(_terms(system, reached, pose_type.predictor)),
        pivot_ratio,
        admissible,
    )
