"""Frontal elimination, body by body, of the saddle-point matrix of constrained motion.

The multiplier of each row is assigned to one of the bodies of the row. The equations of motion of a large mechanism
then go through the same fronts as its Jacobian: the columns of a body are its coordinates and the assigned
multipliers, and its rows are its force balance and the assigned constraint rows. Bodies with fewer multipliers than
others are padded with zeros.
"""

import itertools
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jounce.base.modules import Module
from jounce.base.shapes import Numbers
from jounce.dynamics.forward.saddle_point import BodyMatrices
from jounce.linear_algebra.frontal import FrontalFactor
from jounce.linear_algebra.frontal_inverse import FrontalInverse, InversePlan
from jounce.linear_algebra.fronts import Fronts
from jounce.linear_algebra.pattern import Pattern

FRONT_COST = 20.0  # of an operation in fronts over one in dense elimination, as measured for one run
MOST_NEIGHBORS = 16  # of a body; rows with more would be too long

Unknowns = Float[Numbers, "size batch"]


class SaddleFronts(Module):
    """Plan of the frontal elimination of a saddle-point matrix.

    Attributes
    ----------
    plan : InversePlan
        Plan for the padded matrix, whose entries are those of the mass matrices, of the Jacobian, and one.
    positions : array of int, shape (size,)
        Position of each unknown, the coordinates first, and of its equation in the padded matrix.
    unknowns : array of int, shape (rows of the padded matrix,)
        The unknown at each position of the padded matrix; one beyond the last for padding.
    rows : array of int, shape (entries,)
        Row of each entry of the Jacobian; arbitrary for entries of the ground.
    """

    plan: InversePlan
    positions: Int[Numbers, " size"]
    unknowns: Int[Numbers, " row"]
    rows: Int[Numbers, " entry"]

    @property
    def fronts(self) -> Fronts:
        """Fronts of the padded matrix."""
        return self.plan.fronts

    @classmethod
    def of(cls, pattern: Pattern) -> "SaddleFronts | None":
        """Return the cached plan for a pattern of the Jacobian; None if dense elimination is less work."""
        arrays = (np.asarray(pattern.bodies), np.asarray(pattern.entry_indices))
        key = tuple((x.shape, x.dtype.str, x.tobytes()) for x in arrays)
        return _planned(key, pattern.body_count, pattern.entry_count, FRONT_COST)

    @classmethod
    def planned(cls, pattern: Pattern) -> "SaddleFronts | None":
        """Return a new plan for a pattern of the Jacobian; None if dense elimination is less work."""
        size, width, count = sum(pattern.shape), pattern.width, pattern.body_count
        bodies, positions = np.asarray(pattern.bodies), np.asarray(pattern.entry_indices)
        owners = _owners(bodies.tolist(), count)
        if not owners:
            return None
        max_owned = int(np.bincount(owners, minlength=count).max())
        stride = width + max_owned
        if FRONT_COST * count * stride * (3 * stride) * (2 * stride) >= size**3:  # no front is smaller in a chain
            return None
        owned = np.array(owners, int) * stride + width + _ranks(owners)
        entries = _meeting(pattern, owned, stride)
        if max(len(by_body) for by_body in entries) > MOST_NEIGHBORS:
            return None
        fronts = Fronts.of(_as_pattern(entries, count, stride, width * width * count + pattern.entry_count + 1))
        number, height, wide = fronts.shape
        if FRONT_COST * number * stride * height * wide >= size**3:
            return None
        rows = np.zeros(pattern.entry_count + 1, np.int32)
        rows[positions] = np.arange(len(bodies))[:, None, None]
        coordinates = (np.arange(count)[:, None] * stride + np.arange(width)).ravel()
        unknown_positions = np.concatenate([coordinates, owned]).astype(np.int32)
        unknowns = np.full(count * stride, size, np.int32)
        unknowns[unknown_positions] = np.arange(size)
        return cls(InversePlan.of(fronts), unknown_positions, unknowns, rows[:-1])

    def factored(
        self,
        masses: BodyMatrices,
        entries: Float[Numbers, "entry batch"],
        scale: Float[Numbers, " coordinate"],
        row_scale: Float[Numbers, "row 1"],
    ) -> "SaddleFactor":
        """Return the factors for unscaled mass matrices of all bodies and entries of the Jacobian."""
        masses = masses * (scale[:, None] * scale[None])[:, :, None, None]
        lanes = entries.shape[-1]
        flat = jnp.broadcast_to(masses, (*masses.shape[:-1], lanes)).reshape(-1, lanes)
        values = jnp.concatenate([flat, entries * row_scale[self.rows], jnp.ones((1, lanes))])
        return SaddleFactor(FrontalFactor.of(self.fronts, values, jnp.ones((self.fronts.row_count, 1))), self)

    def blank(self, lanes: int) -> "SaddleFactor":
        """Return a placeholder for the factors of a batch, as the initial value of a loop."""
        return SaddleFactor(FrontalFactor.blank(self.fronts, lanes), self)

    def spread(self, right: Unknowns) -> Float[Numbers, "row batch"]:
        """Return right-hand sides, in the order of coordinates and rows, in the order of the padded matrix."""
        right = jnp.concatenate([right, jnp.zeros((1, right.shape[-1]))])
        return right.at[self.unknowns].get(mode="promise_in_bounds")


