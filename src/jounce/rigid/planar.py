"""Planar rigid bodies on jets: poses, points and directions. Sommer 2024, equations 9-20."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from jounce.jet import Jet, next_sine_cosine, sine_cosine
from jounce.rigid.body_arrays import body_vector, take_bodies


def perpendicular(vector: Any) -> Any:
    """Turn a plane vector by +90 degrees: the matrix R of Sommer 2024, equation 9."""
    return jnp.stack([-vector[1], vector[0]]) if not isinstance(vector, Jet) else vector.map(perpendicular)


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class PlanarPose:
    """Pose of one or many planar bodies as jets; all batch axes trail.

    Parameters
    ----------
    position : Jet
        Origins of the body frames in the global frame, shape (2, ...), m.
    angle : Jet
        Angles from the global to the body x axes, shape (...), rad.
    sine, cosine : Jet
        Of the angle: the entries of the attitude matrix A, Sommer 2024, equation 9.
    """

    position: Jet
    angle: Jet
    sine: Jet
    cosine: Jet

    shifts, turns = 2, 1  # coordinates of each kind: x, y; angle
    predictor = ("position", "angle")  # the jets that a prediction needs

    @classmethod
    def from_jets(cls, position: Jet, angle: Jet) -> "PlanarPose":
        """Build the pose from its coordinates; their jets may be of any order."""
        return cls(position, angle, *sine_cosine(angle))

    @property
    def order(self) -> int:
        """Highest time derivative that the pose carries."""
        return self.position.order

    def point(self, local: Any) -> Jet:
        """Return the global position of a point of the body frame, shape (2, ...): Sommer 2024, equations 10-14."""
        return self.position + self.direction(local)

    def direction(self, local: Any) -> Jet:
        """Return the global components of a vector given in the body frame: Sommer 2024, equations 19-20."""
        local = body_vector(local, len(self.angle.shape))
        return self.cosine * local + self.sine * perpendicular(local)

    def to_body(self, vector: Jet) -> Jet:
        """Return the body components, shape (2, ...), of a vector given in the global frame."""
        return self.cosine * vector - self.sine * perpendicular(vector)

    def take(self, bodies: tuple[int, ...]) -> "PlanarPose":
        """Return the poses of the given bodies, by index; body 0 is the ground, which never moves."""
        return jax.tree.map(lambda jet: take_bodies(jet, bodies), self, is_leaf=lambda x: isinstance(x, Jet))

    def displaced(self, shift: Any, turn: Any) -> "PlanarPose":
        """Return the pose of order zero moved by a shift, (2, ...) in m, and a turn, (1, ...) in rad."""
        position, angle = self.position.coefficients[0] + shift, self.angle.coefficients[0] + turn[0]
        return PlanarPose.from_jets(Jet([position]), Jet([angle]))

    def extended(self, shift: Any, turn: Any) -> "PlanarPose":
        """Return the pose one order higher, with new Taylor coefficients r[k], (2, ...), and phi[k], (1, ...).

        What is None is zero.
        """
        angle = self.angle.append(None if turn is None else turn[0])
        sine, cosine = next_sine_cosine(self.sine.coefficients, self.cosine.coefficients, angle)
        return PlanarPose(self.position.append(shift), angle, self.sine.append(sine), self.cosine.append(cosine))

    def varied(self, shift: Jet, turn: Jet) -> "PlanarPose":
        """Return how the jets change, to first order, as bodies shift, (2, ...) in m, and turn, (1, ...) in rad."""
        turn = turn[0]
        return PlanarPose(shift, turn, self.cosine * turn, -(self.sine * turn))

    def truncate(self, order: int) -> "PlanarPose":
        """Return the pose cut to at most `order`."""
        jets = (self.position, self.angle, self.sine, self.cosine)
        return PlanarPose(*(jet.truncate(order) for jet in jets))

    @classmethod
    def predicted_from(cls, coordinates: dict[str, Jet], step: Any) -> "PlanarPose":
        """Return the pose of order zero that the Taylor series of coordinates give a time `step` away, in s."""
        position, angle = (coordinates[name].evaluate(step) for name in cls.predictor)
        return cls.from_jets(Jet([position]), Jet([angle]))

    def separation(self, other: "PlanarPose") -> tuple[Any, Any]:
        """Return the vectors of displacement, (2, ...) in m, and of rotation, (1, ...) in rad, from another pose."""
        turn = self.angle.coefficients[0] - other.angle.coefficients[0]
        return self.position.coefficients[0] - other.position.coefficients[0], turn[None]

    def coordinates(self) -> dict[str, Jet]:
        """Return the jets that describe the motion, by name: what a result stores and `from_coordinates` reads."""
        return {"position": self.position, "angle": self.angle}

    @classmethod
    def from_coordinates(cls, coordinates: dict[str, Jet]) -> "PlanarPose":
        """Build the pose again from what `coordinates` gave."""
        return cls.from_jets(coordinates["position"], coordinates["angle"])
