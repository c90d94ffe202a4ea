"""The links, joints and limits of a robot, as given by a file or a script, frozen and checked."""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from jounce.base.shapes import ArrayLike, real_numbers
from jounce.errors import RobotError, check_name
from jounce.rigid.inertia import Inertia, finite_numbers, unchanging, vector_numbers
from jounce.robot.model.mimics import Mimic

MOVING = ("revolute", "continuous", "prismatic")
TYPES = (*MOVING, "fixed")


@dataclasses.dataclass(frozen=True)
class Limits:
    """Limits of a joint; None is no limit. Angles are in rad, lengths in m, torques in N m, forces in N.

    Parameters
    ----------
    lower, upper : float or None
        Range of the coordinate, rad or m.
    velocity, acceleration, jerk : float or None
        Largest absolute values of the derivatives of the coordinate.
    effort : float or None
        Largest torque or force.
    effort_rate : float or None
        Largest rate of the torque or force.
    deceleration : float or None
        Largest absolute value of an acceleration that slows the joint down, with the sign opposite to the velocity;
        `acceleration` unless given.

    Examples
    --------
    >>> import jounce as jn
    >>> limits = jn.Limits(velocity=3.0, effort_rate=500.0)  # rad/s, N m/s
    """

    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    acceleration: float | None = None
    jerk: float | None = None
    effort: float | None = None
    effort_rate: float | None = None
    deceleration: float | None = None

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            number = real_numbers(field.name, value, RobotError, "a finite number")
            if number.ndim or not np.isfinite(number):
                raise RobotError("must be a finite number", name=field.name, value=value)
            if field.name not in ("lower", "upper") and value <= 0:
                raise RobotError("must be greater than zero", name=field.name, value=value)
            object.__setattr__(self, field.name, float(number))
        if self.lower is not None and self.upper is not None and self.lower > self.upper:
            raise RobotError("the lower limit must not exceed the upper one", value=[self.lower, self.upper])


UNLIMITED = Limits()
POINT = 1e-4  # fraction of the narrowest range: a smaller common part of ranges is meant to be one point


@dataclasses.dataclass(frozen=True, eq=False)
class Link:
    """A rigid link; without inertia it is a frame, or a massless piece between two joints.

    Parameters
    ----------
    name : str
        Name of the link, and of its frame.
    inertia : Inertia or None
        Inertia in the frame of the link.
    gravity : float, default 1
        Share of gravity that acts on the link: 0 if gravity is switched off or balanced.

    Raises
    ------
    RobotError
        If the inertia is not an `Inertia`, or the share is not finite.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Link("rod", jn.Inertia(1.2, center_of_mass=[0.25, 0, 0], tensor=[0, 0.03, 0.03]))
    """

    name: str
    inertia: Inertia | None = None
    gravity: float = 1.0

    def __post_init__(self) -> None:
        if self.inertia is not None and not isinstance(self.inertia, Inertia):
            raise RobotError("must be an Inertia or None", name=f"links.{self.name}.inertia", value=self.inertia)
        object.__setattr__(self, "gravity", float(finite_numbers(f"links.{self.name}.gravity", self.gravity, ())))


