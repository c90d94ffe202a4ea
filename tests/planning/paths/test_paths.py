"""Laws: through any number of waypoints goes a path that is as smooth as the limits need it."""

import numpy as np
import pytest

from jounce.planning.paths.paths import checked, path_of


@pytest.mark.parametrize("count", range(2, 9))
@pytest.mark.parametrize("order", [1, 2, 3])
def test_paths_through_waypoints_are_smooth_and_meet_them(count, order):
    points = np.random.default_rng(count).uniform(-1, 1, (count, 2))
    path = checked(path_of(points, ["a", "b"], order), order)
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    np.testing.assert_allclose(path.derivatives(lengths / lengths[-1], 0)[:, 0], points, atol=1e-12)
