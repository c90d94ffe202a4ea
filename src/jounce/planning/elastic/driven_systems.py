"""Driven robots and mechanisms in one form: coordinates, and the forces that their motion needs."""

import abc
import dataclasses
import warnings
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.padding import power_of_two
from jounce.base.shapes import Numbers
from jounce.dynamics.inverse.outputs.reactions import driver_force
from jounce.dynamics.limits.trajectories import FollowedTrajectory
from jounce.errors import MechanismError, RobotError, SampleWarning
from jounce.execution.chunks import in_chunks
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.kinematics.position_analysis.solve import solve
from jounce.mechanism import Mechanism, time_grid
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.planning.elastic.drives import Drive, DriveArrays
from jounce.robot.algorithms.inverse_dynamics import inverse_dynamics
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.drive_forces import passive_forces
from jounce.robot.robot import Robot
from jounce.trajectory.joint_trajectory import JointTrajectory

BLOCK = 2048  # instants per call, always the same number, so that programs compile once

Moved = tuple[Float[np.ndarray, "time level joint"], Float[np.ndarray, "time level joint"]]
"""Coordinates and the forces on the links that the motion needs, with equally many derivatives."""


class DrivenSystem(abc.ABC):
    """A robot on a trajectory, or a driven mechanism.

    Attributes
    ----------
    title : str
        Title of the robot or mechanism.
    drives : dict of str to Drive
        The given drives.
    arrays : DriveArrays
        The drives of all joints in arrays.
    instants : array of shape (time,)
        Instants of the trajectory, s.
    """

    title: str
    drives: Mapping[str, Drive]
    arrays: DriveArrays
    instants: Float[np.ndarray, " time"]

    @abc.abstractmethod
    def moved(self, times: Float[np.ndarray, " time"], levels: int) -> Moved:
        """Return coordinates and forces at instants, both with the given number of levels."""


class DrivenRobot(DrivenSystem):
    """A robot on a trajectory, each motor on its parent link; damping of the robot file acts on the links."""

    def __init__(self, robot: Robot, trajectory: JointTrajectory, drives: Any, losses: bool):
        self.robot, self.trajectory, self.losses = robot, trajectory, losses
        self.drives, self.arrays = drives, robot_drives(robot, drives, losses)
        self.followed = FollowedTrajectory(robot, trajectory)
        self.title, self.resting_joints = robot.name, self.followed.resting_joints
        self.instants = np.unique(np.concatenate([[trajectory.start], trajectory.times, [trajectory.stop]]))

    def moved(self, times: Float[np.ndarray, " time"], levels: int) -> Moved:
        """Return the coordinates and forces of the joints."""
        q = self.followed.coordinates(times, levels + 1)

        def block(chunk: np.ndarray) -> np.ndarray:
            return np.asarray(link_forces(self.robot, q[chunk], self.losses))

        return q[:, :levels], in_chunks(block, len(times), (BLOCK,), axis=0)[:, :levels]

    def warn(self) -> None:
        """Warn of samples that do not support the required derivatives."""
        for message in self.followed.doubts:
            warnings.warn(SampleWarning(message), stacklevel=3)


def robot_drives(robot: Robot, drives: object, losses: bool) -> DriveArrays:
    """Return the drives of a robot; a motor without rotor inertia has the armature of the robot file."""
    if robot.closures:
        message = (
            "the loops of this robot make its joints depend on one another; drive the mechanism that it is "
            "(robot.mechanism, jounce convert), whose drivers take drives"
        )
        raise RobotError(message, name=robot.name, value=list(robot.closures))
    if not robot.joint_names:
        raise RobotError("the robot has no moving joint, and nothing to drive", name="joints")
    followers = {joint.name: ", ".join(joint.mimic.weights) for joint in robot.moving_joints if joint.mimic is not None}
    for name in drives if isinstance(drives, dict) else ():
        if name in followers:
            message = f"this joint follows {followers[name]}; give that one the drive"
            raise RobotError(message, name="drives", value=name)
    tree, names = robot.tree, robot.joint_names
    if losses and np.any(tree.friction_skew):
        message = "elastic joints do not support friction that depends on the direction; give one value for both"
        raise RobotError(message, name=f"joints.{names[int(np.flatnonzero(tree.friction_skew)[0])]}.friction")
    if tree.shape.armed:
        message = "elastic joints do not support balls and tendons with armature; set their armature to zero"
        raise RobotError(message, name="couplings")
    turning = [robot.joints[name].turning for name in names]
    friction = np.asarray(tree.friction) if losses else np.zeros(len(names))
    return DriveArrays.of(names, turning, drives, np.asarray(tree.armature), friction, "moving joint")


