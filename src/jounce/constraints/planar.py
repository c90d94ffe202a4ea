"""Planar joints: a residual of a few lines each. Sommer 2024, section 3.

In each, ``d = r_j^P - r_i^P`` leads from the joint's point on body i to that on body j, and ``a`` is a vector fixed in
a body, seen in the global frame. ``cross(a, b)`` is the paper's ``a^T R^T b``.
"""

import equinox as eqx
from jaxtyping import Float

from jounce.constraints.base import AbstractConstraint, Curve, Scalar, Vector, rows
from jounce.jet import Jet, cross, dot, sqrt
from jounce.rigid import PlanarPose
from jounce.rigid.pose import Pose
from jounce.shapes import Numbers

COORDINATES = ("angle", "x", "y")
Vectors = Float[Numbers, "components *batch"]


def length_of(vector: Float[Numbers, "components *batch"]) -> Float[Numbers, "*batch"]:
    """Return the length of a constant vector of shape (components, ...)."""
    return sqrt(dot(vector, vector))


def slide(body_i: Pose, body_j: Pose, point_i: Vectors, point_j: Vectors, vector_i: Vectors) -> Jet:
    """Return the distance, in m, from the point on body i to that on body j, along a direction fixed in body i."""
    d = body_j.point(point_j) - body_i.point(point_i)
    return body_i.direction(vector_i).dot(d) / length_of(vector_i)


def coordinate_of(body: PlanarPose, coordinate: str) -> Jet:
    """Return the angle, x or y of a planar body."""
    return body.angle if coordinate == "angle" else body.position[0 if coordinate == "x" else 1]


class Revolute(AbstractConstraint, type="revolute", space="planar"):
    """Pin: a point of each body coincides. Sommer 2024, equations 21-25."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector

    symbol = "revolute"
    pair = "revolute"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        return body_j.point(self.point_j) - body_i.point(self.point_i)


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

    symbol = "slot"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return cross(body_i.direction(self.vector_i), d)


class Prismatic(AbstractConstraint, type="prismatic", space="planar"):
    """Slider: parallel-1 and parallel-2 together. Sommer 2024, equations 31-38."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # along the slide, in each frame
    vector_j: Vector

    held_parallel = (("vector_i", "vector_j"),)
    symbol = "prismatic"
    pair = "prismatic"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        along = body_i.direction(self.vector_i)
        return rows(cross(along, body_j.direction(self.vector_j)), cross(along, d))


class Fixed(AbstractConstraint, type="fixed", space="planar"):
    """Weld: a point of each body coincides, and body j keeps its angle to body i, that of the guess unless given."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    offset: Scalar = None  # rad, the angle of body j less that of body i

    dimensions = {"offset": "angle"}

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return rows(d, body_j.angle - body_i.angle - self.offset)


class PlanarCurve(AbstractConstraint, type="curve", space="planar"):
    """Point on a curve: a point of body j stays on a curve of body i, as a pin in a track, or a roller in a cam groove.

    The parameter of the curve is a coordinate of its own, that of a carriage without mass beside the bodies; what the
    curve exerts is along its normal.
    """

    curve: Curve  # of s, m, in the frame of body i
    point_j: Vector  # m, in the frame of body j
    start: Scalar = None  # of the parameter, as a guess; where the curve is nearest to the guess of the bodies else

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

    coordinate: str = eqx.field(static=True)  # angle, x or y of body j
    ratio: Scalar = None
    offset: Scalar = None  # rad or m

    dimensions = {"ratio": "per angle", "offset": "of coordinate"}
    choices = {"coordinate": COORDINATES}
    symbol = "coordinate"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        ratio = 1.0 if self.ratio is None else self.ratio
        return coordinate_of(body_j, self.coordinate) - ratio * body_i.angle - self.offset


class Gear(AbstractConstraint, type="gear", space="planar"):
    """Gears i and j on a rotating frame m (epicyclic). Sommer 2024, equations 41-43."""

    ratio: Scalar  # -rho_i / rho_j external, rho_i / rho_j internal
    offset: Scalar = None  # rad

    body_count = 3
    dimensions = {"ratio": "ratio", "offset": "angle"}
    symbol = "gear"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, body_m: PlanarPose, time: Jet) -> Jet:
        return (body_j.angle - body_m.angle) - self.ratio * (body_i.angle - body_m.angle) - self.offset


class Rolling(AbstractConstraint, type="rolling", space="planar"):
    """A disc j rolls along a line of body i. Sommer 2024, equations 50-52 (51 as corrected in the errata)."""

    point_i: Vector  # m, on the line; in the frame of body i
    point_j: Vector  # m, centre of the disc
    vector_i: Vector  # along the line
    radius: Scalar  # m
    offset: Scalar = None  # m

    dimensions = {"offset": "length"}
    symbol = "rolling"

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        travel = slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)
        return travel - self.radius * (body_j.angle - body_i.angle) - self.offset
