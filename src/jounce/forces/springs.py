"""Linear springs with damping: along the line between two points, along a direction, about an axis."""

from typing import Any

from jounce.base.modules import field
from jounce.constraints.angles import Datum, check_vectors, relative_angle
from jounce.constraints.base import Scalar, Vector
from jounce.constraints.planar import slide
from jounce.forces.actuators import distance
from jounce.forces.base import AbstractForce
from jounce.jet import Jet
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.pose import Pose


def linear_force(self: Any, displacement: Jet, velocity: Jet, time: Jet) -> Jet:  # noqa: ARG001
    """Return the jet of the force of a linear spring with a damper; serves as the method `force` of its class."""
    return -_elongation(self, displacement) * self.stiffness - velocity * self.damping


def stored_energy(self: Any, displacement: Jet) -> Jet:
    """Return the energy stored in a linear spring, J; serves as the method `energy` of its class."""
    return _elongation(self, displacement).square() * (0.5 * self.stiffness)


def _elongation(spring: Any, displacement: Jet) -> Jet:
    return displacement - (spring.angle if hasattr(spring, "angle") else spring.length)


class Spring(AbstractForce, type="spring"):
    """Spring and damper between two points: ``F = -k (s - length) - c s'`` along the line that joins them.

    The points must not meet: the line has no direction there.
    """

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    stiffness: Scalar  # N/m
    length: Scalar  # m, free length
    damping: Scalar = 0.0  # N s/m

    dimensions = {"stiffness": "stiffness", "damping": "damping"}
    signs = {"length": "not negative"}
    symbol = "spring"

    def displacement(self, body_i: Pose, body_j: Pose, time: Jet) -> Jet:
        return distance(body_i, body_j, self.point_i, self.point_j)

    force, energy = linear_force, stored_energy


class SlideSpring(AbstractForce, type="slide_spring"):
    """Spring and damper along a direction of body i: ``F = -k (s - length) - c s'``, with the s of a slide driver."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # direction in which s grows
    stiffness: Scalar  # N/m
    length: Scalar = 0.0  # m, the s of the free spring
    damping: Scalar = 0.0  # N s/m

    dimensions = {"stiffness": "stiffness", "damping": "damping"}
    signs = {"length": "any"}
    symbol = "slide spring"

    def displacement(self, body_i: Pose, body_j: Pose, time: Jet) -> Jet:
        return slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)

    force, energy = linear_force, stored_energy


class TorsionalSpring(AbstractForce, type="torsional_spring", space="planar"):
    """Spring and damper on the angle of body j relative to body i: ``T = -k (s - angle) - c s'``; turns count."""

    stiffness: Scalar  # N m/rad
    angle: Scalar = 0.0  # rad, angle of the free spring
    damping: Scalar = 0.0  # N m s/rad

    unit = "N*m"
    dimensions = {"stiffness": "torsional stiffness", "damping": "torsional damping", "angle": "angle"}
    symbol = "spiral"

    def displacement(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        return body_j.angle - body_i.angle

    force, energy = linear_force, stored_energy


class SpatialTorsionalSpring(AbstractForce, type="torsional_spring", space="spatial"):
    """Spring and damper on the angle of body j about an axis of body i: ``T = -k (s - angle) - c s'``; turns count.

    The angle is that of a rotation driver: with vectors, from `vector_i` to `vector_j`.
    """

    axis_i: Vector
    stiffness: Scalar  # N m/rad
    angle: Scalar = 0.0  # rad, angle of the free spring
    damping: Scalar = 0.0  # N m s/rad
    vector_i: Vector = None
    vector_j: Vector = None
    datum: Datum | None = field(default=None, init=False)  # set when the mechanism is assembled

    unit = "N*m"
    dimensions = {"stiffness": "torsional stiffness", "damping": "torsional damping", "angle": "angle"}
    never_parallel = (("vector_i", "axis_i"),)
    symbol = "spiral"

    __check_init__ = check_vectors

    def displacement(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        return relative_angle(body_i, body_j, self.axis_i, self.vector_i, self.vector_j, self.datum)

    force, energy = linear_force, stored_energy