@dataclasses.dataclass(frozen=True, eq=False)
class Joint:
    """A joint between two links; the frame of the child link is that of the joint.

    Parameters
    ----------
    name : str
        Name of the joint.
    parent, child : str
        Names of the two links.
    type : {"revolute", "continuous", "prismatic", "fixed"}, default "revolute"
        A revolute or continuous joint turns about its axis, a prismatic one slides along it.
    position : array_like of shape (3,), default zero
        Origin of the child link at coordinate zero, in the frame of the parent link, m.
    rotation : array_like of shape (3, 3), default identity
        Rotation matrix from the frame of the child link, at coordinate zero, to the frame of the parent link.
    axis : array_like of shape (3,), default z
        Axis in the frame of the child link, of any length.
    limits : Limits, optional
        Limits of the joint.
    mimic : Mimic, optional
        What this joint follows.
    armature : float, default 0
        Inertia of the drive at the joint, kg m^2 or kg. The armature, damping and friction of a follower act on the
        followed joint through the multiplier.
    damping : float, default 0
        Viscous friction, N m s/rad or N s/m.
    friction : float or sequence of two floats, default 0
        Coulomb friction, N m or N, or a pair for positive and for negative velocities.
    stiffness : float, default 0
        Stiffness of a spring at the joint, N m/rad or N/m.
    spring_reference : float, default 0
        Coordinate at which the spring is free, rad or m.
    start : float, default 0
        Default initial coordinate for closing loops and for equilibria, rad or m.

    Raises
    ------
    RobotError
        If the type is unknown, a value is not finite or has a wrong shape, the axis has no length, the rotation is not
        a rotation matrix, or armature, damping, friction or stiffness is negative.

    Examples
    --------
    >>> import jounce as jn
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0], damping=0.3)  # turns up from x toward z
    >>> rod = jn.Link("rod", jn.Inertia(2.0, center_of_mass=[0.5, 0, 0], tensor=[0, 0.1, 0.1]))
    >>> pendulum = jn.Robot("pendulum", [jn.Link("base"), rod], [pin])
    >>> jn.inverse_dynamics(pendulum, [[0.0], [1.0], [0.0]]).round(6).tolist()  # 2 * 9.81 * 0.5 + 0.3 N m
    [[10.11]]
    """

    name: str
    parent: str
    child: str
    type: str = "revolute"
    position: Any = (0.0, 0.0, 0.0)
    rotation: Any = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    axis: Any = (0.0, 0.0, 1.0)
    limits: Limits = UNLIMITED
    mimic: Mimic | None = None
    armature: float = 0.0
    damping: float = 0.0
    friction: Any = 0.0
    stiffness: float = 0.0
    spring_reference: float = 0.0
    start: float = 0.0

    def __post_init__(self) -> None:
        location = f"joints.{self.name}"
        check_name("joint", self.type, TYPES, RobotError, "type", name=f"{location}.type")
        for field, shape in (("position", (3,)), ("rotation", (3, 3)), ("axis", (3,))):
            object.__setattr__(self, field, vector_numbers(f"{location}.{field}", getattr(self, field), shape))
        rotation_matrix(f"{location}.rotation", self.rotation)
        length = math.hypot(*self.axis)
        if self.type != "fixed":
            if length < 1e-9:
                raise RobotError("must have a direction", name=f"{location}.axis", value=self.axis.tolist())
            object.__setattr__(self, "axis", self.axis if abs(length - 1) < 1e-15 else unchanging(self.axis / length))
        for field in ("armature", "damping", "stiffness"):
            value = float(finite_numbers(f"{location}.{field}", getattr(self, field), ()))
            if value < 0:
                raise RobotError("must be zero or greater", name=f"{location}.{field}", value=value)
            object.__setattr__(self, field, value)
        friction = finite_numbers(f"{location}.friction", self.friction, (), (2,))
        if np.any(friction < 0):
            raise RobotError("must be zero or greater", name=f"{location}.friction", value=friction.tolist())
        forward, backward = (float(x) for x in np.broadcast_to(friction, 2))
        object.__setattr__(self, "friction", forward if forward == backward else (forward, backward))
        for field in ("spring_reference", "start"):
            object.__setattr__(self, field, float(finite_numbers(f"{location}.{field}", getattr(self, field), ())))

    @property
    def moving(self) -> bool:
        """Whether the joint allows a motion of its links."""
        return self.type != "fixed"

    @property
    def turning(self) -> bool:
        """Whether the coordinate is an angle."""
        return self.type in ("revolute", "continuous")


def ranges_at_leader(limits: Limits, followers: Iterable[Joint]) -> list[tuple[float, float]]:
    """Return the range of a joint, and those of its followers as ranges of the joint; infinite without limits."""
    ranges = []
    pairs = [(limits, Mimic("")), *((x.limits, x.mimic) for x in followers if x.mimic and x.mimic.multiplier)]
    for bounds, mimic in pairs:
        ends = (-math.inf if bounds.lower is None else bounds.lower, math.inf if bounds.upper is None else bounds.upper)
        low, high = sorted((x - mimic.offset) / mimic.multiplier + 0.0 for x in ends)  # no -0
        ranges.append((low, high))
    return ranges


