"""In which order the instants of a long grid are solved: in rounds, of as many as a vector has lanes.

An instant is predicted from the one whose index is its own with the last binary one set to zero, unless it is of the
first level. So the instants from a multiple of a power of two up to the next one, a group, start from nothing beyond
it, and as many groups as a vector has lanes are solved side by side, each instant after instant: in the cache are those
that they start from, and groups can be shared among threads.
"""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Int

GROUP = 64  # instants that a lane takes up one after another, once all multiples of so many are solved
LEAST, MOST = 512, 8192  # instants of a part: many enough that what Python does for it does not count
PARTS = 4  # for each thread, unless they have fewer or more instants then: none is to wait long for another


class Part(NamedTuple):
    """The rounds of some groups of instants that start from nothing beyond them but what is solved before.

    Attributes
    ----------
    turns : range
        Which instants of each group are solved.
    group, unit : int
        How many instants belong to a group, and how far apart they are in the grid, powers of two.
    starts : range
        The first instants of the groups that come first among those that are solved side by side.
    """

    turns: range
    group: int
    unit: int
    starts: range

    def rounds(self, width: int, count: int) -> Int[np.ndarray, "round lane"]:
        """Return the indices of a grid of so many instants; where lanes lie beyond it, the first is solved again."""
        lanes = np.arange(width) * (self.group * self.unit)
        block = np.array(self.turns, np.int64)[:, None] * self.unit + lanes
        found = (np.array(self.starts, np.int64)[:, None, None] + block).reshape(-1, width)
        if self.starts.stop > count:
            found = found[found[:, 0] < count]
            found = np.where(found < count, found, found[:, :1])
        return found


def phases(count: int, stride: int, width: int, threads: int) -> Iterator[list[Part]]:
    """Yield the parts of a grid: those of a list start from nothing but what is solved in the lists before.

    Parameters
    ----------
    count : int
        Instants.
    stride : int
        Of the first level, a power of two.
    width : int
        Lanes of a vector.
    threads : int
        That the parts are for.
    """
    group = min(GROUP, stride)
    yield _parts(count, range(stride // group), stride // group, group, width, threads)
    if group > 1:
        yield _parts(count, range(1, group), group, 1, width, threads)


def _parts(count: int, turns: range, group: int, unit: int, width: int, threads: int) -> list[Part]:
    """Return the parts of groups of all instants of a grid that are `unit` apart, as many for each thread."""
    step, together = group * unit * width, group * width
    blocks = -(-count // step)
    wanted = max(min(PARTS * threads, blocks * together // LEAST), -(-blocks * together // MOST), 1)
    parts = min(-(-wanted // threads) * threads, blocks)
    ends = [blocks * k // parts * step for k in range(parts + 1)]
    return [Part(turns, group, unit, range(*span, step)) for span in itertools.pairwise(ends)]
