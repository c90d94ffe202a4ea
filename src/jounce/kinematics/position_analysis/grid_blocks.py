"""Blocks of a long grid, which depend on the anchors alone: any order, any thread.

Multiples of a stride, a power of two, start from anchors. Any other instant is predicted from the instant whose index
is its own with the last binary one cleared, or from an anchor, if that is nearer. The instants from one multiple of the
stride to the next thus depend on nothing beyond them. A block has as many such runs as a round has lanes: those of a
vector of machine code, or of what XLA solves side by side. A thread solves a block round after round in a buffer that
stays in its cache, and copies the requested results out of it.
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
LONG_GRID = 1024  # instants, from which on a grid is solved in blocks
FEW_BATCHES = 4  # of instants that all start from anchors
GROUP = 64  # instants that a lane solves one after another, once all multiples of this number are solved


class Block(NamedTuple):
    """Instants of a grid that start from anchors and from one another only.

    Attributes
    ----------
    first, count : int
        Index of the first instant, and number of instants.
    stride : int
        Distance of the instants that start from anchors.
    """

    first: int
    count: int
    stride: int

    @property
    def indices(self) -> slice:
        """The slice of the block in arrays of all instants."""
        return slice(self.first, self.first + self.count)


def stride_of(solver: Solver, unsolved: int, count: int, anchors: int) -> int:
    """Return the distance between instants that start from anchors, a power of two.

    Parameters
    ----------
    solver : Solver
        Solver of the instants.
    unsolved, count : int
        Number of instants of a grid still to be solved, and their total.
    anchors : int
        Number of anchors. If few instants are left, all of them start from anchors.
    """
    width, stride = solver.from_anchors if count > LONG_GRID else SMALL_BATCH, 1
    if unsolved > FEW_BATCHES * width:
        while count // (2 * stride) >= max(2 * anchors, width) and 2 * stride <= solver.longest_stride:
            stride *= 2
    return stride


def blocks_of(first: int, count: int, stride: int, width: int, *, full: bool = False) -> list[Block]:
    """Return the blocks of `count` instants of a grid from index `first` on, for rounds of a width.

    With `full`, the stride of the last block is shortened until its instants fill the rounds.
    """
    size = stride * width
    blocks = [Block(first + k, min(size, count - k), stride) for k in range(0, count, size)]
    if full and blocks:
        while stride > 1 and stride * width >= 2 * blocks[-1].count:
            stride //= 2
        blocks[-1] = blocks[-1]._replace(stride=stride)
    return blocks


def blocks_for(solver: Solver, first: int, count: int, stride: int) -> list[Block]:
    """Return the blocks of `count` instants for a solver; XLA gets full rounds, as its rounds are wide."""
    return blocks_of(first, count, stride, solver.program.width, full=not solver.is_compiled)


@lru_cache(maxsize=16)
def rounds(count: int, stride: int, width: int) -> Int[np.ndarray, "round lane"]:
    """Return the instants of a block in the order in which they are solved, by their indices in it.

    Multiples of `GROUP` come first, as the others start from them. Lanes beyond the block repeat the first lane of
    their round.
    """
    group = min(GROUP, stride)
    result = [np.empty((0, width), np.int64)]
    for turns, members, distance in ((range(stride // group), stride // group, group), (range(1, group), group, 1)):
        lanes = np.arange(width) * (members * distance)
        block = np.array(turns, np.int64)[:, None] * distance + lanes
        starts = np.arange(0, count, members * distance * width)
        result.append((starts[:, None, None] + block).reshape(-1, width))
    indices = np.concatenate(result)
    indices = indices[indices[:, 0] < count]
    return np.where(indices < count, indices, indices[:, :1])


def neighbors(lanes: Indices, stride: int) -> tuple[Indices, Bool[np.ndarray, " lane"]]:
    """Return the neighbor of each instant, by index, and whether the instant starts from it."""
    return lanes & (lanes - 1), lanes & (stride - 1) > 0


@lru_cache(maxsize=16)
def _neighbors(count: int, stride: int) -> tuple[Indices, Bool[np.ndarray, " lane"]]:
    """Return the neighbor of each instant of a block, and whether the instant starts from it."""
    return neighbors(np.arange(count), stride)


def solve_blocks(
    solver: Solver,
    path: FollowedPath,
    time: Float[np.ndarray, " time"],
    blocks: Sequence[Block],
    put: Callable[[slice, Any, Int[np.ndarray, " lane"]], None],
    parallel_map: Callable[[Callable[[Block], int], Iterable[Block]], Iterator[int]],
) -> Iterator[int]:
    """Solve the blocks of a grid, and yield the number of instants of each.

    For an instant that failed, only the failure is reported.

    Parameters
    ----------
    solver : Solver
        Solver that followed the path.
    path : FollowedPath
        The motion, followed to all instants of the blocks.
    time : array of shape (time,)
        All instants, s.
    blocks : sequence of Block
        Blocks to solve.
    put : callable
        Stores a block, given the slice of its instants, their states in the form of an anchor's, time last, and their
        outcomes. Several threads may call it at once; the arrays are reused after the call.
    parallel_map : callable
        Works like `map`; it may call from several threads at once.
    """
    size = max(block.count for block in blocks) if blocks else 0
    anchors_by_block = {
        block: path.anchors_around(time[block.first], time[block.first + block.count - 1]) for block in blocks
    }
    anchor_count = max(map(len, anchors_by_block.values()), default=0)

    def load(buffer: SolveBuffer, block: Block) -> int:
        block_time, anchors = time[block.indices], anchors_by_block[block]
        buffer.put_anchors(zip(*(anchor.leaves for anchor in anchors), strict=True))
        neighbor, has_neighbor = _neighbors(block.count, block.stride)
        instants = np.array([anchor.instant for anchor in anchors])
        nearest = nearest_instants(instants, block_time)
        to_neighbor, to_anchor = block_time - block_time[neighbor], block_time - instants[nearest]
        is_near = has_neighbor & (np.abs(to_neighbor) <= np.abs(to_anchor))
        sources = np.where(is_near, neighbor, buffer.first_anchor + nearest), np.where(is_near, to_neighbor, to_anchor)
        buffer.load(block_time, sources, rounds(block.count, block.stride, buffer.width))
        return block.count

    def put_block(block: Block, state: Any, status: Indices) -> None:
        put(block.indices, state, status)

    return solve_in_buffers(
        lambda: SolveBuffer(solver, path.anchors[0].state, size, anchor_count), blocks, load, put_block, parallel_map
    )