def link_forces(robot: Robot, q: Numbers, losses: bool) -> Float[Numbers, "*batch level joint"]:
    """Return the joint forces on the links with rates, two levels fewer than q: with damping, without rotors."""
    forces = inverse_dynamics(robot, q, drives=False)
    if losses:
        return forces + _passive(robot, (q,))
    return forces + _passive(_lossless(robot), (q,)) if robot.tree.shape.tendons else forces


@Batched
def _passive(tree: Tree, arrays: tuple[Numbers], _: object) -> Numbers:
    """Return the forces of springs, dampers and friction of tendons and balls; joint friction acts on the motors."""
    (q,) = arrays
    coordinates = Jet(tuple(q))
    smooth = dataclasses.replace(tree, friction=jnp.zeros(tree.shape.coordinates))
    return stacked(passive_forces(smooth, coordinates, coordinates.differentiate(), len(q) - 3))


def _lossless(robot: Robot) -> Robot:
    """Return the robot without damping and friction, with its springs."""
    joints = [dataclasses.replace(joint, damping=0.0, friction=0.0) for joint in robot.joints.values()]
    couplings = [dataclasses.replace(x, damping=0.0, friction=0.0) for x in robot.couplings.values()]
    return robot.changed(joints=joints, couplings=couplings)


class DrivenMechanism(DrivenSystem):
    """A mechanism moved by its drivers, with the motors on the ground side of the driven bodies."""

    def __init__(self, mechanism: Mechanism, times: Any, drives: Any):
        self.mechanism, self.drives, names = mechanism, drives, tuple(mechanism.drivers)
        if not names:
            raise MechanismError("the mechanism has no driver, and nothing to drive", name="drivers")
        turning = [is_turning(driver) for driver in mechanism.drivers.values()]
        nothing = np.zeros(len(names))
        self.arrays = DriveArrays.of(names, turning, drives, nothing, nothing, "driver")
        self.title = mechanism.title or "mechanism"
        self.instants = time_grid(mechanism.time if times is None else times, mechanism.parameter_values)
        if len(self.instants) < 2:
            raise MechanismError("at least two instants are needed, a start and a stop", name="time")

    def moved(self, times: Float[np.ndarray, " time"], levels: int) -> Moved:
        """Return the coordinates and forces of the drivers; each call solves the motion from its start."""
        instants = _filled_up(np.union1d(self.instants, times))
        indices = np.searchsorted(instants, times)
        motion = solve(self.mechanism, instants, order=levels + 1)
        results = [(motion.driver(name), driver_force(motion, name)) for name in self.arrays.names]
        for name, (_, force) in zip(self.arrays.names, results, strict=True):
            if not np.isfinite(force.values).all():
                message = f"its force is not determined: {force.attrs.get('comment', 'it is not finite')}"
                raise MechanismError(message, name=f"drivers.{name}")
        q, force = (np.stack([pair[k].values[indices, :levels] for pair in results], axis=-1) for k in (0, 1))
        return q, force


def _filled_up(times: Float[np.ndarray, " time"]) -> Float[np.ndarray, " more"]:
    """Return instants with midpoints added up to a power of two, so that few sizes are compiled."""
    count = power_of_two(len(times)) - len(times)
    return np.union1d(times, 0.5 * (times[:-1] + times[1:])[:count])
