"""What holds a body that nothing else keeps from spinning about an axis of itself."""

import jax.numpy as jnp

from jounce.constraints.base import AbstractConstraint, Scalar, Vector
from jounce.constraints.planar import length_of
from jounce.jet import Jet
from jounce.rigid import SpatialPose


class SpinHold(AbstractConstraint):
    """The angular velocity of a body about an axis of itself: zero, the least motion, or a constant.

    A condition on velocities (a gauge): the residual is the angle by which the body has spun since the instant, zero
    there, so that its coefficient of order k is affine in the angular velocity of order k - 1, as that of any joint.
    It says nothing of the position, which corrections leave as it is.
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
        still = jnp.zeros_like(body.position.coefficients[0][0])
        if body.order == 0 or body.angular_velocity is None:
            spun = Jet.constant(still, body.order)
        else:
            axis = self.axis / length_of(self.axis)[None]
            spun = body.angular_velocity.dot(axis).integrate(still)
        return spun - self.rate * (time - time.coefficients[0])
