"""Mechanisms with elastic drives: springs between driven bodies and the rotors of motors.

Each rotor is a body that slides perpendicular to gravity, whose position is the coordinate of the motor. Each spring is
a force on the difference between the coordinate that the driver prescribes and this position.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from jounce.base.modules import field
from jounce.base.shapes import real_numbers
from jounce.constraints import Scalar, Vector, drivers, planar, spatial
from jounce.errors import MechanismError, RobotError, UnsupportedError
from jounce.forces import AbstractForce
from jounce.forces.actuators import SlideForce
from jounce.forces.laws import ExpressionLaw, TimeLaw
from jounce.integrate import Simulation, simulate
from jounce.integrate.steps.options import SimulationOptions
from jounce.kinematics.position_analysis.solve import solve
from jounce.mechanism import Body, Mechanism, time_grid
from jounce.mechanism.resolve import resolve
from jounce.mechanism.time import TimeLike
from jounce.planning.elastic.driven_systems import DrivenMechanism
from jounce.planning.elastic.drives import Drive, DriveArrays
from jounce.planning.elastic.motor_torques import MOTOR, torques_of
from jounce.trajectory import AbstractMotion
from jounce.trajectory.labels import in_order


class _DriveSpring(AbstractForce):
    """Spring and damper between the driver coordinate of the first two bodies and the position of a rotor."""

    stiffness: Scalar
    damping: Scalar
    across: Vector  # direction of the slide of the rotor

    body_count = 3
    prescribed: ClassVar[Callable[..., Any]]  # the coordinate of the first two bodies that the driver prescribes

    def displacement(self, body_i: Any, body_j: Any, rotor: Any, time: Any) -> Any:
        coordinate = sum(rotor.position[k] * self.across[k] for k in range(len(self.across)))
        return type(self).prescribed(self, body_i, body_j) - coordinate

    def force(self, displacement: Any, velocity: Any, time: Any) -> Any:
        return -self.stiffness * displacement - self.damping * velocity


class _DistanceSpring(_DriveSpring):
    point_i: Vector
    point_j: Vector

    prescribed = drivers.DistanceDriver.evaluate


class _SlideSpring(_DriveSpring):
    point_i: Vector
    point_j: Vector
    vector_i: Vector

    prescribed = drivers.SlideDriver.evaluate


class _CoordinateSpring(_DriveSpring):
    coordinate: str = field(static=True)
    ratio: Scalar
    offset: Scalar

    prescribed = drivers.CoordinateDriver.evaluate


SPRINGS: dict[type, type[_DriveSpring]] = {
    drivers.DistanceDriver: _DistanceSpring,
    drivers.SpatialDistanceDriver: _DistanceSpring,
    drivers.SlideDriver: _SlideSpring,
    drivers.SpatialSlideDriver: _SlideSpring,
    drivers.CoordinateDriver: _CoordinateSpring,
}


def simulate_elastic_mechanism(
    mechanism: Mechanism,
    drives: Mapping[str, Drive],
    time: TimeLike | None,
    torque: object,
    state: object,
    order: int,
    options: SimulationOptions,
) -> Simulation:
    """Return the motion of a mechanism with elastic drives under torques of its motors; see `simulate_elastic`."""
    arrays = DrivenMechanism(mechanism, time, drives).arrays
    instants = time_grid(mechanism.time if time is None else time, mechanism.parameter_values)
    constant, laws, feedback = torques_of(arrays, torque)
    if feedback is not None:
        raise UnsupportedError(
            "feedback of motors is for robots; give laws of time for those of mechanisms", name="torque"
        )
    motor_laws: dict[int, Any] = dict(laws)
    torques = [motor_laws.get(k, float(value)) for k, value in enumerate(constant)]
    elastic_mechanism = _elastic(
        mechanism, arrays, torques, _start(mechanism, arrays, state, float(instants[0])), float(instants[0])
    )
    return simulate(elastic_mechanism, instants, order, **options)


def _start(mechanism: Mechanism, arrays: DriveArrays, state: object, instant: float) -> np.ndarray:
    """Return start values and rates of drivers and motors, (2, 2, drivers): by default of the laws, springs relaxed."""
    n = len(arrays.names)
    if state is None:
        motion = solve(mechanism, [instant], order=1)
        law_values = np.stack([motion.driver(name).values[0] for name in arrays.names], axis=-1)
        return np.stack([law_values, law_values])
    labels = in_order("state", state, arrays.names, MechanismError, "drivers")
    given_state = real_numbers("state", labels, MechanismError)
    if given_state.shape != (2, 2, n) or not np.isfinite(given_state).all():
        message = f"must hold finite coordinates and rates of drivers and of motors, the shape (2, 2, {n})"
        raise MechanismError(message, name="state", value=given_state.tolist())
    return given_state


def _elastic(
    mechanism: Mechanism, arrays: DriveArrays, torques: list[Any], state: np.ndarray, instant: float
) -> Mechanism:
    bodies, joints, forces = dict(mechanism.bodies), dict(mechanism.joints), dict(mechanism.forces)
    remaining, initial = dict(mechanism.drivers), dict(mechanism.initial)
    axis, normal = _across(mechanism)
    for k in np.flatnonzero(arrays.elastic):
        name, spring = arrays.names[k], arrays.stiffness[k]
        driver, rotor = remaining.pop(name), arrays.names[k] + MOTOR
        kind = SPRINGS.get(type(driver))
        if kind is None:
            message = f"a driver of type {driver.type_name or type(driver).__name__} cannot be simulated with a spring"
            raise UnsupportedError(f"{message}; its feedforward can be computed", name=f"drivers.{name}")
        if arrays.inertia[k] <= 0:
            message = "the rotor has no inertia, so that no acceleration follows from its torque; give rotor_inertia"
            raise RobotError(message, name=f"drives.{name}", value=float(arrays.inertia[k]))
        if rotor in bodies:
            raise MechanismError("a body of this name is there already; the rotor needs it", name=f"bodies.{rotor}")
        fields = [field.name for field in dataclasses.fields(kind) if field.name in vars(driver)]
        values = {field: getattr(driver, field) for field in fields if field != "bodies"}
        if "ratio" in values and values["ratio"] is None:
            values["ratio"] = 1.0
        options = {"stiffness": spring, "damping": spring * arrays.time_constant[k], "across": axis, **values}
        forces[f"{name}_spring"] = kind(bodies=(*driver.bodies, rotor), **options)
        zero, coordinate = [0.0] * len(axis), [float(c * state[1, 0, k]) for c in axis]
        bodies[rotor] = Body(coordinate, mass=float(arrays.inertia[k]), inertia=1.0 if len(axis) == 2 else [1.0] * 3)
        directions = (axis, axis) if len(axis) == 2 else (axis, axis, normal, normal)
        slider = planar.Prismatic if len(axis) == 2 else spatial.Prismatic
        joints[f"{rotor}_guide"] = slider(("ground", rotor), zero, zero, *directions)
        law = torques[k]
        acting = TimeLaw(law) if isinstance(law, AbstractMotion) else ExpressionLaw(repr(float(law)))
        forces[f"{rotor}_torque"] = SlideForce(("ground", rotor), zero, zero, axis, acting)
        slide = drivers.SlideDriver if len(axis) == 2 else drivers.SpatialSlideDriver
        initial[name] = dataclasses.replace(driver, motion=_uniform(state[0, :, k], instant))
        initial[rotor] = slide(("ground", rotor), zero, zero, axis, _uniform(state[1, :, k], instant))
    changed = {"bodies": bodies, "joints": joints, "forces": forces, "drivers": remaining, "initial": initial}
    outputs = {name: x for name, x in mechanism.outputs.items() if not _of_driver(x, remaining, arrays.names)}
    return dataclasses.replace(mechanism, **changed, outputs=outputs)


def _of_driver(output: Any, drivers: Mapping[str, Any], names: tuple[str, ...]) -> bool:
    """Return whether an output belongs to a driver that a spring replaces."""
    owners = {getattr(output, field, None) for field in ("driver", "joint")}
    return any(name in names and name not in drivers for name in owners)


def _uniform(state: np.ndarray, instant: float) -> str:
    coordinate, rate = (float(x) for x in state)
    return f"{coordinate!r} + ({rate!r})*(t - ({instant!r}))"


def _across(mechanism: Mechanism) -> tuple[list[float], list[float]]:
    """Return a unit vector perpendicular to gravity, and one perpendicular to that vector."""
    plane = mechanism.space == "planar"
    components = [0.0] * (2 if plane else 3) if mechanism.gravity is None else mechanism.gravity
    gravity = np.array([float(resolve(g, mechanism.parameter_values)) for g in components])
    if plane:
        direction = np.array([gravity[1], -gravity[0]]) if gravity.any() else np.array([1.0, 0.0])
        return (direction / np.linalg.norm(direction)).tolist(), []
    axis = np.eye(3)[np.argmin(np.abs(gravity))]
    direction = np.cross(gravity, axis) if gravity.any() else axis
    direction = direction / np.linalg.norm(direction)
    normal = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    return direction.tolist(), (normal / np.linalg.norm(normal)).tolist()
