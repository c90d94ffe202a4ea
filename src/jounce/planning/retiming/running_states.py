"""The fastest motion from the state of a running robot, along a path or first along a curve that joins it."""

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike
from jounce.errors import RobotError, SolveError, TrajectoryError
from jounce.planning.paths.joining import (
    MET,
    ROUNDING,
    SHARES,
    State,
    clean_state,
    extended_path,
    joined_from_rest,
    rates_along,
)
from jounce.planning.paths.path import Path
from jounce.planning.pieces import SmoothPieces
from jounce.planning.retiming.joining_curve import EVEN, JoiningCurve, joining_curve
from jounce.planning.retiming.quantities.feasibility import check_possible
from jounce.planning.retiming.quantities.path_quantities import Curves, Quantity
from jounce.planning.retiming.quantities.robot_quantities import ORDER, RobotQuantities
from jounce.planning.retiming.rates.rate_law import Conditions
from jounce.planning.retiming.retimed import RetimedTrajectory
from jounce.robot.algorithms.equations_of_motion import mass_matrix

SPARE = 2e-8  # fraction of a limit: margin that a search needs
SHORTEST = 1e-3  # fraction of the time of the rest of the path at the steady rate
USED = 0.5  # fraction of a limit used by the steady rate at the junction
DURATIONS = 10  # largest number of trial durations, each longer than the last
LONGER = (1.1, 2.5)  # smallest and largest ratio of successive durations
SHORTENED = 4  # largest number of bisections between an infeasible and a feasible duration
CLOSE = 1.1  # ratio of feasible to infeasible duration at which the bisection ends

Planned = Callable[[Path, Conditions, float | None], RetimedTrajectory]
"""Function that returns the motion along a path, which can have the rate 1 up to a value of s."""


def retimed_from(
    path: Path,
    raw_state: ArrayLike | None,
    conditions: Conditions,
    quantities: Callable[[Path], RobotQuantities],
    planned: Planned,
) -> RetimedTrajectory:
    """Return the motion along a path that starts in a state.

    Parameters
    ----------
    path : Path
        The path to follow.
    raw_state : array_like of shape (derivatives, joints), or None
        State of a running robot; None for a robot at the start of the path, with the rate of the conditions.
    conditions : Conditions
        Conditions of the law along the path.
    quantities : callable
        Returns the limited quantities of a path.
    planned : callable
        Returns the motion along a path.

    Raises
    ------
    TrajectoryError, SolveError
        If the state exceeds a limit, or no motion from it within the limits is found; the message names the limit.
    """
    if raw_state is None:
        return planned(path, conditions, None)
    if any(conditions.rates[:1]):
        message = "the state determines the initial rate; leave the first rate at 0"
        raise TrajectoryError(message, name="rates", value=list(conditions.rates))
    source = quantities(path)
    state = clean_state(raw_state, path.names, dict(source.limits.joints))
    check_possible(source, source.labels, path.start, path.stop)
    check_state(source, np.asarray(raw_state, float), ROUNDING)
    if largest_ratio(source, state)[0] > 1 - SPARE:  # a limit of a point or of a torque, not of a joint
        state = within_torque_limits(source, state * (1 - 2 * ROUNDING) ** np.arange(len(state))[:, None])
        check_state(source, state, -SPARE)
    if initial := rates_along(path, state):
        adapted = dataclasses.replace(conditions, rates=(initial[0], conditions.rates[1]), further=initial[1:])
        try:
            return planned(path, adapted, None)
        except SolveError:
            pass  # the path bends too sharply for this state: leave it, and join it again
    is_moving = bool(state[1].any())
    adapted = conditions
    if is_moving:
        adapted = dataclasses.replace(conditions, rates=(1.0, conditions.rates[1]), further=(0.0,) * (len(state) - 2))
    reasons: list[str] = []
    for fraction in SHARES:
        junction = path.start + fraction * (path.stop - path.start)
        try:
            if is_moving:
                joined_path, junction_s = joined(source, state, junction, conditions.order)
            else:
                joined_path, junction_s = joined_from_rest(path, state[0], junction), None
            return planned(joined_path, adapted, junction_s)
        except (SolveError, TrajectoryError, RobotError) as error:
            if error.name == "duration":
                raise
            reasons.append(f"joined at s = {junction:.6g}, {error.message.removesuffix('; choose smaller rates')}")
    message = (
        "no motion from this state onto the path was found that keeps the limits; choose another path, or leave more "
        f"of the limits to the motion before: {'; '.join(dict.fromkeys(reasons))}"
    )
    raise SolveError(message, name="state")


def check_state(source: RobotQuantities, state: Float[np.ndarray, "derivative joint"], allowed: float) -> None:
    """Raise TrajectoryError if a state exceeds a limit by more than a fraction of it."""
    for name, value in zip(source.path.names, state[0].tolist(), strict=True):
        limits = source.limits.joints[name]
        for bound, sign, side in ((limits.upper, 1, "above"), (limits.lower, -1, "below")):
            if bound is not None and sign * (value - bound) > ROUNDING * max(1.0, abs(bound)):
                message = f"the position of {name} is {side} the end of its range, {bound:g}, where the motion begins"
                raise TrajectoryError(message, name="state", value=value)
    ratio, value, label = largest_ratio(source, state)
    if ratio > 1 + allowed:
        phrase = "above" if ratio > 1 + ROUNDING else "to rounding at"
        message = (
            f"the {label.word} of {label.owner} is {phrase} its limit of {abs(value) / ratio:.6g} {label.unit} where "
            "the motion is to begin"
        )
        raise TrajectoryError(message, name="state", value=value)


