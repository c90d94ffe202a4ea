"""The positions of joints along a path."""

import dataclasses
from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.kinematics.chunks import in_chunks
from jounce.trajectory import AbstractMotion
from jounce.trajectory.stacking import law_derivatives

BLOCK = 2048  # places evaluated at once


@dataclasses.dataclass(frozen=True, eq=False)
class Path:
    """The positions of joints along a path, over a parameter s that runs from `start` to `stop`.

    Parameters
    ----------
    laws : dict of str to AbstractMotion
        Position of each joint over s, rad or m.
    start, stop : float
        Ends of s.
    deviation : float, default 0
        How far the path passes by the trajectory that it was made of, at most, rad or m.
    """

    laws: Mapping[str, AbstractMotion]
    start: float
    stop: float
    deviation: float = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.laws)

    def derivatives(self, s: Float[np.ndarray, " point"], order: int) -> Float[np.ndarray, "point derivative joint"]:
        """Return positions and derivatives by s."""
        laws = list(self.laws.values())

        def block(some: np.ndarray) -> np.ndarray:
            return np.moveaxis(np.asarray(law_derivatives(laws, jnp.asarray(s[some]), order)), -1, 0)

        return in_chunks(block, len(s), (BLOCK,), axis=0)  # always as many at once, so that all is compiled once
