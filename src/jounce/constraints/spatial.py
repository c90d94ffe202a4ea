"""Spatial joints: the four basic residuals of Sommer 2024, section 5, and the joints composed of them.

In each, ``d = r_j^P - r_i^P`` leads from the joint's point on body i to that on body j.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jounce.constraints.angles import Datum, Vectors, coaxial, perpendiculars, relative_angle
from jounce.constraints.base import AbstractConstraint, Scalar, Vector, rows
from jounce.constraints.planar import length_of, slide
from jounce.jet import Jet, cross, wrap
from jounce.rigid import SpatialPose


class Spherical(AbstractConstraint, type="spherical", space="spatial"):
    """Ball: a point of each body coincides. Sommer 2024, equations 77-82."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector

    symbol = "spherical"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        return body_j.point(self.point_j) - body_i.point(self.point_i)


class DoubleSpherical(AbstractConstraint, type="double_spherical", space="spatial"):
    """Massless rod: two points at a constant distance. Sommer 2024, equations 83-88."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    length: Scalar  # m

    squared_distance = "length"
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

    held_parallel = (("axis_i", "axis_j"),)
    symbol = "revolute"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return rows(d, *_parallel(body_i, body_j, self.axis_i, self.axis_j))


class Cylindrical(AbstractConstraint, type="cylindrical", space="spatial"):
    """The axes coincide; the bodies turn about them and slide along them. Sommer 2024, section 5."""

    point_i: Vector  # m, on the axis, in the frame of body i
    point_j: Vector
    axis_i: Vector
    axis_j: Vector

    held_parallel = (("axis_i", "axis_j"),)
    symbol = "cylindrical"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        return rows(*_collinear(self, body_i, body_j))


class Prismatic(AbstractConstraint, type="prismatic", space="spatial"):
    """Slider: the axes coincide and one more direction stays parallel. Sommer 2024, section 5."""

    point_i: Vector  # m, on the axis, in the frame of body i
    point_j: Vector
    axis_i: Vector
    axis_j: Vector
    normal_i: Vector  # a perpendicular to the axis on each body that stays parallel
    normal_j: Vector

    held_parallel = (("axis_i", "axis_j"), ("normal_i", "normal_j"))
    never_parallel = (("normal_i", "axis_i"), ("normal_j", "axis_j"))
    symbol = "prismatic"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        side = body_i.direction(cross(self.axis_i, self.normal_i) / length_of(self.axis_i)[None])
        return rows(*_collinear(self, body_i, body_j), side.dot(body_j.direction(self.normal_j)))


class Screw(AbstractConstraint, type="screw", space="spatial"):
    """Nut j on a screw i: cylindrical, and an advance of one lead per turn. Sommer 2024, section 5.

    The advance is counted over turns: what is left of it after whole leads must vanish, so that a continuous motion
    never loses count.
    """

    point_i: Vector  # m, on the axis, in the frame of body i
    point_j: Vector
    axis_i: Vector
    axis_j: Vector
    lead: Scalar  # m per turn of j about the axis of i; negative for a left-hand thread
    offset: Scalar = None  # m

    dimensions = {"offset": "length"}
    held_parallel = (("axis_i", "axis_j"),)
    symbol = "screw"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        advance = slide(body_i, body_j, self.point_i, self.point_j, self.axis_i)
        angle = relative_angle(body_i, body_j, self.axis_i, datum=coaxial(self.axis_i, self.axis_j))
        excess = advance - self.lead / (2 * jnp.pi) * angle - self.offset
        return rows(*_collinear(self, body_i, body_j), wrap(excess, self.lead))


class Gear(AbstractConstraint, type="gear", space="spatial"):
    """Shafts i and j turn in a ratio, each about its axis, relative to the frame m that carries them.

    The axes may lie as they like, crossed as of a worm and its wheel, cut each other as of bevel gears, or be parallel
    as of a belt, and the frame may move. Each is the axis of a joint, which holds its direction in the frame.

    Turns are those that the attitudes tell, and what is left of the ratio after whole turns of both shafts must vanish:
    a continuous motion never loses count, of a ratio of whole numbers, as all of teeth are.
    """

    axis_i: Vector  # in the frame of each body
    axis_j: Vector
    ratio: Scalar  # turns of j about its axis to those of i about its own
    offset: Scalar = None  # rad
    held_i: Datum | None = eqx.field(default=None, init=False)  # that lays each axis on the one that it is in the frame
    held_j: Datum | None = eqx.field(default=None, init=False)
    whole: Any = eqx.field(default=None, init=False)  # the smallest whole number whose product with the ratio is whole

    body_count = 3
    dimensions = {"ratio": "ratio", "offset": "angle"}
    signs = {"ratio": "not zero"}
    symbol = "gear"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, body_m: SpatialPose, time: Jet) -> Jet:
        turn_i, turn_j = (
            -relative_angle(body, body_m, axis, datum=held)
            for body, axis, held in ((body_i, self.axis_i, self.held_i), (body_j, self.axis_j, self.held_j))
        )
        excess = turn_j - self.ratio * turn_i - self.offset
        return excess if self.whole is None else wrap(excess, 2 * jnp.pi / self.whole)


def _parallel(body_i: SpatialPose, body_j: SpatialPose, axis_i: Vectors, axis_j: Vectors) -> list[Jet]:
    """Return the two rows that keep an axis of each body parallel."""
    axis = body_j.direction(axis_j)
    return [body_i.direction(side).dot(axis) for side in perpendiculars(axis_i)]


def _collinear(joint: Any, body_i: SpatialPose, body_j: SpatialPose) -> list[Jet]:
    """Return the four rows that keep the axes of a joint on one line."""
    d = body_j.point(joint.point_j) - body_i.point(joint.point_i)
    on_line = [body_i.direction(side).dot(d) for side in perpendiculars(joint.axis_i)]
    return [*_parallel(body_i, body_j, joint.axis_i, joint.axis_j), *on_line]
