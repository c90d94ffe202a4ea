"""Spatial joints: the four basic residuals of Sommer 2024, section 5, joints composed of them, and couplings of shafts.

In each, ``d = r_j^P - r_i^P`` is the vector from the joint's point on body i to that on body j.
"""

from typing import Any

import jax.numpy as jnp

from jounce.constraints.angles import (
    Vectors,
    coaxial,
    parallel_rows,
    perpendiculars,
    relative_angle,
    upright,
)
from jounce.constraints.base import AbstractConstraint, Curve, Nested, Scalar, Vector, rows
from jounce.constraints.couplings import (
    ConstantVelocity as ConstantVelocity,
    Gear as Gear,
    Oldham as Oldham,
    Rolling as Rolling,
    Tripod as Tripod,
)
from jounce.constraints.friction import Velocities, check_friction, relative_turn, relative_velocity
from jounce.constraints.planar import length_of, slide
from jounce.constraints.wheels import Wheel as Wheel
from jounce.jet import Jet, cross, sqrt, wrap
from jounce.rigid import SpatialPose


class Spherical(AbstractConstraint, type="spherical", space="spatial"):
    """Ball: a point of each body coincides. Sommer 2024, equations 77-82."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    friction: Nested = None

    has_friction_radius = True
    point_distance = "zero"
    symbol = "spherical"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        return body_j.point(self.point_j) - body_i.point(self.point_i)

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the slip of the ball in its socket, m/s, as relative angular velocity times the radius, global."""
        return relative_turn(moving) * self.friction.radius


class DoubleSpherical(AbstractConstraint, type="double_spherical", space="spatial"):
    """Massless rod: two points at a constant distance. Sommer 2024, equations 83-88."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    length: Scalar  # m

    squared_distance = "length"
    point_distance = "length"
    symbol = "rod"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return d.dot(d) - self.length**2


class Dot1(AbstractConstraint, type="dot1", space="spatial"):
    """A direction of each body stays perpendicular. Sommer 2024, equations 89-94."""

    vector_i: Vector  # in the frame of body i
    vector_j: Vector

    symbol = "none"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        return body_i.direction(self.vector_i).dot(body_j.direction(self.vector_j))


class Dot2(AbstractConstraint, type="dot2", space="spatial"):
    """A point of body j stays on a plane of body i, given by a point and its normal. Sommer 2024, equations 95-100."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # normal of the plane

    symbol = "plane"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return body_i.direction(self.vector_i).dot(d)


class Universal(AbstractConstraint, type="universal", space="spatial"):
    """Hooke joint: spherical and dot-1 of the two cross axes. Sommer 2024, section 5."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # the arm of the cross held by each body
    vector_j: Vector

    point_distance = "zero"
    symbol = "universal"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return rows(d, body_i.direction(self.vector_i).dot(body_j.direction(self.vector_j)))


class Revolute(AbstractConstraint, type="revolute", space="spatial"):
    """Hinge: spherical, and the axes parallel. Sommer 2024, section 5."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    axis_i: Vector
    axis_j: Vector
    friction: Nested = None

    has_friction_radius = True

    held_parallel = (("axis_i", "axis_j"),)
    point_distance = "zero"
    symbol = "revolute"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return rows(d, *parallel_rows(body_i, body_j, self.axis_i, self.axis_j))

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the slip of the pin in its bore, m/s."""
        return rows(_turning(bodies, moving, self.axis_i) * self.friction.radius)


class Cylindrical(AbstractConstraint, type="cylindrical", space="spatial"):
    """The axes coincide; the bodies turn about them and slide along them. Sommer 2024, section 5."""

    point_i: Vector  # m, on the axis, in the frame of body i
    point_j: Vector
    axis_i: Vector
    axis_j: Vector
    friction: Nested = None

    has_friction_radius = True

    held_parallel = (("axis_i", "axis_j"),)
    symbol = "cylindrical"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        return rows(*_collinear(self, body_i, body_j))

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the slip of the shaft in its bore along the axis and around it, m/s."""
        rotation = _turning(bodies, moving, self.axis_i) * self.friction.radius
        return rows(_sliding(bodies, moving, self), rotation)


class Prismatic(AbstractConstraint, type="prismatic", space="spatial"):
    """Slider: the axes coincide and one more direction stays parallel. Sommer 2024, section 5."""

    point_i: Vector  # m, on the axis, in the frame of body i
    point_j: Vector
    axis_i: Vector
    axis_j: Vector
    normal_i: Vector  # a perpendicular to the axis on each body that stays parallel
    normal_j: Vector
    friction: Nested = None

    held_parallel = (("axis_i", "axis_j"), ("normal_i", "normal_j"))
    never_parallel = (("normal_i", "axis_i"), ("normal_j", "axis_j"))
    symbol = "prismatic"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        side = body_i.direction(cross(self.axis_i, self.normal_i) / length_of(self.axis_i)[None])
        return rows(*_collinear(self, body_i, body_j), side.dot(body_j.direction(self.normal_j)))

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the sliding velocity of body j in its guide, m/s."""
        return rows(_sliding(bodies, moving, self))


class PlaneOnPlane(AbstractConstraint, type="planar", space="spatial"):
    """Planar joint: a plane of body j stays on one of body i; the bodies slide on it and turn about its normal."""

    point_i: Vector  # m, on the plane, in the frame of body i
    point_j: Vector
    axis_i: Vector  # normal of the plane
    axis_j: Vector
    friction: Nested = None

    held_parallel = (("axis_i", "axis_j"),)
    symbol = "plane"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        distance = slide(body_i, body_j, self.point_i, self.point_j, self.axis_i)
        return rows(distance, *parallel_rows(body_i, body_j, self.axis_i, self.axis_j))

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the slip of the point of body j on the plane, m/s, in two directions of it, without rotation."""
        velocity = relative_velocity(bodies, moving, self.point_j)
        return rows(*[bodies[0].direction(side).dot(velocity) for side in perpendiculars(self.axis_i)])


