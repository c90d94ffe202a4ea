"""Kinetic energy and acceleration energies of any order, with their rates. Negrean 2025, equations 65-120.

The acceleration energy of order p is the kinetic energy with derivatives of order p + 1 in the place of velocities,
``E_p = 1/2 integral |r^(p+1)|^2 dm``; order 0 is the kinetic energy. With the second moments S of a body about its
centre of mass C and its axes a this is ``m/2 |r_C^(p+1)|^2 + 1/2 sum S_jk a_j^(p+1) . a_k^(p+1)`` (equation 107), exact
for any motion. On jets the same two products give the rates.
"""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.errors import MechanismError, RobotError
from jounce.jet import Jet, dot
from jounce.jet.algebra import stacked, total
from jounce.kinematics import Motion, Status
from jounce.kinematics.compilation import compiled
from jounce.mechanism import Mechanism
from jounce.mechanism.masses import body_mass
from jounce.mechanism.resolve import resolve
from jounce.rigid.frames import Frames
from jounce.robot.batches import Batched, checked_coordinates
from jounce.robot.kinematics import body_frames
from jounce.robot.robot import Robot
from jounce.robot.tree import Tree


@dataclasses.dataclass(frozen=True, eq=False)
class Energy:
    """An energy of several bodies, translation and rotation apart, with its rates.

    Parameters
    ----------
    translation, rotation : array of shape (..., rates + 1, bodies)
        The parts of each body, kg m^2 / s^(2 p + 2) for order p, and their derivatives.
    bodies : tuple of str
        Names along the last axis.
    order : int
        The order p of the energy; 0 is the kinetic energy.
    """

    translation: Any
    rotation: Any
    bodies: tuple[str, ...]
    order: int

    @property
    def total(self) -> Any:
        """Energy of all bodies and its rates, shape (..., rates + 1)."""
        return (self.translation + self.rotation).sum(axis=-1)


def body_energy(pose: Any, mass: Any, center_of_mass: Any, second_moments: Any, order: int = 1) -> tuple[Jet, Jet]:
    """Return the acceleration energy of rigid bodies as jets: Negrean 2025, equations 82-113.

    Parameters
    ----------
    pose : SpatialPose, PlanarPose or Frames
        Where the bodies are, as jets of order `order` + 1 or more.
    mass : array_like
        kg; its shape is that of the batch axes of the pose.
    center_of_mass : array of shape (3, ...) or (2, ...)
        In the frames of the bodies, m.
    second_moments : array of shape (3, 3, ...) or (2, 2, ...)
        Integral of rho rho^T dm about the centre of mass, in the frames of the bodies, kg m^2.
    order : int, default 1
        Order p of the energy; 0 is the kinetic energy.

    Returns
    -------
    translation, rotation : Jet
        Shorter than the pose by `order` + 1.

    Raises
    ------
    ValueError
        If the pose has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> angle = jn.Jet([0.0, 2.0, 1.5])  # a disc of 1 kg m^2 that turns in the plane, at 2 rad/s and 3 rad/s^2
    >>> pose = jn.rigid.PlanarPose.from_jets(jn.Jet.constant([0.0, 0.0], 2), angle)
    >>> _, rotation = jn.dynamics.body_energy(pose, 1.0, [0.0, 0.0], [[0.5, 0.0], [0.0, 0.5]])
    >>> float(rotation.coefficients[0])  # (3^2 + 2^4) / 2
    12.5
    """
    velocity = differentiated(pose.point(center_of_mass), order + 1)
    rates = [differentiated(axis, order + 1) for axis in body_axes(pose)]
    translation = dot(velocity, velocity) * (0.5 * mass)
    size = range(len(rates))
    rotation = total(
        dot(rates[i], rates[k]) * ((0.5 if i == k else 1.0) * second_moments[i][k])
        for i in size
        for k in size
        if i <= k
    )
    return translation, rotation


def body_axes(pose: Any) -> tuple[Jet, ...]:
    """Return the axes of bodies, two in the plane, in components of the base."""
    if hasattr(pose, "axes"):
        return pose.axes
    return tuple(pose.direction(unit) for unit in np.eye(2))  # a planar body


