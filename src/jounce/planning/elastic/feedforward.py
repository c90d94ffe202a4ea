"""Feedforward of elastic joints: motions and torques of motors behind springs that move links exactly as planned."""

from collections.abc import Mapping
from typing import overload

import numpy as np

from jounce.base.shapes import ArrayLike, seconds
from jounce.errors import JounceError, RobotError, TrajectoryError
from jounce.mechanism import Mechanism, TimeGrid, check_mechanism
from jounce.planning.elastic.driven_systems import DrivenMechanism, DrivenRobot, DrivenSystem, link_forces, robot_drives
from jounce.planning.elastic.drives import Drive
from jounce.planning.elastic.motor_motion import Feedforward, MotorMotion, motor_motion
from jounce.planning.elastic.spring_deflection import SpringDeflection
from jounce.robot.model.arguments import checked_coordinates, whole_number
from jounce.robot.robot import Robot
from jounce.trajectory.joint_trajectory import JointTrajectory

MOST_RATES = 24  # of motor torques: the highest derivative of a law is 30


@overload
def feedforward(
    system: Robot,
    motion: JointTrajectory,
    drives: Mapping[str, Drive],
    *,
    rates: int = 0,
    times: ArrayLike | None = None,
    losses: bool = True,
    tolerance: float = 1e-6,
) -> Feedforward: ...
@overload
def feedforward(
    system: Robot,
    motion: ArrayLike,
    drives: Mapping[str, Drive],
    *,
    rates: int = 0,
    times: None = None,
    losses: bool = True,
    tolerance: float = 1e-6,
) -> MotorMotion: ...
@overload
def feedforward(
    system: Mechanism,
    motion: ArrayLike | TimeGrid | None = None,
    drives: Mapping[str, Drive] | None = None,
    *,
    rates: int = 0,
    times: ArrayLike | None = None,
    losses: bool = True,
    tolerance: float = 1e-6,
) -> Feedforward: ...
def feedforward(
    system: Robot | Mechanism,
    motion: object = None,
    drives: object = None,
    *,
    rates: int = 0,
    times: ArrayLike | None = None,
    losses: bool = True,
    tolerance: float = 1e-6,
) -> Feedforward | MotorMotion:
    """Return motions and torques of motors that move links behind springs exactly as planned.

    With the link coordinate q, the torque tau that the links need, and the motor position theta as seen at the joint,
    ``K (theta - q) + D (theta' - q') = tau`` and ``B theta'' + tau = u``. Without damping ``theta = q + tau / K``, so
    that the motor torque u needs the fourth derivative of q. Rotors have only the spin about their own axes (Spong
    1987): gyroscopic torques, and the effect of the motion of the links that carry the rotors, are neglected. With
    damping, the deflection is integrated along the trajectory, see `jounce.planning.SpringDeflection`.

    Parameters
    ----------
    system : Robot or Mechanism
        The system to drive; the links that carry rotors and gears include their masses. In a mechanism, a motor
        prescribes one end of a spring instead of the coordinate of the driver.
    motion : JointTrajectory, or array_like of shape (..., order + 1, n)
        Motion of a robot. Joints that a trajectory does not name stand still at zero, or at the end of their range
        nearest to zero. Derivatives ``q, q', q'', ...``, to the order 4 + rates or more, need no instants; with
        damping, the deflection is then the regular expansion in the time constant D / K. For a mechanism, the instants
        of the results; by default those of its file.
    drives : dict of str to Drive
        Drives by name of the joint or driver; all others are rigid.
    rates : int, default 0
        Number of rates of the motor torques.
    times : array_like of shape (time,), optional
        Instants of the results, s; by default those of the trajectory.
    losses : bool, default True
        Whether to include damping and friction of the robot file: damping on the links, Coulomb friction on the motors.
    tolerance : float, default 1e-6
        With damping, for given derivatives: largest ratio of the last term of the expansion to the deflection, and the
        same for its derivatives.

    Returns
    -------
    Feedforward, or MotorMotion for given derivatives

    Raises
    ------
    RobotError, MechanismError
        If an argument does not fit, a robot has closed loops, or the expansion does not reach its tolerance.
    TrajectoryError
        If spring torques or their rates jump along the trajectory, so that motors would have to jump.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, 0, 1])
    >>> arm = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", rod)], [pin], gravity=[0, 0, 0])
    >>> drive = jn.planning.Drive(stiffness=100.0, rotor_inertia=1e-4, gear_ratio=50)
    >>> q = [[0.0], [0.0], [3.0], [0.0], [60.0]]  # to its fourth derivative
    >>> found = jn.planning.feedforward(arm, q, {"pin": drive})
    >>> found.deflection[0].item(), found.torque[0].round(12).item()  # 1 N m, and 0.25 kg m^2 (3 + 20 / 100) more
    (0.01, 1.8)
    """
    rates = whole_number("rates", rates)
    if rates > MOST_RATES:
        raise JounceError(f"must be at most {MOST_RATES}", name="rates", value=rates)
    if isinstance(system, Mechanism):
        check_mechanism(system)
        driven_mechanism = DrivenMechanism(system, motion if times is None else times, drives)
        return _along(driven_mechanism, driven_mechanism.instants, rates)
    if not isinstance(system, Robot):
        raise JounceError("must be a Robot or a Mechanism", name="system", value=type(system).__name__)
    if not isinstance(motion, JointTrajectory):
        if times is not None:
            raise RobotError("belongs to a trajectory; derivatives are given as they are", name="times")
        return _of_derivatives(system, motion, drives, rates, losses, tolerance)
    driven_robot = DrivenRobot(system, motion, drives, losses)
    instants = motion.times if times is None else _checked_times(times, motion)
    result = _along(driven_robot, instants, rates)
    driven_robot.warn()
    return result