def largest_ratio(
    source: RobotQuantities, state: Float[np.ndarray, "derivative joint"]
) -> tuple[float, float, Quantity]:
    """Return the largest ratio of a quantity of a state to its limit, the value, and the quantity."""
    curves, labels = _curves(source, state)[0], source.labels
    orders = (1, 2, 3, 2, 4)  # orders of derivatives of the quantities, in the order of the labels
    counts = [len(x) for x in (labels.first, labels.second, labels.rates, labels.vectors, labels.fourth)]
    ratios = np.where(np.repeat(orders, counts) < len(state), curves.ratios(EVEN)[0], 0.0)
    index = int(np.argmax(ratios))
    values = np.concatenate(curves.values(EVEN), axis=1)[0]
    return float(ratios[index]), float(values[index]), labels.every[index]


def within_torque_limits(source: RobotQuantities, state: Float[np.ndarray, "derivative joint"]) -> State:
    """Return a state with accelerations changed so that torques at their limits are below them by rounding."""
    if len(state) <= 2 or not source.with_effort:
        return state
    curves, q = _curves(source, state)
    first = len(source.with_acceleration)
    torques = curves.values(EVEN)[1][0, first:]
    low, high = (bounds[0, first:] * (1 - 2 * SPARE) for bounds in (curves.quantities.lower, curves.quantities.upper))
    excess = np.zeros(q.shape[2])
    excess[source.with_effort] = torques - np.clip(torques, low, high)
    masses = np.asarray(mass_matrix(source.robot, q[0, 0], drives=source.drives))
    relief = np.linalg.solve(masses[np.ix_(source.columns, source.columns)], excess[source.columns])
    return np.concatenate([state[:2], state[2:3] - relief, state[3:]])


def _curves(source: RobotQuantities, state: Float[np.ndarray, "derivative joint"]) -> tuple[Curves, np.ndarray]:
    """Return the limited quantities of a state at a rate of 1, and its coordinates."""
    motion = np.zeros((1, ORDER + 1, state.shape[1]))
    motion[0, : len(state)] = state
    shape, q = np.array([[source.path.start], [1.0], [0.0], [0.0], [0.0]]), source.whole(motion)
    return Curves(source.at(q, shape[0]), shape), q


def joined(source: RobotQuantities, state: State, junction: float, order: int) -> tuple[Path, float]:
    """Return a path that starts in a state at a rate of 1 and joins another path, and the value of s at the junction.

    Raises
    ------
    SolveError
        If no curve from the state keeps the limits; the message names the limit.
    """
    path, count = source.path, max(MET, order + 1)
    p = path.derivatives(np.array([junction]), count - 1)[0]
    rate = steady_rate(source, junction)
    ends = p * rate ** np.arange(count)[:, None]
    duration = max(first_duration(source, state, ends), SHORTEST * (path.stop - junction) / rate)
    curve, short_duration = joining_curve(source, state, ends, duration), 0.0
    for _ in range(DURATIONS):
        if not curve.over:
            break
        short_duration, duration = duration, duration * float(np.clip(1 + curve.over, *LONGER))
        curve = joining_curve(source, state, ends, duration)
    else:
        amount = f" by {100 * curve.over:.2g} %" if np.isfinite(curve.over) else ""
        message = (
            f"the {curve.worst.word} of {curve.worst.owner} would exceed its limit{amount} within {duration:.3g} s"
        )
        raise SolveError(message, name="state")
    for _ in range(SHORTENED):
        if duration < CLOSE * short_duration or not short_duration:
            break
        middle = float(np.sqrt(short_duration * duration))
        shorter = joining_curve(source, state, ends, middle)
        if shorter.over:
            short_duration = middle
        else:
            curve, duration = shorter, middle
    return _path_of(path, junction, rate, curve), duration


def steady_rate(source: RobotQuantities, s: float) -> float:
    """Return the rate at a place of the path that uses half of the limits."""
    shape = np.array([[s], [1.0], [0.0], [0.0], [0.0]])
    curves = Curves(source(shape[0]), shape)

    def utilization(z: float) -> float:
        return float(curves.ratios(z * EVEN).max())

    z, rest_value = 1.0, utilization(0.0)
    target = max(USED, (1 + rest_value) / 2)
    while utilization(z) > target and z > 1e-12:
        z /= 1.5
    while utilization(1.2 * z) <= target and z < 1e12:
        z *= 1.2
    return float(np.sqrt(z))


def first_duration(source: RobotQuantities, state: State, ends: Float[np.ndarray, "derivative joint"]) -> float:
    """Return an estimate of the time between two states, from the limits of velocity and acceleration."""
    limits = [source.limits.joints[name] for name in source.path.names]

    def bounds(field: str) -> np.ndarray:
        return np.array([getattr(x, field) or np.inf for x in limits])

    distance, turn = np.abs(ends[0] - state[0]), np.abs(ends[1] - state[1])
    speed = max(float(np.linalg.norm(state[1])), float(np.linalg.norm(ends[1])))
    duration = max(float((distance / bounds("velocity")).max()), float((turn / bounds("acceleration")).max()))
    return duration or float(np.linalg.norm(distance)) / speed


def _path_of(path: Path, s0: float, rate: float, curve: JoiningCurve) -> Path:
    from scipy.interpolate import BSpline

    from jounce.trajectory.splines import local_powers

    splines = curve.splines
    begins, stop = splines.ends[:-1], float(splines.ends[-1])
    powers = local_powers(BSpline(splines.knots, curve.coefficients, splines.degree), begins, splines.degree)
    return extended_path(
        path, s0, rate, [SmoothPieces(begins, powers[:, :, k], stop) for k in range(powers.shape[2])], stop
    )
