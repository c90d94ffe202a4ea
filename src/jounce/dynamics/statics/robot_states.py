"""Robots as mechanisms at rest or in a state of motion, for equilibria and small motions."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from typing_extensions import TypeAliasType

from jounce.base.shapes import ArrayLike
from jounce.dynamics.forward.initial_state import TOLERANCE
from jounce.dynamics.statics.equilibrium_search import driven, rest_point
from jounce.dynamics.statics.independent_coordinates import chosen_outputs
from jounce.dynamics.statics.operating_point import OperatingPoint
from jounce.errors import RobotError, check_name
from jounce.forces.actuators import SlideForce, SpatialTorque
from jounce.kinematics.assembly.assemble import assemble
from jounce.mechanism import Mechanism, build
from jounce.robot import Robot
from jounce.robot.closed_loops.closures import GivenCoordinates, given_coordinates
from jounce.robot.closed_loops.mechanism_parts import RobotParts
from jounce.robot.model.arguments import floats
from jounce.trajectory.labels import in_order

DRIVE = "_drive"

GivenState = TypeAliasType("GivenState", Mapping[str, float] | ArrayLike | None)
"""Coordinates, optionally with rates and second derivatives, or coordinates by joint name; the rest is zero."""


def as_held_mechanism(
    robot: Robot, q: GivenCoordinates, hold: str | Sequence[str], torques: Mapping[str, float] | None, drives: bool
) -> Mechanism:
    """Return a robot as a mechanism with held joints, and constant torques or forces in other joints.

    With `drives` the joints have armature inertia and damping. Coulomb friction is left out: it would hold the robot
    anywhere nearby.

    Raises
    ------
    RobotError
        If a name or a value does not fit the robot.
    """
    robot, start = _frictionless(robot), given_coordinates(robot, q)
    names = robot.joint_names if hold == "all" else (hold,) if isinstance(hold, str) else tuple(hold)
    for name in names:
        check_name("moving joint", name, robot.joint_names, RobotError, name="hold")
    constant_torques = dict(torques or {})
    for name, value in constant_torques.items():
        check_name("moving joint", name, robot.joint_names, RobotError, name="torques")
        if name in names:
            raise RobotError("this joint is held; its torque follows", name=f"torques.{name}", value=value)
        if not np.isfinite(float(floats(f"torques.{name}", value))):
            raise RobotError("must be finite", name=f"torques.{name}", value=value)
    elements = RobotParts(robot, {*names, *constant_torques}, None, None, drives)
    order = [joint.name for joint in robot.moving_joints]
    forces: dict[str, Any] = {}
    for name, value in constant_torques.items():
        place, law = elements.joint_placement(order.index(name)), repr(float(value))
        if place.turning:
            forces[f"{name}_torque"] = SpatialTorque(
                place.bodies, axis_i=place.axis_i, law=law, vector_i=place.vector_i, vector_j=place.vector_j
            )
        else:
            forces[f"{name}_force"] = SlideForce(
                place.bodies, point_i=place.point, point_j=np.zeros(3), vector_i=place.axis_i, law=law
            )
    drivers = {name: float(start[robot.joint_names.index(name)]) for name in names}
    return robot.mechanism(start, drivers=drivers, forces=forces, drives=drives)


def through_state(
    robot: Robot, state: GivenState, coordinates: Sequence[str] | None, drives: bool
) -> tuple[OperatingPoint, tuple[str, ...]]:
    """Return a robot in a state, driven in independent joints, and the names of these joints.

    Parameters
    ----------
    robot : Robot
        Robot with or without loops.
    state : array_like of shape (n,), or (k, n) with k to 3
        Coordinates, their rates and second derivatives; those of dependent joints are ignored.
    coordinates : sequence of str, optional
        Independent joints; by default all joints of a tree, or chosen ones if there are loops.
    drives : bool
        Whether the joints have armature inertia and damping; Coulomb friction, which has no slope, is left out.

    Raises
    ------
    RobotError
        If a name or a value does not fit the robot.
    """
    levels = _levels(robot, state)
    names = robot.joint_names if coordinates is None else tuple(coordinates)
    for name in names:
        check_name("moving joint", name, robot.joint_names, RobotError, name="coordinates")
    if coordinates is None and robot.closures:
        names = _independent(robot, levels[0])
    columns = [robot.joint_names.index(name) for name in names]
    series = zip(names, (levels[:, columns] * [[1.0], [1.0], [0.5]]).T.tolist(), strict=True)
    laws = {name: f"{value!r} + {rate!r}*t + {half!r}*t**2" for name, (value, rate, half) in series}
    mechanism = _frictionless(robot).mechanism(levels[0], drivers=laws, time=[0.0], drives=drives)
    model, assembled = assemble(build(mechanism), 0.0, TOLERANCE)
    return driven(rest_point(mechanism, model, assembled, 0.0)), names


def _frictionless(robot: Robot) -> Robot:
    """Return a robot without Coulomb friction."""
    joints = [dataclasses.replace(joint, friction=0.0) for joint in robot.joints.values()]
    couplings = [dataclasses.replace(coupling, friction=0.0) for coupling in robot.couplings.values()]
    return robot.changed(joints=joints, couplings=couplings)


def _levels(robot: Robot, state: GivenState) -> Float[np.ndarray, "3 joint"]:
    """Return coordinates, rates and second derivatives, zero by default."""
    count = len(robot.joint_names)
    values = robot.coordinates(**state) if isinstance(state, Mapping) else np.zeros(count) if state is None else state
    array = np.atleast_2d(np.asarray(floats("q", in_order("q", values, robot.joint_names, RobotError))))
    if array.ndim != 2 or array.shape[1] != count or not 1 <= len(array) <= 3:
        shape_text = f"not {array.shape if len(array) > 1 else array.shape[1:]}"
        message = f"must have the shape (n,), or (k, n) with q, q' and q'' for k to 3, n = {count}, {shape_text}"
        raise RobotError(message, name="q")
    if not np.isfinite(array).all():
        raise RobotError("must be finite", name="q")
    return np.concatenate([array, np.zeros((3 - len(array), count))])


def _independent(robot: Robot, q: Float[np.ndarray, " joint"]) -> tuple[str, ...]:
    """Return independent joints of a robot with loops, chosen in the closed position near q."""
    mechanism = robot.mechanism(q, drives=False)
    model, coordinates = assemble(build(mechanism), 0.0, TOLERANCE, free=True)
    return chosen_outputs(rest_point(mechanism, model, coordinates, 0.0))
