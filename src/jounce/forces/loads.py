"""Loads on one body: a force at a point and a moment, by laws of position, velocity and time, global or in the body."""

import jax.numpy as jnp

from jounce.base.modules import field
from jounce.constraints.base import Vector
from jounce.forces.base import AbstractForce, Law, Laws, by_law
from jounce.jet import Jet
from jounce.rigid import PlanarPose, SpatialPose
from jounce.rigid.orientation import FRAMES
from jounce.rigid.pose import Pose


class PointForce(AbstractForce, type="point_force", space="planar"):
    """Force at a point of a body: one law for each component, of t, x, y, vx and vy.

    x and y are the position of the point in the global frame. The components of force and velocity are global, or along
    the axes of the body (`frame`), as for a thruster.
    """

    point: Vector  # m, in the frame of the body
    law: Laws  # N
    frame: str = field(static=True, default="global")

    body_count = 1
    dimensions = {"law": "force"}
    choices = {"frame": FRAMES}
    symbol = "point force"
    displacement_names = ("x", "y")
    velocity_names = ("vx", "vy")

    def displacement(self, body: Pose, time: Jet) -> Jet:
        return body.point(self.point)

    def velocity(self, body: Pose, time: Jet) -> Jet:
        return self._components(body, body.point(self.point).differentiate())

    def variation(self, bodies: tuple[Pose, ...], changes: tuple[Pose, ...], time: Jet) -> Jet:
        return self._components(bodies[0], super().variation(bodies, changes, time))

    def _components(self, body: Pose, vector: Jet) -> Jet:
        return vector if self.frame == "global" else body.to_body(vector)

    force = by_law


class SpatialPointForce(PointForce, type="point_force", space="spatial"):
    """Force at a point of a body: one law for each component, of t, x, y, z, vx, vy and vz.

    x, y and z are the position of the point in the global frame. The components of force and velocity are global, or
    along the axes of the body (`frame`), as for a thruster.
    """

    displacement_names = ("x", "y", "z")
    velocity_names = ("vx", "vy", "vz")


class Moment(AbstractForce, type="moment", space="planar"):
    """Moment on a body, by a law of its angle x, its rate v and t."""

    law: Law  # N m

    body_count = 1
    unit = "N*m"
    dimensions = {"law": "torque"}
    symbol = "rotation"

    def displacement(self, body: PlanarPose, time: Jet) -> Jet:
        return body.angle

    force = by_law


class SpatialMoment(AbstractForce, type="moment", space="spatial"):
    """Moment on a body: one law for each component, of t and of the angular velocity wx, wy, wz.

    All components are global, or along the axes of the body (`frame`).
    """

    law: Laws  # N m
    frame: str = field(static=True, default="global")

    body_count = 1
    unit = "N*m"
    dimensions = {"law": "torque"}
    choices = {"frame": FRAMES}
    symbol = "rotation"
    displacement_names = ()
    velocity_names = ("wx", "wy", "wz")

    def displacement(self, body: SpatialPose, time: Jet) -> Jet:
        # no vector has the angular velocity as its rate: `velocity` and `variation` below define the work of the moment
        return Jet.constant(jnp.zeros_like(body.position.coefficients[0]), body.order)

    def velocity(self, body: SpatialPose, time: Jet) -> Jet:
        if self.frame == "body" and body.angular_velocity is not None:
            return body.angular_velocity
        return body.global_angular_velocity()

    def variation(self, bodies: tuple[SpatialPose, ...], changes: tuple[SpatialPose, ...], time: Jet) -> Jet:
        turn = bodies[0].turning(changes[0])
        return turn if self.frame == "body" else bodies[0].direction(turn)

    force = by_law