def differentiated(jet: Jet, times: int) -> Jet:
    """Return a derivative of a jet.

    Raises
    ------
    ValueError
        If the jet is too short.
    """
    if jet.order < times:
        raise ValueError(f"the pose has derivatives to order {jet.order}, this energy needs order {times}")
    for _ in range(times):
        jet = jet.differentiate()
    return jet


def acceleration_energy(system: Robot | Motion, q: Any = None, *, order: int = 1) -> Energy:
    """Return the acceleration energy of order p of a robot or of a moving mechanism, and its rates.

    Negrean 2025, equations 73-78 for order 0, 82-113 for order 1, 107 for any order.

    Parameters
    ----------
    system : Robot or Motion
        A robot, or the motion of a mechanism whose bodies have masses.
    q : array_like of shape (..., K + 1, n), optional
        Coordinates of a robot and their derivatives, K at least p + 1.
    order : int, default 1
        The order p; 0 is the kinetic energy.

    Returns
    -------
    Energy
        With K - p - 1 rates; for a motion of derivatives to order K, one for each instant.

    Raises
    ------
    RobotError, MechanismError
        If derivatives are missing, q does not fit the robot, or no body of the mechanism has a mass.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod")
    >>> robot = jn.Robot("one", links, [pin])
    >>> float(jn.acceleration_energy(robot, [[0.0], [2.0], [3.0]]).total[0].round(12))  # (3^2 + 2^4) / 3 / 2
    4.166666666667
    """
    (translation, rotation), bodies, order = evaluated(system, q, order, body_energy)
    return Energy(translation, rotation, bodies, order)


def evaluated(
    system: Robot | Motion, q: Any, order: int, function: Any
) -> tuple[tuple[Any, ...], tuple[str, ...], int]:
    """Return what `body_energy`, or a function like it, gives for the bodies of a system, their names, and the order.

    Arrays are of shape (..., rates + 1, bodies): plain derivatives.

    Raises
    ------
    RobotError, MechanismError
        As for `acceleration_energy`.
    """
    order = whole_number("order", order, 0)
    if isinstance(system, Motion):
        return _of_motion(system, order, function), tuple(system.mechanism.bodies), order
    q = checked_coordinates(system, q, 0)
    if q.shape[-2] < order + 2:
        message = f"an energy of order {order} needs derivatives of q to order {order + 1}"
        raise RobotError(message, name="q", value=q.shape)
    return _of_robot(system, (q,), (), (order, function)), system.moving_links, order


