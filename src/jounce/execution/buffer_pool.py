"""Memory that is kept from one computation to the next.

The system gives new memory page by page, when each is first touched: a seventh of the time of a long grid in two
threads, whose memory it takes back after each.
"""

import math
import sys
from collections import deque
from collections.abc import Sequence

import numpy as np

MOST = 2**26  # bytes that are kept
LINE = 64  # bytes of the cache's lines, at which arrays begin
ENTRY = 8  # bytes of a number
LENT = 2**16, 2**24  # bytes of blocks that come back by themselves: new memory of fewer costs little
MOST_LENT = 2  # of these: the results of one call are given to the next
UNUSED = 2  # references to a block of which no array is left: a name's, and that of the call that counts them
_free: list[np.ndarray] = []
_lent: deque[np.ndarray] = deque(maxlen=MOST_LENT)


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
    """Return a block of so many bytes or more, whatever is in it, which comes back once no array in it is left.

    Nobody gives it back: whether an array in it is left, Python tells by its references.
    """
    least, most = LENT
    if not least <= size <= most:
        return np.empty(size, np.uint8)
    block = _unused(size)
    _lent.append(block)  # in the place of one that is in use still, where there are enough
    return block


def _unused(size: int) -> np.ndarray:
    """Return a block that was lent and came back, or a new one; none that another thread looks at is in the queue."""
    for _ in range(MOST_LENT):
        try:
            block = _lent.popleft()
        except IndexError:
            break
        if sys.getrefcount(block) > UNUSED:
            _lent.append(block)
        elif len(block) >= size:
            return block
    return np.empty(size, np.uint8)


def bytes_needed(shapes: Sequence[Sequence[int]]) -> int:
    """Return how many bytes a block needs for arrays of these shapes."""
    return LINE + sum(_lines(shape) for shape in shapes)


def arrays_in(block: np.ndarray, shapes: Sequence[Sequence[int]], kinds: Sequence[type]) -> list[np.ndarray]:
    """Return arrays of these shapes and types, of eight bytes, one after another in a block."""
    index, result = -block.ctypes.data % LINE, []
    for shape, kind in zip(shapes, kinds, strict=True):
        result.append(block[index : index + math.prod(shape) * ENTRY].view(kind).reshape(shape))
        index += _lines(shape)
    return result


def _lines(shape: Sequence[int]) -> int:
    return -(-math.prod(shape) * ENTRY // LINE) * LINE
