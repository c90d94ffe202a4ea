"""A tree of arrays made from rows of parameters: leaves that depend on them have one entry per row, last."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Float, Int

Lanes = slice | Int[np.ndarray, " lane"]


@dataclasses.dataclass(frozen=True)
class VariedTree:
    """A tree with leaves that differ from lane to lane.

    Attributes
    ----------
    structure : PyTreeDef
        Structure of the tree.
    fixed : sequence
        Leaves that are the same in all lanes; None in the places of the others.
    varied : dict of int to array of shape (..., lanes)
        Leaves that differ, by index.
    """

    structure: Any
    fixed: Sequence[Any]
    varied: dict[int, np.ndarray]

    @classmethod
    def traced(
        cls, make: Callable[[Any], Any], rows: Float[np.ndarray, "lane parameter"], like: Any = None
    ) -> "VariedTree":
        """Return the trees that a function makes of rows, all in one pass; leaves lose their last axis of length one.

        Parameters
        ----------
        make : callable
            Makes a tree of one row, traced by JAX.
        rows : array of shape (lanes, parameters)
            Rows of parameter values.
        like : pytree, optional
            Tree of the same structure that provides the leaves that do not depend on the row.
        """
        flattened: list[Any] = []

        def leaves_of_row(row: Any) -> list[Any]:
            flattened[:] = jax.tree.flatten(make(row))
            return [leaf for leaf in flattened[0] if isinstance(leaf, Tracer)]

        values = [np.asarray(value)[..., 0, :] for value in jax.vmap(leaves_of_row, out_axes=-1)(rows)]
        leaves, structure = flattened
        indices = [k for k, leaf in enumerate(leaves) if isinstance(leaf, Tracer)]
        if like is not None:
            leaves, structure = jax.tree.flatten(like)
        return cls._of(structure, leaves, dict(zip(indices, values, strict=True)))

    @classmethod
    def joined(cls, trees: Sequence[Any], like: Any = None) -> "VariedTree":
        """Return trees that were made one by one; `like` as in `traced`, by default the first of them."""
        columns = [[np.asarray(leaf, float) for leaf in c] for c in zip(*map(jax.tree.leaves, trees), strict=True)]
        differs = [not all(np.array_equal(leaf, column[0]) for leaf in column) for column in columns]
        varied = {k: np.concatenate(columns[k], axis=-1) for k, differ in enumerate(differs) if differ}
        leaves, structure = jax.tree.flatten(trees[0] if like is None else like)
        return cls._of(structure, leaves, varied)

    @classmethod
    def _of(cls, structure: Any, leaves: Sequence[Any], varied: dict[int, np.ndarray]) -> "VariedTree":
        return cls(structure, [None if k in varied else leaf for k, leaf in enumerate(leaves)], varied)

    def own(self, lanes: Lanes) -> dict[int, np.ndarray]:
        """Return the leaves that differ between lanes, by index, in the form of `of_design`."""
        return {k: value[..., lanes] for k, value in self.varied.items()}

    def at(self, lanes: Lanes) -> Any:
        """Return the tree with the leaves of some lanes."""
        values = self.own(lanes)
        return jax.tree.unflatten(self.structure, [values.get(k, leaf) for k, leaf in enumerate(self.fixed)])
