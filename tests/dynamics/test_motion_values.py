"""Values along a motion, computed in chunks of one length."""

import numpy as np
import pytest

from jounce.dynamics.motion_values import in_chunks


@pytest.mark.parametrize("count", [1, 64, 201, 512, 513, 2000])
def test_one_length_serves_motions_of_any_number_of_instants(count):
    lengths = set()

    def squares(lanes):
        lengths.add(len(lanes))
        return {"square": lanes[None] ** 2}

    found = in_chunks(squares, count)["square"]
    np.testing.assert_array_equal(found, np.arange(count)[None] ** 2)
    assert lengths == {512}
