"""Ends of open curves: a motion that comes to one ends there, and is never continued beyond."""

import dataclasses
from collections.abc import Iterable, Mapping

import numpy as np
from jaxtyping import Float

from jounce.kinematics.continuation.path_following import FollowedPath, attitudes_between, within_steps
from jounce.kinematics.status import Status
from jounce.mechanism.building.builder import Model
from jounce.mechanism.carriages import joint_of
from jounce.trajectory.curves import CurveLaw

SLACK = 1e-9  # of the length of a curve: how far rounding may take a point beyond its end
SAMPLES = 24  # in each step of a motion at which its parameters are looked at
HALVINGS = 60


@dataclasses.dataclass(frozen=True)
class CurveEnds:
    """Where a parameter of a curve or a surface ends.

    Parameters
    ----------
    joint : str
        Its name.
    name : str
        Of the parameter.
    body, component : int
        Which coordinate of which body has the parameter, the ground being body 0.
    unit : float
        By which that coordinate is the parameter, m.
    low, high : float
        The least and the greatest value of the parameter.
    is_only : bool
        Whether it is the only parameter: that of a curve.
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
        """How far rounding may take the parameter beyond an end."""
        return SLACK * (self.high - self.low)

    def excess(self, position: Float[np.ndarray, "component body *time"]) -> Float[np.ndarray, "*time"]:
        """Return how far positions of bodies are beyond an end, below zero where they are between both."""
        value = np.asarray(position)[self.component, self.body] / self.unit
        return np.asarray(np.maximum(self.low - value, value - self.high) - self.slack)

    def words(self, beyond_high: bool) -> str:
        """Say which end of which curve it is."""
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
    """Say at which end of which curve bodies are beyond it, in one position; nothing where they are not."""
    for ends in curves:
        position = np.asarray(coordinates["position"])[..., 0]
        if ends.excess(position) > 0:
            return ends.words(bool(position[ends.component, ends.body] / ends.unit > ends.high))
    return ""


def cut_at_ends(path: FollowedPath, curves: Iterable[CurveEnds], grid: Float[np.ndarray, " time"]) -> FollowedPath:
    """Return a path that ends where a point first comes to an end of its curve; the same where none does.

    The grid has the instants that were solved on the way, s.
    """
    for ends in curves:
        end = _leaves(path, ends)
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


def _leaves(path: FollowedPath, ends: CurveEnds) -> tuple[float, bool] | None:
    """Return when the parameter is beyond an end for the first time, s, and whether it is the upper one."""
    times = np.array([anchor.instant for anchor in path.anchors])
    series = [np.asarray(anchor.state[0]["position"])[:, :, ends.body : ends.body + 1] for anchor in path.anchors]
    whole = np.concatenate(series, axis=-1)
    whole = np.where(np.isfinite(whole), whole, 0.0)
    shared = dataclasses.replace(ends, body=0)

    def positions(instants: Float[np.ndarray, " time"]) -> Float[np.ndarray, "component 1 time"]:
        return attitudes_between(times, whole, instants)

    instants = within_steps(times, SAMPLES)
    beyond = shared.excess(positions(instants)) > 0
    if not beyond.any():
        return None
    first = int(np.argmax(beyond))
    low, high = float(instants[max(first - 1, 0)]), float(instants[first])
    for _ in range(HALVINGS if first else 0):
        middle = 0.5 * (low + high)
        out = bool(shared.excess(positions(np.array([middle])))[0] > 0)
        low, high = (low, middle) if out else (middle, high)
    value = float(positions(np.array([high]))[ends.component, 0, 0]) / ends.unit
    return high, value > ends.high
