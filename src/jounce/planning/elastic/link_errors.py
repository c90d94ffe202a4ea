"""Verification of a feedforward: the deviation of links simulated with their springs under the motor torques."""

import dataclasses
from typing import Any

import numpy as np

from jounce.base.shapes import Array
from jounce.kinematics.position_analysis.solve import solve
from jounce.planning.elastic.driven_systems import DrivenMechanism, DrivenRobot
from jounce.planning.elastic.motor_motion import Feedforward
from jounce.planning.elastic.simulation import simulate_elastic

MOST = 1001  # instants of the reported errors


@dataclasses.dataclass(frozen=True, eq=False)
class LinkErrors:
    """Deviations of links from their planned motion, simulated under a feedforward.

    Attributes
    ----------
    names, units : tuple of str
        Joints of a robot, rad or m; bodies of a mechanism, m: the largest error of the origin and of the points 1 m
        from it along the axes.
    time : array of shape (time,)
        Instants, s.
    exact : array of shape (time, names)
        Errors under the full torques.
    rigid : array of shape (time, names) or None
        Errors under torques without the acceleration of the spring deflection, ``B (theta'' - q'')``, which depends on
        the second rate of the torque.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    time: Array[np.ndarray, " time"]
    exact: Array[np.ndarray, "time name"]
    rigid: Array[np.ndarray, "time name"] | None


def link_errors(feedforward: Feedforward, *, rigid: bool = True) -> LinkErrors:
    """Simulate a system with its springs under a feedforward, and return the deviations of its links.

    The simulation uses the trajectory only for its start. It has no feedback, so that in an unstable position rounding
    grows as any disturbance does. Torques and simulation omit Coulomb friction, with which a motor that reverses would
    stick until its torque jumps.

    Parameters
    ----------
    feedforward : Feedforward
        Feedforward of a robot on a trajectory, or of a mechanism.
    rigid : bool, default True
        Whether to simulate a second time without the torques that accelerate the spring deflections.

    Raises
    ------
    RobotError, UnsupportedError
        If an elastic drive has a rotor without inertia, or belongs to a driver of a type that cannot be simulated so.
    """
    system = feedforward.system
    instants = system.instants
    if len(instants) > MOST:
        instants = instants[np.unique(np.linspace(0, len(instants) - 1, MOST).round().astype(int))]
    laws = [feedforward.torque_laws(friction=False)]
    if rigid:
        laws.append(feedforward.rigid_torque_laws(friction=False))
    if isinstance(system, DrivenRobot):
        errors = [_of_robot(system, feedforward, instants, law) for law in laws]
        names, turning = feedforward.names, system.arrays.turning
        units = tuple("rad" if turns else "m" for turns in turning)
    else:
        assert isinstance(system, DrivenMechanism)
        errors = [_of_mechanism(system, feedforward, instants, law) for law in laws]
        names = tuple(system.mechanism.bodies)
        units = ("m",) * len(names)
    return LinkErrors(names, units, instants, errors[0], errors[1] if rigid else None)


def _of_robot(system: DrivenRobot, feedforward: Feedforward, instants: np.ndarray, laws: Any) -> np.ndarray:
    options: Any = {"losses": system.losses, "friction": False, "strict": False}
    result = simulate_elastic(system.robot, system.drives, instants, laws, feedforward.start, order=1, **options)
    columns = [result.robot.joint_names.index(name) for name in feedforward.names]
    return np.abs(result.q[:, 0, columns] - feedforward.at(instants).q[:, 0])


def _of_mechanism(system: DrivenMechanism, feedforward: Feedforward, instants: np.ndarray, laws: Any) -> np.ndarray:
    result = simulate_elastic(system.mechanism, system.drives, instants, laws, feedforward.start, order=1, strict=False)
    ideal = solve(system.mechanism, instants, order=1)
    size = 2 if system.mechanism.space == "planar" else 3
    points = np.concatenate([np.zeros((1, size)), np.eye(size)]).tolist()
    deviations = np.zeros((len(instants), len(system.mechanism.bodies)))
    for column, body in enumerate(system.mechanism.bodies):
        differences = [
            result.point(body, point).values[:, 0] - ideal.point(body, point).values[:, 0] for point in points
        ]
        deviations[:, column] = np.linalg.norm(np.stack(differences), axis=-1).max(axis=0)
    return deviations
