"""Array shapes: selection of bodies along the axis before the batch, and alignment of constants with batch axes."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers, real_or_traced
from jounce.errors import JounceError
from jounce.jet import Jet
from jounce.jet.algebra import JetLike


def each_jet(function: Callable[[Jet], Any], tree: Any) -> Any:
    """Apply a function to the jets of a pose, or of another tree of jets."""
    return jax.tree.map(function, tree, is_leaf=lambda x: isinstance(x, Jet))


def take_bodies(jet: Jet, bodies: tuple[int, ...]) -> Jet:
    """Return the jet of given bodies, in that order, from one of shape (..., bodies, batch).

    The ground alone is a constant, so that nothing is computed with its derivatives.
    """
    if any(bodies):
        return jet.map(lambda c: _taken(c, bodies))
    return Jet.constant(_taken(jet.coefficients[0], bodies), jet.order)


def _taken(array: Float[Numbers, "*components bodies batch"], bodies: tuple[int, ...]) -> Any:
    """Select bodies by slices if indices are equal or evenly spaced, since XLA fuses slices, but not a gather."""
    first, *more_bodies = bodies
    stride = more_bodies[0] - first if more_bodies else 1
    if len(set(bodies)) == 1:
        single = jax.lax.slice_in_dim(array, first, first + 1, axis=jnp.ndim(array) - 2)
        return jnp.broadcast_to(single, (*single.shape[:-2], len(bodies), single.shape[-1]))
    if stride > 0 and bodies == tuple(range(first, bodies[-1] + 1, stride)):
        return jax.lax.slice_in_dim(array, first, bodies[-1] + 1, stride, axis=jnp.ndim(array) - 2)
    return jnp.asarray(array).at[..., np.array(bodies), :].get(mode="promise_in_bounds")


def body_vector(local: JetLike, batch_axes: int) -> Any:
    """Return a body vector with the batch axes of a pose appended to its components; a jet unchanged."""
    if isinstance(local, Jet):
        return local
    local = real_or_traced("vector", local, JounceError)
    if not isinstance(local, jax.Array | np.ndarray):
        local = np.asarray(local, float)
    missing_axes = 1 + batch_axes - local.ndim
    return local.reshape(*local.shape, *[1] * missing_axes) if missing_axes > 0 else local
