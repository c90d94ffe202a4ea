"""Linearized equations of small motions about an equilibrium or about an instant of a motion."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jounce.base.modules import with_fields
from jounce.base.shapes import Real, Refused
from jounce.dynamics.forward.accelerations import Equations
from jounce.dynamics.friction.coupling import check_no_friction, check_unique_pressing
from jounce.dynamics.masses import gravity_of, masses_of, required_masses
from jounce.dynamics.motion_values import cut
from jounce.dynamics.statics.equilibrium_search import BALANCED, SearchResult, remains
from jounce.dynamics.statics.independent_coordinates import Reduction, reduced, with_joints
from jounce.dynamics.statics.kinks import kinked
from jounce.dynamics.statics.operating_point import OperatingPoint
from jounce.dynamics.statics.robot_states import DRIVE, GivenState, through_state
from jounce.dynamics.statics.static_equilibrium import Equilibrium, equilibrium
from jounce.dynamics.statics.variations import clock_at
from jounce.dynamics.vibration.linearization import Linearization, named
from jounce.errors import MechanismError, MobilityError, RobotError, check_name, flag
from jounce.kinematics import Motion, Status
from jounce.kinematics.assembly.assemble import freely_moving
from jounce.mechanism import Mechanism
from jounce.mechanism.building.preconditions import concrete
from jounce.mechanism.transmissions.axis_angles import of_one_lane
from jounce.robot import Robot

INSTANT = 1e-9  # fraction of the duration of a motion: a requested instant this near to one of the motion is that one


@concrete
def linearize(
    subject: Mechanism | Equilibrium | Motion | Robot | Refused,
    time: Real | None = None,
    *,
    coordinates: Sequence[str] | None = None,
    release: Sequence[str] = (),
    q: GivenState = None,
    drives: bool = True,
) -> Linearization:
    """Return the equations of small motions of a mechanism: mass, damping and stiffness matrix, state space, modes.

    The equations are exact: forces, inertia and constraints are differentiated along variations of the motion,
    constraints to second order, multiplied by the joint reactions. About a motion they hold at one instant. Joint
    friction follows its law, smoothed by a speed, at rest: it is viscous, the coefficient times the normal force over
    that speed. This describes motions slower than that speed, which do not stick. About a motion, friction is refused.

    Parameters
    ----------
    subject : Mechanism, Equilibrium, Motion, Simulation or Robot
        A mechanism is linearized about its `jounce.equilibrium`. All bodies that can move need masses. A robot, with
        loops or without, is linearized about the state q under the torques that this state requires: the coordinates
        are those of its joints, the inputs are torques in addition to these.
    time : float, optional
        The instant, s. For a mechanism, that at which its laws are frozen, as for `jounce.equilibrium`; for a
        simulation, any instant that it has reached; for another motion, one of its own.
    coordinates : sequence of str, optional
        One for each degree of freedom: outputs that are functions of the poses, or their components such as ``C_x``; or
        coordinates of bodies, ``BODY.x``, ``BODY.y``, ``BODY.angle``, in space ``BODY.x`` to ``BODY.z`` along the
        global axes and ``BODY.turn_x`` to ``BODY.turn_z`` about the axes of the body. By default, well-conditioned
        coordinates of bodies are chosen.
    release : sequence of str, optional
        Drivers that exert a constant force in small motions instead of prescribing the motion. Their coordinates come
        first among the coordinates, and forces in addition to the constant ones come first among the inputs.
    q : array_like of shape (n,), or (k, n) with k to 3, or dict of str to float, optional
        For robots: coordinates, their rates and second derivatives; zero by default.
    drives : bool, default True
        For robots: include the viscous damping and the armature inertia of the joints. Coulomb friction, which is
        constant while a joint moves and holds it at rest, is neglected.

    Returns
    -------
    Linearization
        With matrices, inputs and modes.

    Raises
    ------
    MechanismError
        If a name or an instant is not valid, coordinates are not independent, a body that can move has no mass, or an
        applied force has a kink there.
    MobilityError
        If nothing can move, or the position is singular.
    AssemblyError, SolveError
        As for `jounce.equilibrium`.

    Examples
    --------
    >>> import jounce as jn
    >>> small = jn.linearize(jn.load("examples/double_pendulum.yaml"))
    >>> small.coordinates, (small.modes.angular_frequencies**2 / 9.81).round(12).tolist()  # 2 - sqrt 2, 2 + sqrt 2
    (('upper.angle', 'lower.angle'), [0.585786437627, 3.414213562373])
    """
    reference = None
    if isinstance(subject, Robot):
        return _of_robot(subject, q, coordinates, flag("drives", drives, error=RobotError))
    if q is not None:
        raise MechanismError("is for robots; a mechanism has its own guess", name="q")
    if isinstance(subject, Mechanism):
        required_masses(subject, "small motions")
        subject = equilibrium(subject, time)
    elif isinstance(subject, Equilibrium) and time is not None:
        raise MechanismError("an equilibrium has its instant already", name="time", value=time)
    if isinstance(subject, Equilibrium):
        required_masses(subject.mechanism, "small motions")
        reference, point = subject, subject.point
    elif isinstance(subject, Motion):
        required_masses(subject.mechanism, "small motions")
        check_no_friction(subject.mechanism, "small motions about a motion, not about an equilibrium,")
        point = point_along(subject, time)
    else:
        message = "must be a jn.Mechanism, a jn.Motion, an equilibrium or a jn.Robot"
        raise MechanismError(message, name="subject", value=subject)
    released = named("release", release)
    for name in released:
        check_name("driver", name, point.mechanism.drivers, MechanismError, name="release")
    check_unique_pressing(point.model, point.equations.system)
    _check_free(point, reference, released)
    names = None if coordinates is None else named("coordinates", coordinates)
    reduction = reduced(point, names, released, prefer_outputs=reference is not None and reference.of_robot)
    _check(reduction)
    return Linearization(reduction, reference)


def _of_robot(robot: Robot, q: GivenState, coordinates: Sequence[str] | None, drives: bool) -> Linearization:
    """Return the linearized equations of a robot about a state, in the coordinates of its joints."""
    joint_coordinates = None if coordinates is None else named("coordinates", coordinates)
    point, names = through_state(robot, q, joint_coordinates, drives)
    reduction = reduced(point, released=[name + DRIVE for name in names], drivers=False)
    _check(reduction)
    return Linearization(with_joints(reduction, names), None, by_forces=False)  # joint dampers are no inputs


def point_along(motion: Motion, time: Real | None) -> OperatingPoint:
    """Return the operating point of a mechanism at an instant of its motion.

    Raises
    ------
    MechanismError
        If the motion has no such instant, was not solved at it, has no accelerations, or does not satisfy the equations
        of motion.
    """
    motion, lane = _at(motion, time)
    pose_type, coordinates = motion.poses
    if len(coordinates["position"]) < 3:
        raise MechanismError(
            "small motions need a motion solved to order 2 or higher", name="order", value=motion.order
        )
    if motion.status[lane] != Status.OK:
        raise MechanismError("the motion was not solved at this instant", name="time", value=float(motion.time[lane]))
    mechanism = motion.mechanism
    at_lane = {name: np.asarray(x)[..., [lane]] for name, x in cut(coordinates, 2).items()}
    system = with_fields(motion.model.system, outputs=(), forces=of_one_lane(motion.forces, lane))
    equations = Equations(system, masses_of(mechanism), gravity_of(mechanism), 1.0, pose_type)
    point = OperatingPoint(
        mechanism, motion.model, equations, at_lane, clock_at(float(motion.time[lane]), stopped=False)
    )
    left = point.free.T @ point.loads.sum(axis=0)
    if not np.abs(left).max(initial=0.0) <= 1e3 * BALANCED * max(np.abs(point.loads).max(initial=0.0), 1e-300):
        message = f"does not follow from the forces: {remains(SearchResult(point, left, False))} remains unbalanced"
        raise MechanismError(message, name="motion", value=motion)
    return point


def _at(motion: Motion, time: Any) -> tuple[Motion, int]:
    """Return a motion that contains an instant, and the index of the instant."""
    if time is None:
        if len(motion.time) > 1:
            raise MechanismError("a motion has many instants; name one", name="time")
        return motion, 0
    try:
        instant = float(time)
    except (TypeError, ValueError):
        raise MechanismError("must be one instant, in s", name="time", value=time) from None
    anywhere = getattr(motion, "at", None)  # of a simulation
    if anywhere is not None:
        return anywhere([instant], max(motion.order, 2)), 0
    lane = int(np.argmin(np.abs(motion.time - instant)))
    if not abs(motion.time[lane] - instant) <= INSTANT * max(np.ptp(motion.time), abs(instant)):
        message = f"is no instant of this motion, the nearest is {motion.time[lane]:.9g} s; solve for it"
        raise MechanismError(message, name="time", value=time)
    return motion, lane


def _check_free(point: OperatingPoint, reference: Equilibrium | None, released: Sequence[str]) -> None:
    """Raise MobilityError if nothing can move, or more motions are possible than elsewhere."""
    if reference is not None and reference.singular:
        raise MobilityError(f"there are no linear equations of motion: {reference.reason}")
    if not point.free.shape[1] and not released:
        drivers = ", ".join(point.mechanism.drivers)
        advice = f"leave a driver out of the equilibrium, or release it ({drivers})" if drivers else "free a joint"
        raise MobilityError(f"no degree of freedom: joints and drivers hold all bodies, nothing can move; {advice}")


def _check(reduction: Reduction) -> None:
    """Raise MechanismError if a body that can move has no mass, or a force is not smooth."""
    point, mass = reduction.point, reduction.part(2)
    even = np.sqrt(np.maximum(np.diag(reduction.noise(2)), 1e-300))
    values, vectors = np.linalg.eigh((mass + mass.T) / 2 / np.outer(even, even))
    if values[0] <= 1e-12 * values[-1]:
        direction = (reduction.basis / even) @ vectors[:, 0]
        shares = np.abs(direction).reshape(len(point.model.bodies), -1)
        lacking = [
            k
            for k, body in enumerate(point.mechanism.rigid_bodies.values())
            if body.mass is None or body.inertia is None
        ]
        chosen = max(lacking or range(len(shares)), key=lambda k: shares[k].max())
        body = point.model.bodies[chosen]
        lacks = "mass" if point.mechanism.bodies[body].mass is None else "inertia"
        body_names = freely_moving(point.model, direction[None])
        message = f"{body_names} can move without moving a mass, so its acceleration is not determined; give it a mass"
        raise MechanismError(message, name=f"bodies.{body}.{lacks}")
    if names := kinked(reduction):
        message = (
            "the force has a kink or a jump there, or bends within a millionth of the mechanism's size: it cannot "
            "be linearized; smooth its law, or linearize elsewhere"
        )
        raise MechanismError(message, name=f"forces.{names[0]}")