def whole_number(name: str, value: Any, least: int) -> int:
    """Return a whole number that is large enough.

    Raises
    ------
    RobotError
        If it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise RobotError(f"must be a whole number, {least} or greater", name=name, value=value)
    return int(value)


def kinetic_energy(system: Robot | Motion, q: Any = None) -> Energy:
    """Return the kinetic energy of a robot or of a moving mechanism, and its rates: `acceleration_energy` of order 0.

    Negrean 2025, equations 65-78 (Koenig's theorem).

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> jn.kinetic_energy(jn.robot.from_screws([slide]), [[0.0], [3.0], [1.0]]).total.tolist()  # energy and power
    [9.0, 6.0]
    """
    return acceleration_energy(system, q, order=0)


def robot_energy(tree: Tree, frames: Frames, order: int, function: Any = body_energy) -> tuple[Jet, ...]:
    """Return the energy of the bodies of a robot as jets of shape (bodies, batch), from the frames of the bodies."""
    tensor = jnp.moveaxis(jnp.asarray(tree.inertia), 0, -1)[..., None]
    spread = 0.5 * (tensor[0, 0] + tensor[1, 1] + tensor[2, 2])
    moments = [[(spread if i == k else 0.0) - tensor[i, k] for k in range(3)] for i in range(3)]
    center = jnp.swapaxes(jnp.asarray(tree.center), 0, 1)[:, :, None]
    return function(frames, jnp.asarray(tree.mass)[:, None], center, moments, order)


@Batched
def _of_robot(tree: Tree, arrays: Any, _: Any, order: int, function: Any) -> Any:
    frames = body_frames(tree, arrays[0]).without_base()
    return tuple(stacked(part) for part in robot_energy(tree, frames, order, function))


def _of_motion(motion: Motion, order: int, function: Any) -> tuple[np.ndarray, ...]:
    if motion.order < order + 1:
        message = f"an energy of order {order} needs a motion solved to order {order + 1}"
        raise MechanismError(message, name="order", value=motion.order)
    pose_type, coordinates = motion.poses
    parts = _evaluated(coordinates, *mechanism_masses(motion), pose_type, order, function)
    bad = (motion.status != Status.OK)[:, None, None]

    def derivatives(coefficients: Any) -> np.ndarray:
        factorials = np.array([float(math.factorial(k)) for k in range(len(coefficients))])
        values = np.asarray(coefficients) * factorials[:, None, None]  # order, body, time
        return np.where(bad, np.nan, np.moveaxis(values[:, 1:], -1, 0))  # without the ground

    return tuple(derivatives(part[: motion.order - order]) for part in parts)


@compiled("pose_type", "order", "function")
def _evaluated(
    coordinates: Any, mass: Any, center: Any, moments: Any, pose_type: Any, order: int, function: Any
) -> Any:
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    return tuple(stacked(part) for part in function(pose, mass, center, moments, order))


def potential_energy(motion: Motion) -> Any:
    """Return the potential energy of all bodies of a mechanism in its gravity, and its rates; zero at the origin.

    Parameters
    ----------
    motion : Motion
        Of a mechanism whose bodies have masses.

    Returns
    -------
    array of shape (time, order + 1)
        J, J/s, ...; NaN at instants that were not solved.

    Raises
    ------
    MechanismError
        If no body has a mass.

    Examples
    --------
    >>> import jounce as jn
    >>> lift = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -10.0],
    ...     bodies={"cage": jn.Body([0, 0], mass=3.0)},
    ...     joints={"rail": jn.planar.Prismatic(("ground", "cage"), [0, 0], [0, 0], [0, 1], [0, 1])},
    ...     drivers={"height": jn.drivers.SlideDriver(("ground", "cage"), [0, 0], [0, 0], [0, 1], "2*t")},
    ... )
    >>> jn.dynamics.potential_energy(jn.solve(lift, [0.0, 1.0], order=1))[1].round(9).tolist()  # energy and power
    [60.0, 60.0]
    """
    found = potential_coefficients(motion)[: motion.order + 1].sum(axis=1)
    values = found * np.array([float(math.factorial(k)) for k in range(len(found))])[:, None]
    return np.where((motion.status == Status.OK)[:, None], values.T, np.nan)


def potential_coefficients(motion: Motion) -> np.ndarray:
    """Return the potential energies of bodies as Taylor coefficients, (levels, bodies, time), the ground first."""
    mass, center, _ = mechanism_masses(motion)
    pose_type, coordinates = motion.poses
    return 0.0 - np.asarray(_heights(coordinates, center, gravity_of(motion.mechanism), pose_type)) * mass  # no -0


def energy_coefficients(motion: Motion, order: int) -> np.ndarray:
    """Return the energies of order p of bodies as Taylor coefficients, (levels, bodies, time), the ground first.

    Raises
    ------
    MechanismError
        If no body has a mass, or the motion has too few derivatives.
    """
    pose_type, coordinates = motion.poses
    if len(coordinates["position"]) < order + 2:
        message = f"an energy of order {order} needs a motion solved to order {order + 1}"
        raise MechanismError(message, name="order", value=motion.order)
    parts = _evaluated(coordinates, *mechanism_masses(motion), pose_type, order, body_energy)
    return np.asarray(parts[0]) + np.asarray(parts[1])


@compiled("pose_type")
def _heights(coordinates: Any, center: Any, gravity: Any, pose_type: Any) -> Any:
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    return stacked(dot(pose.point(center), gravity))


def stored_energy(motion: Motion) -> np.ndarray:
    """Return the energy that springs, and other forces that give back what they take, have stored.

    Parameters
    ----------
    motion : Motion
        Of any mechanism; without such forces it is zero.

    Returns
    -------
    array of shape (time,)
        J; NaN at instants that were not solved.

    Examples
    --------
    >>> import jounce as jn
    >>> sled = jn.Mechanism(
    ...     space="planar",
    ...     bodies={"sled": jn.Body([1, 0])},
    ...     joints={"rail": jn.planar.Prismatic(("ground", "sled"), [0, 0], [0, 0], [1, 0], [1, 0])},
    ...     drivers={"push": jn.drivers.SlideDriver(("ground", "sled"), [0, 0], [0, 0], [1, 0], "1 + t**2")},
    ...     forces={"spring": jn.forces.Spring(("ground", "sled"), [0, 0], [0, 0], stiffness=5.0, length=1.0)},
    ... )
    >>> jn.dynamics.stored_energy(jn.solve(sled, [0.0, 2.0], order=1)).round(12).tolist()  # 5/2 t^4
    [0.0, 40.0]
    """
    pose_type, coordinates = motion.poses
    low = {name: values[: 2 - (name == "angular_velocity")] for name, values in coordinates.items()}
    stored = np.asarray(_stored(motion.forces, low, motion.time[None], pose_type))
    return np.where(motion.status == Status.OK, stored, np.nan)


@compiled("pose_type")
def _stored(groups: Any, coordinates: Any, time: Any, pose_type: Any) -> Any:
    pose, clock = (
        pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()}),
        Jet.variable(time, 1),
    )
    total_energy = jnp.zeros(time.shape[-1])
    for group in groups:
        stored = jnp.broadcast_to(group.energy(pose, clock).coefficients[0], (group.instances, time.shape[-1]))
        total_energy = total_energy + jnp.sum(stored, axis=0)
    return total_energy


def gravity_of(mechanism: Mechanism) -> Any:
    """Return the acceleration of free fall in a mechanism, shape (k, 1, 1), m/s^2."""
    given = [0.0] * (2 if mechanism.space == "planar" else 3) if mechanism.gravity is None else mechanism.gravity
    return resolve(given, mechanism.parameter_values)[:, None, None]


def mechanism_masses(motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return masses (bodies, 1), centres of mass (k, bodies, 1) and second moments (k, k, bodies, 1), the ground first.

    Raises
    ------
    MechanismError
        If no body has a mass, or a body has an inertia without a mass.
    """
    found = masses_of(motion.mechanism)
    if not found[0].any():
        raise MechanismError("no body has a mass; energies need some", name="bodies")
    return found


