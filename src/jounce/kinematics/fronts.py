"""Orthogonal elimination of large sparse matrices, body by body: a multifrontal QR factorisation, the batch last.

The rows of a Jacobian touch two bodies, seldom three, so that most of it is zero, and where is known before any number.
Bodies are eliminated one by one, those with the fewest neighbours first (George and Liu 1989, the evolution of the
minimum degree ordering algorithm). The front of a body holds the rows that touch it: its own, and those left over by
the fronts before; Householder reflections clear its columns, and the rows that are left touch its neighbours only
(Duff and Reid 1983; Davis 2011, algorithm 915). Nothing is chosen by the numbers, so that all lanes of a batch, and all
instants of a motion, go through one program, and all fronts through one scan of it: neither the program nor the time to
compile it grows with the number of bodies.
"""

import heapq
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np


class Fronts(eqx.Module):
    """Which rows and columns meet in which front; index arrays, that a program takes as input.

    Attributes
    ----------
    entries : array of int, shape (fronts, rows, columns)
        Which entry of the matrix stands there before the elimination; one beyond the last where there is none.
    rights : array of int, shape (fronts, rows)
        Which row of the matrix that is; one beyond the last where it is none.
    left_rows : array of int, shape (fronts, rows)
        Which row of all those that fronts leave over is taken in there; one beyond the last where there is none.
    left_columns : array of int, shape (fronts, rows, columns)
        Which column of that row stands there; one beyond the last where there is none.
    neighbours : array of int, shape (fronts, neighbours)
        Fronts of the bodies that the rest of the columns belong to; one beyond the last where there are fewer.
    of_body : array of int, shape (bodies,)
        The front of each body.
    row_count : int
        Rows of the matrix.
    width : int
        Columns of a body.
    """

    entries: Any
    rights: Any
    left_rows: Any
    left_columns: Any
    neighbours: Any
    of_body: Any
    row_count: int = eqx.field(static=True)
    width: int = eqx.field(static=True)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of fronts, and of rows and columns of each."""
        return self.entries.shape

    @classmethod
    def of(cls, bodies: np.ndarray, places: np.ndarray, body_count: int) -> "Fronts":
        """Plan the elimination from the pattern of a matrix.

        Parameters
        ----------
        bodies : array of int, shape (rows, slots)
            Bodies that each row touches, below zero where there are fewer.
        places : array of int, shape (rows, slots, width)
            Where the entries of the row in the columns of that body stand in the list of all entries.
        body_count : int
            Number of bodies.
        """
        rows, _, width = places.shape
        order, separators = _ordered([set(row[row >= 0].tolist()) for row in bodies], body_count)
        position = np.empty(body_count, int)
        position[order] = np.arange(body_count)
        held: list[list[tuple[int, int]]] = [[] for _ in order]  # rows of each front: (-1, row), or (front, left row)
        for row in range(rows):
            touched = bodies[row][bodies[row] >= 0]
            held[min(position[touched])].append((-1, row))
        for front in range(body_count):
            left = len(held[front]) - width
            if separators[front]:
                held[min(position[list(separators[front])])] += [(front, k) for k in range(max(left, 0))]
        height, beside = max(max(map(len, held)), width), max(map(len, separators))
        return cls._written(held, order, position, separators, bodies, places, height, beside)

    @classmethod
    def _written(cls, held, order, position, separators, bodies, places, height, beside) -> "Fronts":
        count, width = len(order), places.shape[-1]
        columns, entry_count, left_height = width * (1 + beside), int(places.max()) + 1, height - width
        entries = np.full((count, height, columns), entry_count, np.int32)
        rights = np.full((count, height), len(bodies), np.int32)
        left_rows = np.full((count, height), count * left_height, np.int32)
        left_columns = np.full((count, height, columns), width * beside, np.int32)
        neighbours = np.full((count, beside), count, np.int32)
        ordered = [sorted(position[list(s)]) if s else [] for s in separators]
        for front, members in enumerate(held):
            neighbours[front, : len(ordered[front])] = ordered[front]
            block = {p: k for k, p in enumerate([front, *ordered[front]])}
            for at, (source, row) in enumerate(members):
                if source < 0:
                    rights[front, at] = row
                    for slot, body in enumerate(bodies[row]):
                        if body >= 0:
                            first = block[position[body]] * width
                            entries[front, at, first : first + width] = places[row, slot]
                else:
                    left_rows[front, at] = source * left_height + row
                    for k, p in enumerate(ordered[source]):
                        first = block[p] * width
                        left_columns[front, at, first : first + width] = k * width + np.arange(width)
        return cls(entries, rights, left_rows, left_columns, neighbours, position.astype(np.int32), len(bodies), width)


def _ordered(touched: list[set[int]], count: int) -> tuple[np.ndarray, list[set[int]]]:
    """Return the bodies in the order of their elimination, and the neighbours that each has then."""
    beside: list[set[int]] = [set() for _ in range(count)]
    for members in touched:
        for body in members:
            beside[body] |= members
    for body, members in enumerate(beside):
        members.discard(body)
    waiting = [(len(members), body) for body, members in enumerate(beside)]
    heapq.heapify(waiting)
    order, separators, done = [], [], np.zeros(count, bool)
    while waiting:
        degree, body = heapq.heappop(waiting)
        if done[body] or degree != len(beside[body]):
            continue
        done[body] = True
        around = beside[body]
        order.append(body)
        separators.append(set(around))
        for other in around:
            beside[other] |= around
            beside[other] -= {other, body}
            heapq.heappush(waiting, (len(beside[other]), other))
    return np.array(order, int), separators


class FrontalFactor(eqx.Module):
    """A batch of matrices, factored front by front into reflections and triangles.

    Solutions are as good as substitution makes them, without refinement: reflections keep lengths. Where rows are more
    than columns the solution is that of least squares.
    """

    fronts: Fronts
    vectors: Any  # (fronts, width, rows, batch): the reflections of each front
    factors: Any  # (fronts, width, batch): two over their squares
    triangle: Any  # (fronts, width, columns, batch): finished rows
    inverted: Any  # (fronts, width, batch): inverse of the diagonal, infinite where singular

    @classmethod
    def of(cls, fronts: Fronts, entries: Any) -> "FrontalFactor":
        """Factor the matrices with these entries, shape (entries, batch)."""
        count, height, columns = fronts.shape
        width, lanes = fronts.width, entries.shape[-1]
        entries = jnp.concatenate([entries, jnp.zeros((1, lanes))])

        def step(left: Any, plan: Any) -> Any:
            front, own, rows, taken = plan
            known = left.reshape(count * (height - width), columns - width, lanes)
            inherited = known.at[rows[:, None], taken].get(mode="fill", fill_value=0.0)
            *found, rest = _eliminated(entries[own] + inherited, width)
            return _put(left, rest, front), tuple(found)

        left = jnp.zeros((count, height - width, columns - width, lanes))
        plans = (np.arange(count), fronts.entries, fronts.left_rows, fronts.left_columns)
        return cls(fronts, *jax.lax.scan(step, left, plans)[1])

    def solve(self, right: Any) -> Any:
        """Return the solutions, shape (columns, batch), for right-hand sides of shape (rows, batch)."""
        _, height, columns = self.fronts.shape
        width, lanes, plan = self.fronts.width, right.shape[-1], self.fronts
        right = jnp.concatenate([right, jnp.zeros((1, lanes))])

        def forward(left: Any, level: Any) -> Any:
            front, own, rows, vectors, factors = level
            y = right[own] + left.reshape(-1, lanes).at[rows].get(mode="fill", fill_value=0.0)
            y = _reflected(y, zip(vectors, factors, strict=True))
            return _put(left, y[width:], front), y[:width]

        def backward(known: Any, level: Any) -> Any:
            front, beside, triangle, inverted, y = level
            y = y - jnp.sum(triangle[:, width:] * known[beside].reshape(1, columns - width, lanes), axis=1)
            x: list[Any] = [None] * width
            for i in reversed(range(width)):
                x[i] = (y[i] - sum(triangle[i, j] * x[j] for j in range(i + 1, width))) * inverted[i]
            return _put(known, jnp.stack(x), front), None

        count = np.arange(len(plan.entries))
        left = jnp.zeros((len(count), height - width, lanes))
        _, y = jax.lax.scan(forward, left, (count, plan.rights, plan.left_rows, self.vectors, self.factors))
        known = jnp.zeros((len(count) + 1, width, lanes))
        levels = (count, plan.neighbours, self.triangle, self.inverted, y)
        known, _ = jax.lax.scan(backward, known, levels, reverse=True)
        return known[plan.of_body].reshape(-1, lanes)

    def solve_transposed(self, right: Any) -> Any:
        """Return the solutions with the transposed matrices, shape (rows, batch), of least norm where they are many."""
        _, height, columns = self.fronts.shape
        width, lanes, plan = self.fronts.width, right.shape[-1], self.fronts
        count = np.arange(len(plan.entries))
        blocks = jnp.asarray(right).reshape(len(count), width, lanes)
        order = jnp.argsort(plan.of_body)

        def forward(owed: Any, level: Any) -> Any:
            front, beside, body, triangle, inverted = level
            w = blocks[body] - owed[front]
            u: list[Any] = []
            for i in range(width):
                u.append((w[i] - sum(triangle[j, i] * u[j] for j in range(i))) * inverted[i])
            found = jnp.stack(u)
            share = jnp.sum(triangle[:, width:] * found[:, None], axis=0).reshape(-1, width, lanes)
            return owed.at[beside].add(share, mode="drop"), found

        owed = jnp.zeros((len(count), width, lanes))
        _, u = jax.lax.scan(forward, owed, (count, plan.neighbours, order, self.triangle, self.inverted))

        def backward(carry: Any, level: Any) -> Any:
            left, solution = carry
            front, own, rows, vectors, factors, top = level
            y = jnp.concatenate([top, left[front]])
            y = _reflected(y, zip(vectors[::-1], factors[::-1], strict=True))
            flat = left.reshape(-1, lanes).at[rows].set(y, mode="drop")
            return (flat.reshape(left.shape), solution.at[own].set(y, mode="drop")), None

        blank = jnp.zeros((len(count), height - width, lanes)), jnp.zeros((plan.row_count, lanes))
        levels = (count, plan.rights, plan.left_rows, self.vectors, self.factors, u)
        return jax.lax.scan(backward, blank, levels, reverse=True)[0][1]

    def pivot_ratio(self) -> Any:
        """Return the smallest pivot over the largest, shape (batch,): near zero at a singular position."""
        sizes = 1 / jnp.abs(self.inverted.reshape(-1, self.inverted.shape[-1]))
        return jnp.min(sizes, axis=0) / jnp.max(sizes, axis=0)

    def sign(self) -> Any:
        """Return the signs of the determinants, or all of them turned round, shape (batch,): 0 where singular.

        The order of rows and columns, which is the same for all matrices of a pattern, is not counted.
        """
        return jnp.prod(jnp.sign(jnp.where(jnp.isinf(self.inverted), 0.0, self.inverted)), axis=(0, 1))


def _put(whole: Any, part: Any, place: Any) -> Any:
    return jax.lax.dynamic_update_index_in_dim(whole, part, place, 0)


def _reflected(y: Any, reflections: Any) -> Any:
    for vector, factor in reflections:
        y = y - vector * (factor * jnp.sum(vector * y, axis=0))
        y = jax.lax.optimization_barrier(y)  # or XLA computes the chain again for each use
    return y


def _eliminated(front: Any, width: int) -> tuple[Any, Any, Any, Any, Any]:
    """Return the reflections that clear the first columns, the finished rows, and what is left.

    As in `FrontalFactor`: vectors, factors, triangle and inverted.
    """
    vectors, factors, rows, inverted = [], [], [], []
    for k in range(width):
        x = front[:, 0]
        size = jnp.sqrt(jnp.sum(x * x, axis=0))
        pivot = jnp.where(x[0] > 0, -size, size)
        vector = jnp.concatenate([(x[0] - pivot)[None], x[1:]])
        square = size * (size + jnp.abs(x[0]))
        factor = jnp.where(square == 0, 0.0, 1.0 / jnp.where(square == 0, 1.0, square))
        rest = front[:, 1:] - vector[:, None] * (factor * jnp.sum(vector[:, None] * front[:, 1:], axis=0))[None]
        above = jnp.zeros((k, *x.shape[1:]))
        vectors.append(jnp.concatenate([above, vector]))
        factors.append(factor)
        rows.append(jnp.concatenate([above, pivot[None], rest[0]]))
        inverted.append(1.0 / pivot)
        front = jax.lax.optimization_barrier(rest[1:])
    return jnp.stack(vectors), jnp.stack(factors), jnp.stack(rows), jnp.stack(inverted), front