class SaddleFactor(Module):
    """The factors of a batch of saddle-point matrices."""

    factor: FrontalFactor
    saddle: SaddleFronts

    def solve(self, right: Unknowns) -> Unknowns:
        """Return the solutions for right-hand sides in the order of coordinates and rows."""
        return self.factor.solve(self.saddle.spread(right))[self.saddle.positions]

    def inverse(self) -> Float[Numbers, "size size batch"]:
        """Return the dense inverse matrices."""
        size = len(self.saddle.positions)

        def lane_inverse(lane: Any) -> Any:
            arrays = jax.tree.map(lambda x: jax.lax.dynamic_slice_in_dim(x, lane, 1, x.ndim - 1), self.factor.arrays)
            return SaddleFactor(FrontalFactor(self.factor.fronts, *arrays), self.saddle).solve(jnp.eye(size))

        return jnp.moveaxis(jax.lax.map(lane_inverse, jnp.arange(self.factor.inverted.shape[-1])), 0, -1)

    def inverted(self) -> "SaddleInverse":
        """Return the inverse for many right-hand sides that arrive one after the other."""
        return SaddleInverse(FrontalInverse.of(self.saddle.plan, self.factor), self.saddle)


class SaddleInverse(Module):
    """The inverses of a batch of saddle-point matrices, in memory linear in the number of bodies."""

    inverse: FrontalInverse
    saddle: SaddleFronts

    def solve(self, right: Unknowns) -> Unknowns:
        """Return the solutions for right-hand sides in the order of coordinates and rows."""
        return self.inverse.solve(self.saddle.spread(right))[self.saddle.positions]

    def responses(self, columns: int) -> tuple[Float[Numbers, "column batch"], Float[Numbers, " batch"]]:
        """Return upper bounds of the largest response to a force on each coordinate, and to a gap of the rows.

        The inverse is positive semidefinite on the coordinates and negative semidefinite on the rows. No entry of a
        column therefore exceeds the root of the product of its diagonal entry and the largest diagonal entry.
        """
        diagonal = jnp.abs(self.inverse.diagonal()[self.saddle.positions])
        forces = diagonal[:columns]
        max_force = jnp.max(forces, axis=0, keepdims=True)
        return jnp.sqrt(forces * max_force), jnp.max(diagonal[columns:], axis=0, initial=0.0)


@lru_cache(maxsize=100)
def _planned(
    key: tuple[tuple[tuple[int, ...], str, bytes], ...], body_count: int, entry_count: int, _: float
) -> SaddleFronts | None:
    """Return the plan for a pattern given by its arrays as bytes."""
    bodies, positions = (np.frombuffer(data, kind).reshape(shape) for shape, kind, data in key)
    fronts = SaddleFronts.planned(Pattern(bodies, positions, body_count, entry_count))
    for array in jax.tree.leaves(fronts):
        array.setflags(write=False)  # many equations share it
    return fronts


Meeting = list[dict[int, dict[int, int]]]
"""For each row, the bodies that it touches, and for each their columns with the indices of the entries."""


def _meeting(pattern: Pattern, owned: Int[np.ndarray, " row"], stride: int) -> Meeting:
    """Return the rows of the padded matrix; its entries are those of the masses, of the Jacobian, and one.

    Parameters
    ----------
    pattern : Pattern
        Pattern of the Jacobian.
    owned : array of int, shape (rows,)
        Position of each multiplier and of its row.
    stride : int
        Number of columns of a body, with its multipliers.
    """
    width, count = pattern.width, pattern.body_count
    mass = width * width * count
    entries: Meeting = [{k // stride: {k % stride: mass + pattern.entry_count}} for k in range(count * stride)]
    for body, i in itertools.product(range(count), range(width)):
        entries[body * stride + i][body] = {j: (i * width + j) * count + body for j in range(width)}
    rows = zip(
        np.asarray(pattern.bodies).tolist(), np.asarray(pattern.entry_indices).tolist(), owned.tolist(), strict=True
    )
    for touched, columns, multiplier in rows:
        entries[multiplier] = {}
        for body, block in zip(touched, columns, strict=True):
            if body < count:
                entries[multiplier][body] = {i: mass + position for i, position in enumerate(block)}
                for i, position in enumerate(block):
                    entries[body * stride + i].setdefault(multiplier // stride, {})[multiplier % stride] = (
                        mass + position
                    )
    return entries


def _as_pattern(entries: Meeting, count: int, stride: int, nothing: int) -> Pattern:
    """Return the pattern of the padded matrix; `nothing` is the number of entries."""
    slots = max(map(len, entries))
    bodies = np.full((len(entries), slots), count, np.int32)
    positions = np.full((len(entries), slots, stride), nothing, np.int32)
    for row, by_body in enumerate(entries):
        for slot, (body, columns) in enumerate(by_body.items()):
            bodies[row, slot] = body
            positions[row, slot, list(columns)] = list(columns.values())
    return Pattern(bodies, positions, count, nothing)


def _owners(bodies: Sequence[Sequence[int]], count: int) -> list[int]:
    """Return the body that the multiplier of each row is assigned to: that with the fewest multipliers so far."""
    load, owners = [0] * count, []
    for touched in bodies:
        owner = min((body for body in touched if body < count), key=load.__getitem__)
        load[owner] += 1
        owners.append(owner)
    return owners


def _ranks(owners: Sequence[int]) -> Int[np.ndarray, " row"]:
    """Return for each row the number of earlier rows with the same owner."""
    counts: dict[int, int] = {}
    ranks = []
    for owner in owners:
        ranks.append(counts.get(owner, 0))
        counts[owner] = ranks[-1] + 1
    return np.array(ranks, int)