def masses_of(mechanism: Mechanism) -> tuple[Any, Any, Any]:
    """Return what `mechanism_masses` does, also where no body has a mass; parameters may be traced by JAX."""
    size = 2 if mechanism.space == "planar" else 3
    masses, centers, moments = [0.0], [np.zeros(size)], [np.zeros((size, size))]
    for name, body in mechanism.bodies.items():
        if body.mass is None and body.inertia is not None:
            raise MechanismError("an inertia needs a mass beside it", name=f"bodies.{name}.mass")
        mass, center, inertia = body_mass(name, body, mechanism.parameter_values, size, solid=False)
        masses.append(mass)
        centers.append(center)
        if size == 2:  # the second moments of a plane body about its axes are not known apart; only their sum counts
            moments.append(np.eye(2) * 0.5 * inertia)
        else:
            tensor = inertia * np.eye(3) if np.ndim(inertia) < 2 else inertia
            moments.append((tensor[0, 0] + tensor[1, 1] + tensor[2, 2]) / 2 * np.eye(3) - tensor)
    traced = any(isinstance(x, Tracer) for x in (*masses, *centers, *moments))
    stack = jnp.stack if traced else np.stack
    mass, center, second = (
        stack([*map(jnp.asarray if traced else np.asarray, x)], -1) for x in (masses, centers, moments)
    )
    return mass[:, None], center[..., None], second[..., None]
