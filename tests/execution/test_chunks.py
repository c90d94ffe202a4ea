"""Values at many instants, computed in chunks of one length."""

import numpy as np
import pytest

from jounce.execution.chunks import in_chunks


@pytest.mark.parametrize("count", [1, 64, 201, 256, 257, 1000])
def test_one_length_serves_motions_of_any_number_of_instants(count):
    lengths = set()

    def squares(lanes):
        lengths.add(len(lanes))
        return {"square": lanes[None] ** 2}

    found = in_chunks(squares, count)["square"]
    np.testing.assert_array_equal(found, np.arange(count)[None] ** 2)
    assert lengths == {256}


@pytest.mark.parametrize("axis", [0, 1, -1])
@pytest.mark.parametrize("count", [3, 8, 20])
def test_instants_may_stand_along_any_axis(count, axis):
    found = in_chunks(lambda lanes: np.moveaxis(np.ones((4, 5, 1)) * lanes, -1, axis), count, (8,), axis)
    np.testing.assert_array_equal(np.moveaxis(found, axis, -1), np.ones((4, 5, 1)) * np.arange(count))
    found[:] = 0.0  # an array of the caller's own


@pytest.mark.parametrize("count, lengths", [(1, [1]), (5, [5]), (8, [8]), (20, [8, 8, 4])])
def test_the_last_chunk_may_be_shorter(count, lengths):
    asked = []

    def squares(lanes):
        asked.append(len(lanes))
        return lanes**2

    np.testing.assert_array_equal(in_chunks(squares, count, (8,), filled=False), np.arange(count) ** 2)
    assert sorted(asked, reverse=True) == lengths
