"""Outputs of suspensions and linkages: angles of lines in planes, instant centers and roll centers."""

from typing import Any

import jax.numpy as jnp

from jounce.base.modules import field
from jounce.constraints.base import Vector
from jounce.constraints.planar import length_of
from jounce.jet import Jet, atan2, cross, dot, stack
from jounce.jet.rounding import SMALLEST, nan_where_rounding, nan_where_rounding_in_plane, rates_of, sizes
from jounce.mechanism.outputs.base import AbstractOutput
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.planar import perpendicular

PERPENDICULAR = 1e-9  # cosine of the angle between unit vectors that are perpendicular


class ProjectedAngleOutput(AbstractOutput):
    """Angle of the line from a point of body j to one of body m, projected on a plane of body i, rad.

    The plane is perpendicular to `normal`; the angle is measured in it from the projection of `vector_i`, both on body
    i, and is positive about the normal, by the right-hand rule. It is continuous over turns. Bodies j and m may be
    the same. Where the line is perpendicular to the plane there is no angle.
    """

    normal: Vector
    vector_i: Vector
    point_j: Vector  # m, in the frame of each body
    point_m: Vector

    unit = "rad"
    space = "spatial"
    turning = True
    body_count = 3
    may_repeat = True
    never_parallel = (("vector_i", "normal"),)

    def evaluate(self, body_i: SpatialPose, body_j: SpatialPose, body_m: SpatialPose) -> Jet:
        line = body_m.point(self.point_m) - body_j.point(self.point_j)
        seen = stack([axis.dot(line) for axis in body_i.axes])
        normal = self.normal / length_of(self.normal)[None]
        first = self.vector_i - dot(self.vector_i, normal)[None] * normal
        first = first / length_of(first)[None]
        along, across = seen.dot(first), seen.dot(cross(normal, first))
        return nan_where_rounding_in_plane(atan2(across, along), stack([along, across]), seen)


class _CenterOutput(AbstractOutput):
    rate_names = ("position", "velocity", "acceleration", "jerk", "jounce")

    def is_vector(self, mechanism: Any) -> bool:
        del mechanism
        return True


class InstantCenterOutput(_CenterOutput):
    """Instant center of planar body j relative to body i, m: the point of both bodies that has one velocity.

    In the frame `global`, or `body`: that of body i, in which it moves on the fixed centrode. Where the bodies do not
    turn relative to each other there is none.
    """

    frame: str = field(static=True, default="global")

    lost_orders = 1
    space = "planar"
    body_count = 2
    choices = {"frame": ("global", "body")}

    def evaluate(self, body_i: PlanarPose, body_j: PlanarPose) -> Jet:
        position = body_i.to_body(body_j.position - body_i.position)
        turning = (body_j.angle - body_i.angle).differentiate()
        arm = position.differentiate() / turning
        center = position.truncate(arm.order) + perpendicular(arm)
        center = _nan_without_rotation(center, turning)
        if self.frame == "body":
            return center
        return (body_i.position + body_i.direction(center)).truncate(center.order)


class SpatialInstantCenterOutput(_CenterOutput):
    """Instant center of spatial body j relative to body i in a plane of body i, m.

    The point of the plane, through `point_i` and perpendicular to `normal`, where the velocity of body j relative to
    body i has no component in the plane. In the frame `global`, or `body`: that of body i. Where body j does not turn
    about the normal there is none.
    """

    point_i: Vector  # m, in the frame of body i
    normal: Vector
    frame: str = field(static=True, default="global")

    lost_orders = 1
    space = "spatial"
    body_count = 2
    choices = {"frame": ("global", "body")}

    def evaluate(self, body_i: SpatialPose, body_j: SpatialPose) -> Jet:
        normal = body_i.direction(self.normal / length_of(self.normal)[None])
        position, turning = body_i.point(self.point_i), _spin(body_j) - _spin(body_i)
        # both bodies have a point here, at rest in body i; that of body j moves on
        velocity = (
            body_j.position.differentiate()
            + _spin(body_j).cross(position - body_j.position)
            - body_i.position.differentiate()
            - _spin(body_i).cross(position - body_i.position)
        )
        about = normal.dot(turning)
        center = position + normal.cross(velocity) / about
        center = _nan_without_rotation(center, about)
        if self.frame == "body":
            offset = center - body_i.position
            return stack([axis.dot(offset) for axis in body_i.axes])
        return center


