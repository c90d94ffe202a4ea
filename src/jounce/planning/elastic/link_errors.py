"""The proof of a feedforward: where links go that are simulated with their springs under the torques of the motors."""

import dataclasses
from typing import Any

import numpy as np

from jounce.base.shapes import Array
from jounce.kinematics.position_analysis.solve import solve
from jounce.planning.elastic.driven_systems import DrivenMechanism, DrivenRobot
from jounce.planning.elastic.motor_motion import Feedforward
from jounce.planning.elastic.simulation import simulate_elastic

MOST = 1001  # instants at which errors are reported


@dataclasses.dataclass(frozen=True, eq=False)
class LinkErrors:
    """How far links are from where they should be, simulated under a feedforward.

    Attributes
    ----------
    names, units : tuple of str
        Joints of a robot, rad or m; bodies of a mechanism, m: the largest error of its origin and of the points 1 m
        from it along its axes.
    time : array of shape (time,)
        s.
    exact : array of shape (time, names)
        Under the whole torques.
    rigid : array of shape (time, names) or None
        Under torques without what accelerates the springs, ``B (theta'' - q'')``, which the second rate of the torque
        gives.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    time: Array[np.ndarray, " time"]
    exact: Array[np.ndarray, "time name"]
    rigid: Array[np.ndarray, "time name"] | None


def link_errors(feedforward: Feedforward, *, rigid: bool = True) -> LinkErrors:
    """Simulate what is driven with its springs under a feedforward, and return how far the links go astray.

    The simulation knows nothing of the trajectory but its start; there is no feedback, so that where a position is not
    stable by itself, rounding grows as any disturbance would. Coulomb friction is left out, of the torques and of the
    simulation: a motor that turns back would stick until its torque jumps.

    Parameters
    ----------
    feedforward : Feedforward
        Of a robot on a trajectory, or of a mechanism.
    rigid : bool, default True
        Whether to simulate it a second time without what accelerates the springs.

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
    run = simulate_elastic(system.robot, system.drives, instants, laws, feedforward.start, order=1, **options)
    columns = [run.robot.joint_names.index(name) for name in feedforward.names]
    return np.abs(run.q[:, 0, columns] - feedforward.at(instants).q[:, 0])


def _of_mechanism(system: DrivenMechanism, feedforward: Feedforward, instants: np.ndarray, laws: Any) -> np.ndarray:
    run = simulate_elastic(system.mechanism, system.drives, instants, laws, feedforward.start, order=1, strict=False)
    ideal = solve(system.mechanism, instants, order=1)
    size = 2 if system.mechanism.space == "planar" else 3
    points = np.concatenate([np.zeros((1, size)), np.eye(size)]).tolist()
    deviations = np.zeros((len(instants), len(system.mechanism.bodies)))
    for column, body in enumerate(system.mechanism.bodies):
        differences = [run.point(body, point).values[:, 0] - ideal.point(body, point).values[:, 0] for point in points]
        deviations[:, column] = np.linalg.norm(np.stack(differences), axis=-1).max(axis=0)
    return deviations