class Fixed(AbstractConstraint, type="fixed", space="spatial"):
    """Weld: a point of each body coincides, and both an axis and a normal of each stay parallel."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    axis_i: Vector  # a direction of each body that stays parallel
    axis_j: Vector
    normal_i: Vector  # another one, not along the first
    normal_j: Vector

    held_parallel = (("axis_i", "axis_j"), ("normal_i", "normal_j"))
    point_distance = "zero"
    never_parallel = (("normal_i", "axis_i"), ("normal_j", "axis_j"))

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        side = body_i.direction(cross(self.axis_i, self.normal_i) / length_of(self.axis_i)[None])
        level = side.dot(body_j.direction(self.normal_j))
        return rows(d, *parallel_rows(body_i, body_j, self.axis_i, self.axis_j), level)


class SpatialCurve(AbstractConstraint, type="curve", space="spatial"):
    """Point on a curve: a point of body j stays on a curve of body i, as a roller in the groove of a barrel cam.

    The parameter of the curve is a separate coordinate, that of an additional massless carriage; the force of the curve
    is perpendicular to its tangent.
    """

    curve: Curve  # of s, m, in the frame of body i
    point_j: Vector  # m, in the frame of body j
    start: Scalar = None  # of the parameter, as a guess; by default the point of the curve nearest to the guess

    hidden = ("s",)
    dimensions = {"curve": "length", "start": "any"}
    symbol = "curve"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, carriage: SpatialPose, time: Jet) -> Jet:
        along, aside, unit = carriage.position
        d = body_j.point(self.point_j) - body_i.point(self.curve(along / self.curve.unit))
        return rows(d, aside, unit - self.curve.unit, *upright(carriage))


class Surface(AbstractConstraint, type="surface", space="spatial"):
    """Point on a surface: a point of body j stays on a surface of body i.

    The parameters of the surface are separate coordinates, those of an additional massless carriage; the force of the
    surface is along its normal.
    """

    surface: Curve  # of u and v, m, in the frame of body i
    point_j: Vector  # m, in the frame of body j
    start_u: Scalar = None  # of the parameters, as a guess
    start_v: Scalar = None

    hidden = ("u", "v")
    dimensions = {"surface": "length"}
    symbol = "surface"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, carriage: SpatialPose, time: Jet) -> Jet:
        along, aside, unit = carriage.position
        point = self.surface(along / self.surface.unit, aside / self.surface.unit)
        d = body_j.point(self.point_j) - body_i.point(point)
        return rows(d, unit - self.surface.unit, *upright(carriage))


class Screw(AbstractConstraint, type="screw", space="spatial"):
    """Nut j on a screw i: cylindrical, and an advance of one lead per turn. Sommer 2024, section 5.

    The advance is counted over turns: its remainder after whole leads must vanish, so that a continuous motion never
    loses count.
    """

    point_i: Vector  # m, on the axis, in the frame of body i
    point_j: Vector
    axis_i: Vector
    axis_j: Vector
    lead: Scalar  # m per turn of j about the axis of i; negative for a left-hand thread
    offset: Scalar = None  # m
    friction: Nested = None

    has_friction_radius = True

    dimensions = {"offset": "length"}
    held_parallel = (("axis_i", "axis_j"),)
    symbol = "screw"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        advance = slide(body_i, body_j, self.point_i, self.point_j, self.axis_i)
        angle = relative_angle(body_i, body_j, self.axis_i, datum=coaxial(self.axis_i, self.axis_j))
        excess = advance - self.lead / (2 * jnp.pi) * angle - self.offset
        return rows(*_collinear(self, body_i, body_j), wrap(excess, self.lead))

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the slip of the nut along the thread at its mean radius, m/s."""
        cosine, sine = self._helix()
        rotation = _turning(bodies, moving, self.axis_i) * self.friction.radius
        return rows(rotation * cosine + _sliding(bodies, moving, self) * sine)

    def pressing(self, bodies: tuple[Any, ...], force: Jet) -> Jet:
        """Return the normal force on the flanks of the thread, N, from its component along the axis."""
        along = bodies[0].direction(self.axis_i).dot(force) / length_of(self.axis_i)
        return rows(along / self._helix()[0])

    def _helix(self) -> tuple[Any, Any]:
        """Return cosine and sine of the lead angle."""
        rise = self.lead / (2 * jnp.pi * self.friction.radius)
        cosine = 1 / sqrt(1 + rise * rise)
        return cosine, rise * cosine


def _turning(bodies: tuple[Any, ...], moving: Velocities, axis_i: Vectors) -> Jet:
    """Return the angular velocity of body j about an axis of body i, relative to body i, rad/s."""
    return bodies[0].direction(axis_i).dot(relative_turn(moving)) / length_of(axis_i)


def _sliding(bodies: tuple[Any, ...], moving: Velocities, joint: Any) -> Jet:
    """Return the sliding velocity of the point of a joint on body j along the axis of body i, m/s."""
    velocity = relative_velocity(bodies, moving, joint.point_j)
    return bodies[0].direction(joint.axis_i).dot(velocity) / length_of(joint.axis_i)


def _collinear(joint: Any, body_i: SpatialPose, body_j: SpatialPose) -> list[Jet]:
    """Return the four rows that keep the axes of a joint collinear."""
    d = body_j.point(joint.point_j) - body_i.point(joint.point_i)
    on_line = [body_i.direction(side).dot(d) for side in perpendiculars(joint.axis_i)]
    return [*parallel_rows(body_i, body_j, joint.axis_i, joint.axis_j), *on_line]