class RollCenterOutput(_CenterOutput):
    """Roll center of an axle, m, in the global frame: of a body i, the chassis, on two wheels, bodies j and m.

    It is where the lines from the points of contact of the wheels to their instant centers meet, in the plane
    perpendicular to `normal`, the longitudinal direction of body i, through the middle of the contact points (SAE
    J670). Each line is perpendicular to the velocity of its contact point, as a point of the body that carries the
    wheel, relative to the chassis. Where the lines are parallel, or a contact point stands still, there is none.
    """

    normal: Vector
    point_j: Vector  # m, in the frame of each body
    point_m: Vector

    lost_orders = 1
    space = "spatial"
    body_count = 3

    def evaluate(self, body_i: SpatialPose, body_j: SpatialPose, body_m: SpatialPose) -> Jet:
        normal = self.normal / length_of(self.normal)[None]
        left, right = _in_frame(body_i, body_j.point(self.point_j)), _in_frame(body_i, body_m.point(self.point_m))
        center = _intersection(normal, left, right, left.differentiate(), right.differentiate())
        return (body_i.position + body_i.direction(center)).truncate(center.order)


class SymmetricRollCenterOutput(_CenterOutput):
    """Roll center of an axle of which one wheel is modeled, m, in the global frame: the other is its mirror image.

    As that of two wheels, relative to the ground, with the image of the `point` of contact of the body in the plane
    through the global origin perpendicular to `vector_i`, the lateral direction; `normal` is the longitudinal one,
    perpendicular to it. So it is where the line of the wheel meets that plane, also where both lines are one.
    """

    point: Vector  # m, in the frame of the body
    normal: Vector
    vector_i: Vector

    lost_orders = 1
    space = "spatial"

    def evaluate(self, body: SpatialPose) -> Jet:
        normal = self.normal / length_of(self.normal)[None]
        lateral = self.vector_i / length_of(self.vector_i)[None]
        position = body.point(self.point)
        velocity = position.differentiate()
        line = cross(normal, velocity)
        onward = line.dot(lateral)
        center = position - line * (position.dot(lateral) / onward)
        batch = jnp.ndim(onward.coefficients[0])
        scale = sizes(position, batch)[0]
        rate = rates_of(velocity - velocity.dot(normal) * normal, scale, batch)[1]
        square = jnp.broadcast_to(jnp.abs(dot(normal, lateral)) < PERPENDICULAR, jnp.shape(scale))
        return nan_where_rounding(center, rates_of(onward, scale, batch)[0], rate, lost=1, also=square)


def _spin(body: SpatialPose) -> Jet:
    return body.global_angular_velocity()


def _in_frame(frame: SpatialPose, position: Jet) -> Jet:
    """Return a position in the frame of a body."""
    offset = position - frame.position
    return stack([axis.dot(offset) for axis in frame.axes])


def _nan_without_rotation(center: Jet, turning: Jet) -> Jet:
    """Return a center with NaN where the rate of turning that it was divided by vanishes."""
    batch = jnp.ndim(turning.coefficients[0])
    return nan_where_rounding(center, *rates_of(turning, jnp.ones_like(turning.coefficients[0]), batch))


def _intersection(normal: Any, first: Jet, second: Jet, first_rate: Jet, second_rate: Jet) -> Jet:
    """Return where lines through two points, perpendicular to velocities, meet in a plane midway between them."""

    def flat(vector: Jet) -> Jet:
        return vector - vector.dot(normal) * normal

    between = second - first
    middle = between.dot(normal) * (0.5 * normal)
    v, w = flat(first_rate), flat(second_rate)
    area = dot(cross(v, w), normal)
    reach = flat(between).dot(w) / area
    center = first + middle + cross(normal, v) * reach
    batch = jnp.ndim(area.coefficients[0])
    scale = sizes(between, batch)[0]
    slow, fast = sizes(v, batch)[0], sizes(w, batch)[0]
    rates = [rates_of(speed, scale, batch) for speed in (v, w)]
    for pair in rates:
        center = nan_where_rounding(center, *pair)
    distinct = jnp.abs(area.coefficients[0]) > SMALLEST * slow * fast
    return nan_where_rounding(
        center, rates_of(area, scale, batch)[0], jnp.maximum(rates[0][1], rates[1][1]), lost=1, also=distinct
    )
