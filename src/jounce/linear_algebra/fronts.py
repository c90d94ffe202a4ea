"""Symbolic analysis of a Jacobian for elimination body by body, independent of its numbers.

Rows of a Jacobian touch two bodies, seldom three, so most of it is known to be zero. Bodies are eliminated one by one,
those with the fewest neighbors first (George and Liu 1989, the evolution of the minimum degree ordering algorithm). The
front of a body holds the rows that touch it: its own, and those left over by earlier fronts. Householder reflections
clear its columns, and the remaining rows touch its neighbors only (Duff and Reid 1983; Davis 2011, algorithm 915). No
choice depends on the numbers, so that all lanes of a batch, and all instants of a motion, go through one program, and
all fronts through one scan of it. Neither the program nor its compile time grows with the number of bodies.
"""

import heapq

import numpy as np
from jaxtyping import Int

from jounce.base.modules import Module, field
from jounce.base.shapes import Numbers
from jounce.linear_algebra.pattern import Pattern

MOST_DENSE = 100  # columns of a matrix with more rows, for which the slower dense elimination gives the orientation
FRONT_COST = 4.0  # measured cost of an operation in fronts, relative to one in dense elimination
Row = tuple[int, int]  # the front that left the row over, and its index there; -1 and its number for a matrix row


class Fronts(Module):
    """Rows and columns of each front, as index arrays that a program takes as input.

    Attributes
    ----------
    entries : array of int, shape (fronts, rows, columns)
        Index of the matrix entry at each place before the elimination; one beyond the last if there is none.
    rights : array of int, shape (fronts, rows)
        Index of the matrix row in each row of a front; one beyond the last if there is none.
    left_rows : array of int, shape (fronts, rows)
        Index, among the left-over rows of all fronts, of the one taken into each row; one beyond the last if there is
        none.
    left_columns : array of int, shape (fronts, rows, columns)
        Index of the column of that left-over row at each place; one beyond the last if there is none.
    neighbors : array of int, shape (fronts, neighbors)
        Fronts of the bodies to which the other columns belong; one beyond the last if there are fewer.
    of_body : array of int, shape (bodies,)
        Front of each body.
    row_count : int
        Number of rows of the matrix.
    width : int
        Number of columns per body.
    """

    entries: Int[Numbers, "front row column"]
    rights: Int[Numbers, "front row"]
    left_rows: Int[Numbers, "front row"]
    left_columns: Int[Numbers, "front row column"]
    neighbors: Int[Numbers, "front neighbor"]
    of_body: Int[Numbers, " front"]
    row_count: int = field(static=True)
    width: int = field(static=True)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of fronts, and of rows and columns of each front."""
        count, rows, columns = self.entries.shape
        return count, rows, columns

    @classmethod
    def of(cls, pattern: Pattern) -> "Fronts":
        """Plan the elimination of matrices of a pattern with NumPy arrays."""
        bodies, indices, count, width = pattern.bodies, pattern.entry_indices, pattern.body_count, pattern.width
        entry_count = pattern.entry_count
        order, separators, front_rows = _ordered(pattern)
        position = np.argsort(order)
        height = max(width + 1, *map(len, front_rows))  # avoids empty arrays
        most_neighbors = max(1, *map(len, separators))
        columns, left_height = width * (1 + most_neighbors), height - width
        entries = np.full((count, height, columns), entry_count, np.int32)
        rights = np.full((count, height), len(bodies), np.int32)
        left_rows = np.full((count, height), count * left_height, np.int32)
        left_columns = np.full((count, height, columns), width * most_neighbors, np.int32)
        neighbors = np.full((count, most_neighbors), count, np.int32)
        ordered = [sorted(position[list(s)]) if s else [] for s in separators]
        for front, members in enumerate(front_rows):
            neighbors[front, : len(ordered[front])] = ordered[front]
            block = {p: k for k, p in enumerate([front, *ordered[front]])}
            for line, (source, row) in enumerate(members):
                if source < 0:
                    rights[front, line] = row
                    for slot, body in enumerate(bodies[row]):
                        if body < count:
                            first = block[position[body]] * width
                            entries[front, line, first : first + width] = indices[row, slot]
                else:
                    left_rows[front, line] = source * left_height + row
                    for k, p in enumerate(ordered[source]):
                        first = block[p] * width
                        left_columns[front, line, first : first + width] = k * width + np.arange(width)
        return cls(entries, rights, left_rows, left_columns, neighbors, position.astype(np.int32), len(bodies), width)


def _ordered(pattern: Pattern) -> tuple[Int[np.ndarray, " body"], list[set[int]], list[list[Row]]]:
    """Return the bodies in the order of their elimination, with the neighbors and rows of each at that time.

    Among bodies with equally many neighbors, one with the fewest rows is first.
    """
    count, width = pattern.body_count, pattern.width
    adjacent: list[set[int]] = [set() for _ in range(count)]
    rows: list[set[Row]] = [set() for _ in range(count)]
    for row, slots in enumerate(pattern.bodies.tolist()):
        touched = {body for body in slots if body < count}
        for body in touched:
            adjacent[body] |= touched - {body}
            rows[body].add((-1, row))
    queue = [(len(adjacent[body]), len(rows[body]), body) for body in range(count)]
    heapq.heapify(queue)
    order: list[int] = []
    separators, front_rows, is_eliminated = [], [], np.zeros(count, bool)
    while queue:
        *key, body = heapq.heappop(queue)
        if is_eliminated[body] or key != [len(adjacent[body]), len(rows[body])]:
            continue  # an outdated entry; the body was queued again
        is_eliminated[body] = True
        neighbors, members = adjacent[body], sorted(rows[body])
        remaining = {(len(order), k) for k in range(len(members) - width)}
        order.append(body)
        separators.append(set(neighbors))
        front_rows.append(members)
        for other in neighbors:
            adjacent[other] |= neighbors
            adjacent[other] -= {other, body}
            rows[other] -= rows[body]
            rows[other] |= remaining
            heapq.heappush(queue, (len(adjacent[other]), len(rows[other]), other))
    return np.array(order, int), separators, front_rows


def elimination(pattern: Pattern) -> Fronts | None:
    """Return the fronts of matrices of a pattern if their elimination is less work than a dense one, or None."""
    rows, columns = pattern.shape
    if rows < columns or not rows or (rows > columns and columns <= MOST_DENSE):
        return None
    fronts = Fronts.of(pattern)
    count, height, front_columns = fronts.shape
    return fronts if FRONT_COST * count * pattern.width * height * front_columns < rows**3 else None
