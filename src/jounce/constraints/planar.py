"""Planar joints: a residual of a few lines each. Sommer 2024, section 3.

In each, ``d = r_j^P - r_i^P`` is the vector from the joint's point on body i to that on body j, and ``a`` is a
body-fixed vector in global components. ``cross(a, b)`` is the paper's ``a^T R^T b``.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.constraints.base import AbstractConstraint, Curve, Flag, Nested, Scalar, Vector, rows
from jounce.constraints.friction import Velocities, check_friction, line_turn, relative_turn, relative_velocity
from jounce.errors import MechanismError
from jounce.jet import Jet, atan2, cross, dot, sqrt, wrap
from jounce.jet.turns import shifted_by_turns
from jounce.rigid import PlanarPose
from jounce.rigid.pose import Pose

COORDINATES = ("angle", "x", "y")
FAR = 1e300  # a period that is never completed
Vectors = Float[Numbers, "components *batch"]


def length_of(vector: Float[Numbers, "components *batch"]) -> Float[Numbers, "*batch"]:
    """Return the length of a constant vector of shape (components, ...)."""
    return sqrt(dot(vector, vector))


def slide(body_i: Pose, body_j: Pose, point_i: Vectors, point_j: Vectors, vector_i: Vectors) -> Jet:
    """Return the distance, m, from the point on body i to that on body j, along a direction fixed in body i."""
    d = body_j.point(point_j) - body_i.point(point_i)
    return body_i.direction(vector_i).dot(d) / length_of(vector_i)


def _sliding(bodies: tuple[Any, ...], moving: Velocities, point_j: Vectors, vector_i: Vectors) -> Jet:
    """Return the velocity, m/s, of a point of body j relative to body i, along a direction fixed in body i."""
    velocity = relative_velocity(bodies, moving, point_j)
    return bodies[0].direction(vector_i).dot(velocity) / length_of(vector_i)


def coordinate_of(body: PlanarPose, coordinate: str) -> Jet:
    """Return the angle, x or y of a planar body."""
    return body.angle if coordinate == "angle" else body.position[0 if coordinate == "x" else 1]


class Revolute(AbstractConstraint, type="revolute", space="planar"):
    """Pin: a point of each body coincides. Sommer 2024, equations 21-25."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    friction: Nested = None

    has_friction_radius = True
    symbol = "revolute"
    pair = "revolute"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        return body_j.point(self.point_j) - body_i.point(self.point_i)

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the slip of the pin in its bore, m/s."""
        return rows(relative_turn(moving) * self.friction.radius)


class DoubleRevolute(AbstractConstraint, type="double_revolute", space="planar"):
    """Massless rod: two points at a constant distance. Sommer 2024, equations 26-30."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    length: Scalar  # m

    squared_distance = "length"
    symbol = "rod"
    pair = "rod"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return d.dot(d) - self.length**2


class Parallel1(AbstractConstraint, type="parallel1", space="planar"):
    """A vector of each body stays parallel. Sommer 2024, equations 31-33."""

    vector_i: Vector  # in the frame of body i
    vector_j: Vector

    held_parallel = (("vector_i", "vector_j"),)
    symbol = "none"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        return cross(body_i.direction(self.vector_i), body_j.direction(self.vector_j))


class Parallel2(AbstractConstraint, type="parallel2", space="planar"):
    """Pin in slot: a point of body j stays on a line of body i. Sommer 2024, equations 34-38."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # along the slot
    friction: Nested = None

    symbol = "slot"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return cross(body_i.direction(self.vector_i), d)

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the sliding velocity of the point along the slot, m/s; rotation of the pin in it does not count."""
        return rows(_sliding(bodies, moving, self.point_j, self.vector_i))


