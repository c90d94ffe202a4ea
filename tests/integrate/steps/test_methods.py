"""How far series carry: what is left out of them, at the end of the step that is returned."""

import numpy as np
import pytest

from jounce.integrate.steps.methods import LOWEST_ORDER, furthest

RADIUS, SIZE = 0.7, 3.0
TERMS = SIZE * RADIUS ** -np.arange(1.0, 16.0)[:, None]  # of the series of a simple pole


@pytest.mark.parametrize("allowed", [1e-6, 1e-12])
def test_next_term_is_what_is_allowed(allowed):
    used, step = map(np.asarray, furthest(TERMS, np.array([allowed])))
    cut = int(used.sum()) - 1
    assert cut >= LOWEST_ORDER
    left_out = TERMS[cut, 0] * step[0] ** (cut + 1)
    assert allowed / 30 <= left_out <= allowed * (1 + 1e-9)


@pytest.mark.parametrize("duration", [10.0, 1e3])
@pytest.mark.parametrize("allowed", [1e-6, 1e-12])
def test_velocities_that_are_left_wrong_move_on(allowed, duration):
    used, step = map(np.asarray, furthest(TERMS, np.array([allowed]), duration=duration))
    cut = int(used.sum()) - 1
    acceleration = cut * (cut + 1) * TERMS[cut, 0] * step[0] ** (cut - 1)
    moved = acceleration * step[0] * duration
    assert allowed / 30 <= moved <= allowed * (1 + 1e-9)
    assert step[0] < furthest(TERMS, np.array([allowed]))[1][0]