def _along(system: DrivenSystem, instants: np.ndarray, rates: int) -> Feedforward:
    levels, arrays, elastic = 3 + rates, system.arrays, np.flatnonzero(system.arrays.elastic)
    nodes = np.union1d(system.instants, instants)

    def torques(times: np.ndarray) -> np.ndarray:
        return system.moved(times, levels)[1][..., elastic]

    deflection = None
    if len(elastic):
        names = tuple(arrays.names[k] for k in elastic)
        deflection = SpringDeflection(torques, arrays.stiffness[elastic], arrays.time_constant[elastic], nodes, names)
    return Feedforward(system, instants, levels, deflection)


def _of_derivatives(robot: Robot, q: object, drives: object, rates: int, losses: bool, tolerance: float) -> MotorMotion:
    arrays, levels = robot_drives(robot, drives, losses), 3 + rates
    q = np.asarray(checked_coordinates(robot, q, levels + 1))
    forces = np.asarray(link_forces(robot, q, losses))
    level_count = forces.shape[-2]
    deflection = forces[..., :levels, :] / arrays.stiffness
    last_terms = np.zeros_like(deflection)
    for k in range(level_count):  # terms of the regular expansion
        count = min(levels, level_count - k)
        term = (-arrays.time_constant) ** k * forces[..., k : k + count, :] / arrays.stiffness
        deflection[..., :count, :] += term if k else 0.0
        last_terms[..., :count, :] = np.abs(term)
    damped = np.where(arrays.time_constant > 0, 1.0, 0.0)
    n = len(arrays.names)
    peaks = [np.abs(x).reshape(-1, levels, n).max(axis=0) for x in (last_terms * damped, deflection)]
    rounding = 1e-9 * peaks[1].max(axis=1, keepdims=True)
    ratios = peaks[0] / np.maximum(np.maximum(peaks[1], rounding), 1e-300)
    if (ratios > tolerance).any():
        level, joint = np.unravel_index(np.argmax(ratios), ratios.shape)
        noun = f"derivative {level} of the deflection" if level else "the deflection"
        message = (
            f"the expansion in its time constant, {arrays.time_constant[joint]:.3g} s, still has a term of "
            f"{ratios[level, joint]:.3g} of {noun} where it ends; give a trajectory, along which it is solved, or more "
            "derivatives, or a larger tolerance"
        )
        raise RobotError(message, name=f"drives.{arrays.names[joint]}.damping")
    return motor_motion(arrays, q[..., :levels, :], forces[..., :levels, :], deflection)


def _checked_times(times: ArrayLike, trajectory: JointTrajectory) -> np.ndarray:
    instants = np.atleast_1d(seconds("times", times, TrajectoryError))
    if instants.ndim != 1 or not len(instants) or not np.isfinite(instants).all() or (np.diff(instants) <= 0).any():
        raise TrajectoryError("must be finite instants that increase", name="times", value=instants.tolist())
    if instants[0] < trajectory.start or instants[-1] > trajectory.stop:
        message = (
            f"the trajectory goes from {trajectory.start:.9g} to {trajectory.stop:.9g} s; choose instants within it"
        )
        raise TrajectoryError(message, name="times", value=[instants[0], instants[-1]])
    return instants
