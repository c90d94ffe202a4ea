"""Factors of all products of series side by side, one row per order, so that a single loop sums all products."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jounce.jet.coefficients import total

BLOCK = 8  # terms of a sum per iteration; a row with its constant entries left out is padded to a multiple
LEAST_ROW = 40  # numbers of such a row: machine code adds shorter rows number by number


class ProductHistory:
    """History of the coefficients of all factors of products.

    Parameters
    ----------
    shapes : sequence of tuple
        Shapes of the factors.
    pairs : sequence of tuple
        For each product, the indices of its factors, and whether coefficients of the first are weighted by their order.
    order : int
        Highest order that will be requested.
    still : sequence of array of bool, optional
        Entries of the factors that are constant in time; their products need no sum.
    reversible, unrolled : bool, default False
        As in `Recursion`.

    Attributes
    ----------
    initial
        History before the first order, a pytree of arrays.
    """

    def __init__(
        self,
        shapes: Sequence[tuple[int, ...]],
        pairs: Sequence[tuple[int, int, bool]],
        order: int,
        still: Sequence[np.ndarray] | None = None,
        *,
        reversible: bool = False,
        unrolled: bool = False,
    ):
        self._shapes, self._pairs, self._order = shapes, pairs, order
        self._reversible, self._unrolled, self._in_parts = reversible, unrolled, still is not None and not unrolled
        if still is None or unrolled:
            self._runs = [_Runs(math.prod(shapes[a])) for a, _, _ in pairs]
        else:
            self._runs = [_Runs.of(~(still[a] | still[b])) for a, b, _ in pairs]
        self._width = sum(runs.count for runs in self._runs)
        if self._in_parts:
            self._width = max(LEAST_ROW, -(-self._width // BLOCK) * BLOCK)
        sizes = [order + BLOCK, order + 2 * BLOCK]
        self.initial: Any = ((), ()) if unrolled else tuple(jnp.zeros((size, self._width)) for size in sizes)

    def noted(self, history: Any, k: Any, newest: Sequence[Any]) -> Any:
        """Return the history with the coefficients of order k of all factors.

        They are written as one piece per side, which keeps the compiled code small; with constant entries, piece by
        piece.
        """
        if not self._pairs:
            return history
        numbers, result = [jnp.ravel(c) for c in newest], []
        for side, rows in enumerate(history):
            parts = []
            for pair, runs in zip(self._pairs, self._runs, strict=True):
                of_pair = runs.cut(numbers[pair[side]])
                parts += [k * x for x in of_pair] if pair[2] and side == 0 else of_pair
            if not self._in_parts:
                parts = [jnp.concatenate(parts)]
            if self._unrolled:
                result.append((*rows, *parts))
                continue
            place = 0
            for part in parts:
                rows = jax.lax.dynamic_update_slice(rows, part[None], (k + side * BLOCK, place))
                place += len(part)
            result.append(rows)
        return tuple(result)

    def sums(self, history: Any, k: Any) -> list[Any]:
        """Return, for each product, the sum over the products of coefficients of orders 1 to k - 1."""
        left, right = history

        def block(i: Any, products: Any) -> Any:
            first = 1 + i * BLOCK
            a = jax.lax.dynamic_slice_in_dim(left, first, BLOCK)
            b = jax.lax.dynamic_slice_in_dim(right, k - first + 1, BLOCK)
            return products + total(a[j] * b[BLOCK - 1 - j] for j in range(BLOCK))

        count = -(-self._order // BLOCK) if self._reversible else (k + BLOCK - 2) // BLOCK  # terms beyond are zero
        if self._unrolled:
            products = total(left[j - 1] * right[k - j - 1] for j in range(1, k)) if k > 1 else jnp.zeros(self._width)
        else:
            products = jax.lax.fori_loop(0, count, block, jnp.zeros(self._width))
        sums, place = [], 0
        for (kind, _, weighted), runs in zip(self._pairs, self._runs, strict=True):
            part, place = runs.spread(products[place : place + runs.count]), place + runs.count
            part = part.reshape(self._shapes[kind])
            sums.append(part / k if weighted else part)
        return sums


class _Runs(NamedTuple):
    """Contiguous parts of a row of numbers."""

    size: int
    ends: tuple[tuple[int, int], ...] | None = None  # start and stop of each part; None selects all numbers

    @classmethod
    def of(cls, mask: np.ndarray) -> "_Runs":
        """Return the parts of an array in which a mask is true."""
        steps = np.flatnonzero(np.diff(mask.ravel().astype(int), prepend=0, append=0)).tolist()
        return cls(mask.size, tuple(zip(steps[::2], steps[1::2], strict=True)))

    @property
    def count(self) -> int:
        """Number of numbers in the parts."""
        return self.size if self.ends is None else sum(stop - start for start, stop in self.ends)

    def cut(self, row: Any) -> list[Any]:
        """Return the parts of a row."""
        return [row] if self.ends is None else [row[start:stop] for start, stop in self.ends]

    def spread(self, parts: Any) -> Any:
        """Return a row with given numbers in its parts and zeros elsewhere."""
        if self.ends is None:
            return parts
        pieces, before, place = [jnp.zeros(0)], 0, 0
        for start, stop in self.ends:
            pieces += [jnp.zeros(start - before), parts[place : place + stop - start]]
            before, place = stop, place + stop - start
        return jnp.concatenate([piece for piece in (*pieces, jnp.zeros(self.size - before)) if piece.size])
