"""Limits of a motion along a path: of joints, including jounce and limits that depend on position, and of points."""

import dataclasses
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import RobotError, check_name
from jounce.rigid.inertia import vector_numbers
from jounce.robot.model.links_and_joints import Limits
from jounce.robot.robot import Robot

VARYING = ("velocity", "acceleration", "deceleration", "jerk", "jounce", "effort", "effort_rate")

PAIR = ("acceleration", "deceleration")

PositionLaw = Callable[[Float[np.ndarray, " point"]], Any]
"""Function from positions of a joint, rad or m, to a limit."""


@dataclasses.dataclass(frozen=True)
class PointLimits:
    """Limits of the motion of a point of a link.

    Parameters
    ----------
    link : str
        Name of the link.
    speed, acceleration : float or None
        Largest magnitudes, m/s and m/s^2; None for no limit.
    point : tuple of float
        The point, m, in the frame of the link; its origin unless given.
    """

    link: str
    speed: float | None = None
    acceleration: float | None = None
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for field in ("speed", "acceleration"):
            _check_positive(field, getattr(self, field))
        object.__setattr__(self, "point", tuple(vector_numbers("point", self.point, (3,)).tolist()))


@dataclasses.dataclass(frozen=True)
class MotionLimits:
    """Limits of the motion of a robot, for `retime`.

    Parameters
    ----------
    joints : dict of str to Limits, optional
        Limits of joints that replace those of the robot; limits of joints that follow them hold as well.
    jounce : dict of str to float, optional
        Largest fourth derivatives of coordinates, rad/s^4 or m/s^4.
    varying : dict of str to dict of str to callable, optional
        Limits of a joint that depend on its position: velocity, acceleration, deceleration, jerk, jounce, effort or
        effort_rate as a function of an array of positions. They replace constant limits, except those of joints that
        follow.
    points : tuple of PointLimits, optional
        Limits of points of links, such as the tool.
    backward : dict of str to Limits, optional
        Limits of negative values of a joint, such as the backward velocity or the pulling torque, if they differ from
        those of positive values: velocity, acceleration, deceleration, jerk, effort or effort_rate.

    Raises
    ------
    RobotError
        If a limit is not greater than zero, or a backward limit is a range.

    Examples
    --------
    >>> import jounce as jn
    >>> slow = jn.planning.MotionLimits(points=(jn.planning.PointLimits("panda_hand", speed=0.25),))
    >>> near_the_end = jn.planning.MotionLimits(varying={"elbow": {"velocity": lambda q: 2.0 - 0.5 * q**2}})
    """

    joints: Mapping[str, Limits] = dataclasses.field(default_factory=dict)
    jounce: Mapping[str, float] = dataclasses.field(default_factory=dict)
    varying: Mapping[str, Mapping[str, PositionLaw]] = dataclasses.field(default_factory=dict)
    points: tuple[PointLimits, ...] = ()
    backward: Mapping[str, Limits] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value in self.jounce.items():
            _check_positive(f"jounce.{name}", value)
        for name, laws in self.varying.items():
            for field, law in laws.items():
                check_name("limit", field, VARYING, RobotError, name=f"varying.{name}")
                if not callable(law):
                    raise RobotError("must be a function of the position", name=f"varying.{name}.{field}", value=law)
        for name, entry in self.backward.items():
            if not isinstance(entry, Limits):
                raise RobotError("must be Limits", name=f"backward.{name}", value=entry)
            if entry.lower is not None or entry.upper is not None:
                raise RobotError("a range has no direction; give it in joints", name=f"backward.{name}", value=entry)
        for field in ("joints", "jounce", "varying", "backward"):
            object.__setattr__(self, field, MappingProxyType(dict(getattr(self, field))))
        object.__setattr__(self, "points", tuple(self.points))

    def own(self, name: str) -> frozenset[str]:
        """Return the fields of `Limits` of a joint that depend on position or direction, with their pairs."""
        fields = set(self.varying.get(name, {})) | directed(self.backward.get(name, Limits()))
        return frozenset(fields | (set(PAIR) if fields & set(PAIR) else set()))


def directed(limits: Limits) -> set[str]:
    """Return the names of the limits that are set."""
    return {name for name, value in dataclasses.asdict(limits).items() if value is not None}


GivenLimits = Mapping[str, Limits] | MotionLimits
"""Limits by name of the joint, or all limits of a motion."""


def limits_of(robot: Robot, limits: GivenLimits | None) -> MotionLimits:
    """Return limits as `MotionLimits` with entries for all joints of the robot.

    Raises
    ------
    RobotError
        If a joint or link does not exist, or an entry is not a limit.
    """
    given = MotionLimits() if limits is None else limits
    if isinstance(given, Mapping):
        given = MotionLimits(joints=given)
    if not isinstance(given, MotionLimits):
        raise RobotError(
            "must be MotionLimits, or Limits of joints by name", name="limits", value=type(limits).__name__
        )
    for field in ("joints", "jounce", "varying", "backward"):
        for name, entry in getattr(given, field).items():
            check_name("moving joint", name, robot.joint_names, RobotError, name="limits")
            if field == "joints" and not isinstance(entry, Limits):
                raise RobotError("must be Limits", name=f"limits.{name}", value=entry)
    for point in given.points:
        check_name("link", point.link, robot.frames, RobotError, name="limits")
    chosen = {name: given.joints.get(name, robot.joints[name].limits) for name in robot.joint_names}
    constant = {name: dataclasses.replace(x, **_nothing(given.varying.get(name, {}))) for name, x in chosen.items()}
    joints = robot.limits_with(constant)  # where a law replaces the limit, only limits of joints that follow remain
    varying = {name: _with_followers(laws, constant[name], joints[name]) for name, laws in given.varying.items()}
    reverse = robot.limits_with(
        {name: dataclasses.replace(x, **_given(given.backward, name)) for name, x in chosen.items()}
    )
    backward = {  # with limits of the joints that follow
        name: Limits(**{field: getattr(reverse[name], field) for field in directed(entry)})
        for name, entry in given.backward.items()
    }
    return dataclasses.replace(given, joints=joints, varying=varying, backward=backward)


def _given(backward: Mapping[str, Limits], name: str) -> dict[str, float]:
    entry = backward.get(name, Limits())
    return {field: getattr(entry, field) for field in directed(entry)}


def _nothing(laws: Mapping[str, PositionLaw]) -> dict[str, None]:
    return {field: None for field in laws if field != "jounce"}


def _with_followers(laws: Mapping[str, PositionLaw], limits: Limits, merged: Limits) -> dict[str, PositionLaw]:
    """Return the laws of a joint, bounded by the limits of the joints that follow it."""
    bounded = dict(laws)
    if "acceleration" in laws and limits.deceleration is None and merged.deceleration is not None:
        bounded.setdefault("deceleration", laws["acceleration"])
    return {field: _least(law, getattr(merged, field, None)) for field, law in bounded.items()}


def _least(law: PositionLaw, bound: float | None) -> PositionLaw:
    return law if bound is None else lambda position: np.minimum(law(position), bound)


def _check_positive(name: str, value: Any) -> None:
    if value is None:
        return
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) or value <= 0:
        raise RobotError("must be a finite number greater than zero; None is no limit", name=name, value=value)
