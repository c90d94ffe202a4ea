"""Couplings, which act on several joints at once: tendons along joints, and drives of balls."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from jounce.errors import RobotError, check_name
from jounce.rigid.inertia import finite_numbers

OF_TENDON = ("stiffness", "rest", "damping", "friction", "armature")
OF_BALL = ("armature", "damping", "friction")


def _check_numbers(coupling: Any, fields: Sequence[str]) -> None:
    """Convert the values of fields to numbers; raise RobotError if one other than ``rest`` is negative."""
    for field in fields:
        location = f"couplings.{coupling.name}.{field}"
        value = float(finite_numbers(location, getattr(coupling, field), ()))
        if value < 0 and field != "rest":
            raise RobotError("must be zero or greater", name=location, value=value)
        object.__setattr__(coupling, field, value)


@dataclasses.dataclass(frozen=True, eq=False)
class Tendon:
    """A line along joints, whose length is a weighted sum of coordinates, with spring, damper, friction and inertia.

    Parameters
    ----------
    name : str
        Name of the tendon.
    weights : dict of str to float
        Change of the length per unit of each coordinate, m/rad or 1.
    stiffness : float, default 0
        Stiffness of the spring, N by the unit of the length.
    rest : float, default 0
        Length at which the spring is unstressed.
    damping : float, default 0
        Viscous friction.
    friction : float, default 0
        Coulomb friction, N.
    armature : float, default 0
        Inertia against the second derivative of the length, kg by the square of its unit over m.

    Raises
    ------
    RobotError
        If a value is not finite, or one but `rest` is negative.

    Examples
    --------
    >>> import jounce as jn
    >>> links = [jn.Link("base"), jn.Link("a", jn.Inertia(1.0)), jn.Link("b", jn.Inertia(1.0))]
    >>> joints = [jn.Joint("x", "base", "a", "prismatic"), jn.Joint("y", "a", "b", "prismatic")]
    >>> line = jn.robot.Tendon("line", {"x": 1.0, "y": 2.0}, stiffness=10.0)
    >>> robot = jn.Robot("two", links, joints, gravity=[0, 0, 0], couplings=[line])
    >>> jn.inverse_dynamics(robot, [[0.0, 0.5], [0, 0], [0, 0]]).round(9).tolist()  # 10 * (2 * 0.5) by each weight
    [[10.0, 20.0]]
    """

    name: str
    weights: Mapping[str, float]
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0

    def __post_init__(self) -> None:
        _check_numbers(self, OF_TENDON)
        location = f"couplings.{self.name}.weights"
        numbers = {joint: float(finite_numbers(f"{location}.{joint}", x, ())) for joint, x in self.weights.items()}
        object.__setattr__(self, "weights", numbers)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints along the tendon."""
        return tuple(self.weights)

    def locked(self, positions: Mapping[str, float]) -> Tendon | None:
        """Return the tendon of a robot with some joints locked; None if all joints of the tendon are."""
        locked_joints = {joint for joint in self.weights if joint in positions}
        remaining = {joint: weight for joint, weight in self.weights.items() if joint not in locked_joints}
        rest = self.rest - sum(self.weights[joint] * positions[joint] for joint in locked_joints)
        return dataclasses.replace(self, weights=remaining, rest=rest) if remaining else None


@dataclasses.dataclass(frozen=True, eq=False)
class BallDrive:
    """Armature, damping and friction against the relative angular velocity of three turns that form a ball joint.

    Parameters
    ----------
    name : str
        Name of the ball.
    joints : sequence of str
        The three turns of the ball, about z, y and x, each axis moved by the turns before it.
    armature : float, default 0
        Isotropic inertia against the relative angular acceleration, kg m^2.
    damping : float, default 0
        Viscous friction, N m s/rad.
    friction : float, default 0
        Coulomb friction about each axis of the moved link, N m.

    Raises
    ------
    RobotError
        If there are not three joints, or a value is not finite or negative.

    Examples
    --------
    >>> import jounce as jn
    >>> drive = jn.robot.BallDrive("hip", ("hip_z", "hip_y", "hip_x"), damping=0.2)
    >>> drive.damping
    0.2
    """

    name: str
    joints: Sequence[str]
    armature: float = 0.0
    damping: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        _check_numbers(self, OF_BALL)
        joints = () if isinstance(self.joints, str) else tuple(self.joints)
        if len(set(joints)) != 3:
            raise RobotError("must be three joints", name=f"couplings.{self.name}.joints", value=self.joints)
        object.__setattr__(self, "joints", joints)

    def locked(self, positions: Mapping[str, float]) -> BallDrive | None:
        """Return the drive of a robot with some joints locked; None if all three turns are."""
        locked_turns = [joint for joint in self.joints if joint in positions]
        if locked_turns and len(locked_turns) < 3:
            message = f"is one turn of the ball {self.name}, which has armature, damping or friction; hold all three"
            raise RobotError(message, name=f"locked.{locked_turns[0]}", value=positions[locked_turns[0]])
        return None if locked_turns else self


Coupling = Tendon | BallDrive


def check_coupling(coupling: Any, joints: Mapping[str, Any], free: Collection[str]) -> None:
    """Raise RobotError unless a coupling acts on moving joints, and those of a ball are turns about z, y, x.

    Parameters
    ----------
    coupling : Tendon or BallDrive
    joints : dict of str to Joint
        Joints of the robot.
    free : collection of str
        Names of the joints that follow no other joint.
    """
    moving_joints = [name for name, joint in joints.items() if joint.moving]
    names = free if isinstance(coupling, BallDrive) else moving_joints
    location = f"couplings.{coupling.name}"
    for name in coupling.joints:
        check_name("moving joint", name, names, RobotError, name=location)
    if not isinstance(coupling, BallDrive):
        return
    turns = [joints[name] for name in coupling.joints]
    chained = all(first.child == second.parent for first, second in itertools.pairwise(turns))
    displaced = any(np.any(turn.position) or np.any(turn.rotation != np.eye(3)) for turn in turns[1:])
    axes = np.array([turn.axis for turn in turns])
    if not chained or displaced or not all(turn.turning for turn in turns) or np.any(axes != np.eye(3)[::-1]):
        message = "must be three turns in a row about z, y and x at one point, as those of a ball"
        raise RobotError(message, name=f"{location}.joints", value=list(coupling.joints))
