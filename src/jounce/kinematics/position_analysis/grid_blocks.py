"""Blocks of a long grid, each solved from the anchors of a motion alone: in any order, in any thread.

An instant is predicted from the one whose index is its own with the last binary one set to zero, unless it is a
multiple of a stride, a power of two, and starts from an anchor; or from the anchor, where that is nearer. So the
instants from a multiple of the stride up to the next one start from nothing beyond it. A block is as many of these as a
round has instants: a vector of machine code, or what XLA solves side by side. They are solved round after round, in the
memory of a thread, which stays in the cache; the requested results are copied out of it.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.kinematics.continuation.path_following import FollowedPath
from jounce.kinematics.continuation.solver import SMALL_BATCH, Solver
from jounce.kinematics.position_analysis.solve_buffers import SolveBuffer, solve_in_buffers
from jounce.mechanism.time import nearest_instants

Indices = Int[np.ndarray, " lane"]
LONG_GRID = 1024  # instants: from here on in blocks
FEW_BATCHES = 4  # of instants: they all start from anchors
GROUP = 64  # instants that a lane takes up one after another, once all multiples of so many are solved


class Block(NamedTuple):
    """Instants of a grid that start from nothing but anchors and one another.

    Attributes
    ----------
    first, count : int
        The index of the first one, and how many there are.
    stride : int
        How far apart those are that start from anchors.
    """

    first: int
    count: int
    stride: int

    @property
    def indices(self) -> slice:
        """Where they are in arrays of all instants."""
        return slice(self.first, self.first + self.count)


def stride_of(solver: Solver, left: int, count: int, anchors: int) -> int:
    """Return how far apart the instants that start from anchors are, a power of two.

    Parameters
    ----------
    solver : Solver
        What solves them.
    left, count : int
        How many of a grid are to be solved, and how many there are.
    anchors : int
        From how many. Where few instants are left, they all start from anchors.
    """
    width, stride = solver.from_anchors if count > LONG_GRID else SMALL_BATCH, 1
    if left > FEW_BATCHES * width:
        while count // (2 * stride) >= max(2 * anchors, width) and 2 * stride <= solver.longest_stride:
            stride *= 2
    return stride


def blocks_of(first: int, count: int, stride: int, width: int, *, full: bool = False) -> list[Block]:
    """Return the blocks of so many instants of a grid from an index on, for rounds of a width.

    To have `full` rounds, the last block has a stride of its own, so short that its instants fill them.
    """
    size = stride * width
    blocks = [Block(first + k, min(size, count - k), stride) for k in range(0, count, size)]
    if full and blocks:
        while stride > 1 and stride * width >= 2 * blocks[-1].count:
            stride //= 2
        blocks[-1] = blocks[-1]._replace(stride=stride)
    return blocks


def blocks_for(solver: Solver, first: int, count: int, stride: int) -> list[Block]:
    """Return the blocks of so many instants for what solves them; a round of XLA is too wide to be left half empty."""
    return blocks_of(first, count, stride, solver.program.width, full=not solver.is_compiled)


@lru_cache(maxsize=16)
def rounds(count: int, stride: int, width: int) -> Int[np.ndarray, "round lane"]:
    """Return the instants of a block in the order in which they are solved, by their indices in it.

    Multiples of `GROUP` come first, as what the others start from. Where lanes lie beyond the block, the first of their
    round is solved again.
    """
    group = min(GROUP, stride)
    result = [np.empty((0, width), np.int64)]
    for turns, members, distance in ((range(stride // group), stride // group, group), (range(1, group), group, 1)):
        lanes = np.arange(width) * (members * distance)
        block = np.array(turns, np.int64)[:, None] * distance + lanes
        starts = np.arange(0, count, members * distance * width)
        result.append((starts[:, None, None] + block).reshape(-1, width))
    whole = np.concatenate(result)
    whole = whole[whole[:, 0] < count]
    return np.where(whole < count, whole, whole[:, :1])


def neighbors(lanes: Indices, stride: int) -> tuple[Indices, Bool[np.ndarray, " lane"]]:
    """Return the neighbor of each of some instants, by index, and whether it is solved before."""
    return lanes & (lanes - 1), lanes & (stride - 1) > 0


@lru_cache(maxsize=16)
def _neighbors(count: int, stride: int) -> tuple[Indices, Bool[np.ndarray, " lane"]]:
    """Return the neighbor of each instant of a block, and whether it is solved before."""
    return neighbors(np.arange(count), stride)


def solve_blocks(
    solver: Solver,
    path: FollowedPath,
    time: Float[np.ndarray, " time"],
    blocks: Sequence[Block],
    put: Callable[[slice, Any, Int[np.ndarray, " lane"]], None],
    each: Callable[[Callable[[Block], int], Iterable[Block]], Iterator[int]],
) -> Iterator[int]:
    """Solve blocks of a grid, and yield how many instants each of them has.

    Nothing is known of an instant that failed but that it did.

    Parameters
    ----------
    solver : Solver
        What solved the path.
    path : FollowedPath
        The motion, followed to all these instants.
    time : array of shape (time,)
        All instants, s.
    blocks : sequence of Block
        Those to solve.
    put : callable
        Takes over the instants of a block by where they are among all: their states, as an anchor's, time last, and the
        outcome of each. It may be called from several threads at once; the arrays are used again after it.
    each : callable
        In the manner of `map`; it may call from several threads at once.
    """
    size = max(block.count for block in blocks) if blocks else 0
    around = {block: path.anchors_around(time[block.first], time[block.first + block.count - 1]) for block in blocks}
    most = max(map(len, around.values()), default=0)

    def begin(buffer: SolveBuffer, block: Block) -> int:
        here, anchors = time[block.indices], around[block]
        buffer.put_anchors(zip(*(anchor.leaves for anchor in anchors), strict=True))
        neighbor, known = _neighbors(block.count, block.stride)
        instants = np.array([anchor.instant for anchor in anchors])
        nearest = nearest_instants(instants, here)
        to_neighbor, to_anchor = here - here[neighbor], here - instants[nearest]
        near = known & (np.abs(to_neighbor) <= np.abs(to_anchor))
        sources = np.where(near, neighbor, buffer.first_anchor + nearest), np.where(near, to_neighbor, to_anchor)
        buffer.load(here, sources, rounds(block.count, block.stride, buffer.width))
        return block.count

    def put_block(block: Block, state: Any, status: Indices) -> None:
        put(block.indices, state, status)

    return solve_in_buffers(
        lambda: SolveBuffer(solver, path.anchors[0].state, size, most), blocks, begin, put_block, each
    )
