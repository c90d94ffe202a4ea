"""The acceleration energy term by term, as Negrean 2025 derives it: equations 83-106 and 112-115, and for any order.

The derivative of order p + 1 of a point rho of a body is the sum of three: that of the origin; ``w^(p) x rho``, with
the highest derivative of the angular velocity; and the remainder ``sum C(p, j) w^(j) x rho^(p - j)`` over j < p, which
for p = 1 is ``w x (w x rho)`` (below equation 83). Their square has six terms.
"""

import dataclasses
import math
from typing import Any

from jounce.base.shapes import ArrayLike
from jounce.dynamics.energy.energies import axes_of, differentiated, energies_of, summed
from jounce.errors import RobotError, check_choice
from jounce.jet import Jet, cross, dot
from jounce.jet.algebra import total
from jounce.kinematics import Motion
from jounce.rigid import PlanarPose
from jounce.rigid.frames import Frames
from jounce.rigid.planar import perpendicular
from jounce.rigid.pose import Pose
from jounce.robot.robot import Robot

POINTS = ("center_of_mass", "origin")


@dataclasses.dataclass(frozen=True, eq=False)
class EnergyTerms:
    """The terms of an acceleration energy of several bodies, with their rates.

    Each is an array of shape (..., rates + 1, bodies), kg m^2 / s^(2 p + 2) for order p, and its derivatives. In the
    formulas for order 1, w and e are angular velocity and acceleration, a is the acceleration of the reference
    point, c the vector from it to the center of mass, and I the inertia tensor about it.

    Parameters
    ----------
    translation : array
        ``1/2 m a . a``: Negrean 2025, equation 84.
    coupling : array
        ``m a . (e x c)``: equation 85; zero about the center of mass.
    coupling_remaining : array
        ``m a . (w x (w x c))``: equation 86; zero about the center of mass.
    leading : array
        ``1/2 e . I e``, of the highest derivative of the angular velocity alone: equations 87 and 113.
    mixed : array
        ``e . (w x I w)``: equations 88-96 and 114.
    remaining : array
        ``1/2 (w . w) (w . I w)``, without the highest derivative: equations 97-104, 111 and 115.
    bodies : tuple of str
        Names along the last axis.
    order : int
        The order p of the energy; 0 is the kinetic energy, which has no mixed and no remaining terms.
    """

    translation: Any
    coupling: Any
    coupling_remaining: Any
    leading: Any
    mixed: Any
    remaining: Any
    bodies: tuple[str, ...]
    order: int

    @property
    def rotation(self) -> Any:
        """The sum of the three terms of rotation, shape (..., rates + 1, bodies)."""
        return self.leading + self.mixed + self.remaining

    @property
    def total(self) -> Any:
        """Energy of all bodies and its rates, shape (..., rates + 1)."""
        return summed(self.translation + self.coupling + self.coupling_remaining + self.rotation)


def energy_terms(
    system: Robot | Motion, q: ArrayLike | None = None, *, order: int = 1, about: str = "center_of_mass"
) -> EnergyTerms:
    """Return the terms of translation and rotation of the acceleration energy of order p, with rates.

    For order 1 these are the terms of Negrean 2025, equations 83-106 and 110-115. For any other order the same split
    is exact, and replaces equations 117-122, which lack terms. Only links count: the armature inertia of joints, which
    `acceleration_energy` adds unless `drives` is False, has no such split.

    Parameters
    ----------
    system : Robot or Motion
        A robot, or the motion of a mechanism whose bodies have masses.
    q : array_like of shape (..., K + 1, n), optional
        Coordinates of a robot and their derivatives, K at least p + 1.
    order : int, default 1
        The order p; 0 is the kinetic energy (equations 66-71).
    about : {"center_of_mass", "origin"}, default "center_of_mass"
        The point of each body whose motion counts as translation: the center of mass (equation 106), or the origin of
        the body frame (equation 105), about which two terms couple translation and rotation. The total is the same.

    Returns
    -------
    EnergyTerms
        With K - p - 1 rates; for a motion with derivatives to order K, at each instant.

    Raises
    ------
    RobotError, MechanismError
        If derivatives are missing, q does not fit the robot, no body of the mechanism has a mass, or `about` is no
        such point.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod")
    >>> terms = jn.energy.energy_terms(jn.Robot("one", links, [pin]), [[0.0], [2.0], [3.0]])  # 2 rad/s, 3 rad/s^2
    >>> [float(x[0, 0].round(12)) for x in (terms.translation, terms.leading, terms.mixed, terms.remaining)]
    [3.125, 0.375, 0.0, 0.666666666667]
    >>> float(terms.total[0].round(12))  # (3^2 + 2^4) / 3 / 2
    4.166666666667
    """
    check_choice("point", about, POINTS, RobotError, name="about")
    function = terms_about_center if about == "center_of_mass" else terms_about_origin
    return EnergyTerms(*energies_of(system, q, order, function))


def terms_about_center(pose: Pose | Frames, mass: Any, center: Any, moments: Any, order: int) -> tuple[Jet, ...]:
    """Return the terms of `body_energy` about the center of mass, as jets: Negrean 2025, equation 106."""
    linear = differentiated(pose.point(center), order + 1)
    nothing = dot(linear, linear) * (0.0 * mass)
    return dot(linear, linear) * (0.5 * mass), nothing, nothing, *_rotation(*_rates(pose, order), moments)


def terms_about_origin(pose: Pose | Frames, mass: Any, center: Any, moments: Any, order: int) -> tuple[Jet, ...]:
    """Return the terms of `body_energy` about the origin of the frame, as jets: Negrean 2025, equation 105."""
    linear, rates = differentiated(pose.position, order + 1), _rates(pose, order)
    couplings = (dot(linear, total(r * c for r, c in zip(rate, center, strict=True))) * mass for rate in rates)
    size = range(len(center))
    second_moments = [[moments[i][k] + mass * center[i] * center[k] for k in size] for i in size]
    return dot(linear, linear) * (0.5 * mass), *couplings, *_rotation(*rates, second_moments)


def _rates(pose: Pose | Frames, order: int) -> tuple[list[Jet], list[Jet]]:
    """Return the derivatives of the axes in two parts: by the last rate of the angular velocity, and the remainder."""
    axes = axes_of(pose)
    if isinstance(pose, PlanarPose):
        spin = pose.angle.differentiate()
    else:
        spin = pose.angular_velocity if isinstance(pose, Frames) else pose.global_angular_velocity()
    assert spin is not None  # there are velocities
    spins = [differentiated(spin, j) for j in range(order + 1)]

    def rotated(j: int, axis: Jet) -> Jet:
        """Return ``C(p, j) w^(j) x axis^(p - j)``."""
        arm = differentiated(axis, order - j)
        velocity = cross(spins[j], arm) if len(axes) == 3 else perpendicular(arm) * spins[j]
        return (velocity * float(math.comb(order, j))).truncate(spins[order].order)

    leading = [rotated(order, axis) for axis in axes]
    if not order:
        return leading, [rate * 0.0 for rate in leading]
    return leading, [total(rotated(j, axis) for j in range(order)) for axis in axes]


def _rotation(leading: list[Jet], remaining: list[Jet], moments: Any) -> tuple[Jet, Jet, Jet]:
    def product(first: list[Jet], second: list[Jet]) -> Jet:
        size = range(len(first))
        return total(dot(first[i], second[k]) * moments[i][k] for i in size for k in size)

    return product(leading, leading) * 0.5, product(leading, remaining), product(remaining, remaining) * 0.5
