"""Kinetic energy and acceleration energies of any order, with their rates. Negrean 2025, equations 65-122.

The acceleration energy of order p is the kinetic energy with derivatives of order p + 1 in place of velocities,
``E_p = 1/2 integral |r^(p+1)|^2 dm``; order 0 is the kinetic energy. With the second moments S of a body about its
center of mass C and its axes a this is ``m/2 |r_C^(p+1)|^2 + 1/2 sum S_jk a_j^(p+1) . a_k^(p+1)`` (equation 107), exact
for any motion. On jets the same two products give the rates.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Numbers
from jounce.dynamics.masses import Masses, required_masses, second_moments
from jounce.dynamics.motion_values import Coordinates, labeled, pose_of
from jounce.errors import JounceError, MechanismError, RobotError, flag, whole_number
from jounce.execution.mapped import Mapped
from jounce.jet import Jet, dot
from jounce.jet.algebra import stacked, total
from jounce.kinematics import Motion
from jounce.kinematics.position_analysis.solve import HIGHEST_ORDER
from jounce.rigid import PlanarPose
from jounce.rigid.frames import Frames
from jounce.rigid.pose import Pose
from jounce.robot.model.arguments import checked_coordinates
from jounce.robot.model.couplings import BallDrive
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.drive_forces import ball_spin, tendon_energy
from jounce.robot.recursions.kinematics import body_frames
from jounce.robot.recursions.tree_scan import Series
from jounce.robot.robot import Robot
from jounce.units.shown_units import derivative_unit

Energies = Float[Numbers, "order body time"]
"""Taylor coefficients of energies of bodies along a motion."""

EnergyFunction = Callable[..., tuple[Jet, ...]]
"""A function of a pose, masses, centers of mass, second moments and an order that returns energies: `body_energy`."""


@dataclasses.dataclass(frozen=True, eq=False)
class Energy:
    """The energy of several bodies with its rates, separately for translation and rotation.

    The energy of a robot consists of plain arrays, that of a motion of `xarray.DataArray` with the dimensions time,
    derivative and body.

    Parameters
    ----------
    translation, rotation : array of shape (..., rates + 1, bodies)
        The two parts for each body, kg m^2 / s^(2 p + 2) for order p, and their derivatives.
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
        return summed(self.translation + self.rotation)


def summed(energies: Any) -> Any:
    """Return the sum of the energies of all bodies; it is NaN if one of them is."""
    return energies.sum("body", skipna=False) if hasattr(energies, "dims") else energies.sum(axis=-1)


def body_energy(
    pose: Pose | Frames, mass: Any, center_of_mass: Any, second_moments: Any, order: int = 1
) -> tuple[Jet, Jet]:
    """Return the acceleration energy of rigid bodies as jets: Negrean 2025, equations 83-110.

    Parameters
    ----------
    pose : SpatialPose, PlanarPose or Frames
        Poses of the bodies, as jets of order `order` + 1 or higher.
    mass : array_like
        Masses, kg, in the shape of the batch axes of the pose.
    center_of_mass : array of shape (3, ...) or (2, ...)
        Centers of mass in the frames of the bodies, m.
    second_moments : array of shape (3, 3, ...) or (2, 2, ...)
        Integral of rho rho^T dm about the center of mass, in the frames of the bodies, kg m^2.
    order : int, default 1
        Order p of the energy; 0 is the kinetic energy.

    Returns
    -------
    translation, rotation : Jet
        Their order is lower than that of the pose by `order` + 1.

    Raises
    ------
    ValueError
        If the pose has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> import numpy as np
    >>> angle = jn.Jet([0.0, 2.0, 1.5])  # a disc of 1 kg m^2 that turns in the plane, at 2 rad/s and 3 rad/s^2
    >>> pose = jn.rigid.PlanarPose.from_jets(jn.Jet.constant(np.zeros(2), 2), angle)
    >>> _, rotation = jn.dynamics.body_energy(pose, 1.0, np.zeros(2), 0.5 * np.eye(2))
    >>> float(rotation.coefficients[0])  # (3^2 + 2^4) / 2
    12.5
    """
    velocity = differentiated(pose.point(center_of_mass), order + 1)
    rates = [differentiated(axis, order + 1) for axis in axes_of(pose)]
    translation = dot(velocity, velocity) * (0.5 * mass)
    size = range(len(rates))
    rotation = total(
        dot(rates[i], rates[k]) * ((0.5 if i == k else 1.0) * second_moments[i][k])
        for i in size
        for k in size
        if i <= k
    )
    return translation, rotation


