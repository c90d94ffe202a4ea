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

    The plane is perpendicular to `normal`. The angle is measured in the plane from the projection of `vector_i`,
    positive about the normal by the right-hand rule, and continuous over turns. Both vectors are fixed on body i.
    Bodies j and m may be the same. The angle is undefined where the line is perpendicular to the plane.
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
        projected = stack([axis.dot(line) for axis in body_i.axes])
        normal = self.normal / length_of(self.normal)[None]
        first = self.vector_i - dot(self.vector_i, normal)[None] * normal
        first = first / length_of(first)[None]
        along, across = projected.dot(first), projected.dot(cross(normal, first))
        return nan_where_rounding_in_plane(atan2(across, along), stack([along, across]), projected)


class _CenterOutput(AbstractOutput):
    rate_names = ("position", "velocity", "acceleration", "jerk", "jounce")

    def is_vector(self, mechanism: Any) -> bool:
        del mechanism
        return True


class InstantCenterOutput(_CenterOutput):
    """Instant center of planar body j relative to body i, m: the point at which both bodies have the same velocity.

    The frame is `global`, or `body` for that of body i, in which the center moves on the fixed centrode. The center is
    undefined where the bodies do not turn relative to each other.
    """

    frame: str = field(static=True, default="global")

    lost_orders = 1
    space = "planar"
    body_count = 2
    choices = {"frame": ("global", "body")}

    def evaluate(self, body_i: PlanarPose, body_j: PlanarPose) -> Jet:
        position = body_i.to_body(body_j.position - body_i.position)
        rate = (body_j.angle - body_i.angle).differentiate()
        arm = position.differentiate() / rate
        center = position.truncate(arm.order) + perpendicular(arm)
        center = _nan_without_rotation(center, rate)
        if self.frame == "body":
            return center
        return (body_i.position + body_i.direction(center)).truncate(center.order)


class SpatialInstantCenterOutput(_CenterOutput):
    """Instant center of spatial body j relative to body i in a plane of body i, m.

    It is the point of the plane, through `point_i` and perpendicular to `normal`, at which the velocity of body j
    relative to body i has no component in the plane. The frame is `global`, or `body` for that of body i. The center is
    undefined where body j does not turn about the normal.
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
        position, spin = body_i.point(self.point_i), _spin(body_j) - _spin(body_i)
        # `position` is a point of body i; the coincident point of body j moves relative to it
        velocity = (
            body_j.position.differentiate()
            + _spin(body_j).cross(position - body_j.position)
            - body_i.position.differentiate()
            - _spin(body_i).cross(position - body_i.position)
        )
        rate = normal.dot(spin)
        center = position + normal.cross(velocity) / rate
        center = _nan_without_rotation(center, rate)
        if self.frame == "body":
            offset = center - body_i.position
            return stack([axis.dot(offset) for axis in body_i.axes])
        return center


class RollCenterOutput(_CenterOutput):
    """Roll center of an axle, m, in the global frame: of body i, the chassis, on two wheels, bodies j and m.

    It is the intersection of the lines from the contact points of the wheels to their instant centers, in the plane
    perpendicular to `normal`, the longitudinal direction of body i, through the middle of the contact points (SAE
    J670). Each line is perpendicular to the velocity, relative to the chassis, of its contact point as a point of the
    body that carries the wheel. The center is undefined where the lines are parallel, or a contact point stands still.
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
    """Roll center of an axle with one modeled wheel, m, in the global frame; the other wheel is its mirror image.

    It is the roll center of two wheels relative to the ground. The contact `point` of the body is mirrored in the plane
    through the global origin perpendicular to `vector_i`, the lateral direction; `normal` is the longitudinal
    direction, perpendicular to `vector_i`. The center is the intersection of the line of the wheel with that plane,
    also where both lines coincide.
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
        component = line.dot(lateral)
        center = position - line * (position.dot(lateral) / component)
        batch = jnp.ndim(component.coefficients[0])
        scale = sizes(position, batch)[0]
        rate = rates_of(velocity - velocity.dot(normal) * normal, scale, batch)[1]
        square = jnp.broadcast_to(jnp.abs(dot(normal, lateral)) < PERPENDICULAR, jnp.shape(scale))
        return nan_where_rounding(center, rates_of(component, scale, batch)[0], rate, lost=1, also=square)


def _spin(body: SpatialPose) -> Jet:
    return body.global_angular_velocity()


def _in_frame(frame: SpatialPose, position: Jet) -> Jet:
    """Return a position in the frame of a body."""
    offset = position - frame.position
    return stack([axis.dot(offset) for axis in frame.axes])


def _nan_without_rotation(center: Jet, rate: Jet) -> Jet:
    """Return a center with NaN where the angular rate by which it was divided vanishes."""
    batch = jnp.ndim(rate.coefficients[0])
    return nan_where_rounding(center, *rates_of(rate, jnp.ones_like(rate.coefficients[0]), batch))


def _intersection(normal: Any, first: Jet, second: Jet, first_rate: Jet, second_rate: Jet) -> Jet:
    """Return the intersection of lines through two points, perpendicular to their velocities, in the plane midway."""

    def flat(vector: Jet) -> Jet:
        return vector - vector.dot(normal) * normal

    difference = second - first
    middle = difference.dot(normal) * (0.5 * normal)
    v, w = flat(first_rate), flat(second_rate)
    area = dot(cross(v, w), normal)
    factor = flat(difference).dot(w) / area
    center = first + middle + cross(normal, v) * factor
    batch = jnp.ndim(area.coefficients[0])
    scale = sizes(difference, batch)[0]
    slow, fast = sizes(v, batch)[0], sizes(w, batch)[0]
    rates = [rates_of(speed, scale, batch) for speed in (v, w)]
    for pair in rates:
        center = nan_where_rounding(center, *pair)
    distinct = jnp.abs(area.coefficients[0]) > SMALLEST * slow * fast
    return nan_where_rounding(
        center, rates_of(area, scale, batch)[0], jnp.maximum(rates[0][1], rates[1][1]), lost=1, also=distinct
    )
