"""Memory that is lent again once no array in it is left.

The system gives new memory page by page, when each is first touched: a seventh of the time of a long grid in two
threads, whose memory it takes back after each, and a quarter of that of a short one.
"""

import math
import weakref
from collections.abc import Sequence

import numpy as np

LEAST = 2**16  # bytes of a block that is lent again: new memory of fewer costs little
MOST = 2**26  # bytes that are free at most
LARGEST = 2  # block that is lent, by what is needed
LINE = 64  # bytes of the cache's lines, at which arrays begin
ENTRY = 8  # bytes of a number
_free: dict[int, np.ndarray] = {}  # blocks by their identities, that which came back last at the end


def lend(size: int) -> np.ndarray:
    """Return an array of so many bytes or more, whatever is in it, whose memory is lent again once nobody has it.

    Nobody gives it back: the arrays in it, and only they, keep it.
    """
    if size < LEAST:
        return np.empty(size, np.uint8)
    for block in sorted(_free.copy().values(), key=len):
        # a much larger one would be kept for little; one that is gone another thread was faster to take
        if size <= len(block) <= LARGEST * size and _free.pop(id(block), None) is not None:
            break
    else:
        block = np.empty(size, np.uint8)
    lease: np.ndarray = np.frombuffer(block.data, np.uint8)  # the base of arrays in it, as a block is not
    weakref.finalize(lease, _take_back, block).atexit = False
    return lease


def _take_back(block: np.ndarray) -> None:
    """Keep a block for the next; those that have been free for longest go if there is too much."""
    _free[id(block)] = block
    while sum(map(len, (blocks := _free.copy()).values())) > MOST:
        _free.pop(next(iter(blocks)), None)


def bytes_needed(shapes: Sequence[Sequence[int]]) -> int:
    """Return how many bytes a block needs for arrays of these shapes."""
    return LINE + sum(_lines(shape) for shape in shapes)


def arrays_in(block: np.ndarray, shapes: Sequence[Sequence[int]], kinds: Sequence[type]) -> list[np.ndarray]:
    """Return arrays of these shapes and types, of eight bytes, one after another in a block."""
    index, result = -address_of(block) % LINE, []
    for shape, kind in zip(shapes, kinds, strict=True):
        result.append(block[index : index + math.prod(shape) * ENTRY].view(kind).reshape(shape))
        index += _lines(shape)
    return result


def address_of(array: np.ndarray) -> int:
    """Return where the numbers of an array begin in memory."""
    return array.__array_interface__["data"][0]  # half as long as by its `ctypes`


def _lines(shape: Sequence[int]) -> int:
    return -(-math.prod(shape) * ENTRY // LINE) * LINE
