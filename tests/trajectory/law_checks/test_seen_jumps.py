"""Jumps of derivatives that show in values: found to rounding, and not where something is only steep."""

import numpy as np
import pytest

from jounce.trajectory.law_checks.seen_jumps import seen_jumps

GRID = np.linspace(0.0, 2.0, 2001)


def powers(knots, sizes, degree):
    """Return sums of one-sided powers, whose derivative of that degree jumps by factorials of the sizes."""

    def evaluate(t):
        away = np.maximum(t[:, None] - np.array(knots), 0.0)
        on = (away > 0).astype(float)
        factors = [np.prod(np.arange(degree - k + 1, degree + 1)) if k <= degree else 0.0 for k in range(4)]
        levels = [f * away ** max(degree - k, 0) * on @ np.array(sizes) for k, f in enumerate(factors)]
        return np.stack(levels, axis=1)[..., None]

    return evaluate


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_jumps_are_found_where_they_are(degree):
    knots, sizes = [0.30303, 1.0, 1.7], [1.0, -0.5, 2.0]
    law = powers(knots, sizes, degree)
    where, found = seen_jumps(law, GRID, law(GRID))
    np.testing.assert_allclose(where, knots, atol=1e-10)
    np.testing.assert_allclose(found[:, degree, 0], np.array(sizes) * [1, 1, 2][degree], rtol=1e-7)
    assert not found[:, :degree].any()


@pytest.mark.parametrize("width", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5])
def test_what_is_steep_is_no_jump(width):
    def law(t):
        x = (t - 0.77) / width
        y = np.tanh(x)
        z = 1 - y**2
        levels = [y, z / width, -2 * y * z / width**2, (6 * y**2 - 2) * z / width**3]
        return np.stack(levels, axis=1)[..., None]

    where, _ = seen_jumps(law, GRID, law(GRID))
    assert not len(where)


def test_rounding_of_what_stands_still_is_no_jump():
    noise = np.random.default_rng(3)

    def law(t):
        return np.stack([1 + 1e-16 * noise.standard_normal(len(t))] + [1e-14 * noise.standard_normal(len(t))] * 3, 1)[
            ..., None
        ]

    assert not len(seen_jumps(law, GRID, law(GRID))[0])
