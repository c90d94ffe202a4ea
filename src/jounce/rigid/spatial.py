"""Spatial rigid bodies on jets: poses, points, directions, angular velocity. Sommer 2024, equations 59-76.

The attitude follows the recursion ``A' = A skew(w')`` with the body-fixed angular velocity w', and the unit quaternion
``p' = 1/2 p o (0, w')``; no exponential map is ever differentiated.
"""

import dataclasses
from functools import reduce
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers, Real, Refused, real_or_traced
from jounce.errors import JounceError
from jounce.jet import Jet, components, concatenate, dot, matmul, matvec, stack, transpose
from jounce.jet.coefficients import minus, plus, sum_of_products, total
from jounce.rigid.body_arrays import each_jet, take_bodies
from jounce.rigid.frames import AbstractFrame

Triad = tuple[Float[Numbers, "3 *batch"], Float[Numbers, "3 *batch"], Float[Numbers, "3 *batch"]]
Quadruples = tuple[Float[Numbers, "4 *batch"], Float[Numbers, "4 *batch"], Float[Numbers, "4 *batch"]]


def body_axes(quaternion: Float[Numbers, "4 *batch"] | Refused) -> Triad:
    """Return the axes of the body in the global frame, the columns of the attitude matrix A, each of shape (3, ...).

    Parameters
    ----------
    quaternion : array of shape (4, ...)
        Unit Euler parameters [e0, e1, e2, e3].
    """
    e0, e1, e2, e3 = real_or_traced("quaternion", quaternion, JounceError)
    return (
        jnp.stack([e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3, 2 * (e1 * e2 + e0 * e3), 2 * (e1 * e3 - e0 * e2)]),
        jnp.stack([2 * (e1 * e2 - e0 * e3), e0 * e0 - e1 * e1 + e2 * e2 - e3 * e3, 2 * (e2 * e3 + e0 * e1)]),
        jnp.stack([2 * (e1 * e3 + e0 * e2), 2 * (e2 * e3 - e0 * e1), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3]),
    )


def quaternion_spins(quaternion: Float[Numbers, "4 *batch"]) -> Quadruples:
    """Return the quaternion products of p with i, j and k: its changes by rotation about the body axes."""
    e0, e1, e2, e3 = components(quaternion)
    return (
        jnp.concatenate([-e1, e0, e3, -e2]),
        jnp.concatenate([-e2, -e3, e0, e1]),
        jnp.concatenate([-e3, e2, -e1, e0]),
    )


def quaternion_change(
    quaternion: Float[Numbers, "4 *batch"], turn: Float[Numbers, "3 *batch"]
) -> Float[Numbers, "4 *batch"]:
    """Return the change of Euler parameters by a rotation about the body axes, rad; or its rate, given rates."""
    return 0.5 * total(spin * angle for spin, angle in zip(quaternion_spins(quaternion), components(turn), strict=True))


