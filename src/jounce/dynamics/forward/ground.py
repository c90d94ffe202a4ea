"""Arrays of all bodies from those of the moving bodies: the ground comes first."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers


def with_ground(
    moving: Float[Numbers, "*components body batch"], of_ground: float | np.ndarray = 0.0
) -> Float[Numbers, "*components body+1 batch"]:
    """Return an array of all bodies, with `of_ground` first; a NumPy array if `moving` is one."""
    array: Any = np if isinstance(moving, np.ndarray) else jnp
    ground = array.broadcast_to(of_ground, (*moving.shape[:-2], 1, moving.shape[-1]))
    return array.concatenate([ground, moving], axis=-2)


def turns_with_ground(moving: Float[Numbers, "*orders 4 body batch"]) -> Float[Numbers, "*orders 4 body+1 batch"]:
    """Return Euler parameters, or their series, of all bodies, with the identity for the ground first."""
    components = moving.shape[:-2]
    return with_ground(moving, np.eye(1, math.prod(components)).reshape(*components, 1, 1))
