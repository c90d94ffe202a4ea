"""Planar rigid bodies on jets: poses, points and directions. Sommer 2024, equations 9-20."""

import dataclasses
from typing import Any, overload

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers, Real, Refused, real_or_traced
from jounce.errors import JounceError
from jounce.jet import Jet, next_sine_cosine, sine_cosine
from jounce.jet.algebra import JetLike
from jounce.rigid.body_arrays import body_vector, each_jet, take_bodies


@overload
def perpendicular(vector: Jet) -> Jet: ...
@overload
def perpendicular(vector: Numbers) -> jax.Array: ...
def perpendicular(vector: Jet | Numbers | Refused) -> Jet | jax.Array:
    """Return a plane vector rotated by +90 degrees: the matrix R of Sommer 2024, equation 9."""
    if isinstance(vector, Jet):
        return vector.map(_turned)
    return _turned(real_or_traced("vector", vector, JounceError))


def _turned(vector: Numbers) -> jax.Array:
    return jnp.stack([-vector[1], vector[0]])


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class PlanarPose:
    """Pose of one or many planar bodies as jets; batch axes are last.

    Parameters
    ----------
    position : Jet
        Origins of the body frames in the global frame, shape (2, ...), m.
    angle : Jet
        Angles from the global to the body x axes, shape (...), rad.
    sine, cosine : Jet
        Sine and cosine of the angle: the entries of the attitude matrix A, Sommer 2024, equation 9.
    """

    position: Jet
    angle: Jet
    sine: Jet
    cosine: Jet

    shifts, turns = 2, 1  # numbers of coordinates: x, y; angle
    predictor = ("position", "angle")  # the jets that a prediction needs

    @classmethod
    def from_jets(cls, position: Jet, angle: Jet) -> "PlanarPose":
        """Return the pose of jets of its coordinates, of any order."""
        return cls(position, angle, *sine_cosine(angle))

    @classmethod
    def at_unit(cls, position: Numbers, angle: Numbers) -> "PlanarPose":
        """Return the pose of order zero."""
        return cls.from_jets(Jet([position]), Jet([angle]))

    @property
    def order(self) -> int:
        """Highest order of time derivative in the pose."""
        return self.position.order

    def point(self, local: JetLike) -> Float[Jet, "2 *batch"]:
        """Return the global position of a point of the body frame, shape (2, ...): Sommer 2024, equations 10-14."""
        return self.position + self.direction(local)

    def direction(self, local: JetLike) -> Float[Jet, "2 *batch"]:
        """Return the global components of a vector given in the body frame: Sommer 2024, equations 19-20."""
        vector = body_vector(local, len(self.angle.shape))
        return self.cosine * vector + self.sine * perpendicular(vector)

    def to_body(self, vector: Jet | Numbers | Refused) -> Float[Jet, "2 *batch"]:
        """Return the body components, shape (2, ...), of a vector given in the global frame."""
        checked: Any = vector if isinstance(vector, Jet) else real_or_traced("vector", vector, JounceError)
        return self.cosine * checked - self.sine * perpendicular(checked)

    def take(self, bodies: tuple[int, ...]) -> "PlanarPose":
        """Return the poses of given bodies by index; body 0 is the ground, which never moves."""
        return each_jet(lambda jet: take_bodies(jet, bodies), self)

    def displaced(self, shift: Float[Numbers, "2 *batch"], turn: Float[Numbers, "1 *batch"]) -> "PlanarPose":
        """Return the pose of order zero moved by a shift, (2, ...) in m, and a turn, (1, ...) in rad."""
        position, angle = self.position.coefficients[0] + shift, self.angle.coefficients[0] + turn[0]
        return PlanarPose.from_jets(Jet([position]), Jet([angle]))

    def extended(
        self, shift: Float[Numbers, "2 *batch"] | None, turn: Float[Numbers, "1 *batch"] | None
    ) -> "PlanarPose":
        """Return the pose one order higher, with new Taylor coefficients r[k], (2, ...), and phi[k], (1, ...).

        None is zero.
        """
        angle = self.angle.append(None if turn is None else turn[0])
        sine, cosine = next_sine_cosine(self.sine.coefficients, self.cosine.coefficients, angle)
        return PlanarPose(self.position.append(shift), angle, self.sine.append(sine), self.cosine.append(cosine))

    def varied(self, shift: Float[Jet, "2 *batch"], turn: Float[Jet, "1 *batch"]) -> "PlanarPose":
        """Return the first-order variation of the pose by shifts, (2, ...) in m, and rotations, (1, ...) in rad."""
        turn = turn[0]
        return PlanarPose(shift, turn, self.cosine * turn, -(self.sine * turn))

    def truncate(self, order: int) -> "PlanarPose":
        """Return the pose cut to at most `order`."""
        return each_jet(lambda jet: jet.truncate(order), self)

    @classmethod
    def predicted_from(cls, coordinates: dict[str, Jet], step: Real) -> "PlanarPose":
        """Return the pose of order zero that the Taylor series of coordinates give after a time `step`, s."""
        position, angle = (coordinates[name].evaluate(step) for name in cls.predictor)
        return cls.from_jets(Jet([position]), Jet([angle]))

    def separation(self, other: "PlanarPose") -> tuple[Float[Numbers, "2 *batch"], Float[Numbers, "1 *batch"]]:
        """Return the displacement, (2, ...) in m, and the rotation, (1, ...) in rad, from another pose."""
        turn = self.angle.coefficients[0] - other.angle.coefficients[0]
        return self.position.coefficients[0] - other.position.coefficients[0], turn[None]

    def coordinates(self) -> dict[str, Jet]:
        """Return the jets that describe the motion by name, which results store and `from_coordinates` reads."""
        return {"position": self.position, "angle": self.angle}

    @classmethod
    def from_coordinates(cls, coordinates: dict[str, Jet]) -> "PlanarPose":
        """Return the pose of jets from `coordinates`."""
        return cls.from_jets(coordinates["position"], coordinates["angle"])