def axes_of(pose: Pose | Frames) -> tuple[Jet, ...]:
    """Return the axes of the body frames in components of the base frame; two axes in the plane."""
    return tuple(pose.direction(unit) for unit in np.eye(2)) if isinstance(pose, PlanarPose) else pose.axes


def differentiated(jet: Jet, times: int) -> Jet:
    """Return the derivative of a jet of order `times`.

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


def acceleration_energy(
    system: Robot | Motion, q: ArrayLike | None = None, *, order: int = 1, drives: bool = True
) -> Energy:
    """Return the acceleration energy of order p of a robot or a moving mechanism, with its rates.

    Negrean 2025, equations 73-77 for order 0, 83-115 for order 1, 107 for any order.

    Parameters
    ----------
    system : Robot or Motion
        A robot, or the motion of a mechanism whose bodies have masses.
    q : array_like of shape (..., K + 1, n), optional
        Coordinates of a robot and their derivatives, K at least p + 1.
    order : int, default 1
        The order p; 0 is the kinetic energy.
    drives : bool, default True
        For robots: include the rotors of the drives. The armature inertia I of a joint adds ``1/2 I (q^(p+1))^2`` to
        the rotation of the link that the joint moves; for followers, of the link that their leader moves.

    Returns
    -------
    Energy
        With K - p - 1 rates; for a motion with derivatives to order K, at each instant.

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
    >>> float(jn.energy.acceleration_energy(robot, [[0.0], [2.0], [3.0]]).total[0].round(12))  # (3^2 + 2^4) / 3 / 2
    4.166666666667
    """
    drives = flag("drives", drives, error=error_for(system))
    return Energy(*energies_of(system, q, order, body_energy, drives))


def energy_unit(order: int) -> str:
    """Return the unit of the acceleration energy of an order.

    Examples
    --------
    >>> from jounce.dynamics.energy.energies import energy_unit
    >>> energy_unit(0), energy_unit(1)
    ('J', 'J/s^2')
    """
    return derivative_unit("J", 2 * order)


def error_for(system: Any) -> type[JounceError]:
    """Return MechanismError for the motion of a mechanism, RobotError otherwise."""
    return MechanismError if isinstance(system, Motion) else RobotError


def energies_of(
    system: Robot | Motion, q: ArrayLike | None, order: int, function: EnergyFunction, drives: bool = False
) -> tuple[Any, ...]:
    """Return the results of `body_energy`, or a function like it, for a system, its body names, and the order.

    If `drives` is true, the energies of rotors are added to the last result of the function.

    Raises
    ------
    RobotError, MechanismError
        As for `acceleration_energy`.
    """
    order = whole_number("order", order, 0, HIGHEST_ORDER, error=error_for(system))
    if isinstance(system, Motion):
        if q is not None:
            raise MechanismError("a motion has its coordinates already", name="q", value=q)
        _check_known(system, order, system.order)
        bodies = tuple(system.mechanism.rigid_bodies)
        coefficients = energy_coefficients(system, order, function)
        energies = tuple(
            labeled(system, x[: system.order - order, 1 : 1 + len(bodies)], energy_unit(order), body=bodies)
            for x in coefficients
        )
        return *energies, bodies, order
    series = checked_coordinates(system, q, order + 1)
    energies = energies_of_tree(system, (series,), (), (order, function, *rotors_of(system, drives=drives)))
    return *energies, system.moving_links, order


def rotors_of(robot: Robot, *, drives: bool) -> tuple[tuple[int, ...], tuple[int, ...], tuple[tuple[int, int], ...]]:
    """Return the indices of the bodies that carry the rotors of joints, of ball drives, and of tendons.

    Each tendon with armature is a pair: its index, and that of the body that its first coordinate moves.
    """
    if not drives:
        return (), (), ()
    names = [joint.name for joint in robot.moving_joints]
    leading = tuple(names.index(name) for name in robot.joint_names)
    balls = [x for x in robot.couplings.values() if isinstance(x, BallDrive)]
    tendons = robot.tree.tendons
    heavy = np.flatnonzero(tendons.armature * tendons.weights.any(axis=1)).tolist()
    lined = tuple((k, leading[int(np.flatnonzero(tendons.weights[k])[0])]) for k in heavy)
    return leading, tuple(names.index(ball.joints[-1]) for ball in balls), lined


def kinetic_energy(system: Robot | Motion, q: ArrayLike | None = None, *, drives: bool = True) -> Energy:
    """Return the kinetic energy of a robot or a moving mechanism, with its rates: `acceleration_energy` of order 0.

    Negrean 2025, equations 65-77 (Koenig's theorem). For a robot, the armature inertia of its joints is included unless
    `drives` is False.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> jn.energy.kinetic_energy(jn.robot.from_screws([slide]), [[0.0], [3.0], [1.0]]).total.tolist()  # J, W
    [9.0, 6.0]
    """
    return acceleration_energy(system, q, order=0, drives=drives)


def mass_arrays(tree: Tree) -> tuple[Any, Any, Any]:
    """Return masses, centers of mass and second moments of the bodies of a robot, as `body_energy` takes them."""
    tensor = jnp.moveaxis(jnp.asarray(tree.inertia), 0, -1)[..., None]
    center = jnp.swapaxes(jnp.asarray(tree.center), 0, 1)[:, :, None]
    return jnp.asarray(tree.mass)[:, None], center, second_moments(tensor)


@Batched
def energies_of_tree(
    tree: Tree,
    arrays: tuple[Series],
    _: Any,
    order: int,
    function: EnergyFunction,
    leading: tuple[int, ...],
    ball_links: tuple[int, ...],
    tendon_bodies: tuple[tuple[int, int], ...],
) -> tuple[Float[Numbers, "levels body batch"], ...]:
    """Return the Taylor coefficients of the energies of all bodies of a robot, rotors included."""
    frames = body_frames(tree, arrays[0]).without_base()
    *terms, final = (stacked(term) for term in function(frames, *mass_arrays(tree), order))
    if leading:  # the bodies that coordinates move, in their order
        rate = differentiated(Jet(tuple(arrays[0])), order + 1)
        final = final.at[:, np.array(leading)].add(stacked(rate * rate * (0.5 * jnp.asarray(tree.armature)[:, None])))
    if ball_links:  # the links of balls
        coordinates = Jet(tuple(arrays[0]))
        spin = differentiated(ball_spin(tree, coordinates, coordinates.differentiate()), order)
        rotors = dot(spin, spin) * (0.5 * jnp.asarray(tree.balls.armature)[:, None])
        final = final.at[:, np.array(ball_links)].add(stacked(rotors.truncate(len(final) - 1)))
    if tendon_bodies:  # the bodies that the first coordinates of tendons move
        tendons, columns = (np.array(x) for x in zip(*tendon_bodies, strict=True))
        energy = stacked(tendon_energy(tree, differentiated(Jet(tuple(arrays[0])), order + 1)))
        final = final.at[:, columns].add(energy[: len(final), tendons])
    return *terms, final


def energy_coefficients(motion: Motion, order: int, function: EnergyFunction = body_energy) -> tuple[Energies, ...]:
    """Return the Taylor coefficients of `body_energy`, or of a function like it; the ground comes first.

    Raises
    ------
    MechanismError
        If no body has a mass, or the motion has too few derivatives.
    """
    pose_type, coordinates = motion.poses
    _check_known(motion, order, len(coordinates["position"]) - 1)
    options = {"pose_type": pose_type, "order": order, "function": function}
    return _of_bodies.along(required_masses(motion.mechanism), coordinates, **options)


def _check_known(motion: Motion, order: int, order_known: int) -> None:
    if order_known < order + 1:
        message = f"an energy of order {order} needs a motion solved to order {order + 1}"
        raise MechanismError(message, name="order", value=motion.order)


@Mapped
def _of_bodies(
    masses: Masses, coordinates: Coordinates, *, pose_type: type[Pose], order: int, function: EnergyFunction
) -> tuple[Energies, ...]:
    return tuple(stacked(term) for term in function(pose_of(coordinates, pose_type), *masses, order))
