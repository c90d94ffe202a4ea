"""Damping and friction of a ball joint, against the relative angular velocity of two bodies."""

import jax.numpy as jnp

from jounce.constraints.base import Scalar
from jounce.forces.base import AbstractForce
from jounce.jet import Jet, sign
from jounce.rigid import SpatialPose


class BallDamper(AbstractForce, space="spatial"):
    """Moment against the angular velocity w of body j relative to body i, isotropic.

    ``M = -damping w - friction sign(w)``, by components along the axes of body j.
    """

    damping: Scalar  # N m s/rad
    friction: Scalar = 0.0  # N m

    unit = "N*m"
    dimensions = {"damping": "torsional damping", "friction": "torque"}
    symbol = "rotation"

    def displacement(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:  # noqa: ARG002
        """Return zero: no vector has an angular velocity as its rate, so `velocity` and `variation` replace it."""
        return Jet.constant(jnp.zeros_like(body_j.position.coefficients[0]), body_j.order)

    def velocity(self, body_i: SpatialPose, body_j: SpatialPose, time: Jet) -> Jet:  # noqa: ARG002
        """Return the relative angular velocity in axes of body j."""
        return body_j.to_body(body_j.global_angular_velocity() - body_i.global_angular_velocity())

    def variation(self, bodies: tuple[SpatialPose, ...], changes: tuple[SpatialPose, ...], time: Jet) -> Jet:  # noqa: ARG002
        """Return the relative infinitesimal rotation in axes of body j."""
        rotated = bodies[0].direction(bodies[0].turning(changes[0]))
        return bodies[1].turning(changes[1]) - bodies[1].to_body(rotated)

    def force(self, displacement: Jet, velocity: Jet, time: Jet) -> Jet:  # noqa: ARG002
        """Return the moment on body j."""
        return -(velocity * self.damping + sign(velocity) * self.friction)
