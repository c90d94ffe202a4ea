"""The matrix of constrained motion, ``[[M, Phi_q^T], [Phi_q, 0]]``, and how its columns belong to the bodies.

Coordinates of bodies are shifts and turns, those of one body after those of another; the ground has none.
"""

import jax.numpy as jnp
from jaxtyping import Float

from jounce.shapes import Numbers

ByBody = Float[Numbers, "coordinate body batch"]
"""One number for each coordinate of each body."""

BodyMatrices = Float[Numbers, "coordinate coordinate body batch"]
MassMatrix = Float[Numbers, "column column #batch"]
Jacobian = Float[Numbers, "row column batch"]
Column = Float[Numbers, "column batch"]


def saddle_point(mass: MassMatrix, jacobian: Jacobian) -> Float[Numbers, "size size batch"]:
    """Return the mass matrix bordered by the Jacobian and its transpose."""
    rows, columns, lanes = jacobian.shape
    mass = jnp.broadcast_to(mass, (columns, columns, lanes))
    above = jnp.concatenate([mass, jnp.swapaxes(jacobian, 0, 1)], axis=1)
    below = jnp.concatenate([jacobian, jnp.zeros((rows, rows, lanes))], axis=1)
    return jnp.concatenate([above, below])


def block_diagonal(blocks: BodyMatrices, scale: Float[Numbers, " coordinate"]) -> MassMatrix:
    """Return the mass matrix of all bodies from those of each, both its rows and its columns scaled."""
    size, _, bodies, lanes = blocks.shape
    blocks = blocks * (scale[:, None] * scale[None])[:, :, None, None]
    whole = jnp.eye(bodies)[:, None, :, None, None] * jnp.moveaxis(blocks, 2, 0)[:, :, None]
    return whole.reshape(bodies * size, bodies * size, lanes)


def as_column(forces: ByBody, scale: Float[Numbers, " coordinate"]) -> Column:
    """Return what acts on the coordinates of bodies as a scaled column."""
    return jnp.swapaxes(forces * scale[:, None, None], 0, 1).reshape(-1, forces.shape[-1])


def by_body(column: Column, scale: Float[Numbers, " coordinate"]) -> ByBody:
    """Return a scaled column of unknown coordinates by body."""
    return jnp.swapaxes(column.reshape(-1, len(scale), column.shape[-1]), 0, 1) * scale[:, None, None]
