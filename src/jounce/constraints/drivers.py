"""Drivers: constraints with a motion law ``f(t)``. Sommer 2024, equations 39-40, 44-49, 53-55 and 101-111.

Each can be evaluated like an output: its value is the coordinate that it prescribes, whatever its law.
"""

import jax.numpy as jnp
from jaxtyping import Bool

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.constraints.angles import Datum, check_vectors, relative_angle
from jounce.constraints.base import AbstractConstraint, MotionLaw, Scalar, Vector
from jounce.constraints.planar import COORDINATES, coordinate_of, slide
from jounce.jet import Jet, sqrt, wrap
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.pose import Pose


class CoordinateDriver(AbstractConstraint, type="coordinate", space="planar", role="driver"):
    """Prescribed angle, x or y of body j: ``c_j = K phi_i + C + f(t)``. Sommer 2024, equations 39-40.

    K is 1 unless given; the motion is then relative to body i. From ground, K makes no difference.
    """

    coordinate: str = field(static=True)  # angle, x or y of body j
    motion: MotionLaw  # rad or m
    ratio: Scalar = None
    offset: Scalar = 0.0  # rad or m

    separable = True
    dimensions = {"motion": "of coordinate", "ratio": "per angle", "offset": "of coordinate"}
    choices = {"coordinate": COORDINATES}
    symbol = "coordinate"

    def evaluate(self, body_i: PlanarPose, body_j: PlanarPose) -> Jet:
        ratio = 1.0 if self.ratio is None else self.ratio
        return coordinate_of(body_j, self.coordinate) - ratio * body_i.angle - self.offset

    def residual(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        return self.evaluate(body_i, body_j) - self.motion(time)


class SlideDriver(AbstractConstraint, type="slide", space="planar", role="driver"):
    """Prescribed distance along a direction of body i. Sommer 2024, equations 44-49."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # direction of travel
    motion: MotionLaw  # m

    separable = True
    dimensions = {"motion": "length"}
    symbol = "slide"

    def evaluate(self, body_i: Pose, body_j: Pose) -> Jet:
        return slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)

    def residual(self, body_i: Pose, body_j: Pose, time: Jet) -> Jet:
        return self.evaluate(body_i, body_j) - self.motion(time)


class DistanceDriver(AbstractConstraint, type="distance", space="planar", role="driver"):
    """Prescribed distance of two points, always above zero. Sommer 2024, equations 53-55."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    motion: MotionLaw  # m

    separable = True
    dimensions = {"motion": "length"}
    squared_distance = "motion"
    symbol = "distance"

    def evaluate(self, body_i: Pose, body_j: Pose) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return sqrt(d.dot(d))

    def residual(self, body_i: Pose, body_j: Pose, time: Jet) -> Jet:
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return d.dot(d) - self.motion(time).square()

    def admissible(self, time: Jet) -> Bool[Numbers, "..."]:
        distance = self.motion(time.truncate(0)).coefficients[0]
        return (distance > 0) & jnp.isfinite(distance)


class SpatialSlideDriver(SlideDriver, type="slide", space="spatial", role="driver"):
    """Prescribed distance along a direction of body i. Sommer 2024, equations 108-111."""


class SpatialDistanceDriver(DistanceDriver, type="distance", space="spatial", role="driver"):
    """Prescribed distance of two points, always above zero. Sommer 2024, equations 104-107."""


class RotationDriver(AbstractConstraint, type="rotation", space="spatial", role="driver"):
    """Prescribed angle of body j about an axis of body i. Sommer 2024, equations 101-103, continuous over turns.

    Without vectors, the angle is that of ``A_i^T A_j`` at the assembled position, plus the rotation since then; with
    vectors, the signed angle from `vector_i` to `vector_j`. The remainder of angle minus motion after whole turns must
    vanish, so that the motion may span many turns.
    """

    axis_i: Vector
    motion: MotionLaw  # rad
    vector_i: Vector = None
    vector_j: Vector = None
    datum: Datum | None = field(default=None, init=False)  # set when the mechanism is assembled

    periodic = True
    separable = True
    dimensions = {"motion": "angle"}
    never_parallel = (("vector_i", "axis_i"),)
    symbol = "rotation"

    __check_init__ = check_vectors

    def evaluate(self, body_i: SpatialPose, body_j: SpatialPose) -> Jet:
        return relative_angle(body_i, body_j, self.axis_i, self.vector_i, self.vector_j, self.datum)

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        return wrap(self.evaluate(body_i, body_j) - self.motion(time))