def _normalized(quaternion: Float[Numbers, "4 *batch"]) -> Float[Numbers, "4 *batch"]:
    return quaternion / jnp.sqrt(dot(quaternion, quaternion))[None]


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class SpatialPose(AbstractFrame):
    """Pose of one or many spatial bodies as jets; batch axes are last.

    Parameters
    ----------
    position : Jet
        Origins of the body frames in the global frame, shape (3, ...), m.
    quaternion : Jet
        Unit Euler parameters [e0, e1, e2, e3] from the body to the global frame, shape (4, ...).
    spins : tuple of 3 Jet
        Quaternion products of the Euler parameters with i, j and k, each of shape (4, ...).
    axes : tuple of 3 Jet
        Axes of the body in the global frame, the columns of the attitude matrix A, each of shape (3, ...).
    angular_velocity : Jet or None
        Body-fixed angular velocity w', shape (3, ...), rad/s, one order shorter; None at order zero, and if it is known
        to be zero.
    """

    position: Jet
    quaternion: Jet
    spins: tuple[Jet, ...]
    axes: tuple[Jet, ...]
    angular_velocity: Jet | None

    shifts, turns = 3, 3  # numbers of coordinates: x, y, z; rotations about the three body axes
    predictor = ("position", "quaternion")  # the jets that a prediction needs

    @classmethod
    def at(
        cls, position: Float[Numbers, "3 *batch"] | Refused, quaternion: Float[Numbers, "4 *batch"] | Refused
    ) -> "SpatialPose":
        """Return the pose of order zero; the quaternion is normalized."""
        origin: Any = real_or_traced("position", position, JounceError)
        return cls.at_unit(origin, _normalized(real_or_traced("quaternion", quaternion, JounceError)))

    @classmethod
    def at_unit(cls, position: Float[Numbers, "3 *batch"], quaternion: Float[Numbers, "4 *batch"]) -> "SpatialPose":
        """Return the pose of order zero from Euler parameters of unit length."""
        spins, axes = (tuple(Jet([x]) for x in f(quaternion)) for f in (quaternion_spins, body_axes))
        return cls(Jet([position]), Jet([quaternion]), spins, axes, None)

    @property
    def order(self) -> int:
        """Highest order of time derivative in the pose."""
        return self.position.order

    def relative_quaternion(self, quaternion: Jet) -> tuple[Jet, Jet]:
        """Return the Euler parameters e0, (...), and e, (3, ...), of another attitude relative to this one."""
        return self.quaternion.dot(quaternion), stack([spin.dot(quaternion) for spin in self.spins])

    def global_angular_velocity(self) -> Float[Jet, "3 *batch"]:
        """Return the angular velocity in the global frame, to any order: Sommer 2024, equations 73-76."""
        if self.order == 0:
            raise ValueError("a pose of order 0 has no angular velocity; ask for order 1 or more")
        if self.angular_velocity is None:
            return Jet.constant(jnp.zeros_like(self.position.coefficients[0]), self.order - 1)
        return self.direction(self.angular_velocity)

    def take(self, bodies: tuple[int, ...]) -> "SpatialPose":
        """Return the poses of given bodies by index; body 0 is the ground, which never moves."""
        taken = each_jet(lambda jet: take_bodies(jet, bodies), self)
        return taken if any(bodies) else dataclasses.replace(taken, angular_velocity=None)

    def displaced(self, shift: Float[Numbers, "3 *batch"], turn: Float[Numbers, "3 *batch"]) -> "SpatialPose":
        """Return the pose of order zero moved by a shift, (3, ...) in m, and a turn in body axes, (3, ...) in rad."""
        quaternion = self.quaternion.coefficients[0]
        return SpatialPose.at(self.position.coefficients[0] + shift, quaternion + quaternion_change(quaternion, turn))

    def extended(
        self, shift: Float[Numbers, "3 *batch"] | None, turn: Float[Numbers, "3 *batch"] | None
    ) -> "SpatialPose":
        """Return the pose one order higher, with new coefficients r[k] and w'[k-1] / k, both of shape (3, ...).

        None is zero.
        """
        k = self.order + 1
        velocity = self.angular_velocity
        if velocity is not None:
            velocity = velocity.append(None if turn is None else k * turn)
        elif turn is not None:
            velocity = Jet((k * turn,)) if k == 1 else Jet((jnp.zeros_like(turn), *[None] * (k - 2), k * turn))
        # the term with the newest w' is last, so that a trial and the solution share the others
        rates = [None] * k if velocity is None else velocity.coefficients
        w = list(zip(*(components(rate) if rate is not None else [None] * 3 for rate in rates), strict=True))

        def convolved(jet: Jet, rate: Any) -> Any:
            return sum_of_products(jnp.multiply, jet.coefficients[::-1], rate)

        def scaled(coefficient: Any, factor: float) -> Any:
            return None if coefficient is None else coefficient * factor

        axes = []
        for axis, (i, j) in zip(self.axes, ((1, 2), (2, 0), (0, 1)), strict=True):
            change = minus(convolved(self.axes[i], w[j]), convolved(self.axes[j], w[i]))
            axes.append(axis.append(scaled(change, 1 / k)))
        spun = reduce(plus, (convolved(spin, rate) for spin, rate in zip(self.spins, w, strict=True)))
        quaternion = scaled(spun, 0.5 / k)
        changes = (None,) * 3 if quaternion is None else quaternion_spins(quaternion)
        return SpatialPose(
            self.position.append(shift),
            self.quaternion.append(quaternion),
            tuple(spin.append(c) for spin, c in zip(self.spins, changes, strict=True)),
            tuple(axes),
            velocity,
        )

    def varied(self, shift: Float[Jet, "3 *batch"], turn: Float[Jet, "3 *batch"]) -> "SpatialPose":
        """Return the first-order variation of the pose by shifts, (3, ...) in m, and rotations, (3, ...) in rad.

        The rotation is about the body axes; it need not be small, since the variation is linear in it.
        """
        x, y, z = self.axes
        p, q, r = components(turn)
        axes = (y * r - z * q, z * p - x * r, x * q - y * p)
        quaternion = total(spin * angle for spin, angle in zip(self.spins, (p, q, r), strict=True)) * 0.5
        spins = zip(*map(quaternion_spins, quaternion.dense().coefficients), strict=True)
        velocity = None
        if self.angular_velocity is not None:
            velocity = turn.differentiate() + self.angular_velocity.cross(turn)
        return SpatialPose(shift, quaternion, tuple(map(Jet, spins)), axes, velocity)

    def turning(self, change: "SpatialPose") -> Float[Jet, "3 *batch"]:
        """Return the rotation, (3, ...) in rad about the body axes, of a variation from `varied`."""
        (x, y, z), (dx, dy, dz) = self.axes, change.axes
        return stack([dot(dy, z), dot(dz, x), dot(dx, y)])

    def truncate(self, order: int) -> "SpatialPose":
        """Return the pose cut to at most `order`."""
        spin = self.angular_velocity
        return SpatialPose(
            self.position.truncate(order),
            self.quaternion.truncate(order),
            tuple(jet.truncate(order) for jet in self.spins),
            tuple(jet.truncate(order) for jet in self.axes),
            None if spin is None or order == 0 else spin.truncate(order - 1),
        )

    @classmethod
    def predicted_from(cls, coordinates: dict[str, Jet], step: Real) -> "SpatialPose":
        """Return the pose of order zero that the Taylor series of coordinates give after a time `step`, s."""
        return cls.at(*(coordinates[name].evaluate(step) for name in cls.predictor))

    def separation(self, other: "SpatialPose") -> tuple[Float[Numbers, "3 *batch"], Float[Numbers, "3 *batch"]]:
        """Return the displacement, (3, ...) in m, and the rotation, (3, ...) in rad, from another pose."""
        turn = other.truncate(0).relative_quaternion(self.quaternion.truncate(0))[1]
        return self.position.coefficients[0] - other.position.coefficients[0], 2 * turn.coefficients[0]

    def coordinates(self) -> dict[str, Jet]:
        """Return the jets that describe the motion by name, which results store and `from_coordinates` reads."""
        jets = {"position": self.position, "quaternion": self.quaternion}
        return jets if self.angular_velocity is None else {**jets, "angular_velocity": self.angular_velocity}

    @classmethod
    def from_coordinates(cls, coordinates: dict[str, Jet]) -> "SpatialPose":
        """Return the pose of jets from `coordinates`; the attitude follows by its recursion."""
        pose = cls.at(coordinates["position"].coefficients[0], coordinates["quaternion"].coefficients[0])
        for k in range(1, coordinates["position"].order + 1):
            rate = coordinates["angular_velocity"].coefficients[k - 1] * (1 / k)
            pose = pose.extended(coordinates["position"].coefficients[k], rate)
        return pose