class Prismatic(AbstractConstraint, type="prismatic", space="planar"):
    """Slider: parallel-1 and parallel-2 together. Sommer 2024, equations 31-38."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # along the slide, in each frame
    vector_j: Vector
    friction: Nested = None

    held_parallel = (("vector_i", "vector_j"),)
    symbol = "prismatic"
    pair = "prismatic"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        along = body_i.direction(self.vector_i)
        return rows(cross(along, body_j.direction(self.vector_j)), cross(along, d))

    def __check_init__(self):
        check_friction(self)

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the sliding velocity of body j in its guide, m/s."""
        return rows(_sliding(bodies, moving, self.point_j, self.vector_i))


class Fixed(AbstractConstraint, type="fixed", space="planar"):
    """Weld: a point of each body coincides, and body j keeps its angle to body i, by default that of the guess."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    offset: Scalar = None  # rad, the angle of body j minus that of body i

    dimensions = {"offset": "angle"}
    point_distance = "zero"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return rows(d, body_j.angle - body_i.angle - self.offset)


class PlanarCurve(AbstractConstraint, type="curve", space="planar"):
    """Point on a curve: a point of body j stays on a curve of body i, as a pin in a track, or a roller in a cam groove.

    The parameter of the curve is a separate coordinate, that of an additional massless carriage; the force of the curve
    is along its normal.
    """

    curve: Curve  # of s, m, in the frame of body i
    point_j: Vector  # m, in the frame of body j
    start: Scalar = None  # of the parameter, as a guess; by default the point of the curve nearest to the guess

    hidden = ("s",)
    dimensions = {"curve": "length", "start": "any"}
    symbol = "curve"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, carriage: PlanarPose, time: Jet) -> Jet:
        along, unit = carriage.position
        d = body_j.point(self.point_j) - body_i.point(self.curve(along / self.curve.unit))
        return rows(d, unit - self.curve.unit, carriage.angle)


class Coordinate(AbstractConstraint, type="coordinate", space="planar"):
    """Fixed angle, gear pair or rolling along x or y: ``c_j = K phi_i + C``. Sommer 2024, equations 39-40.

    K is 1 unless given, 0 from ground; for a gear pair ``-rho_i / rho_j`` (external) or ``rho_i / rho_j`` (internal),
    for rolling along x or y the radius. C follows from the starting guess unless given.
    """

    coordinate: str = field(static=True)  # angle, x or y of body j
    ratio: Scalar = None
    offset: Scalar = None  # rad or m

    dimensions = {"ratio": "per angle", "offset": "of coordinate"}
    choices = {"coordinate": COORDINATES}
    symbol = "coordinate"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        ratio = 1.0 if self.ratio is None else self.ratio
        return coordinate_of(body_j, self.coordinate) - ratio * body_i.angle - self.offset


class Gear(AbstractConstraint, type="gear", space="planar"):
    """Gears i and j by their pitch circles, or by a ratio on a frame m that turns. Sommer 2024, equations 41-43.

    Toothed gears have two bodies, the points on them at their centers, and pitch radii, negative for a ring gear. They
    turn relative to the line of centers as rolling circles do. The tooth force acts on the bearings: along the common
    tangent of the pitch circles, and, with a pressure angle, inclined to it so as to press the gears apart, for either
    direction of load.

    Gears with a ratio turn relative to a third body, and exert no force on bearings.
    """

    ratio: Scalar = None  # -rho_i / rho_j external, rho_i / rho_j internal
    offset: Scalar = None  # rad
    point_i: Vector = None  # m, center of each gear in its frame
    point_j: Vector = None
    radius_i: Scalar = None  # m, of the pitch circle; negative for a ring gear
    radius_j: Scalar = None
    pressure_angle: Scalar = None  # rad
    friction: Nested = None
    arm: Any = field(default=None, init=False)  # rad, direction of the line of centers in the frame of their carrier
    flank: Any = field(default=None, init=False)  # 1 or -1, the sign of the multiplier; zero if no flank is loaded

    body_counts = (2, 3)
    dimensions = {"ratio": "ratio", "offset": "angle", "pressure_angle": "angle"}
    signs = {"radius": "not zero", "pressure_angle": "pressure angle"}
    symbol = "gear"

    def __check_init__(self):
        toothed = ("point_i", "point_j", "radius_i", "radius_j")
        given = [name for name in toothed if getattr(self, name) is not None]
        if (self.ratio is None) == (not given):
            message = "gears have either a ratio, or points and radii, from which it follows"
            raise MechanismError(message, name="ratio", value=self.ratio)
        if given and len(given) < len(toothed):
            missing = next(name for name in toothed if name not in given)
            raise MechanismError("gears with teeth have two points, their centers, and two radii", name=missing)
        if len(self.bodies) != (2 if given else 3):
            message = (
                "gears with teeth are two bodies; the one that carries both centers is found by their pins"
                if given
                else "gears by a ratio are [i, j, m]: the third body is the frame that carries both, such as ground"
            )
            raise MechanismError(message, name="bodies", value=list(self.bodies))
        if self.pressure_angle is not None and not given:
            message = "gears by a ratio have no teeth: give points and radii in place of the ratio"
            raise MechanismError(message, name="pressure_angle", value=self.pressure_angle)
        check_friction(self)

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, *others: Any) -> Jet:
        """Return the difference between the rotation of body j and that required by body i.

        `others` are the body m and the time. Toothed gears have a body m only if their carrier is known: it counts the
        turns of the line of centers.
        """
        if self.ratio is not None:
            return _turned(self, body_i, body_j, others[0].angle, self.ratio)
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        ratio, center_distance = -self.radius_i / self.radius_j, self.radius_i + self.radius_j
        d = d + _center_offset(d, center_distance)
        excess = _turned_on_line(self, body_i, body_j, others, d, ratio)
        if self.flank is None or self.pressure_angle is None:
            return excess
        # with the separation of the centers, which is always zero, the tooth force is along the line of action
        parted = sqrt(d.dot(d)) - jnp.abs(center_distance)
        side = -self.flank * jnp.sign(center_distance) / jnp.abs(self.radius_j)
        return excess + side * jnp.tan(self.pressure_angle) * parted

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the angular velocity of gear i relative to the carrier of the gears, rad/s."""
        toothed = self.ratio is None
        carrier = line_turn(bodies, moving, self.point_i, self.point_j) if toothed else moving[2][1]
        return rows(moving[0][1] - carrier)

    def passed_on(self, multiplier: Jet) -> Jet:
        """Return the torque that gear i transmits to gear j, as seen at gear i, N m."""
        return multiplier * (-self.ratio if self.ratio is not None else self.radius_i / self.radius_j)


