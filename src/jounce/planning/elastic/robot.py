"""Robots with elastic joints, simulated with the rotors of their motors.

Each rotor is a massless link on the base, whose joint has the inertia of the rotor as armature, so that it only turns
about its axis. The kinetic energy is that of the links plus ``B theta'^2 / 2`` for each rotor: exactly the model of
Spong (1987).
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.base.modules import field
from jounce.base.shapes import real_numbers
from jounce.errors import RobotError
from jounce.integrate import RobotSimulation, simulate
from jounce.integrate.steps.options import SimulationOptions
from jounce.jet import Jet
from jounce.jet.programs.composition import SampleFunction
from jounce.planning.elastic.driven_systems import robot_drives
from jounce.planning.elastic.drives import Drive, DriveArrays
from jounce.planning.elastic.motor_torques import MOTOR, torques_of
from jounce.robot import Joint, Link, Robot
from jounce.robot.model.joint_laws import AbstractJointLaws, read_forces
from jounce.trajectory import AbstractMotion
from jounce.trajectory.labels import in_order


def elastic_robot(robot: Robot, drives: Mapping[str, Drive], *, losses: bool = True, friction: bool = True) -> Robot:
    """Return a robot with two joints for each elastic joint: that of the link, and that of the rotor, ``NAME_motor``.

    Nothing connects the two; `simulate_elastic` adds the springs as forces. Coordinates of rotors are those seen at the
    joints. Their inertia is an armature, which counts only with `drives=True`.

    Parameters
    ----------
    robot : Robot
        A robot without closed loops.
    drives : dict of str to Drive
        Drives of its joints; joints without one do not change.
    losses : bool, default True
        Whether to include the damping of the links and the Coulomb friction of the motors from the robot file.
    friction : bool, default True
        Whether to include Coulomb friction.

    Raises
    ------
    RobotError
        If a drive does not fit the robot, or the rotor of an elastic drive has no inertia.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    >>> arm = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    >>> drive = jn.planning.Drive(stiffness=100.0, rotor_inertia=1e-4, gear_ratio=50)
    >>> jn.planning.elastic_robot(arm, {"pin": drive}).joint_names
    ('pin', 'pin_motor')
    """
    arrays = robot_drives(robot, drives, losses)
    columns = {name: k for k, name in enumerate(arrays.names)}
    for k in np.flatnonzero(arrays.elastic & (arrays.inertia <= 0)):
        message = "the rotor has no inertia, so that no acceleration follows from its torque; give rotor_inertia"
        raise RobotError(message, name=f"drives.{arrays.names[k]}", value=float(arrays.inertia[k]))
    joints: list[Joint] = []
    rubs = losses and friction
    for joint in robot.joints.values():
        armature, rubbing = joint.armature, joint.friction if rubs else 0.0
        damping = joint.damping if losses else 0.0
        several = joint.mimic is not None and joint.mimic.several
        if joint.moving and not several:  # the motor of a joint includes the armature and friction of its followers
            leader = joint.name if joint.mimic is None else joint.mimic.joint
            k = columns[leader]
            if arrays.elastic[k]:
                armature = rubbing = 0.0
            elif drives.get(leader, Drive()).rotor_inertia is not None:
                armature = float(arrays.inertia[k]) if joint.mimic is None else 0.0
        joints.append(dataclasses.replace(joint, armature=armature, damping=damping, friction=rubbing))
    links = list(robot.links.values())
    for k in np.flatnonzero(arrays.elastic):
        name = arrays.names[k] + MOTOR
        links.append(Link(name))
        kind = "continuous" if arrays.turning[k] else "prismatic"
        armature, rubbing = float(arrays.inertia[k]), float(arrays.friction[k]) if rubs else 0.0
        joints.append(Joint(name, robot.base, name, kind, armature=armature, friction=rubbing))
    changes = {key: 0.0 for key, counts in {"damping": losses, "friction": rubs}.items() if not counts}
    couplings = [dataclasses.replace(x, **changes) for x in robot.couplings.values()]
    return Robot(robot.name, links, joints, robot.gravity, strict=False, couplings=couplings)


class _ElasticForces(AbstractJointLaws):
    """Forces of all joints of an elastic robot: commanded motor torques, and springs between motors and links."""

    torque: Any
    laws: tuple[AbstractMotion, ...]
    stiffness: Any
    damping: Any
    indices: tuple[int, ...] = field(static=True)  # numbers of the original joints with laws
    links: tuple[int, ...] = field(static=True)  # columns of the original joints
    motors: tuple[int, ...] = field(static=True)  # columns of their rotors, or of rigid joints themselves
    feedback: SampleFunction | None

    @property
    def changing(self) -> bool:
        return True

    def __call__(self, time: Any, q: Any, rate: Any) -> Any:
        links, motors = np.array(self.links), np.array(self.motors)
        motor_torques = jnp.broadcast_to(jnp.asarray(self.torque)[:, None], (len(links), q.shape[-1]))
        if self.laws:
            zero = jnp.zeros_like(time[0])
            values = {k: law(Jet([time[0]])).coefficients[0] for k, law in zip(self.indices, self.laws, strict=True)}
            motor_torques = motor_torques + jnp.stack([values.get(k, zero) for k in range(len(links))])
        if self.feedback is not None:
            motor_torques = motor_torques + self.feedback(time[0], q[links], rate[links], q[motors], rate[motors])
        spring = jnp.asarray(self.stiffness)[:, None] * (q[motors] - q[links])
        spring = spring + jnp.asarray(self.damping)[:, None] * (rate[motors] - rate[links])
        forces = jnp.zeros(q.shape)
        return forces.at[links].add(spring).at[motors].add(motor_torques - spring)


def simulate_elastic_robot(
    robot: Robot,
    drives: Mapping[str, Drive],
    time: Any,
    torque: object,
    state: object,
    order: int,
    options: SimulationOptions,
    *,
    losses: bool,
    friction: bool,
) -> RobotSimulation:
    """Return the motion of a robot with elastic joints under torques of its motors; see `simulate_elastic`."""
    arrays = robot_drives(robot, drives, losses)
    robot_with_motors = elastic_robot(robot, drives, losses=losses, friction=friction)
    names = robot_with_motors.joint_names
    links = tuple(names.index(name) for name in arrays.names)
    motors = tuple(
        names.index(name + MOTOR) if elastic else names.index(name)
        for name, elastic in zip(arrays.names, arrays.elastic, strict=True)
    )
    constant, laws, function = torques_of(arrays, torque)
    count, feedback = len(arrays.names), None
    if function is not None:
        sample = jnp.zeros(()), *[jnp.zeros(count)] * 4
        feedback = read_forces(function, "torque", (count,), sample, "time, q, q', theta and theta'")
    stiffness = np.where(arrays.elastic, arrays.stiffness, 0.0)
    indices, functions = tuple(k for k, _ in laws), tuple(law for _, law in laws)
    damping = stiffness * arrays.time_constant
    forces = _ElasticForces(constant, functions, stiffness, damping, indices, links, motors, feedback)
    start_state = _start(arrays, state, len(names), links, motors)
    return simulate(robot_with_motors, time, order, state=start_state, torque=forces, drives=True, **options)


def _start(
    arrays: DriveArrays, state: object, count: int, links: tuple[int, ...], motors: tuple[int, ...]
) -> np.ndarray:
    """Return q and q' of links and rotors; by default springs are relaxed, and rotors move with the links."""
    n = len(arrays.names)
    levels = np.zeros((2, n)) if state is None else in_order("state", state, arrays.names, RobotError)
    values = real_numbers("state", levels, RobotError)
    if values.shape not in ((2, n), (2, 2, n)) or not np.isfinite(values).all():
        message = f"must hold finite q and q' of the links, the shape (2, {n}), or of links and motors, (2, 2, {n})"
        raise RobotError(message, name="state", value=values.tolist())
    link_and_motor = values if values.ndim == 3 else np.stack([values, values])
    state_values = np.zeros((2, count))
    state_values[:, list(motors)] = link_and_motor[1]
    state_values[:, list(links)] = link_and_motor[0]
    return state_values
