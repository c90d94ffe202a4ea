"""Angles about an axis, independent of the choice of body frames. Sommer 2024, equations 101-103.

Between bodies that turn about a common axis, fixed in both, there is one angle, up to its zero. The Euler parameters of
their frames give it as ``2 atan2(u.e, e0)``. But unless the axis has the same components in both frames, that function
also changes as the axes tilt against each other, and a torque that works on it tilts the bearing. Body j is therefore
given a frame that differs from that of body i by a rotation about the axis only, at an assembled position: its `Datum`.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.modules import Module
from jounce.base.shapes import Numbers
from jounce.constraints.planar import length_of
from jounce.errors import MechanismError
from jounce.execution.traced_once import traced_once
from jounce.jet import Jet, components, cross, dot, stack, wrap
from jounce.jet.algebra import total
from jounce.jet.turns import principal, shifted_by_turns
from jounce.rigid.spatial import SpatialPose, body_axes

SMALLEST_COSINE = 1e-6  # of half the tilt of the axis: below, the tilt is half a turn, and the angle is undefined


Vectors = Float[Numbers, "3 *#batch"]
"""A body-fixed vector of each instance, common to all lanes or one per lane."""


class Datum(Module):
    """A relative attitude of two bodies at which the angle about an axis is known.

    Parameters
    ----------
    attitude : array of shape (4, ...)
        Euler parameters of ``A_i^T A_j``.
    angle : array of shape (...)
        Angle at this attitude, rad, with whole turns.
    near : array of shape (...)
        Expected angle, to within half a turn, rad, which determines the whole turns; the angle at the datum, unless a
        motion has been followed from there.
    across : array of shape (3, ...), optional
        Component of the second vector perpendicular to the axis at the datum, on body j, for forces about the axis.
    """

    attitude: Float[Numbers, "4 *batch"]
    angle: Float[Numbers, "*batch"]
    near: Float[Numbers, "*lanes"]
    across: Float[Numbers, "3 *batch"] | None = None


def check_vectors(self: Any) -> None:
    """Raise MechanismError unless an angle has a vector on both bodies or on none: `__check_init__` of its class."""
    if (self.vector_i is None) != (self.vector_j is None):
        raise MechanismError(f"{self.type_name} takes two vectors, one on each body, or none", name="vectors")


def perpendiculars(axis: Vectors) -> tuple[Vectors, Vectors]:
    """Return two unit vectors that complete a constant axis, of shape (3, ...), to a right-handed frame."""
    x, y, z = axis / length_of(axis)[None]
    sign = jnp.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    return (
        jnp.stack([1.0 + sign * a * x * x, sign * a * x * y, -sign * x]),
        jnp.stack([a * x * y, sign + a * y * y, -y]),
    )


def relative_angle(
    body_i: SpatialPose,
    body_j: SpatialPose,
    axis_i: Vectors,
    vector_i: Vectors | None = None,
    vector_j: Vectors | None = None,
    datum: Datum | None = None,
) -> Jet:
    """Return the rotation angle, rad, of body j about an axis of body i.

    With vectors, it is the signed angle from the first, on body i, to the second, on body j, or to `across` of the
    datum. Without vectors, it is the angle at the datum plus the rotation about the axis since then; if the axis
    changes its direction on body j, the rotation that remains after the shortest tilt of the axis. Without a datum, it
    is the angle of ``A_i^T A_j``, ``2 atan2(u.e, e0)`` of the relative Euler parameters, within half a turn of zero;
    this keeps the sign that Sommer 2024, equation 101, loses. With a datum, it has the whole turns that bring it
    nearest to `near`.
    """
    axis = axis_i / length_of(axis_i)[None]
    if vector_i is not None and vector_j is not None:
        second = vector_j if datum is None or datum.across is None else datum.across
        angle = _between(body_i, body_j, axis, vector_i, second)
        return angle if datum is None else shifted_by_turns(angle, datum.near)
    turn = _turn(body_i, body_j, axis, datum)
    return wrap(turn) if datum is None else shifted_by_turns(turn, datum.near - datum.angle) + datum.angle


# The rate of the angle is the angular velocity along the axis, plus terms that vanish while the bodies turn about the
# axis only. Jets of the arctangent would subtract products that are larger by 2^k at order k.


@traced_once()
def _turn(body_i: SpatialPose, body_j: SpatialPose, axis: Vectors, datum: Datum | None) -> Jet:
    quaternion, w = body_j.quaternion, body_j.angular_velocity  # the latter in the frame of body j
    if body_i.angular_velocity is not None:
        omega = body_j.to_body(body_i.global_angular_velocity())
        w = -omega if w is None else w - omega
    if datum is not None:  # the rotation of body j since the datum, at which it has the frame of body i
        inverse = [part * sign for part, sign in zip(components(datum.attitude), (1.0, -1.0, -1.0, -1.0), strict=True)]
        quaternion = total(part * x for part, x in zip((quaternion, *body_j.spins), inverse, strict=True))
        w = None if w is None else stack([dot(side, w) for side in body_axes(jnp.concatenate(inverse))])
    e0, e = body_i.relative_quaternion(quaternion)
    along = dot(axis, e)
    value = 2.0 * jnp.arctan2(along.coefficients[0], e0.coefficients[0])
    if w is None:
        return Jet.constant(value, body_i.order)
    across = e - along * axis
    excess = e0 * dot(axis, cross(across, w)) + along * dot(across, w)
    rate = dot(axis, w) + excess / (e0.square() + along.square())
    return rate.integrate(value)


@traced_once()
def _between(body_i: SpatialPose, body_j: SpatialPose, axis: Vectors, vector_i: Vectors, vector_j: Vectors) -> Jet:
    u, a, b = body_i.direction(axis), body_i.direction(vector_i), body_j.direction(vector_j)
    along = u.dot(b)
    across = b - along * u
    first = [x.coefficients[0] for x in (u, a, across)]
    value = jnp.arctan2(dot(cross(first[0], first[1]), first[2]), dot(first[1], first[2]))
    if body_i.order == 0:
        return Jet([value])
    w = body_j.global_angular_velocity() - body_i.global_angular_velocity()
    rate = u.dot(w) - along * w.dot(across) / across.dot(across)
    return rate.integrate(value)


def coaxial(axis_i: Vectors, axis_j: Vectors) -> Datum:
    """Return a datum for two bodies that turn about coinciding axes, one fixed in each, of shape (3, ...).

    Its angle is that of ``A_i^T A_j``, as at every attitude with coinciding axes.
    """
    u, v = (axis / length_of(axis)[None] for axis in (axis_i, axis_j))
    opposite = dot(u, v) < 0
    aligned = jnp.where(opposite[None], -u, u)
    # the shortest rotation that takes the axis of body j to that of body i, or to its opposite
    attitude = jnp.concatenate([1.0 + dot(v, aligned)[None], cross(v, aligned)])
    attitude = attitude / length_of(attitude)[None]
    side, _ = perpendiculars(u)  # axis of half a turn that follows
    e0, e = attitude[:1], attitude[1:]
    flipped = jnp.concatenate([-dot(side, e)[None], e0 * side + cross(side, e)])
    attitude = jnp.where(opposite[None], flipped, attitude)
    angle, is_defined = angle_of(attitude, u)
    angle = jnp.where(is_defined, angle, 0.0)
    return Datum(attitude, angle, angle)


def angle_of(
    attitude: Float[Numbers, "4 *#batch"], axis: Float[Numbers, "3 *#batch"]
) -> tuple[Float[Numbers, "*#batch"], Bool[Numbers, "*#batch"]]:
    """Return the angle of Euler parameters about a unit axis, in (-pi, pi], and whether it is defined.

    It is undefined where the attitude reverses the axis.
    """
    along, e0 = (axis * attitude[1:]).sum(axis=0), attitude[0]
    namespace = jnp if isinstance(along, jax.Array) else np
    return principal(2.0 * namespace.arctan2(along, e0)), namespace.hypot(along, e0) > SMALLEST_COSINE


def parallel_rows(body_i: SpatialPose, body_j: SpatialPose, axis_i: Vectors, axis_j: Vectors) -> list[Jet]:
    """Return the two rows that keep an axis of each body parallel."""
    axis = body_j.direction(axis_j)
    return [body_i.direction(side).dot(axis) for side in perpendiculars(axis_i)]


def upright(body: SpatialPose) -> list[Jet]:
    """Return the three rows that keep the axes of a body along those of the ground."""
    x, y = (body.direction(unit[:, None, None]) for unit in np.eye(3)[:2])
    return [x[1], x[2], y[2]]
