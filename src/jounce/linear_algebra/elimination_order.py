"""Elimination order of the bodies in a small dense matrix, chosen for little fill-in.

It depends only on the bodies that each row touches, so that it is the same for all values and in all processes.
"""

from collections.abc import Sequence
from functools import lru_cache

Order = tuple[tuple[int, ...], tuple[int, ...]]  # orders of the rows and of the columns


@lru_cache
def elimination_order(touched: tuple[frozenset[int], ...], body_count: int, width: int) -> Order:
    """Return the order of rows and columns with the fewest operations that local search by moving single bodies finds.

    Parameters
    ----------
    touched : tuple of frozenset of int
        Bodies that each row touches.
    body_count, width : int
        Number of bodies, and of columns per body.
    """
    best = list(reversed(range(body_count)))  # driven bodies late: their rows touch few bodies
    fewest, improved = _operations(best, touched, width), True
    while improved:
        improved = False
        for body in range(body_count):
            others = [other for other in best if other != body]
            for place in range(body_count):
                tried = [*others[:place], body, *others[place:]]
                if (operations := _operations(tried, touched, width)) < fewest:
                    best, fewest, improved = tried, operations, True
    masks = _masks(best, touched)
    rows = tuple(sorted(range(len(touched)), key=lambda row: _ends(masks[row])))
    return rows, tuple(width * body + k for body in best for k in range(width))


def _masks(bodies: Sequence[int], touched: Sequence[frozenset[int]]) -> list[int]:
    """Return the bodies that rows touch as bit masks, in the order of their elimination."""
    bits = {body: 1 << k for k, body in enumerate(bodies)}
    return [sum(bits[body] for body in members) for members in touched]


def _ends(mask: int) -> tuple[int, int]:
    """Return the positions of the first and the last body of a row."""
    return (mask & -mask).bit_length(), mask.bit_length()


def _operations(bodies: Sequence[int], touched: Sequence[frozenset[int]], width: int) -> int:
    """Return the number of operations of elimination by reflections: rows of each front times their columns."""
    rows, result = sorted(_masks(bodies, touched), key=_ends), 0
    for k in range(len(bodies)):
        meeting = [row for row, mask in enumerate(rows) if mask >> k & 1 or row < width]
        union = 0
        for row in meeting:
            union |= rows[row]
        for row in meeting:
            rows[row] = union & ~(1 << k)
        columns = width * union.bit_count()
        result += sum((len(meeting) - j) * (columns - j) for j in range(width))
        rows = rows[width:]
    return result