def common_range(ranges: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """Return the intersection of ranges; the lower end exceeds the upper end if it is empty."""
    lower, upper = zip(*ranges, strict=True)
    return max(lower), min(upper)


def has_room(limits: Limits, followers: Iterable[Joint]) -> bool:
    """Whether joints that follow another leave it more than a point of its range, unless its own is one.

    What is left is a point also where rounding of what a file says makes it a little more.
    """
    ranges = ranges_at_leader(limits, followers)
    widths = [high - low for low, high in ranges]
    lower, upper = common_range(ranges)
    narrowest = min(filter(math.isfinite, widths), default=0.0)
    return upper - lower > POINT * narrowest or (widths[0] == 0 and upper >= lower)


def limits_with_followers(name: str, limits: Limits, followers: Iterable[Joint]) -> Limits:
    """Return limits of a joint that include those of its followers.

    A follower moves as the joint does, times its multiplier. The drive of the joint provides the torque of the
    follower, which has no limit of its own.

    Raises
    ------
    RobotError
        If the ranges have no coordinate in common, or only one.
    """
    followers = list(followers)
    pairs = [(limits, Mimic(name))]
    pairs += [(other.limits, other.mimic) for other in followers if other.mimic and other.mimic.multiplier]
    if len(pairs) == 1:
        return limits

    def smallest(*fields: str) -> float | None:
        """Return the smallest limit, with the first available field of each joint."""
        given = [(next((x for f in fields if (x := getattr(own, f)) is not None), None), mimic) for own, mimic in pairs]
        return min((x / abs(mimic.multiplier) for x, mimic in given if x is not None), default=None)

    lower, upper = common_range(ranges_at_leader(limits, followers))
    if not has_room(limits, followers):
        names = ", ".join(joint.name for joint in followers)
        phrase = "no coordinate" if lower > upper else "one coordinate alone"
        message = f"{phrase} keeps the range of this joint and of those that follow it ({names}); correct their limits"
        raise RobotError(message, name=name, value=[lower, upper])
    slowing = any(own.deceleration is not None for own, _ in pairs)
    return dataclasses.replace(
        limits,
        lower=lower if math.isfinite(lower) else None,
        upper=upper if math.isfinite(upper) else None,
        velocity=smallest("velocity"),
        acceleration=smallest("acceleration"),
        jerk=smallest("jerk"),
        deceleration=smallest("deceleration", "acceleration") if slowing else None,
    )


CLOSURES = ("connect", "weld", "pin", "slider")


@dataclasses.dataclass(frozen=True, eq=False)
class Closure:
    """The closure of a loop: a connection of two links in addition to the joints of the tree.

    Parameters
    ----------
    name : str
        Name of the closure, different from names of joints.
    links : sequence of str
        Names of the two links.
    type : {"connect", "weld", "pin", "slider"}, default "connect"
        Constraint between the links: a common point (connect, 3 equations), or a constant relative pose (weld, 6); a
        pin allows a rotation about an axis (5), a slider a translation along it (5).
    points : array_like of shape (3,) or (2, 3), default zero
        Points in the frames of the first and of the second link, m. Unless given, the second point coincides with the
        first at coordinates zero.
    axis : array_like of shape (3,), optional
        Axis of a pin or a slider, in the frame of the first link.
    rotation : array_like of shape (3, 3), optional
        Rotation matrix from the frame of the second link to the frame of the first in a closed loop; for a pin, up to
        rotations about its axis. By default the rotation at coordinates zero.

    Raises
    ------
    RobotError
        If the type is unknown, there are not two links, a value is not finite or has a wrong shape, or the axis of a
        pin or a slider is missing.

    Examples
    --------
    >>> import jounce as jn
    >>> closure = jn.robot.Closure("tip", ("left", "right"), points=[0.2, 0, 0])
    """

    name: str
    links: Sequence[str]
    type: str = "connect"
    points: Any = (0.0, 0.0, 0.0)
    axis: Any = None
    rotation: Any = None

    def __post_init__(self) -> None:
        location = f"closures.{self.name}"
        check_name("closure", self.type, CLOSURES, RobotError, "type", name=f"{location}.type")
        links = () if isinstance(self.links, str) else tuple(self.links)
        if len(links) != 2 or links[0] == links[1]:
            raise RobotError("must be two different links", name=f"{location}.links", value=self.links)
        object.__setattr__(self, "links", links)
        object.__setattr__(self, "points", vector_numbers(f"{location}.points", self.points, (3,), (2, 3)))
        if self.type in ("pin", "slider"):
            axis = vector_numbers(f"{location}.axis", self.axis, (3,)) if self.axis is not None else np.zeros(3)
            length = float(np.linalg.norm(axis))
            if length < 1e-9:
                value = None if self.axis is None else axis.tolist()
                raise RobotError(f"a {self.type} needs the direction of its axis", name=f"{location}.axis", value=value)
            object.__setattr__(self, "axis", unchanging(axis / length))
        if self.rotation is not None:
            object.__setattr__(self, "rotation", rotation_matrix(f"{location}.rotation", self.rotation))


def rotation_matrix(name: str, value: ArrayLike) -> np.ndarray:
    """Return a checked rotation matrix.

    Raises
    ------
    RobotError
        If the value is not a rotation matrix.
    """
    matrix = vector_numbers(name, value, (3, 3))
    if not np.allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=1e-6) or np.linalg.det(matrix) < 0:
        raise RobotError("must be a rotation matrix", name=name, value=matrix.tolist())
    return matrix
