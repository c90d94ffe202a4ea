"""Wheels that roll on a plane without slip: nonholonomic rows, which constrain velocities but not positions."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jounce.constraints.base import AbstractConstraint, Scalar, Vector, rows
from jounce.constraints.planar import length_of
from jounce.jet import Jet, cross, sqrt
from jounce.rigid import SpatialPose


class Wheel(AbstractConstraint, type="wheel", space="spatial"):
    """A thin wheel of body j that rolls without slip on a plane of body i: a disc, or a tire of no width.

    Its lowest point touches the plane, and the material point of the wheel there has the velocity of the plane, both
    along and across the wheel. These two rows constrain velocities: they restrict how the wheel moves, but not where it
    is. Wheels can therefore only be simulated. Neimark and Fufaev, Dynamics of nonholonomic systems, 1972.

    The residual contains the distance that the wheel has slipped since the instant, zero at the instant itself; its
    coefficient of order k is affine in the velocities of order k - 1, as for any joint.
    """

    point_j: Vector  # m, center of the wheel, in the frame of body j
    axis_j: Vector
    radius: Scalar  # m
    point_i: Vector  # m, on the plane, in the frame of body i
    normal_i: Vector  # of the plane, toward the wheel

    nonholonomic = True
    parts = {"plane": {"point": "point_i", "normal": "normal_i"}}
    symbol = "wheel"

    def residual(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:
        height = self._height(body_i, body_j)
        zeros, order = jnp.zeros_like(height.coefficients[0]), body_j.order
        if order == 0:
            return rows(height, *[Jet.constant(zeros, 0)] * 2)
        moving = [(body.position.differentiate(), body.global_angular_velocity()) for body in (body_i, body_j)]
        slip = self._slip(body_i.truncate(order - 1), body_j.truncate(order - 1), moving)
        return rows(height, *(part.integrate(zeros) for part in slip))

    def variation(self, bodies: tuple[Any, ...], changes: tuple[Any, ...], time: Jet) -> Jet:
        """Return the variation of the height, and the slip of the touching points by displacements."""
        varied = [k for k, change in enumerate(changes) if change is not None]

        def height(*poses: Any) -> Jet:
            displaced = list(bodies)
            for k, pose in zip(varied, poses, strict=True):
                displaced[k] = pose
            return self._height(*displaced)

        raised = jax.jvp(height, tuple(bodies[k] for k in varied), tuple(changes[k] for k in varied))[1]
        zero = Jet.constant(jnp.zeros_like(bodies[0].position.coefficients[0]), bodies[0].order)
        moving = [
            (zero, zero) if change is None else (change.position, body.direction(body.turning(change)))
            for body, change in zip(bodies, changes, strict=True)
        ]
        body_i, body_j = bodies
        return rows(raised, *self._slip(body_i, body_j, moving))

    def _height(self, body_i: SpatialPose, body_j: SpatialPose) -> Jet:
        touching, normal, _ = self._contact(body_i, body_j)
        return (touching - body_i.point(self.point_i)).dot(normal)

    def _contact(self, body_i: SpatialPose, body_j: SpatialPose) -> tuple[Jet, Jet, Jet]:
        """Return the lowest point of the wheel, the normal of the plane, and the axis of the wheel."""
        normal = body_i.direction(self.normal_i / length_of(self.normal_i)[None])
        axis = body_j.direction(self.axis_j / length_of(self.axis_j)[None])
        down = axis * axis.dot(normal) - normal
        return body_j.point(self.point_j) + unit(down) * self.radius, normal, axis

    def _slip(self, body_i: SpatialPose, body_j: SpatialPose, moving: Sequence[tuple[Jet, Jet]]) -> tuple[Jet, Jet]:
        """Return the slip velocity of the wheel along its direction of rolling, and across it.

        Parameters
        ----------
        body_i, body_j : SpatialPose
            Poses of the bodies.
        moving : sequence of tuple of Jet
            Velocity of the origin and angular velocity, both global, of each body.
        """
        touching, normal, axis = self._contact(body_i, body_j)
        plane, wheel = (
            velocity + cross(turning, touching - body.position)
            for body, (velocity, turning) in zip((body_i, body_j), moving, strict=True)
        )
        along = unit(cross(axis, normal))
        slip = wheel - plane
        return slip.dot(along), slip.dot(cross(normal, along))


def unit(vector: Jet) -> Jet:
    """Return the unit vector in the direction of a vector."""
    return vector / sqrt(vector.dot(vector))
