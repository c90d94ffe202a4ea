"""Sparsity pattern of a Jacobian: a row touches two bodies, seldom three, however many there are."""

import math
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jounce.base.modules import Module, field
from jounce.base.shapes import Numbers


class Pattern(Module):
    """The bodies that each row of a matrix touches, and the indices of its entries in a list.

    Attributes
    ----------
    bodies : array of int, shape (rows, slots)
        Bodies that each row touches; the number of bodies fills unused slots.
    entry_indices : array of int, shape (rows, slots, width)
        Indices of the entries in the columns of these bodies; the number of entries where there are none.
    body_count, entry_count : int
        Number of bodies, and of entries.
    row_counts : tuple of int
        Number of rows per instance of each group.
    """

    bodies: Int[Numbers, "row slot"]
    entry_indices: Int[Numbers, "row slot width"]
    body_count: int = field(static=True)
    entry_count: int = field(static=True)
    row_counts: tuple[int, ...] = field(static=True, default=())

    @classmethod
    def of(cls, groups: Sequence[Any], row_counts: Sequence[int], width: int, body_count: int) -> "Pattern":
        """Return the pattern of the blocks of groups of joints and drivers, one after another.

        Parameters
        ----------
        groups : sequence of Group
            Groups with the bodies of their instances, the ground as 0.
        row_counts : sequence of int
            Number of rows per instance of each group.
        width : int
            Number of columns per body.
        body_count : int
            Number of bodies, without the ground.
        """
        blocks = [count * group.instances for count, group in zip(row_counts, groups, strict=True)]
        slot_counts = [len(group.moving_slots) for group in groups]
        entry_count = width * sum(map(math.prod, zip(blocks, slot_counts, strict=True)))
        bodies = np.full((sum(blocks), max(slot_counts, default=1)), body_count)
        entry_indices = np.full((*bodies.shape, width), entry_count)
        row = first = 0
        for block, count, group in zip(blocks, row_counts, groups, strict=True):
            block_rows = slice(row, row + block)
            for k, slot in enumerate(group.moving_slots):
                slot_bodies = np.tile(group.bodies[slot], count) - 1
                bodies[block_rows, k] = np.where(slot_bodies < 0, body_count, slot_bodies)
                indices = first + np.arange(width * block).reshape(width, block).T
                entry_indices[block_rows, k] = np.where(slot_bodies[:, None] < 0, entry_count, indices)
                first += width * block
            row += block
        return cls(bodies.astype(np.int32), entry_indices.astype(np.int32), body_count, entry_count, tuple(row_counts))

    @property
    def width(self) -> int:
        """Number of columns per body."""
        return self.entry_indices.shape[-1]

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows, and of columns."""
        return len(self.bodies), self.body_count * self.width

    def dense(self, entries: Float[Numbers, "entry batch"]) -> Float[Numbers, "row column batch"]:
        """Return the dense matrices with given entries."""
        bodies = np.arange(self.body_count, dtype=np.int32)[None, None, :, None]
        entry_indices = jnp.where(
            self.bodies[:, :, None, None] == bodies, self.entry_indices[:, :, None], self.entry_count
        )
        return _with_zero(entries)[jnp.min(entry_indices, axis=1).reshape(self.shape)]

    def product(
        self, entries: Float[Numbers, "entry #batch"], columns: Float[Numbers, "column batch"]
    ) -> Float[Numbers, "row batch"]:
        """Return the products of matrices with given entries and columns."""
        return jnp.sum(self.by_row(entries) * self.touched(columns), axis=(1, 2))

    def by_row(self, entries: Float[Numbers, "entry batch"]) -> Float[Numbers, "row slot width batch"]:
        """Return the entries of each row in the columns of each body that it touches."""
        return _with_zero(entries)[self.entry_indices]

    def touched(self, columns: Float[Numbers, "column batch"]) -> Float[Numbers, "row slot width batch"]:
        """Return the components of the bodies that each row touches."""
        by_body = jnp.reshape(columns, (self.body_count, self.width, -1))
        return by_body.at[self.bodies].get(mode="fill", fill_value=0.0)

    def summed(self, shares: Float[Numbers, "row slot width batch"]) -> Float[Numbers, "column batch"]:
        """Return the sums over all rows of the shares of each component: the transpose of `touched`."""
        sums = jnp.zeros((self.body_count, self.width, shares.shape[-1])).at[self.bodies].add(shares, mode="drop")
        return sums.reshape(self.shape[1], -1)

    def row_scale(self, entries: Float[Numbers, "entry batch"]) -> Float[Numbers, "row batch"]:
        """Return factors that scale the largest entry of each row to one; one if that entry is zero or not finite."""
        largest = jnp.max(jnp.abs(self.by_row(entries)), axis=(1, 2))
        return 1 / jnp.where((largest > 0) & jnp.isfinite(largest), largest, 1.0)


def _with_zero(entries: Float[Numbers, "entry batch"]) -> Float[Numbers, "entry+1 batch"]:
    return jnp.concatenate([entries, jnp.zeros((1, entries.shape[-1]))])
