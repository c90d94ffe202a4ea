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
    width : int
        Columns of a body.
    """

    entries: Any
    rights: Any
    left_rows: Any
    left_columns: Any
    neighbours: Any
    of_body: Any
    width: int = eqx.field(static=True)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of fronts, of rows and of columns in each."""
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
        return cls(entries, rights, left_rows, left_columns, neighbours, position.astype(np.int32), width)


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
    """A batch of matrices, factored front by front into reflections and triangles."""

    fronts: Fronts
    vectors: Any  # (fronts, width, rows, batch): the reflections of each front
    factors: Any  # (fronts, width, batch)
    triangle: Any  # (fronts, width, columns, batch): finished rows, the inverse on the diagonal

    @classmethod
    def of(cls, fronts: Fronts, entries: Any) -> "FrontalFactor":
        """Factor the matrices with these entries, shape (entries, batch)."""
        count, height, columns = fronts.shape
        width, lanes = fronts.width, entries.shape[-1]
        entries = jnp.concatenate([entries, jnp.zeros((1, lanes))])

        def step(left: Any, plan: Any) -> Any:
            k, own, rows, taken = plan
            known = left.reshape(count * (height - width), columns - width, lanes)
            front = entries[own] + known.at[rows[:, None], taken].get(mode="fill", fill_value=0.0)
            *found, rest = _eliminated(front, width)
            return jax.lax.dynamic_update_index_in_dim(left, rest, k, 0), tuple(found)

        left = jnp.zeros((count, height - width, columns - width, lanes))
        plans = (np.arange(count), fronts.entries, fronts.left_rows, fronts.left_columns)
        _, (vectors, factors, triangle) = jax.lax.scan(step, left, plans)
        return cls(fronts, vectors, factors, triangle)

    def solve(self, right: Any) -> Any:
        """Return the solutions, shape (columns, batch), for right-hand sides of shape (rows, batch)."""
        count, height, columns = self.fronts.shape
        width, lanes = self.fronts.width, right.shape[-1]
        right = jnp.concatenate([right, jnp.zeros((1, lanes))])

        def forward(left: Any, level: Any) -> Any:
            k, own, rows, vectors, factors = level
            known = left.reshape(-1, lanes)
            y = right[own] + known.at[rows].get(mode="fill", fill_value=0.0)
            for vector, factor in zip(vectors, factors, strict=True):
                y = y - vector * (factor * jnp.sum(vector * y, axis=0))
                if width > 3:
                    y = jax.lax.optimization_barrier(y)
            return jax.lax.dynamic_update_index_in_dim(left, y[width:], k, 0), y[:width]

        def backward(known: Any, level: Any) -> Any:
            k, beside, triangle, y = level
            following = known[beside].reshape(columns - width, lanes)
            y = y - jnp.sum(triangle[:, width:] * following[None], axis=1)
            x: list[Any] = [None] * width
            for i in range(width - 1, -1, -1):
                x[i] = (y[i] - sum(triangle[i, j] * x[j] for j in range(i + 1, width))) * triangle[i, i]
            return jax.lax.dynamic_update_index_in_dim(known, jnp.stack(x), k, 0), None

        left, places = jnp.zeros((count, height - width, lanes)), np.arange(count)
        _, y = jax.lax.scan(forward, left, (places, self.fronts.rights, self.fronts.left_rows, self.vectors, self.factors))
        known = jnp.zeros((count + 1, width, lanes))
        known, _ = jax.lax.scan(backward, known, (places, self.fronts.neighbours, self.triangle, y), reverse=True)
        return known[self.fronts.of_body].reshape(-1, lanes)


def _eliminated(front: Any, width: int) -> tuple[Any, Any, Any, Any]:
    """Return the reflections that clear the first columns, their factors, the finished rows, and what is left."""
    vectors, factors, rows = [], [], []
    for k in range(width):
        x = front[:, 0]
        size = jnp.sqrt(jnp.sum(x * x, axis=0))
        alpha = jnp.where(x[0] > 0, -size, size)
        vector = jnp.concatenate([(x[0] - alpha)[None], x[1:]])
        factor = 1.0 / (size * (size + jnp.abs(x[0])))
        rest = front[:, 1:] - vector[:, None] * (factor * jnp.sum(vector[:, None] * front[:, 1:], axis=0))[None]
        above = jnp.zeros((k, *x.shape[1:]))
        vectors.append(jnp.concatenate([above, vector]))
        factors.append(factor)
        rows.append(jnp.concatenate([above, (1.0 / alpha)[None], rest[0]]))
        front = rest[1:]
        if width > 3:
            front = jax.lax.optimization_barrier(front)  # or XLA computes the chain again for each use
    return jnp.stack(vectors), jnp.stack(factors), jnp.stack(rows), front
