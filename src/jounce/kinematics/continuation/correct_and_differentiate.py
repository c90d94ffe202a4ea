"""One compiled function from solved neighbors to solved instants with all their derivatives.

Each lane of the batch is predicted by the Taylor series of a neighbor, corrected by Newton-Raphson, and differentiated
order after order with the last factorization of its Jacobian (Sommer 2024, equations 1-8). The quality of the
prediction does not decide whether an instant is on the branch of its neighbor. Instead, the simplified Newton iteration
must contract (Deuflhard 2011, chapter 5), and the determinant of the Jacobian must keep its sign. On request, the
nearest real or complex zero of the determinant is estimated; no step may go beyond it.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers, Real
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.jet.turns import shifted_by_turns
from jounce.kinematics.continuation.corrector import newton_raphson
from jounce.kinematics.continuation.jacobian_factors import Factor, factored
from jounce.kinematics.continuation.predictor import hidden_by_laws, laws_predictable, near_prediction, travel_of
from jounce.kinematics.continuation.singularity_distance import det_rate_of, det_rates_of
from jounce.kinematics.status import Status
from jounce.linear_algebra.least_squares import LeastSquaresFactor
from jounce.mechanism.system import Group, System
from jounce.mechanism.transmissions.axis_angles import measures_angle
from jounce.rigid.pose import Pose

Lanes = Float[Numbers, " batch"]
Truths = Bool[Numbers, " batch"]
SolvedState = tuple[Mapping[str, Numbers], tuple[Numbers, ...], Numbers]
"""State of a solved instant: jets of coordinates by name, jets of outputs, and the sign of the determinant."""

CONVERGED = 1e-9  # a last correction up to this size has converged, however small the tolerance
# part of the time in which a Taylor term would move a body by a radian, or by the size of the mechanism
SAFE_FRACTION = 0.4
SINGULAR_PIVOT = 1e-12  # part of the largest pivot; corrections stop converging earlier
LARGEST_GAP = 1e-9  # of redundant rows that agree, rad or sizes of the mechanism, or this many tolerances:
GAP_TOLERANCES = 1e3
LARGEST_CONTRADICTION = 1e-6  # of derivatives in redundant rows, relative to the possible derivatives of the motion


class Settings(NamedTuple):
    """Accuracy settings of a solve."""

    tolerance: Float[Numbers, ""]  # largest correction of an accepted pose, rad or sizes of the mechanism
    refine: Bool[Numbers, ""]  # whether accepted poses are corrected to rounding
    finite_order: Int[Numbers, ""]  # highest derivative that must be finite


class StepResult(NamedTuple):
    """Results of the instants of a batch; every array has the batch last."""

    coordinates: dict[str, Numbers]  # jets of the pose by name, shape (order + 1, ...)
    outputs: tuple[Numbers, ...]  # jets of each group of outputs
    status: Int[Numbers, " batch"]  # see Status
    body: Int[Numbers, " batch"]  # index of the moving body that is farthest from its prediction
    safe_step: Lanes  # time over which the first lane can be predicted, s; 0 unless searched; (1,)
    radius: Lanes  # the same by the first three Taylor terms, the least affected by rounding, s; (1,)
    deviation: Lanes  # departure from the prediction, relative to the predicted travel
    sign: Lanes  # of the determinant of the Jacobian
    det_rate: Lanes  # rate of approach (< 0) to, or departure from, a singular position, 1/s; (1,)
    pivot_ratio: Lanes  # smallest pivot of the Jacobian over the largest
    admissible: Bool[Numbers, "driver batch"]  # whether each driver has a permitted value
    finite: Bool[Numbers, "result batch"]  # of requested derivatives of the pose, and of each output
    gaps: Float[Numbers, "2 contradicting batch"]  # of redundant rows, see `_gaps`; empty without redundancy

    def state(self, lanes: slice | np.ndarray) -> SolvedState:
        """Return the state of some lanes, from which neighbors start."""
        return jax.tree.map(lambda x: x[..., lanes], (self.coordinates, self.outputs, self.sign))


def predicts_turns(group: Group) -> bool:
    """Return whether the outputs of a group are angles whose turns follow from a prediction.

    The turns of angles about axes are counted along the attitudes of the bodies instead: near an attitude at which such
    an angle is undefined it jumps by half a turn, which no series predicts.
    """
    return group.element.turning and not measures_angle(group)


def predictor(system: System, pose_type: type[Pose], solved: SolvedState) -> SolvedState:
    """Return the data of solved instants for predictions: jets of the pose and of turning angles, and the sign."""
    coordinates, outputs, sign = solved
    angles = [output for output, group in zip(outputs, system.outputs, strict=True) if predicts_turns(group)]
    return {name: coordinates[name] for name in pose_type.predictor}, tuple(angles), sign


def differentiated(system: System, pose: Pose, factor: Factor, time: Float[Jet, "1 batch"]) -> Pose:
    """Return the pose with all derivatives that the time jet has: order after order, one solve each.

    Coefficient k of the residual is affine in the unknown (r[k], w'[k-1] / k), with the Jacobian as its slope. The
    unknown thus follows from the coefficient evaluated with the unknown set to zero.
    """
    for k in range(1, time.order + 1):
        trial = pose.extended(None, None)
        rhs = -system.residual(trial, time.truncate(k)).dense().coefficients[k]
        pose = pose.extended(*system.coordinates(factor.solve(rhs), pose.shifts))
        pose = jax.lax.optimization_barrier(pose)  # otherwise XLA recomputes it wherever it is used
    return pose


def _departures(system: System, pose: Pose, predicted: Any) -> Float[Numbers, "body batch"]:
    """Return the distance of each moving body from its prediction, rad or sizes of the mechanism, (bodies, batch)."""
    shift, turn = (jnp.max(jnp.abs(part), axis=0) for part in pose.separation(predicted))
    return jnp.maximum(shift / system.column_scale[0], turn)[1:]


def _terms(system: System, coordinates: dict[str, Jet], predictor: tuple[str, ...]) -> list[Lanes]:
    """Return the size of each Taylor coefficient from order 1 on, rad or sizes of the mechanism, order x (batch,)."""
    # the scale of a slide that runs away, as toward a dead point of its axes, is its own position
    scales = {"position": jnp.maximum(system.column_scale[0], _largest(coordinates["position"].coefficients[0]))}
    sizes = [
        jnp.stack([_largest(c) / scales.get(name, 1.0) for name, c in zip(predictor, level, strict=True)])
        for level in zip(*(coordinates[name].coefficients[1:] for name in predictor), strict=True)
    ]
    return [jnp.max(jnp.where(jnp.isfinite(size), size, 0.0), axis=0) for size in sizes]


def _largest(coefficient: Float[Numbers, "*rest batch"]) -> Lanes:
    return jnp.max(jnp.abs(coefficient.reshape(-1, coefficient.shape[-1])), axis=0)


def safe_step_and_radius(system: System, coordinates: dict[str, Jet], predictor: tuple[str, ...]) -> tuple[Any, Any]:
    """Return the step over which no Taylor term moves a body far, and the radius estimated from the first three terms.

    The step uses all terms, since the highest may vanish together (for a body at rest or at a turning point).
    """
    terms = _terms(system, coordinates, predictor)
    steps = [jnp.power(jnp.maximum(term, 1e-300), -1.0 / k) for k, term in enumerate(terms, 1)]
    safe_step, radius = (SAFE_FRACTION * jnp.min(jnp.stack(subset), axis=0) for subset in (steps, steps[:3]))
    return safe_step, radius / SAFE_FRACTION


def _outputs(system: System, pose: Pose, angles: Sequence[Numbers], step: Lanes) -> tuple[Numbers, ...]:
    """Return the jets of the outputs, with the turns of angles predicted by the jets of a neighbor."""
    results, predictions = [], iter(angles)
    for group in system.outputs:
        result = group.evaluate(pose)
        if predicts_turns(group):
            expected = next(predictions)
            expected = Jet(tuple(jnp.where(jnp.isfinite(expected), expected, 0.0)))
            result = shifted_by_turns(result, expected.evaluate(step))
        results.append(stacked(result))
    return tuple(results)


def _finite_results(
    coordinates: Sequence[Numbers], outputs: Sequence[Numbers], finite_order: Int[Numbers, ""]
) -> Bool[Numbers, "result batch"]:
    """Return whether the pose and each output are finite up to the requested order."""

    def finite(jet: Numbers, axes: tuple[int, ...]) -> Any:
        unused = (np.arange(len(jet)) > finite_order).reshape(-1, *[1] * (jet.ndim - 1))
        return jnp.all(jnp.isfinite(jet) | unused, axis=axes)

    checks = [finite(jnp.max(part, axis=-2), tuple(range(part.ndim - 2))) for part in coordinates]
    return jnp.concatenate([jnp.all(jnp.stack(checks), axis=0, keepdims=True), *(finite(x, (0, 1)) for x in outputs)])


def _signs(system: System, factor: Factor, before: Callable[[], tuple[Pose, Jet]], sign: Lanes) -> Lanes:
    """Return the signs of the determinants of the Jacobians, given poses (`before`) and signs of the neighbors.

    With redundant rows there is no determinant; the orientation of the column space relative to the neighbor replaces
    it.
    """
    if isinstance(factor, LeastSquaresFactor):
        return factor.orientation(factored(system, *before())) * jnp.where(sign == 0, 1.0, sign)
    return factor.sign() if system.rank is None else jnp.ones_like(sign)  # large systems provide no orientation


def _gaps(
    system: System, pose: Pose, time: Jet, terms: list[Lanes], tolerance: Real
) -> Float[Numbers, "2 contradicting batch"]:
    """Return the gaps of redundant rows: their size, rad or sizes of the mechanism, and its ratio to the allowed size.

    The ratio also counts derivatives of the rows, relative to the possible derivatives of the motion.
    """
    if system.rank is None:
        return np.zeros((2, 0, *terms[0].shape))
    rate = jnp.max(jnp.stack([jnp.power(term, 1.0 / k) for k, term in enumerate(terms, 1)]), axis=0)
    values, *derivatives = system.residual(pose, time).dense().coefficients
    allowed = GAP_TOLERANCES * tolerance
    ratios, bound = [jnp.abs(values) / jnp.maximum(allowed, LARGEST_GAP)], jnp.maximum(allowed, LARGEST_CONTRADICTION)
    for k, level in enumerate(derivatives, 1):
        ratios.append(jnp.abs(level) / jnp.maximum(bound * rate**k, 1e-300)[None])
    return jnp.stack([jnp.abs(values), jnp.max(jnp.nan_to_num(jnp.stack(ratios)), axis=0)])


def _status(
    correction: Lanes,
    predictable: Truths,
    pivot_ratio: Lanes,
    admissible: Truths,
    finite: Truths,
    consistent: Truths,
    tolerance: Real,
) -> Int[Numbers, " batch"]:
    """Return the outcome at each instant; graver outcomes override others."""
    outcomes = (
        (~finite, Status.UNDEFINED),
        (~consistent, Status.INCONSISTENT),
        (~predictable, Status.BRANCH_JUMP),
        (~(correction <= jnp.maximum(tolerance, CONVERGED)), Status.NOT_CONVERGED),
        (pivot_ratio <= SINGULAR_PIVOT, Status.SINGULAR),
        (~jnp.isfinite(correction), Status.NOT_CONVERGED),
        (~admissible, Status.INADMISSIBLE),
    )
    status = np.full(correction.shape, int(Status.OK))
    for condition, outcome in outcomes:
        status = jnp.where(condition, int(outcome), status)
    return status


def advance(
    system: System,
    settings: Settings,
    source: SolvedState,
    step: Lanes,
    instant: Lanes,
    search: Bool[Numbers, ""],
    *,
    pose_type: type[Pose],
    order: int,
    searched: int = 1,
    with_det_rate: bool = True,
) -> StepResult:
    """Solve a batch of instants, each from a solved neighbor.

    Parameters
    ----------
    system : System
        The mechanism.
    settings : Settings
        Settings of all instants.
    source : tuple
        State of the neighbors as returned by `predictor`, batch last: jets of the pose and of turning angles, and the
        sign of the determinant of the Jacobian, 0 where it does not matter.
    step, instant : array of shape (batch,)
        Time step from the neighbor, and the instant itself, s.
    search : bool
        Whether to find the time over which the first lanes can be predicted, and the nearest singular position.
    pose_type, order
        PlanarPose or SpatialPose; derivatives requested.
    searched : int, default 1
        Number of lanes to search: one, or all.
    with_det_rate : bool, default True
        Whether to compute the rate of the determinant; otherwise it is zero.
    """
    arrival, factor, pose = solved_batch(system, settings, source, step, instant, pose_type=pose_type, order=order)
    first = arrival.status[:searched]

    def search_result() -> Any:
        hidden = hidden_by_laws(system, first, instant[:searched], step[:searched], order)
        det_rates = det_rate_of if searched == 1 else det_rates_of
        det_rate = det_rates(system, pose, factor, instant) if with_det_rate else np.zeros(1)
        first_lanes = {name: jet.map(lambda c: c[..., :searched]) for name, jet in pose.coordinates().items()}
        return hidden, det_rate, *safe_step_and_radius(system, first_lanes, pose_type.predictor)

    first, det_rate, safe_step, radius = jax.lax.cond(search, search_result, lambda: (first, *[np.zeros(searched)] * 3))
    status = jnp.concatenate([first, arrival.status[searched:]])
    return arrival._replace(status=status, det_rate=det_rate, safe_step=safe_step, radius=radius)


def solved_batch(
    system: System,
    settings: Settings,
    source: SolvedState,
    step: Lanes,
    instant: Lanes,
    *,
    pose_type: type[Pose],
    order: int,
) -> tuple[StepResult, Factor, Pose]:
    """Return the result of `advance` without the searched values, the factored Jacobian, and the pose."""
    (jets, angles, sign), (tolerance, refine, finite_order) = source, settings
    # infinite derivatives of a law, such as the third one of t**2.5 at t = 0, are useless for predictions
    finite_jets = {name: Jet(tuple(jnp.where(jnp.isfinite(c), c, 0.0))) for name, c in jets.items()}
    predicted = pose_type.predicted_from(finite_jets, step)
    time = Jet.variable(instant[None], order)
    pose, factor, correction = newton_raphson(system, predicted, time.truncate(0), tolerance, refine)
    pose = differentiated(system, pose, factor, time)

    outputs = _outputs(system, pose, angles, step)
    solved_jets = pose.coordinates()
    coordinates: dict[str, Numbers] = {name: stacked(jet) for name, jet in solved_jets.items()}
    departures = _departures(system, pose, predicted)
    departure = jnp.max(departures, axis=0)
    travel = travel_of(_terms(system, finite_jets, pose_type.predictor), step)
    signs = _signs(
        system, factor, lambda: (pose_type.predicted_from(finite_jets, 0.0 * step), Jet([(instant - step)[None]])), sign
    )
    predictable = near_prediction(departure, travel) & laws_predictable(system, instant, step, order)
    predictable &= correction.contracts() & ((sign == 0) | (signs == sign))
    admissible, pivot_ratio = system.admissible(time), factor.pivot_ratio()
    finite = _finite_results([coordinates[name] for name in pose_type.predictor], outputs, finite_order)
    admitted, defined = jnp.all(admissible, axis=0), jnp.all(finite, axis=0)
    terms = _terms(system, solved_jets, pose_type.predictor)
    gaps = _gaps(system, pose, time, terms, tolerance)
    consistent = jnp.all(gaps[1] <= 1.0, axis=0)
    status = _status(correction.last, predictable, pivot_ratio, admitted, defined, consistent, tolerance)
    body, deviation = jnp.argmax(departures, axis=0), departure / jnp.maximum(travel, 1e-300)
    zeros = jnp.zeros_like(step)  # placeholder of the searched values
    arrival = StepResult(
        coordinates, outputs, status, body, zeros, zeros, deviation, signs, zeros, pivot_ratio, admissible,
        finite, gaps,
    )  # fmt: skip
    return arrival, factor, pose
