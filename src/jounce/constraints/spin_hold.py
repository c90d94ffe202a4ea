"""The constraint that holds an idle body, which nothing else keeps from spinning about its own axis."""

import jax.numpy as jnp

from jounce.constraints.base import AbstractConstraint, Scalar, Vector
from jounce.constraints.planar import length_of
from jounce.jet import Jet
from jounce.rigid import SpatialPose


class SpinHold(AbstractConstraint):
    """The angular velocity of a body about its own axis: zero, for the least motion, or a constant.

    This is a condition on velocities (a gauge). The residual is the angle by which the body has spun since the instant,
    zero at the instant itself, so that its coefficient of order k is affine in the angular velocity of order k - 1, as
    for any joint. It does not constrain the position, which corrections leave unchanged.
    """

    axis: Vector
    rate: Scalar = 0.0  # rad/s

    space = "spatial"
    body_count = 1
    symbol = "none"

    def variation(self, bodies: tuple[SpatialPose], changes: tuple[SpatialPose], time: Jet) -> Jet:
        (body,), (change,) = bodies, changes
        return body.turning(change).dot(self.axis / length_of(self.axis)[None])

    def residual(self, body: SpatialPose, time: Jet) -> Jet:
        zero = jnp.zeros_like(body.position.coefficients[0][0])
        if body.order == 0 or body.angular_velocity is None:
            turn = Jet.constant(zero, body.order)
        else:
            axis = self.axis / length_of(self.axis)[None]
            turn = body.angular_velocity.dot(axis).integrate(zero)
        return turn - self.rate * (time - time.coefficients[0])
