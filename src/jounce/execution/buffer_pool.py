"""A pool of memory that is reused once no array in it is left.

The system provides new memory page by page at first touch, and takes it back after use. This costs a seventh of the
time of a long grid in two threads, and a quarter of that of a short one.
"""

import math
import weakref
from collections.abc import Sequence

import numpy as np

LEAST = 2**16  # bytes of a block that is reused: smaller new blocks cost little
MOST = 2**26  # bytes of free blocks
LARGEST = 2  # largest ratio of a reused block to the needed size
LINE = 64  # bytes of a cache line, at which arrays begin
ENTRY = 8  # bytes of a number
_free: dict[int, np.ndarray] = {}  # free blocks by identity, in the order of their return


def lend(size: int) -> np.ndarray:
    """Return an uninitialized array of at least `size` bytes, whose memory is reused once it has no references.

    Views of the array keep its memory; nothing has to be given back.
    """
    if size < LEAST:
        return np.empty(size, np.uint8)
    for block in sorted(_free.copy().values(), key=len):
        # a much larger block would be wasted; a missing one was taken by another thread
        if size <= len(block) <= LARGEST * size and _free.pop(id(block), None) is not None:
            break
    else:
        block = np.empty(size, np.uint8)
    lease: np.ndarray = np.frombuffer(block.data, np.uint8)  # the base of the arrays in the block
    weakref.finalize(lease, _take_back, block).atexit = False
    return lease


def _take_back(block: np.ndarray) -> None:
    """Keep a block for reuse, and drop the blocks that have been free for longest beyond the limit."""
    _free[id(block)] = block
    while sum(map(len, (blocks := _free.copy()).values())) > MOST:
        _free.pop(next(iter(blocks)), None)


def bytes_needed(shapes: Sequence[Sequence[int]]) -> int:
    """Return the number of bytes of a block for arrays of given shapes."""
    return LINE + sum(_lines(shape) for shape in shapes)


def arrays_in(block: np.ndarray, shapes: Sequence[Sequence[int]], kinds: Sequence[type]) -> list[np.ndarray]:
    """Return consecutive arrays of given shapes and eight-byte types in a block."""
    index, result = -address_of(block) % LINE, []
    for shape, kind in zip(shapes, kinds, strict=True):
        result.append(block[index : index + math.prod(shape) * ENTRY].view(kind).reshape(shape))
        index += _lines(shape)
    return result


def address_of(array: np.ndarray) -> int:
    """Return the address of the first entry of an array."""
    return array.__array_interface__["data"][0]  # takes half as long as `ctypes`


def _lines(shape: Sequence[int]) -> int:
    return -(-math.prod(shape) * ENTRY // LINE) * LINE
