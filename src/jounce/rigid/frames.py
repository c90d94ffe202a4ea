"""Moving frames as jets: origins, axes and angular velocities."""

import dataclasses
from typing import Any

import jax
from jaxtyping import Float, Int

from jounce.base.shapes import Numbers, Refused, real_or_traced
from jounce.errors import JounceError
from jounce.jet import Jet, components, dot, stack, transpose
from jounce.jet.algebra import JetLike, total
from jounce.rigid.body_arrays import body_vector


class AbstractFrame:
    """A moving frame: an origin and three axes, in the frame of the base; batch axes are last."""

    position: Jet  # (3, ...), m
    axes: tuple[Jet, ...]  # three of shape (3, ...)

    def point(self, local: JetLike) -> Float[Jet, "3 *batch"]:
        """Return a point of the moving frame, shape (3, ...), m: Sommer 2024, 59-66; Negrean 2025, 23."""
        return self.position + self.direction(local)

    def direction(self, local: JetLike) -> Float[Jet, "3 *batch"]:
        """Return a vector of the moving frame in components of the base: Sommer 2024, equations 71-72."""
        coordinates = components(body_vector(local, len(self.position.shape) - 1))
        return total(axis * coordinate for axis, coordinate in zip(self.axes, coordinates, strict=True))

    def to_body(self, vector: Jet | Numbers | Refused) -> Float[Jet, "3 *batch"]:
        """Return the components, in the moving frame, of a vector given in the frame of the base."""
        checked: Any = vector if isinstance(vector, Jet) else real_or_traced("vector", vector, JounceError)
        return stack([dot(axis, checked) for axis in self.axes])

    @property
    def attitude(self) -> Float[Jet, "3 3 *batch"]:
        """Rotation matrix from the moving frame to the base, shape (3, 3, ...)."""
        return transpose(stack(self.axes))


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Frames(AbstractFrame):
    """One or many moving frames; batch axes are last.

    Parameters
    ----------
    position : Jet
        Origins in the frame of the base, shape (3, ...), m.
    axes : tuple of 3 Jet
        Axes in the frame of the base, each of shape (3, ...).
    angular_velocity : Jet
        Angular velocity in the frame of the base, shape (3, ...), rad/s, one order shorter; None at order zero.
    """

    position: Jet
    axes: tuple[Jet, ...]
    angular_velocity: Jet | None

    def take(self, index: Int[Numbers, ""] | int) -> "Frames":
        """Return one of several frames, by its index along the axis after the components."""

        def taken_at(coefficient: Any) -> Any:
            return jax.lax.dynamic_index_in_dim(coefficient, index, axis=1, keepdims=False)

        return jax.tree.map(taken_at, self)

    def without_base(self) -> "Frames":
        """Return all of several frames but the last one."""
        return jax.tree.map(lambda c: c[:, :-1], self)

    def truncate(self, order: int) -> "Frames":
        """Return the frames cut to at most `order`."""
        spin = None if self.angular_velocity is None or not order else self.angular_velocity.truncate(order - 1)
        return Frames(self.position.truncate(order), tuple(axis.truncate(order) for axis in self.axes), spin)
