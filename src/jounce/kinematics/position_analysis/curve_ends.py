"""Ends of open curves: a motion stops where a point reaches the end of its curve."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping

import numpy as np
from jaxtyping import Float

from jounce.kinematics.continuation.path_following import FollowedPath, attitudes_between, within_steps
from jounce.kinematics.status import Status
from jounce.mechanism.building.builder import Model
from jounce.mechanism.carriages import joint_of
from jounce.trajectory.curves import CurveLaw

SLACK = 1e-9  # of the length of a curve: how far rounding may take a point beyond its end
SAMPLES = 24  # of the curve parameters in each step of a motion
HALVINGS = 60


@dataclasses.dataclass(frozen=True)
class CurveEnds:
    """The range of a parameter of a curve or a surface.

    Parameters
    ----------
    joint : str
        Name of the joint.
    name : str
        Name of the parameter.
    body, component : int
        The body and the coordinate that hold the parameter; the ground is body 0.
    unit : float
        Length that the coordinate advances per unit of the parameter, m.
    low, high : float
        Least and greatest value of the parameter.
    is_only : bool
        Whether the element has no other parameter: a curve, not a surface.
    """

    joint: str
    name: str
    body: int
    component: int
    unit: float
    low: float
    high: float
    is_only: bool

    @property
    def slack(self) -> float:
        """Excess beyond an end that rounding may cause."""
        return SLACK * (self.high - self.low)

    def excess(self, position: Float[np.ndarray, "component body *time"]) -> Float[np.ndarray, "*time"]:
        """Return the excess of the parameter beyond its range, negative inside, for positions of all bodies."""
        value = np.asarray(position)[self.component, self.body] / self.unit
        return np.asarray(np.maximum(self.low - value, value - self.high) - self.slack)

    def words(self, beyond_high: bool) -> str:
        """Return the name of the joint and the end of its curve, for messages."""
        return f"joints.{self.joint} at its end {self.name} = {self.high if beyond_high else self.low:.6g}"


def ends_of(model: Model) -> list[CurveEnds]:
    """Return the ends of all open curves of a mechanism."""
    ends = []
    for group in model.system.groups:
        for curve in [x for x in vars(group.element).values() if isinstance(x, CurveLaw)]:
            if curve.ends is None:
                continue
            limits, unit = (np.asarray(x, float) for x in (curve.ends, curve.unit))
            for k, body in enumerate(group.bodies[-1]):
                joint = joint_of(model.bodies[body - 1])
                for component, name in enumerate(group.element.hidden):
                    low, high = limits[2 * component : 2 * component + 2, k, 0].tolist()
                    is_only = len(group.element.hidden) == 1
                    ends.append(CurveEnds(joint, name, body, component, float(unit[k, 0]), low, high, is_only))
    return ends


def beyond_end(curves: Iterable[CurveEnds], coordinates: Mapping[str, Float[np.ndarray, "..."]]) -> str:
    """Return the first curve end exceeded in a configuration, in words, or an empty string."""
    for ends in curves:
        position = np.asarray(coordinates["position"])[..., 0]
        if ends.excess(position) > 0:
            return ends.words(bool(position[ends.component, ends.body] / ends.unit > ends.high))
    return ""


def cut_at_ends(path: FollowedPath, curves: Iterable[CurveEnds], grid: Float[np.ndarray, " time"]) -> FollowedPath:
    """End the path where a point first reaches an end of its curve, and return it.

    `grid` has the instants that were solved on the way, s.
    """
    for ends in curves:
        end = _first_excess(path, ends)
        if end is None:
            continue
        instant, beyond_high = end
        if instant >= path.ended_at:
            continue
        path.anchors = [anchor for anchor in path.anchors if anchor.instant <= instant] or path.anchors[:1]
        path.change_points = [point for point in path.change_points if point.instant <= instant]
        path.is_solved &= grid < instant
        path.ended(Status.END_OF_CURVE, instant, ends.words(beyond_high))
    return path


def _first_excess(path: FollowedPath, ends: CurveEnds) -> tuple[float, bool] | None:
    """Return the first instant beyond an end, s, and whether that end is the upper one."""
    times = np.array([anchor.instant for anchor in path.anchors])
    series = [np.asarray(anchor.state[0]["position"])[:, :, ends.body : ends.body + 1] for anchor in path.anchors]
    coefficients = np.concatenate(series, axis=-1)
    coefficients = np.where(np.isfinite(coefficients), coefficients, 0.0)
    single = dataclasses.replace(ends, body=0)

    def positions(instants: Float[np.ndarray, " time"]) -> Float[np.ndarray, "component 1 time"]:
        return attitudes_between(times, coefficients, instants)

    samples = within_steps(times, SAMPLES)
    instants = np.union1d(samples, _peaks(lambda t: single.excess(positions(t)), samples))
    is_beyond = single.excess(positions(instants)) > 0
    if not is_beyond.any():
        return None
    first = int(np.argmax(is_beyond))
    low, high = float(instants[max(first - 1, 0)]), float(instants[first])
    for _ in range(HALVINGS if first else 0):
        middle = 0.5 * (low + high)
        is_outside = bool(single.excess(positions(np.array([middle])))[0] > 0)
        low, high = (low, middle) if is_outside else (middle, high)
    value = float(positions(np.array([high]))[ends.component, 0, 0]) / ends.unit
    return high, value > ends.high


def _peaks(
    excess: Callable[[Float[np.ndarray, " time"]], Float[np.ndarray, " time"]], samples: Float[np.ndarray, " time"]
) -> Float[np.ndarray, " peak"]:
    """Return the instants of the peaks between samples that may go beyond an end, by ternary search."""
    values = excess(samples)
    before, middle, after = values[:-2], values[1:-1], values[2:]
    rise = middle - np.minimum(before, after)  # a parabola through three samples rises an eighth of it above the middle
    candidates = np.flatnonzero((middle >= before) & (middle >= after) & (middle <= 0) & (middle + rise > 0))
    low, high = samples[candidates], samples[candidates + 2]
    for _ in range(HALVINGS if candidates.size else 0):
        third = (high - low) / 3
        rising = excess(low + third) < excess(high - third)
        low, high = np.where(rising, low + third, low), np.where(rising, high, high - third)
    return 0.5 * (low + high)
