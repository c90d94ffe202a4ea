"""Values along a motion, computed in chunks of few lengths."""

import numpy as np
import pytest

from jounce.dynamics.motion_values import in_chunks


@pytest.mark.parametrize("count, width", [(1, 64), (64, 64), (201, 64), (512, 64), (513, 512), (2000, 512)])
def test_motions_that_are_not_long_share_one_length(count, width):
    lengths = set()

    def squares(lanes):
        lengths.add(len(lanes))
        return {"square": lanes[None] ** 2}

    found = in_chunks(squares, count)["square"]
    np.testing.assert_array_equal(found, np.arange(count)[None] ** 2)
    assert lengths == {width}
