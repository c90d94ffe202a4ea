"""Spatial rigid bodies on jets: poses, points, directions, angular velocity. Sommer 2024, equations 59-76.

Attitude moves by the recursion ``A' = A skew(w')`` with the body-fixed angular velocity w', and the unit
quaternion by ``p' = 1/2 p o (0, w')``; no exponential map is ever differentiated.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from jounce.jet import Jet, dot, matvec, transpose
from jounce.jet.algebra import sum_of_products
from jounce.rigid.selection import take_bodies


def attitude_matrix(quaternion: Any) -> Any:
    """Return the attitude matrix, shape (3, 3, ...), of unit Euler parameters [e0, e1, e2, e3], shape (4, ...)."""
    e0, e1, e2, e3 = quaternion
    return jnp.stack(
        [
            jnp.stack([e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3, 2 * (e1 * e2 - e0 * e3), 2 * (e1 * e3 + e0 * e2)]),
            jnp.stack([2 * (e1 * e2 + e0 * e3), e0 * e0 - e1 * e1 + e2 * e2 - e3 * e3, 2 * (e2 * e3 - e0 * e1)]),
            jnp.stack([2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3]),
        ]
    )


def _rows_cross(matrix: Any, vector: Any) -> Any:
    """Return ``A skew(w)``: each row of A times w as a vector product."""
    a, w = matrix, vector
    return jnp.stack(
        [a[:, 1] * w[2] - a[:, 2] * w[1], a[:, 2] * w[0] - a[:, 0] * w[2], a[:, 0] * w[1] - a[:, 1] * w[0]], axis=1
    )


def _quaternion_times_vector(quaternion: Any, vector: Any) -> Any:
    """Return the quaternion product of p and the pure quaternion (0, w)."""
    (e0, e1, e2, e3), (w1, w2, w3) = quaternion, vector
    return jnp.stack(
        [
            -e1 * w1 - e2 * w2 - e3 * w3,
            e0 * w1 + e2 * w3 - e3 * w2,
            e0 * w2 + e3 * w1 - e1 * w3,
            e0 * w3 + e1 * w2 - e2 * w1,
        ]
    )


def _normalised(quaternion: Any) -> Any:
    return quaternion / jnp.sqrt(dot(quaternion, quaternion))[None]


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class SpatialPose:
    """Pose of one or many spatial bodies as jets; all batch axes trail.

    Parameters
    ----------
    position : Jet
        Origins of the body frames in the global frame, shape (3, ...), m.
    quaternion : Jet
        Unit Euler parameters [e0, e1, e2, e3] from the body to the global frame, shape (4, ...).
    attitude : Jet
        Attitude matrix A, which takes body components to global ones, shape (3, 3, ...).
    angular_velocity : Jet or None
        Body-fixed angular velocity w', shape (3, ...), rad/s, one order shorter; None at order zero.
    """

    position: Jet
    quaternion: Jet
    attitude: Jet
    angular_velocity: Jet | None

    shifts, turns = 3, 3  # coordinates of each kind: x, y, z; rotation about the three body axes
    predictor = ("position", "quaternion")  # the jets that a prediction needs

    @classmethod
    def at(cls, position: Any, quaternion: Any) -> "SpatialPose":
        """Build the pose of order zero; the quaternion is normalised."""
        quaternion = _normalised(quaternion)
        return cls(Jet([position]), Jet([quaternion]), Jet([attitude_matrix(quaternion)]), None)

    @property
    def order(self) -> int:
        """Highest time derivative that the pose carries."""
        return self.position.order

    def point(self, local: Any) -> Jet:
        """Return the global position of a point given in the body frame, (3, ...): Sommer 2024, equations 59-66."""
        return self.position + self.direction(local)

    def direction(self, local: Any) -> Jet:
        """Return the global components of a vector given in the body frame: Sommer 2024, equations 71-72."""
        return matvec(self.attitude, local)

    def to_body(self, vector: Any) -> Jet:
        """Return the body components of a vector given in the global frame, with their derivatives."""
        return matvec(transpose(self.attitude), vector)

    def global_angular_velocity(self) -> Jet:
        """Return the angular velocity in the global frame, to any order: Sommer 2024, equations 73-76."""
        return to_global(self.attitude, self._angular_velocity())

    def _angular_velocity(self) -> Jet:
        if self.angular_velocity is None:
            raise ValueError("a pose of order 0 has no angular velocity; ask for order 1 or more")
        return self.angular_velocity

    def take(self, bodies: tuple[int, ...]) -> "SpatialPose":
        """Return the poses of the given bodies, by index; body 0 is the ground, which never moves."""
        return jax.tree.map(lambda jet: take_bodies(jet, bodies), self, is_leaf=lambda x: isinstance(x, Jet))

    def displaced(self, shift: Any, turn: Any) -> "SpatialPose":
        """Return the pose of order zero moved by a shift, (3, ...) in m, and a turn about body axes, (3, ...) in rad."""
        quaternion = self.quaternion.coefficients[0]
        turned = quaternion + 0.5 * _quaternion_times_vector(quaternion, turn)
        return SpatialPose.at(self.position.coefficients[0] + shift, turned)

    def extended(self, shift: Any, turn: Any) -> "SpatialPose":
        """Return the pose one order higher, with new coefficients r[k] and w'[k-1] / k, both of shape (3, ...).

        What is None is zero.
        """
        k = self.order + 1
        newest = None if turn is None else k * turn
        if self.angular_velocity is not None:
            velocity = self.angular_velocity.append(newest)
        else:
            velocity = Jet([jnp.zeros_like(self.position.coefficients[0]) if newest is None else newest])
        # the term with the newest w' stands last: the others are then shared between a trial and the solution
        rates = velocity.coefficients if newest is not None or k > 1 else (None,)
        attitude = sum_of_products(_rows_cross, self.attitude.coefficients[::-1], rates)
        quaternion = sum_of_products(_quaternion_times_vector, self.quaternion.coefficients[::-1], rates)
        return SpatialPose(
            self.position.append(shift),
            self.quaternion.append(None if quaternion is None else quaternion * (0.5 / k)),
            self.attitude.append(None if attitude is None else attitude * (1 / k)),
            velocity,
        )

    @classmethod
    def predicted_from(cls, coordinates: dict[str, Jet], step: Any) -> "SpatialPose":
        """Return the pose of order zero that the Taylor series of coordinates give a time `step` away, in s."""
        return cls.at(*(coordinates[name].evaluate(step) for name in cls.predictor))

    def separation(self, other: "SpatialPose") -> tuple[Any, Any]:
        """Return the vectors of displacement, (3, ...) in m, and of rotation, (3, ...) in rad, from another pose."""
        (e0, *e), (f0, *f) = self.quaternion.coefficients[0], other.quaternion.coefficients[0]
        (e1, e2, e3), (f1, f2, f3) = e, f
        turn = jnp.stack(
            [
                f0 * e1 - f1 * e0 - f2 * e3 + f3 * e2,
                f0 * e2 - f2 * e0 - f3 * e1 + f1 * e3,
                f0 * e3 - f3 * e0 - f1 * e2 + f2 * e1,
            ]
        )
        return self.position.coefficients[0] - other.position.coefficients[0], 2 * turn

    def coordinates(self) -> dict[str, Jet]:
        """Return the jets that describe the motion, by name: what a result stores and `from_coordinates` reads."""
        jets = {"position": self.position, "quaternion": self.quaternion}
        return jets if self.angular_velocity is None else {**jets, "angular_velocity": self.angular_velocity}

    @classmethod
    def from_coordinates(cls, coordinates: dict[str, Jet]) -> "SpatialPose":
        """Build the pose again from what `coordinates` gave; the attitude follows by its recursion."""
        pose = cls.at(coordinates["position"].coefficients[0], coordinates["quaternion"].coefficients[0])
        for k in range(1, coordinates["position"].order + 1):
            rate = coordinates["angular_velocity"].coefficients[k - 1] * (1 / k)
            pose = pose.extended(coordinates["position"].coefficients[k], rate)
        return pose


def to_global(attitude: Jet, body: Jet) -> Jet:
    """Return a body-fixed vector, shape (3, ...), in global components, with derivatives: Sommer 2024, equations 73-76.

    Applied to the angular velocity w' it gives the angular velocity, acceleration, jerk and jounce in the global
    frame, with all the additional terms of equations 75 and 76.
    """
    return matvec(attitude, body)


def to_body(attitude: Jet, vector: Jet) -> Jet:
    """Return a global vector, shape (3, ...), in body components, with derivatives: Sommer 2024, equations 73-76."""
    return matvec(transpose(attitude), vector)
