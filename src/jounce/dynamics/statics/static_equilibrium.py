"""Positions of static equilibrium of a mechanism under its forces, and their stability."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from jounce.base.display import Displayed
from jounce.base.shapes import Real, Refused
from jounce.constraints import Rope
from jounce.dynamics.forward.initial_state import TOLERANCE
from jounce.dynamics.inverse.outputs.components import JointForceOutput
from jounce.dynamics.masses import check_loads
from jounce.dynamics.statics.equilibrium_search import SearchResult, check_forces, remains, rest_point, search
from jounce.dynamics.statics.independent_coordinates import Reduction, reduced
from jounce.dynamics.statics.kinks import kinked
from jounce.dynamics.statics.operating_point import OperatingPoint
from jounce.dynamics.statics.robot_states import as_held_mechanism
from jounce.dynamics.statics.stability import Verdict, stability_of
from jounce.errors import MechanismError, RobotError, SolveError, check_choice, check_name, flag
from jounce.kinematics import Motion, Status
from jounce.kinematics.assembly.assemble import assemble, freely_moving
from jounce.kinematics.position_analysis.curve_ends import beyond_end, ends_of
from jounce.kinematics.results.pose_outputs import output_values
from jounce.mechanism import Body, Mechanism, build, check_mechanism
from jounce.mechanism.building.preconditions import check_holonomic, concrete
from jounce.mechanism.laws.law_checks import check_laws
from jounce.mechanism.outputs.base import lost_orders
from jounce.mechanism.time import first_instant
from jounce.robot import Robot
from jounce.robot.closed_loops.closures import GivenCoordinates

METHODS = ("settle", "newton")
SLIGHT = 1e-9  # fraction of the largest tension of a rope: less is rounding
SINGULAR = "the position is singular, joints can move there that cannot elsewhere; positions nearby are not examined"


class Equilibrium(Displayed):
    """A position of static equilibrium, with the laws of drivers and forces frozen at an instant.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism, without the drivers that were released.
    time : float
        The instant, s.
    motion : Motion
        The mechanism at rest, at one instant, with its outputs; `jounce.joint_reaction`, `jounce.driver_force` and
        `jounce.dynamics.applied_force` return the forces that hold it.
    stability : str
        ``stable``; ``unstable``; ``indifferent`` if no force resists some motion; ``held`` if nothing can move; or
        ``undetermined``.
    reason : str
        The reason for this stability, in words.
    singular : bool
        Whether the position is singular: joints can move there that cannot elsewhere, and linear equations do not
        describe small motions.
    of_robot : bool
        Whether it is the equilibrium of a robot, whose small motions are described by its joints.
    cautions : tuple of str
        What the analysis neglects.
    """

    def __init__(self, point: OperatingPoint, singular: bool, *, of_robot: bool = False):
        self.point, self.of_robot = point, of_robot
        self.mechanism, self.time = point.mechanism, point.instant
        self.singular = singular

    def __repr__(self) -> str:
        title = f"{self.mechanism.title}: " if self.mechanism.title else ""
        noun = "degree of freedom" if self.degrees_of_freedom == 1 else "degrees of freedom"
        return f"<Equilibrium {title}{self.stability}, {self.degrees_of_freedom} {noun}>"

    @property
    def degrees_of_freedom(self) -> int:
        """Number of independent small motions that the constraints allow."""
        return self.point.free.shape[1]

    @property
    def stable(self) -> bool | None:
        """Whether the mechanism stays in this position, also because nothing can move; None if not determined."""
        return {"stable": True, "held": True, "unstable": False}.get(self.stability)

    @property
    def stability(self) -> str:
        """The stability in a word."""
        return self._verdict.word

    @cached_property
    def reason(self) -> str:
        """The reason for the stability in words."""
        verdict = self._verdict
        if verdict.direction is None:
            return verdict.reason
        direction = self._reduction.basis @ verdict.direction
        body_names = freely_moving(self.point.model, np.abs(direction)[None])
        tail = {"energy falls": "in motions of {}", "no stiffness": "resists motions of {}"}.get(
            verdict.reason, "those of {}"
        )
        start = {"no stiffness": "no force", "energy falls": "energy falls"}.get(verdict.reason, verdict.reason)
        separator = ": " if tail.startswith("those") else " "
        return f"{start}{separator}{tail.format(body_names)}"

    @cached_property
    def cautions(self) -> tuple[str, ...]:
        """What the analysis neglects."""
        kinks = (
            [
                f"forces.{name} has a kink or a jump there: its slope is not the same on both sides"
                for name in kinked(self._reduction)
            ]
            if self.degrees_of_freedom and not self.singular
            else []
        )
        return (*kinks, *((SINGULAR,) if self.singular else ()), *self._slack, *self._friction)

    @property
    def _friction(self) -> tuple[str, ...]:
        """A message that smoothed joint friction does not stick."""
        rubbing = [name for name, joint in self.mechanism.joints.items() if getattr(joint, "friction", None)]
        if not rubbing or not self.degrees_of_freedom:
            return ()
        more_text = f" and {len(rubbing) - 1} more" if len(rubbing) > 1 else ""
        joints = f"joints.{rubbing[0]}{more_text}"
        return (
            f"friction of {joints} does not stick: slower than its speed it is viscous; dry, it could hold elsewhere",
        )

    @cached_property
    def _slack(self) -> tuple[str, ...]:
        """Messages on slack ropes, which would have to push."""
        ropes = [name for name, joint in self.mechanism.joints.items() if isinstance(joint, Rope)]
        tensions = {name: float(JointForceOutput(name).coefficients(self.motion)[0, 0, 0]) for name in ropes}
        size = max(map(abs, tensions.values()), default=0.0)
        return tuple(
            f"joints.{name} is slack, as it would have to push with {-tension:.4g} N: this is no equilibrium"
            for name, tension in tensions.items()
            if tension < -SLIGHT * size
        )

    @cached_property
    def _reduction(self) -> Reduction:
        return reduced(self.point, drivers=False, prefer_outputs=self.of_robot)

    @cached_property
    def _verdict(self) -> Verdict:
        if self.singular:
            return Verdict("undetermined", SINGULAR)
        if self._slack:
            return Verdict("undetermined", "; ".join(self._slack))
        if not self.degrees_of_freedom:
            return Verdict("held", "nothing can move")
        r = self._reduction
        return stability_of(r.part(0), r.noise(0), r.part(1), r.noise(1), r.part(2))

    @cached_property
    def motion(self) -> Motion:
        """The mechanism at rest, as a motion of one instant, of order 2."""
        point, model = self.point, self.point.model
        extra_orders = lost_orders(self.mechanism.outputs.values())
        coordinates = {name: _padded(x, extra_orders) for name, x in point.coordinates.items()}
        groups = output_values(model.system.outputs, coordinates, model.pose_type)
        status = np.array([int(Status.OK)])
        return Motion(self.mechanism, model, np.array([self.time]), 2, (coordinates, groups), status, {})

    @cached_property
    def outputs(self) -> dict[str, Any]:
        """Values of all outputs, by name: a number, or an array of components; SI."""
        return {name: values[0, 0] for name, values in self.motion.outputs.items()}

    @cached_property
    def poses(self) -> dict[str, dict[str, Any]]:
        """Poses of the moving bodies, by name: position, m, and angle, rad, or Euler parameters."""
        return {name: pose for name, pose in self._all_poses.items() if name in self.mechanism.rigid_bodies}

    @cached_property
    def _all_poses(self) -> dict[str, dict[str, Any]]:
        """Poses of all moving bodies, carriages included."""
        poses = {}
        for k, name in enumerate(self.point.model.bodies, 1):
            position, attitude = (self.point.coordinates[key][0, ..., k, 0] for key in self._keys)
            key = "angle" if self._keys[1] == "angle" else "orientation"
            poses[name] = {"position": position, key: float(attitude) if key == "angle" else attitude}
        return poses

    @property
    def placed(self) -> Mechanism:
        """The mechanism with this position as its starting guess, from which a simulation starts."""
        bodies = {name: _posed(self.mechanism.bodies[name], pose) for name, pose in self._all_poses.items()}
        return dataclasses.replace(self.mechanism, bodies=bodies, initial={})

    @property
    def _keys(self) -> tuple[str, str]:
        return ("position", "angle") if "angle" in self.point.coordinates else ("position", "quaternion")


def _padded(values: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate([values, np.zeros((count, *values.shape[1:]))])


def _posed(body: Body, pose: dict[str, Any]) -> Body:
    changed = {"position": pose["position"].tolist()}
    if "angle" in pose:
        return dataclasses.replace(body, **changed, angle=pose["angle"])
    return dataclasses.replace(body, **changed, orientation=pose["orientation"].tolist())


TO_BALANCE = (
    "if a motor or a brake holds this body, give it a driver; otherwise check the signs and values of forces and "
    "gravity, or place the bodies nearer to the position expected"
)
TO_BALANCE_ROBOTS = (
    "name the joints that motors or brakes hold (hold), give their torques, check the direction of gravity and the "
    "springs, or begin at other coordinates (q)"
)


@concrete
def equilibrium(
    mechanism: Mechanism | Robot,
    time: Real | Refused | None = None,
    *,
    without: Sequence[str] = (),
    method: str = "settle",
    q: GivenCoordinates = None,
    hold: str | Sequence[str] = (),
    torques: Mapping[str, float] | None = None,
    drives: bool = True,
) -> Equilibrium:
    """Return a position of static equilibrium of a mechanism, and whether it is stable.

    Velocities are zero, and the laws of drivers and forces are frozen at an instant. All forces are in balance:
    ``Q(q, 0, t) = Phi_q^T lambda``, ``Phi(q, t) = 0``. Bodies need masses only for their weight.

    Parameters
    ----------
    mechanism : Mechanism or Robot
        A mechanism with masses or applied forces; the search begins at the assembled position nearest to the starting
        guess. A robot, with loops or without, is converted to a mechanism (`Robot.mechanism`), whose outputs are the
        coordinates of its joints.
    time : float, optional
        The instant, s; by default the first of the mechanism, or 0 if it has none.
    without : sequence of str, optional
        Drivers to leave out, so that what they drive can move.
    method : {"settle", "newton"}, default "settle"
        With "settle", the bodies creep in the direction of the forces until they rest: the equilibrium found is stable,
        unless the search begins at another one. Newton's method converges to any equilibrium nearby.
    q : array_like of shape (n,) or dict of str to float, optional
        For robots: coordinates at which the search begins, and at which joints are held.
    hold : sequence of str, or "all", optional
        For robots: joints that are held. ``jn.driver_force(found.motion, "JOINT_drive")`` returns the torque required.
    torques : dict of str to float, optional
        For robots: constant torques, N m, or forces, N, of joints that are not held.
    drives : bool, default True
        For robots: include the armature inertia and the viscous damping of the joints in stability and small motions.
        Coulomb friction, which would hold the robot anywhere nearby, is neglected.

    Returns
    -------
    Equilibrium
        Position, forces and stability.

    Raises
    ------
    MechanismError
        If a name or an option is not valid, or there are neither masses nor applied forces.
    AssemblyError
        If the bodies cannot be assembled.
    SolveError
        If no equilibrium is found; the message names the remaining force and its body. Also if a force is not finite at
        rest.

    Examples
    --------
    >>> import jounce as jn
    >>> pendulum = jn.load("examples/simple_pendulum.yaml")
    >>> hanging = jn.equilibrium(pendulum)
    >>> round(float(hanging.outputs["place"][1]), 12), hanging.stability
    (-1.0, 'stable')
    """
    robot = isinstance(mechanism, Robot)
    start = at_rest_from(as_mechanism(mechanism, q, hold, torques, drives), time, without, method)
    result = search(start, settle=method == "settle")
    if not result.balanced and method == "settle":
        result = min(result, search(start, settle=False), key=lambda f: not f.balanced)
    if not result.balanced:
        message = (
            f"no equilibrium was found from the starting guess: where the search ended, {remains(result)} is balanced "
            f"by nothing; {TO_BALANCE_ROBOTS if robot else TO_BALANCE}"
        )
        raise SolveError(message, status=Status.NOT_CONVERGED)
    return equilibrium_of(result, start, of_robot=robot)


def as_mechanism(
    subject: Mechanism | Robot,
    q: GivenCoordinates,
    hold: str | Sequence[str],
    torques: Mapping[str, float] | None,
    drives: bool,
) -> Mechanism:
    """Return a robot as a mechanism at rest with some joints held; return a mechanism unchanged.

    Raises
    ------
    RobotError, MechanismError
        If a name or a value does not fit the robot, or is given for a mechanism.
    """
    if isinstance(subject, Robot):
        return as_held_mechanism(subject, q, hold, torques, flag("drives", drives, error=RobotError))
    robot_arguments = {"q": q, "hold": hold or None, "torques": torques}
    if unfit := [k for k, v in robot_arguments.items() if v is not None]:
        raise MechanismError("is for robots; a mechanism has its own guess, drivers and forces", name=unfit[0])
    return subject


def at_rest_from(
    mechanism: Mechanism, time: Real | Refused | None, without: Sequence[str], method: str
) -> OperatingPoint:
    """Return the mechanism at rest in an assembled position; raise an error if something is not valid."""
    check_mechanism(mechanism)
    about_motion = "simulate the motion; jn.linearize and jounce modes --moving have small motions about it"
    check_holonomic(mechanism, "an equilibrium", about_motion)
    check_choice("method", method, METHODS, MechanismError)
    if isinstance(without, str):
        without = (without,)
    for name in without:
        check_name("driver", name, mechanism.drivers, MechanismError, name="without")
    drivers = {name: driver for name, driver in mechanism.drivers.items() if name not in without}
    mechanism = dataclasses.replace(mechanism, drivers=drivers, outputs=_outputs_without(mechanism, drivers))
    check_loads(mechanism)
    instant = _instant(mechanism, time)
    check_laws(mechanism, np.array([instant]), 2, forces=True)
    model, coordinates = assemble(build(mechanism), instant, TOLERANCE, free=True)
    point = rest_point(mechanism, model, coordinates, instant)
    check_forces(point)
    return point


def _outputs_without(mechanism: Mechanism, drivers: dict[str, Any]) -> dict[str, Any]:
    """Return the outputs of a mechanism with some of its drivers, without the forces of removed drivers."""
    if len(drivers) == len(mechanism.drivers):
        return dict(mechanism.outputs)
    left = dataclasses.replace(mechanism, drivers=drivers, outputs={})

    def fits(output: Any) -> bool:
        try:
            output.check(left)
        except MechanismError:
            return False
        return True

    return {name: output for name, output in mechanism.outputs.items() if fits(output)}


def _instant(mechanism: Mechanism, time: Any) -> float:
    if time is None:
        return first_instant(mechanism.time, mechanism.parameter_values)
    try:
        instant = float(time)
    except (TypeError, ValueError):
        raise MechanismError("must be one instant, in s", name="time", value=time) from None
    if not np.isfinite(instant):
        raise MechanismError("must be finite", name="time", value=time)
    return instant


def equilibrium_of(result: SearchResult, start: OperatingPoint, *, of_robot: bool = False) -> Equilibrium:
    """Return the equilibrium at the end of a search; it is singular if it has more free directions than the start.

    Raises
    ------
    SolveError
        If bodies come to rest only beyond an end of a curve.
    """
    singular = result.point.free.shape[1] > start.free.shape[1]
    coordinates = {"position": result.point.coordinates["position"][0]}
    if excess := beyond_end(ends_of(result.point.model), coordinates):
        message = f"bodies would come to rest only beyond an end of a curve, {excess}: {Status.END_OF_CURVE.advice}"
        raise SolveError(message, status=Status.END_OF_CURVE)
    return Equilibrium(result.point, singular, of_robot=of_robot)
