"""Memory that is kept from one computation to the next.

The system gives new memory page by page, when each is first touched: a seventh of the time of a long grid in two
threads, whose memory it takes back after each.
"""

import math
import weakref
from collections import deque
from collections.abc import Sequence

import numpy as np

MOST = 2**26  # bytes that are kept
LINE = 64  # bytes of the cache's lines, at which arrays begin
ENTRY = 8  # bytes of a number
LENT = 2**16, 2**24  # bytes of blocks that come back by themselves: new memory of fewer costs little
MOST_RETURNED = 2  # of these: the results of one call are given to the next
_free: list[np.ndarray] = []
_returned: deque[bytearray] = deque(maxlen=MOST_RETURNED)


def acquire(size: int) -> np.ndarray:
    """Return a block of so many bytes or more, whatever is in it."""
    try:
        block = _free.pop()
    except IndexError:
        block = np.empty(0, np.uint8)
    return block if len(block) >= size else np.empty(size, np.uint8)


def release(block: np.ndarray) -> None:
    """Keep a block for the next who borrows, unless there is enough; nobody may use it any more."""
    if sum(map(len, _free)) + len(block) <= MOST:
        _free.append(block)


def lend(size: int) -> np.ndarray:
    """Return an array of so many bytes or more, whatever is in it, whose memory is lent again once nobody has it.

    Nobody gives it back: the arrays in it, and only they, keep it.
    """
    least, most = LENT
    if not least <= size <= most:
        return np.empty(size, np.uint8)
    try:
        block = _returned.popleft()
    except IndexError:
        block = bytearray()
    if len(block) < size:
        block = bytearray(size)
    lease = np.frombuffer(block, np.uint8)  # the base of arrays in it, as its own memory is that of no array
    weakref.finalize(lease, _returned.append, block).atexit = False
    return lease


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