def angular_product_matrices(angular_velocity: Jet) -> Float[jax.Array, "derivative 3 3 *batch"]:
    """Return the products of angular velocities in the derivatives of an attitude: Sommer 2024, equations 63 and 65.

    The k-th derivative of an attitude is ``A^(k) = A (P_k + [w^(k-1)]x)`` with the body-fixed angular velocity w, and
    of a point ``r^(k) + A (P_k + [w^(k-1)]x) s``. P_3 is the angular jerk product matrix H of the paper, P_4 its
    angular jounce product matrix W, and P_2 is ``[w]x [w]x``; those of higher orders follow.

    Parameters
    ----------
    angular_velocity : Jet of shape (3, ...)
        Angular velocity in the body axes, rad/s.

    Returns
    -------
    array of shape (order + 2, 3, 3, ...)
        The matrices P_0 (the identity), P_1 (zero), P_2, ..., P_(order + 1), in the body axes, 1/s^k.

    Examples
    --------
    >>> import jounce as jn
    >>> w = jn.Jet.from_derivatives([[0.0, 0.0, 2.0], [0.0, 0.0, 3.0], [0.0, 0.0, 0.0]])  # 2 rad/s and 3 rad/s^2
    >>> jn.rigid.angular_product_matrices(w)[3, :, 0].tolist()  # of H: -3 w w' along the axis, -w^3 across
    [-18.0, -8.0, 0.0]
    """
    x, y, z = components(angular_velocity.dense())
    zero = x * 0.0
    spin = stack([concatenate([zero, -z, y]), concatenate([z, zero, -x]), concatenate([-y, x, zero])])
    identity = jnp.broadcast_to(jnp.eye(3).reshape(3, 3, *[1] * (len(spin.shape) - 2)), spin.shape)
    attitude = Jet([identity])
    for k in range(spin.order + 1):  # A' = A [w]x, from the identity
        attitude = attitude.append(matmul(attitude, spin.truncate(k)).dense().coefficients[k] / (k + 1))
    matrices, rates = attitude.derivatives(), spin.derivatives()
    return jnp.concatenate([matrices[:1], matrices[1:] - rates])


def to_global(attitude: Float[Jet, "3 3 *batch"], body: Float[Jet, "3 *batch"]) -> Float[Jet, "3 *batch"]:
    """Return a body-fixed vector, shape (3, ...), in global components, with derivatives: Sommer 2024, equations 73-76.

    Applied to the angular velocity w' it gives the angular velocity, acceleration, jerk and jounce in the global
    frame, with all the additional terms of equations 75 and 76.
    """
    return matvec(attitude, body)


def to_body(attitude: Float[Jet, "3 3 *batch"], vector: Float[Jet, "3 *batch"]) -> Float[Jet, "3 *batch"]:
    """Return a global vector, shape (3, ...), in body components, with derivatives: Sommer 2024, equations 73-76."""
    return matvec(transpose(attitude), vector)
