"""Couplings in space: of shafts (constant velocity, tripod, Oldham, gears), and of a pinion with its rack."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from jounce.base.modules import field
from jounce.constraints.angles import Datum, Vectors, coaxial, parallel_rows, relative_angle
from jounce.constraints.base import AbstractConstraint, Nested, Scalar, Vector, rows
from jounce.constraints.friction import Velocities, check_friction, displacements, relative_turn, velocity_at, where
from jounce.constraints.planar import length_of, slide
from jounce.constraints.wheels import unit
from jounce.errors import MechanismError
from jounce.jet import Jet, cross, dot, wrap
from jounce.rigid import SpatialPose

ROLLING = 1e-6  # of the speed of a pitch point: slower sliding is rounding of the input


class ConstantVelocity(AbstractConstraint, type="constant_velocity", space="spatial"):
    """Homokinetic joint, such as a Rzeppa joint: the centers coincide, and both shafts rotate equally about their axes.

    The relative attitude, after the shortest tilt of the axis, contains no rotation about it except for the offset: the
    balls of such a joint lie in the plane that bisects the angle of the shafts. Hunt, Constant-velocity shaft
    couplings: a general theory, 1973.
    """

    point_i: Vector  # m, center, in the frame of body i
    point_j: Vector
    axis_i: Vector  # of each shaft in its frame, both in the same sense along the drive
    axis_j: Vector
    offset: Scalar = None  # rad, rotation of shaft j about its axis

    dimensions = {"offset": "angle"}
    point_distance = "zero"
    symbol = "spherical"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        twist = relative_angle(body_i, body_j, self.axis_i, datum=coaxial(self.axis_i, self.axis_j))
        return rows(body_i.to_body(d), wrap(twist - self.offset))


class Tripod(AbstractConstraint, type="tripod", space="spatial"):
    """Plunging joint: three rollers on the arms of spider j, each in the middle plane of a track of tulip i.

    The tracks contain the axis of the tulip, 120 degrees apart, and so are the arms of the spider. Its center may slide
    along the tulip, and runs around a small circle three times per turn if the shafts are at an angle.
    """

    point_i: Vector  # m, on the axis of the tulip, in the frame of body i
    point_j: Vector  # m, center of the spider, in the frame of body j
    axis_i: Vector  # of each shaft in its frame, both in the same sense along the drive
    axis_j: Vector
    normal_i: Vector  # normal to the axis, toward the first track
    normal_j: Vector  # normal to the axis, along the first arm
    radius: Scalar  # m, distance of the roller centers from the axis

    never_parallel = (("normal_i", "axis_i"), ("normal_j", "axis_j"))
    symbol = "spherical"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        first, second = _frame_of(self.axis_i, self.normal_i)
        arm, side = _frame_of(self.axis_j, self.normal_j)
        residuals = []
        for c, s in ((1.0, 0.0), (-0.5, 0.75**0.5), (-0.5, -(0.75**0.5))):
            roller = body_j.point(self.point_j + self.radius[None] * (c * arm + s * side))
            residuals.append(body_i.direction(c * second - s * first).dot(roller - body_i.point(self.point_i)))
        return rows(*residuals)


class Oldham(AbstractConstraint, type="oldham", space="spatial"):
    """Coupling of parallel shafts: a disc with two slots at right angles, in which a tongue of each hub slides.

    The disc has no mass. The hubs may move relative to each other in the plane normal to the axes, but neither rotate
    nor tilt.
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
        cosine = body_i.direction(first).dot(body_j.direction(second))
        return rows(offset, *parallel_rows(body_i, body_j, self.axis_i, self.axis_j), cosine)