def _turned_on_line(
    joint: Any, body_i: PlanarPose, body_j: PlanarPose, others: tuple[Any, ...], d: Jet, ratio: Any
) -> Jet:
    """Return the residual of rotation in a ratio relative to the line of centers, whose turns the arm counts."""
    line = atan2(d[1], d[0])
    if joint.arm is None:
        period = 2 * jnp.pi * (1.0 - ratio)
        period = jnp.where(period == 0, FAR, period)  # the line then does not matter
        return wrap(_turned(joint, body_i, body_j, line, ratio), period)
    line = shifted_by_turns(line, others[0].angle.coefficients[0] + joint.arm)
    return _turned(joint, body_i, body_j, line, ratio)


def _turned(joint: Any, body_i: PlanarPose, body_j: PlanarPose, line: Jet, ratio: Any) -> Jet:
    return (body_j.angle - line) - ratio * (body_i.angle - line) - joint.offset


def _center_offset(d: Jet, distance: Any) -> Any:
    """Return an offset for gear centers that coincide in a guess, where the line of centers is undefined."""
    value = d.coefficients[0]
    coincide = (value == 0).all(axis=0)
    return jnp.where(coincide, jnp.abs(distance), 0.0)[None] * np.array([1.0, 0.0]).reshape(2, *[1] * coincide.ndim)


