"""The piece of a piecewise law that applies at an instant."""

import jax.numpy as jnp
from jaxtyping import Float, Int

from jounce.base.shapes import Numbers


def last_begun(starts: Float[Numbers, " piece"], instants: Float[Numbers, "*batch"]) -> Int[Numbers, "*batch"]:
    """Return the last piece that has begun at each instant; the first piece before it begins.

    The bisection uses operations that machine code supports, unlike `jax.numpy.searchsorted`.

    Parameters
    ----------
    starts : array of shape (pieces,)
        Start of each piece, nondecreasing.
    instants : array of shape (...)

    Examples
    --------
    >>> import numpy as np
    >>> last_begun(np.array([0.0, 1.0, 1.0, 3.0]), np.array([-1.0, 0.5, 1.0, 9.0])).tolist()
    [0, 0, 2, 3]
    """
    starts, last = jnp.asarray(starts), len(starts) - 1
    index, step = jnp.zeros(jnp.shape(instants), int), 1 << last.bit_length()
    while step := step // 2:
        further = jnp.minimum(index + step, last)
        index = jnp.where(starts.at[further].get(mode="promise_in_bounds") <= instants, further, index)
    return index
