"""The factors of all products of series side by side, one row an order, so that one loop sums all products."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jounce.jet.coefficients import total

BLOCK = 8  # terms of a sum taken at once; a row that is made for certain zeros has some times as many numbers
LEAST_ROW = 40  # numbers of such a row: machine code adds those of a shorter one by one


class ProductHistory:
    """Coefficients known so far of what is multiplied.

    Parameters
    ----------
    shapes : sequence of tuple
        Of the factors.
    pairs : sequence of tuple
        For each product, the places of its factors, and whether coefficients of the first count by their order.
    order : int
        Highest that will be requested.
    still : sequence of array of bool, optional
        Which entries of the factors do not change in time: there is no sum of their products.
    reversible, unrolled : bool, default False
        As for `Recursion`.

    Attributes
    ----------
    begun
        The history before the first order, a pytree of arrays.
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
        self.begun: Any = ((), ()) if unrolled else tuple(jnp.zeros((size, self._width)) for size in sizes)

    def noted(self, history: Any, k: Any, newest: Sequence[Any]) -> Any:
        """Return the history with the coefficients of order k of all factors.

        They go there in one piece a side, so that what is compiled stays small; a few are put in their places at once.
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
        """Return the sums over the products of coefficients of orders 1 to k - 1, those of order k left out."""
        left, right = history

        def block(i: Any, products: Any) -> Any:
            first = 1 + i * BLOCK
            a = jax.lax.dynamic_slice_in_dim(left, first, BLOCK)
            b = jax.lax.dynamic_slice_in_dim(right, k - first + 1, BLOCK)
            return products + total(a[j] * b[BLOCK - 1 - j] for j in range(BLOCK))

        count = -(-self._order // BLOCK) if self._reversible else (k + BLOCK - 2) // BLOCK  # what is beyond is zero
        if self._unrolled:
            products = total(left[j - 1] * right[k - j - 1] for j in range(1, k)) if k > 1 else jnp.zeros(self._width)
        else:
            products = jax.lax.fori_loop(0, count, block, jnp.zeros(self._width))
        sums, place = [], 0
        for (which, _, weighted), runs in zip(self._pairs, self._runs, strict=True):
            part, place = runs.spread(products[place : place + runs.count]), place + runs.count
            part = part.reshape(self._shapes[which])
            sums.append(part / k if weighted else part)
        return sums


class _Runs(NamedTuple):
    """Parts of a row of numbers: those from one place to another."""

    size: int
    ends: tuple[tuple[int, int], ...] | None = None  # of each part; all numbers if None

    @classmethod
    def of(cls, mask: np.ndarray) -> "_Runs":
        """Return those of the numbers of an array for which a mask is true."""
        steps = np.flatnonzero(np.diff(mask.ravel().astype(int), prepend=0, append=0)).tolist()
        return cls(mask.size, tuple(zip(steps[::2], steps[1::2], strict=True)))

    @property
    def count(self) -> int:
        """How many numbers there are."""
        return self.size if self.ends is None else sum(stop - start for start, stop in self.ends)

    def cut(self, row: Any) -> list[Any]:
        """Return the parts of a row."""
        return [row] if self.ends is None else [row[start:stop] for start, stop in self.ends]

    def spread(self, parts: Any) -> Any:
        """Return a row with its parts given, one after another, and zero elsewhere."""
        if self.ends is None:
            return parts
        pieces, before, place = [jnp.zeros(0)], 0, 0
        for start, stop in self.ends:
            pieces += [jnp.zeros(start - before), parts[place : place + stop - start]]
            before, place = stop, place + stop - start
        return jnp.concatenate([piece for piece in (*pieces, jnp.zeros(self.size - before)) if piece.size])
