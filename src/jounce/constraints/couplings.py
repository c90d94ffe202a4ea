"""Couplings in space: of shafts, by constant velocity, tripod and Oldham; of a pinion and its rack."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jounce.constraints.angles import Vectors, coaxial, parallel_rows, relative_angle
from jounce.constraints.base import AbstractConstraint, Nested, Scalar, Vector, rows
from jounce.constraints.friction import Velocities, check_friction, relative_turn
from jounce.constraints.planar import length_of, slide
from jounce.jet import Jet, cross, dot, wrap
from jounce.rigid import SpatialPose


class ConstantVelocity(AbstractConstraint, type="constant_velocity", space="spatial"):
    """Homokinetic joint, such as a Rzeppa joint: the centers coincide, and both shafts turn about their axes alike.

    What is left of the relative attitude after the shortest tilt of the axis is no turn about it, but for the offset:
    so the balls of such a joint lie in the plane that bisects the angle of the shafts. Hunt, Constant-velocity shaft
    couplings: a general theory, 1973.
    """

    point_i: Vector  # m, center, in the frame of body i
    point_j: Vector
    axis_i: Vector  # of each shaft, in its frame, both from one end of the drive to the other
    axis_j: Vector
    offset: Scalar = None  # rad, by which shaft j is turned about its axis

    dimensions = {"offset": "angle"}
    symbol = "spherical"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        twist = relative_angle(body_i, body_j, self.axis_i, datum=coaxial(self.axis_i, self.axis_j))
        return rows(body_i.to_body(d), wrap(twist - self.offset))


class Tripod(AbstractConstraint, type="tripod", space="spatial"):
    """Plunging joint: three rollers on the arms of spider j, each in the middle plane of a track of tulip i.

    The tracks hold the axis of the tulip, 120 degrees from one another, and so do the arms at the spider: its center
    may slide along the tulip, and goes round a small circle three times a turn where the shafts are at an angle.
    """

    point_i: Vector  # m, on the axis of the tulip, in the frame of body i
    point_j: Vector  # m, center of the spider, in the frame of body j
    axis_i: Vector  # of each shaft, in its frame, both from one end of the drive to the other
    axis_j: Vector
    normal_i: Vector  # across the axis, toward the first track
    normal_j: Vector  # across the axis, along the first arm
    radius: Scalar  # m, of the rollers' centers

    never_parallel = (("normal_i", "axis_i"), ("normal_j", "axis_j"))
    symbol = "spherical"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        first, second = _frame_of(self.axis_i, self.normal_i)
        arm, side = _frame_of(self.axis_j, self.normal_j)
        held = []
        for c, s in ((1.0, 0.0), (-0.5, 0.75**0.5), (-0.5, -(0.75**0.5))):
            roller = body_j.point(self.point_j + self.radius[None] * (c * arm + s * side))
            held.append(body_i.direction(c * second - s * first).dot(roller - body_i.point(self.point_i)))
        return rows(*held)


class Oldham(AbstractConstraint, type="oldham", space="spatial"):
    """Coupling of parallel shafts: a disc with two slots at right angles, in which a tongue of each hub slides.

    The disc has no mass here. The hubs may move to each other in the plane across the axes, and neither turn nor tilt.
    """

    point_i: Vector  # m, in the plane of the disc, in the frame of body i
    point_j: Vector
    axis_i: Vector
    axis_j: Vector
    vector_i: Vector  # the tongue on each hub
    vector_j: Vector

    held_parallel = (("axis_i", "axis_j"),)
    never_parallel = (("vector_i", "axis_i"), ("vector_j", "axis_j"))
    symbol = "universal"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        offset = slide(body_i, body_j, self.point_i, self.point_j, self.axis_i)
        first, _ = _frame_of(self.axis_i, self.vector_i)
        second, _ = _frame_of(self.axis_j, self.vector_j)
        turned = body_i.direction(first).dot(body_j.direction(second))
        return rows(offset, *parallel_rows(body_i, body_j, self.axis_i, self.axis_j), turned)


class Rolling(AbstractConstraint, type="rolling", space="spatial"):
    """Rack and pinion: a pinion j rolls along a line of body i, about an axis across the line.

    A pinion that turns about the axis goes along the line: its center lies on the side of ``vector x axis``, seen from
    the line. Other joints hold the axis on both bodies, and keep the distance of the center from the line. The force of
    a tooth acts along the line at the pitch point, one radius from the center; a pressure angle presses both apart.

    Travel is counted over turns, as that of a nut on its screw.
    """

    point_i: Vector  # m, on the line, in the frame of body i
    point_j: Vector  # m, center of the pinion, in the frame of body j
    vector_i: Vector  # along the line
    axis_i: Vector  # of the pinion, across the line
    axis_j: Vector
    radius: Scalar  # m, of the pitch circle
    offset: Scalar = None  # m
    pressure_angle: Scalar = None  # rad
    friction: Nested = None
    flank: Any = eqx.field(default=None, init=False)  # 1 or -1, the sign of the multiplier; zero for neither

    dimensions = {"offset": "length", "pressure_angle": "angle"}
    signs = {"pressure_angle": "pressure angle"}
    never_parallel = (("axis_i", "vector_i"),)
    symbol = "rolling"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        travel = slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)
        turn = relative_angle(body_i, body_j, self.axis_i, datum=coaxial(self.axis_i, self.axis_j))
        rolled = wrap(travel - self.radius * turn - self.offset, 2 * jnp.pi * self.radius)
        if self.flank is None or self.pressure_angle is None:
            return rolled
        across = cross(self.vector_i, self.axis_i)
        clearance = slide(body_i, body_j, self.point_i, self.point_j, across) - self.radius
        return rolled - self.flank * jnp.tan(self.pressure_angle) * clearance

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return how fast the pinion turns about its axis relative to the rack, rad/s."""
        return rows(bodies[0].direction(self.axis_i).dot(relative_turn(moving)) / length_of(self.axis_i))

    def passed_on(self, multiplier: Jet) -> Jet:
        """Return the torque that the pinion passes on to the rack, N m."""
        return multiplier * -self.radius


def _frame_of(axis: Vectors, normal: Vectors) -> tuple[Any, Any]:
    """Return the unit vector across a constant axis toward another one, and the vector a quarter turn on."""
    along = axis / length_of(axis)[None]
    across = normal - dot(along, normal)[None] * along
    across = across / length_of(across)[None]
    return across, cross(along, across)
