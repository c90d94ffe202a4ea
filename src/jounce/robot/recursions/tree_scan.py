"""The scan of a tree of bodies: states passed from parents to children, and values from coordinates to joints."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.jet.algebra import total
from jounce.robot.model.tree import Tree

Series = Float[Numbers, "order coordinate batch"]
"""Taylor coefficients of the coordinates of a robot, or of values for each coordinate."""

BodySeries = Float[Numbers, "order body batch"]
"""Taylor coefficients of one number for each moving body, or for its joint."""


def joint_coordinates(tree: Tree, q: Series) -> BodySeries:
    """Return the coordinates of the joints of the bodies."""
    if tree.shape.direct:
        return q
    q = at_joints(tree, q)
    return jnp.concatenate([q[:1] + jnp.asarray(tree.offset)[None, :, None], q[1:]])


def at_joints(tree: Tree, values: Float[Numbers, "*leading coordinate batch"]) -> Float[Numbers, "*leading body batch"]:
    """Return changes of the joints of the bodies, such as rates, from those of the coordinates."""
    if tree.shape.direct:
        return values
    return total(jnp.take(values, index, axis=-2) * multiplier for index, multiplier in _followed(tree, values.ndim))


def to_coordinates(
    tree: Tree, forces: Float[Numbers, "*leading body batch"]
) -> Float[Numbers, "*leading coordinate batch"]:
    """Return generalized forces from joint forces of the bodies."""
    if tree.shape.direct:
        return forces
    coordinate_forces = jnp.zeros((*forces.shape[:-2], tree.shape.coordinates, forces.shape[-1]))
    for index, multiplier in _followed(tree, forces.ndim):
        coordinate_forces = coordinate_forces.at[..., index, :].add(forces * multiplier)
    return coordinate_forces


def _followed(tree: Tree, dimensions: int) -> Iterator[tuple[Any, Any]]:
    """Yield the first coordinates that joints follow and their multipliers, then the second, and so on."""
    shape = (*(1,) * (dimensions - 2), -1, 1)
    for index, multiplier in zip(jnp.asarray(tree.coordinate), jnp.asarray(tree.multiplier), strict=True):
        yield index, jnp.reshape(multiplier, shape)


def entries(tree: Tree) -> Tree:
    """Return the arrays with one entry for each body, as a scan needs them."""
    fields = ("armature", "damping", "friction", "friction_skew", "tendons", "balls", "gravity", "ancestors")
    fields += ("lift", "lift_moment", "coordinate", "multiplier")
    return dataclasses.replace(jax.tree.map(jnp.asarray, tree), **dict.fromkeys(fields))


def fill_slots(tree: Tree, state: Any) -> Any:
    """Return the places for states of parents, all with a given state."""
    if tree.shape.slots == 1:
        return state
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (tree.shape.slots, *x.shape)), state)


def read_slot(tree: Tree, state: Any, slot: Any) -> Any:
    """Return the state in a place; a chain has only one place."""
    if tree.shape.slots == 1:
        return state
    return jax.tree.map(lambda x: jax.lax.dynamic_index_in_dim(x, slot, keepdims=False), state)


def write_slot(tree: Tree, state: Any, slot: Any, value: Any) -> Any:
    """Return the places with a new state in one place."""
    if tree.shape.slots == 1:
        return value
    return jax.tree.map(lambda x, y: jax.lax.dynamic_update_index_in_dim(x, y, slot, 0), state, value)


def of_one_body(value: Any, body: Any, count: int) -> Any:
    """Return values of one body as an array for all bodies along the second axis, zero for other bodies.

    The function compares indices, because machine code has no indexing at places unknown in advance.
    """
    is_body = jnp.reshape(jnp.arange(count) == body, (1, count) + (1,) * (value.ndim - 1))
    return jnp.where(is_body, value[:, None], 0.0)


def materialised(value: Any) -> Any:
    """Return a value that XLA stores instead of computing it again for every use, which halves the time."""
    return jax.lax.optimization_barrier(value)
