"""Arrays made longer by their last entries."""

import numpy as np
import pytest

from jounce.base.padding import padded, power_of_two


@pytest.mark.parametrize("axis", [0, -1])
@pytest.mark.parametrize("count, length", [(3, 3), (3, 8), (1, 2)])
def test_the_last_entry_is_repeated(axis, count, length):
    array = np.random.default_rng(0).normal(size=(count, count))
    chosen = np.minimum(np.arange(length), count - 1)
    np.testing.assert_array_equal(padded(array, length, axis), np.take(array, chosen, axis))


def test_zeros_stand_for_entries_where_there_is_none():
    for axis, shape in ((0, (4, 2)), (-1, (0, 4))):
        result = padded(np.empty((0, 2), np.float32), 4, axis)
        np.testing.assert_array_equal(result, np.zeros(shape, np.float32), strict=True)


@pytest.mark.parametrize("count", range(34))
def test_powers_of_two(count):
    length = power_of_two(count)
    assert length in 2 ** np.arange(7)
    assert length >= count
    assert length == 1 or length // 2 < count
