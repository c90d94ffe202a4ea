"""Linear springs with damping: along the line of two points, along a direction, about an axis."""

from typing import Any

import equinox as eqx

from jounce.constraints.angles import relative_angle
from jounce.constraints.base import Scalar, Vector
from jounce.constraints.planar import slide
from jounce.forces.actuators import check_vectors, distance
from jounce.forces.base import AbstractForce


class Spring(AbstractForce, type="spring"):
    """Spring and damper between two points: ``F = -k (s - length) - c s'`` along the line that joins them.

    The points must not meet: the line has no direction there.
    """

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    stiffness: Scalar  # N/m
    length: Scalar  # m, at which the spring is free
    damping: Scalar = 0.0  # N s/m

    dimensions = {"stiffness": "stiffness", "damping": "damping"}
    signs = {"length": "not negative"}

    def displacement(self, body_i, body_j, time):
        return distance(body_i, body_j, self.point_i, self.point_j)

    def force(self, displacement, velocity, time):
        return -(displacement - self.length) * self.stiffness - velocity * self.damping

    def energy(self, displacement):
        return (displacement - self.length).square() * (0.5 * self.stiffness)


class SlideSpring(AbstractForce, type="slide_spring"):
    """Spring and damper along a direction of body i: ``F = -k (s - length) - c s'``, with the s of a slide driver."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # direction in which s grows
    stiffness: Scalar  # N/m
    length: Scalar = 0.0  # m, the s at which the spring is free
    damping: Scalar = 0.0  # N s/m

    dimensions = {"stiffness": "stiffness", "damping": "damping"}
    signs = {"length": "any"}

    def displacement(self, body_i, body_j, time):
        return slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)

    def force(self, displacement, velocity, time):
        return -(displacement - self.length) * self.stiffness - velocity * self.damping

    def energy(self, displacement):
        return (displacement - self.length).square() * (0.5 * self.stiffness)


class TorsionalSpring(AbstractForce, type="torsional_spring", space="planar"):
    """Spring and damper on the angle of body j relative to body i: ``T = -k (s - angle) - c s'``; turns count."""

    stiffness: Scalar  # N m/rad
    angle: Scalar = 0.0  # rad, at which the spring is free
    damping: Scalar = 0.0  # N m s/rad

    unit = "N*m"
    dimensions = {"stiffness": "torsional stiffness", "damping": "torsional damping", "angle": "angle"}

    def displacement(self, body_i, body_j, time):
        return body_j.angle - body_i.angle

    def force(self, displacement, velocity, time):
        return -(displacement - self.angle) * self.stiffness - velocity * self.damping

    def energy(self, displacement):
        return (displacement - self.angle).square() * (0.5 * self.stiffness)


class SpatialTorsionalSpring(AbstractForce, type="torsional_spring", space="spatial"):
    """Spring and damper on the angle of body j about an axis of body i: ``T = -k (s - angle) - c s'``; turns count.

    The angle is that of a rotation driver: with vectors, from `vector_i` to `vector_j`.
    """

    axis_i: Vector
    stiffness: Scalar  # N m/rad
    angle: Scalar = 0.0  # rad, at which the spring is free
    damping: Scalar = 0.0  # N m s/rad
    vector_i: Vector = None
    vector_j: Vector = None
    datum: Any = eqx.field(default=None, init=False)  # found when the mechanism is put together

    unit = "N*m"
    dimensions = {"stiffness": "torsional stiffness", "damping": "torsional damping", "angle": "angle"}

    def __check_init__(self):
        check_vectors(self)

    def displacement(self, body_i, body_j, time):
        return relative_angle(body_i, body_j, self.axis_i, self.vector_i, self.vector_j, self.datum)

    def force(self, displacement, velocity, time):
        return -(displacement - self.angle) * self.stiffness - velocity * self.damping

    def energy(self, displacement):
        return (displacement - self.angle).square() * (0.5 * self.stiffness)
