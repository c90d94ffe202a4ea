"""Frames that move, as jets: where their origins are, where their axes point, how fast they turn."""

import dataclasses
from typing import Any

import jax

from jounce.jet import Jet, components, dot, stack, transpose
from jounce.jet.algebra import total
from jounce.rigid.body_arrays import body_vector


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Frames:
    """One or many moving frames; all batch axes trail.

    Parameters
    ----------
    position : Jet
        Origins in the frame of the base, shape (3, ...), m.
    axes : tuple of 3 Jet
        Axes in the frame of the base, each of shape (3, ...).
    angular_velocity : Jet
        In the frame of the base, shape (3, ...), rad/s, one order shorter; None at order zero.
    """

    position: Jet
    axes: tuple[Jet, ...]
    angular_velocity: Jet | None

    def point(self, local: Any) -> Jet:
        """Return a point given in the moving frame, shape (3, ...), m: Negrean 2025, equation 23."""
        return self.position + self.direction(local)

    def direction(self, local: Any) -> Jet:
        """Return a vector given in the moving frame, in components of the base."""
        local = body_vector(local, len(self.position.shape) - 1)
        return total(axis * part for axis, part in zip(self.axes, components(local), strict=True))

    def to_body(self, vector: Any) -> Jet:
        """Return the components, in the moving frame, of a vector given in the frame of the base."""
        return stack([dot(axis, vector) for axis in self.axes])

    @property
    def attitude(self) -> Jet:
        """Rotation matrix from the moving frame to the base, shape (3, 3, ...)."""
        return transpose(stack(self.axes))

    def take(self, index: Any) -> "Frames":
        """Return one of several frames, by its index along the axis after the components."""

        def taken(coefficient: Any) -> Any:
            return jax.lax.dynamic_index_in_dim(coefficient, index, axis=1, keepdims=False)

        return jax.tree.map(taken, self)

    def without_base(self) -> "Frames":
        """Return all of several frames but the last one."""
        return jax.tree.map(lambda c: c[:, :-1], self)