class Rolling(AbstractConstraint, type="rolling", space="spatial"):
    """Rack and pinion: a pinion j rolls along a line of body i, about an axis across the line.

    A pinion that turns about the axis moves along the line: its center lies on the side of ``vector x axis``, seen from
    the line. Other joints hold the axis on both bodies, and the distance of the center from the line. The tooth force
    acts along the line at the pitch point, one radius from the center; with a pressure angle, it also presses both
    apart.

    Travel is counted over turns, as with a nut on its screw.
    """

    point_i: Vector  # m, on the line, in the frame of body i
    point_j: Vector  # m, center of the pinion, in the frame of body j
    vector_i: Vector  # along the line
    axis_i: Vector  # of the pinion, normal to the line
    axis_j: Vector
    radius: Scalar  # m, of the pitch circle
    offset: Scalar = None  # m
    pressure_angle: Scalar = None  # rad
    friction: Nested = None
    flank: Any = field(default=None, init=False)  # 1 or -1, the sign of the multiplier; zero if no flank is loaded

    dimensions = {"offset": "length", "pressure_angle": "angle"}
    signs = {"pressure_angle": "pressure angle"}
    never_parallel = (("axis_i", "vector_i"),)
    rolls_along = ("vector_i", "axis_i")
    symbol = "rolling"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        travel = slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)
        turn = relative_angle(body_i, body_j, self.axis_i, datum=coaxial(self.axis_i, self.axis_j))
        gap = wrap(travel - self.radius * turn - self.offset, 2 * jnp.pi * self.radius)
        if self.flank is None or self.pressure_angle is None:
            return gap
        across = cross(self.vector_i, self.axis_i)
        clearance = slide(body_i, body_j, self.point_i, self.point_j, across) - self.radius
        return gap - self.flank * jnp.tan(self.pressure_angle) * clearance

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the angular velocity of the pinion about its axis relative to the rack, rad/s."""
        return rows(bodies[0].direction(self.axis_i).dot(relative_turn(moving)) / length_of(self.axis_i))

    def passed_on(self, multiplier: Jet) -> Jet:
        """Return the torque that the pinion transmits to the rack, N m."""
        return multiplier * -self.radius


class Gear(AbstractConstraint, type="gear", space="spatial"):
    """Shafts i and j turn in a ratio, each about its axis, relative to the frame m that carries them.

    The axes may be skew, as with a worm and its wheel, intersect, as with bevel gears, or be parallel, as with a belt;
    the frame may move. Each is the axis of a joint, which holds its direction in the frame.

    Rotations are read from the attitudes, and the remainder of the ratio after whole turns of both shafts must vanish:
    a continuous motion never loses count if the ratio is one of whole numbers, as with toothed gears.

    With `points` and a pressure angle, the tooth force acts on the bearings, at the pitch point along the normal of the
    flanks. On skew axes the flanks slide along the teeth, which determines the direction of the teeth; on parallel or
    intersecting axes the helix angle of gear i does, positive for right-handed teeth.
    """

    axis_i: Vector  # in the frame of each body
    axis_j: Vector
    ratio: Scalar  # turns of j about its axis to those of i about its own
    offset: Scalar = None  # rad
    friction: Nested = None
    point_i: Vector = None  # m, on the axis of each shaft, in its frame
    point_j: Vector = None
    point_m: Vector = None  # m, the pitch point, in the frame m
    pressure_angle: Scalar = None  # rad, between the normal of a flank and the common tangent plane of the gears
    helix_angle: Scalar = None  # rad, between the teeth of gear i and its axis, or the generator of the pitch cone
    held_i: Datum | None = field(default=None, init=False)  # aligns the axis with that in the frame
    held_j: Datum | None = field(default=None, init=False)
    whole: Any = field(default=None, init=False)  # the smallest whole number whose product with the ratio is whole

    flank: Any = field(default=None, init=False)  # 1 or -1, the sign of the multiplier; zero if no flank is loaded

    body_count = 3
    dimensions = {"ratio": "ratio", "offset": "angle", "pressure_angle": "angle", "helix_angle": "angle"}
    signs = {"ratio": "not zero", "pressure_angle": "pressure angle", "helix_angle": "helix angle"}
    symbol = "gear"

    def __check_init__(self):
        teeth = ("point_i", "point_j", "point_m", "pressure_angle")
        given = [name for name in teeth if getattr(self, name) is not None]
        if (given and len(given) < len(teeth)) or (self.helix_angle is not None and not given):
            message = (
                "the force of teeth needs a point on the axis of each shaft, the pitch point in the frame, and a "
                "pressure angle"
            )
            raise MechanismError(message, name=next(name for name in teeth if name not in given))
        check_friction(self)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, body_m: SpatialPose, time: Jet) -> Jet:
        turn_i, turn_j = (
            -relative_angle(body, body_m, axis, datum=held)
            for body, axis, held in ((body_i, self.axis_i, self.held_i), (body_j, self.axis_j, self.held_j))
        )
        excess = turn_j - self.ratio * turn_i - self.offset
        return excess if self.whole is None else wrap(excess, 2 * jnp.pi / self.whole)

    def variation(self, bodies: tuple[Any, ...], changes: tuple[Any, ...], time: Jet) -> Jet:
        """Return the variation of the residual; with a flank, including the gap of the teeth, which stays zero."""
        base = super().variation(bodies, changes, time)
        if self.flank is None or self.pressure_angle is None:
            return base
        moving, (place, along, axes, arms) = displacements(bodies, changes), self._mesh(bodies)
        parted = [
            velocity_at(body, twist, place) - arm * axis.dot(twist[1] - moving[2][1])
            for body, twist, axis, arm in zip(bodies[:2], moving, axes, arms, strict=False)
        ]
        return base + along.dot(parted[1] - parted[0])

    def _mesh(self, bodies: tuple[Any, ...]) -> tuple[Jet, Jet, list[Jet], list[Jet]]:
        """Return the pitch point, the tooth force per multiplier, the axes, and the `arms` of the pitch point."""
        mesh = PitchPoint.of(self, bodies)
        normal = mesh.across_teeth(self.helix_angle)
        moved = normal.dot(mesh.arms[1])
        slope = -self.flank * jnp.tan(self.pressure_angle) * jnp.sign(moved.coefficients[0])
        return mesh.place, (normal + mesh.normal * slope) / moved, mesh.axes, mesh.arms

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the angular velocity of shaft i about its axis relative to the frame, rad/s."""
        turning = bodies[0].direction(self.axis_i).dot(moving[0][1] - moving[2][1])
        return rows(turning / length_of(self.axis_i))

    def passed_on(self, multiplier: Jet) -> Jet:
        """Return the torque that shaft i transmits to shaft j, as seen at shaft i, N m."""
        return multiplier * -self.ratio


