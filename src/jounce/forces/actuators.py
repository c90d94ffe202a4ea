"""Forces and torques between two bodies by a law of their displacement, its rate and time: actuators, bumpers."""

from jounce.base.modules import field
from jounce.base.shapes import Numbers
from jounce.constraints.angles import Datum, check_vectors, relative_angle
from jounce.constraints.base import Vector
from jounce.constraints.planar import slide
from jounce.forces.base import AbstractForce, Law, by_law
from jounce.jet import Jet, sqrt
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.pose import Pose


def distance(body_i: Pose, body_j: Pose, point_i: Numbers, point_j: Numbers) -> Jet:
    """Return the distance between two points, m."""
    d = body_j.point(point_j) - body_i.point(point_i)
    return sqrt(d.dot(d))


class DistanceForce(AbstractForce, type="distance_force"):
    """Force along the line of two points by a law of their distance x, its rate v and t; positive, it pushes apart."""

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    law: Law  # N

    dimensions = {"law": "force"}
    symbol = "distance"

    def displacement(self, body_i: Pose, body_j: Pose, time: Jet) -> Jet:
        return distance(body_i, body_j, self.point_i, self.point_j)

    force = by_law


class SlideForce(AbstractForce, type="slide_force"):
    """Force on body j along a direction of body i, by a law of the slide x, its rate v and t, with reaction on body i.

    The slide is that of a slide driver: from the point on body i to that on body j, along the direction.
    """

    point_i: Vector  # m, in the frame of body i
    point_j: Vector
    vector_i: Vector  # direction of a positive force on body j
    law: Law  # N

    dimensions = {"law": "force"}
    symbol = "slide"

    def displacement(self, body_i: Pose, body_j: Pose, time: Jet) -> Jet:
        return slide(body_i, body_j, self.point_i, self.point_j, self.vector_i)

    force = by_law


class Torque(AbstractForce, type="torque", space="planar"):
    """Torque on body j from body i, by a law of the relative angle x, its rate v and t."""

    law: Law  # N m

    unit = "N*m"
    dimensions = {"law": "torque"}
    symbol = "rotation"

    def displacement(self, body_i: PlanarPose, body_j: PlanarPose, time: Jet) -> Jet:
        return body_j.angle - body_i.angle

    force = by_law


class SpatialTorque(AbstractForce, type="torque", space="spatial"):
    """Torque on body j from body i about an axis of body i, by a law of the angle x, its rate v and t.

    The angle is that of a rotation driver: with vectors, from `vector_i` to `vector_j`. Its turns are counted.
    """

    axis_i: Vector
    law: Law  # N m
    vector_i: Vector = None
    vector_j: Vector = None
    datum: Datum | None = field(default=None, init=False)  # set when the mechanism is assembled

    unit = "N*m"
    dimensions = {"law": "torque"}
    never_parallel = (("vector_i", "axis_i"),)
    symbol = "rotation"

    __check_init__ = check_vectors

    def displacement(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        return relative_angle(body_i, body_j, self.axis_i, self.vector_i, self.vector_j, self.datum)

    force = by_law
