"""Sums along the branches of a tree: outward from the base to each body, and inward over the bodies that it carries."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.tree_scan import fill_slots, read_slot, write_slot

BodyVectors = Float[Numbers, "component body batch"]
"""One vector for each moving body."""
BaseVector = Float[Numbers, "component batch"]


def sums_at_parents(tree: Tree, values: BodyVectors, base: BaseVector) -> BodyVectors:
    """Return, for each body, the sum over the base and all bodies from it to the parent.

    Only sums and copies occur, so that `jet.programs.series` runs the same loop over the bodies at every order.
    """

    def outward(state: Any, entry: Any) -> tuple[Any, Any]:
        slot, parent_slot, value = entry
        parent_sum = read_slot(tree, state, parent_slot)
        return write_slot(tree, state, slot, parent_sum + value), parent_sum

    bodies = (jnp.asarray(tree.slot), jnp.asarray(tree.parent_slot), jnp.moveaxis(values, 1, 0))
    _, sums = jax.lax.scan(outward, fill_slots(tree, base), bodies)
    return jnp.moveaxis(sums, 0, 1)


def totals(tree: Tree, values: BodyVectors, to_parent: BodyVectors | None = None) -> tuple[BodyVectors, BaseVector]:
    """Return the sum over each body and all bodies that it carries, and the sum over those that the base carries.

    Parameters
    ----------
    tree : Tree
        Arrays of the robot.
    values : array of shape (components, bodies, batch)
        Contribution of each body.
    to_parent : array, optional
        Contribution of each body to its parent in addition to its total, of the same shape.
    """
    rows = (values,) if to_parent is None else (values, to_parent)

    def inward(state: Any, entry: Any) -> tuple[Any, Any]:
        slot, parent_slot, value, *parent_value = entry
        from_children = read_slot(tree, state, slot)
        total = value + from_children
        passed_on = total + parent_value[0] if parent_value else total
        if tree.shape.slots > 1:
            state = write_slot(tree, state, slot, jnp.zeros_like(from_children))
            passed_on = passed_on + read_slot(tree, state, parent_slot)
        return write_slot(tree, state, parent_slot, passed_on), total

    bodies = (jnp.asarray(tree.slot), jnp.asarray(tree.parent_slot), *(jnp.moveaxis(x, 1, 0) for x in rows))
    nothing = jnp.zeros((values.shape[0], values.shape[2]))
    state, sums = jax.lax.scan(inward, fill_slots(tree, nothing), bodies, reverse=True)
    return jnp.moveaxis(sums, 0, 1), state if tree.shape.slots == 1 else state[0]