class PitchPoint(NamedTuple):
    """The contact of spatial gears, in the ground frame.

    Attributes
    ----------
    place : Jet
        Position of the pitch point.
    axes : list of Jet
        Unit vectors along both axes.
    arms : list of Jet
        Velocities of the points of both gears at the pitch point, as each gear turns at unit rate.
    sliding : Jet
        Sliding velocity of the gears at the pitch point, as gear i turns at unit rate.
    rolls : array of bool
        Whether the gears roll without sliding, as on parallel or intersecting axes.
    normal : Jet
        Normal of the common tangent plane, from gear i to gear j.
    """

    place: Jet
    axes: list[Jet]
    arms: list[Jet]
    sliding: Jet
    rolls: Any
    normal: Jet

    @classmethod
    def of(cls, gear: Gear, bodies: tuple[Any, ...]) -> "PitchPoint":
        """Return the pitch point of gears at the poses of their bodies."""
        place = bodies[2].point(gear.point_m)
        axes = [unit(b.direction(axis)) for b, axis in zip(bodies[:2], (gear.axis_i, gear.axis_j), strict=True)]
        points = [b.point(point) for b, point in zip(bodies[:2], (gear.point_i, gear.point_j), strict=True)]
        arms = [cross(axis, place - point) for axis, point in zip(axes, points, strict=True)]
        sliding = arms[0] - arms[1] * gear.ratio
        square, scale = (x.dot(x).coefficients[0] for x in (sliding, arms[0]))
        rolls = square <= ROLLING**2 * scale
        # the plane contains the line on which gears roll, or, if they slide, the velocities of both gears
        other = where(rolls, axes[0] - axes[1] * gear.ratio, arms[1])
        normal = unit(cross(arms[0], other))
        radial = [cross(arm, axis) for arm, axis in zip(arms, axes, strict=True)]
        curvatures = [normal.dot(r).coefficients[0] / r.dot(r).coefficients[0] for r in radial]
        # gear i is the more convex one, even if one of them is a ring
        return cls(place, axes, arms, sliding, rolls, normal * jnp.where(curvatures[0] > curvatures[1], 1.0, -1.0))

    def across_teeth(self, helix_angle: Any) -> Jet:
        """Return a vector in the common tangent plane, perpendicular to the teeth."""
        radial = unit(self.arms[0])
        along = cross(self.normal, radial)
        along = along * jnp.where(along.dot(self.axes[0]).coefficients[0] < 0, -1.0, 1.0)
        angle = 0.0 if helix_angle is None else helix_angle
        rolling = radial * jnp.cos(angle) - along * jnp.sin(angle)
        return where(self.rolls, rolling, unit(cross(self.normal, where(self.rolls, radial, self.sliding))))


def _frame_of(axis: Vectors, normal: Vectors) -> tuple[Any, Any]:
    """Return the unit vector normal to a constant axis toward another vector, and the vector a quarter turn on."""
    along = axis / length_of(axis)[None]
    across = normal - dot(along, normal)[None] * along
    across = across / length_of(across)[None]
    return across, cross(along, across)
