"""Padding of arrays, so that programs are compiled for few lengths."""

import numpy as np


def padded(array: np.ndarray, length: int, axis: int = -1) -> np.ndarray:
    """Return an array padded along the first or last axis with its last entry, or with zeros if it is empty.

    Parameters
    ----------
    array : array
        Array no longer than `length` along the axis.
    length : int
        Length of the axis of the result.
    axis : int, default -1
        0 or -1.

    Examples
    --------
    >>> padded(np.array([1.0, 2.0]), 4).tolist()
    [1.0, 2.0, 2.0, 2.0]
    """
    count = array.shape[axis]
    if count == length:
        return array
    result = np.zeros((length, *array.shape[1:]) if axis == 0 else (*array.shape[:-1], length), array.dtype)
    if count and axis == 0:
        result[:count], result[count:] = array, array[-1]
    elif count:
        result[..., :count], result[..., count:] = array, array[..., -1:]
    return result


def power_of_two(count: int, least: int = 1) -> int:
    """Return the smallest power of two that is not below a count, but at least `least`.

    Examples
    --------
    >>> power_of_two(5), power_of_two(5, 16)
    (8, 16)
    """
    return max(least, 1 << max(count - 1, 0).bit_length())