class Belt(AbstractConstraint, type="belt", space="planar"):
    """Belt or chain around two pulleys, open or crossed, that neither slips nor stretches.

    Pulleys turn relative to the line of centers in the ratio of their radii: as the centers move around each other, the
    belt winds onto one pulley and off the other. Both strands lengthen equally as the centers separate, as under a
    tensioner. The force of the belt is the difference of the tensions of its strands, along these. Their mean, which
    pulls the pulleys together, is the pretension, which does not depend on the motion.
    """

    point_i: Vector  # m, center of each pulley in its frame
    point_j: Vector
    radius_i: Scalar  # m, to the middle of the belt, or of the pitch circle
    radius_j: Scalar
    crossed: Flag = field(static=True, default=False)
    offset: Scalar = None  # rad
    friction: Nested = None
    arm: Any = field(default=None, init=False)  # rad, direction of the line of centers in the frame of their carrier

    dimensions = {"offset": "angle"}
    symbol = "belt"

    def __check_init__(self):
        check_friction(self)

    @property
    def ratio(self) -> Any:
        """Turns of pulley j per turn of pulley i, relative to the line of centers."""
        return (-1.0 if self.crossed else 1.0) * self.radius_i / self.radius_j

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, *others: Any) -> Jet:
        """Return the difference between the rotation of body j and that required by body i; `others` as in `Gear`."""
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        d = d + _center_offset(d, self.radius_i + self.radius_j)
        return _turned_on_line(self, body_i, body_j, others, d, self.ratio)

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the angular velocity of pulley i relative to the line of centers, rad/s."""
        return rows(moving[0][1] - line_turn(bodies, moving, self.point_i, self.point_j))

    def passed_on(self, multiplier: Jet) -> Jet:
        """Return the torque that pulley i transmits to pulley j, as seen at pulley i, N m."""
        return multiplier * -self.ratio

    def line_force(self) -> Any:
        """Return the tension of the strand left of the line of centers minus that of the other, N, per multiplier.

        Left is as seen from pulley i toward pulley j, where the strand leaves pulley i.
        """
        return (1.0 if self.crossed else -1.0) / self.radius_j


class Rolling(AbstractConstraint, type="rolling", space="planar"):
    """A disc j rolls along a line of body i. Sommer 2024, equations 50-52 (51 as corrected in the errata).

    A disc that turns counterclockwise, in the positive sense of angles, moves along the line: its center lies to the
    right of it. A pinion on a rack has a pressure angle, by which the tooth force presses both apart.
    """

    point_i: Vector  # m, on the line; in the frame of body i
    point_j: Vector  # m, center of the disc
    vector_i: Vector  # along the line
    radius: Scalar  # m
    offset: Scalar = None  # m
    pressure_angle: Scalar = None  # rad
    friction: Nested = None
    flank: Any = field(default=None, init=False)  # 1 or -1, the sign of the multiplier; zero if no flank is loaded

    dimensions = {"offset": "length", "pressure_angle": "angle"}
    signs = {"pressure_angle": "pressure angle"}
    rolls_along = ("vector_i",)
    symbol = "rolling"

    def __check_init__(self):
        check_friction(self)

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        travel = slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)
        gap = travel - self.radius * (body_j.angle - body_i.angle) - self.offset
        if self.flank is None or self.pressure_angle is None:
            return gap
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        aside = cross(body_i.direction(self.vector_i), d) / length_of(self.vector_i)
        return gap + self.flank * jnp.tan(self.pressure_angle) * (aside + self.radius)

    def slip(self, bodies: tuple[Any, ...], moving: Velocities) -> Jet:
        """Return the angular velocity of the disc relative to the line, rad/s."""
        return rows(relative_turn(moving))

    def passed_on(self, multiplier: Jet) -> Jet:
        """Return the torque that the disc transmits to the line, N m."""
        return multiplier * -self.radius
