"""Jumps of derivatives that show in values: found to rounding, and not where something is only steep."""

import numpy as np
import pytest

from jounce.trajectory.law_checks.seen_jumps import seen_jumps


def powers(knots, sizes, degree, levels=6):
    """Return sums of one-sided powers, whose derivative of that degree jumps by factorials of the sizes."""

    def evaluate(t):
        away = np.maximum(t[:, None] - np.array(knots), 0.0)
        on = (away > 0).astype(float)
        factors = [np.prod(np.arange(degree - k + 1, degree + 1)) if k <= degree else 0.0 for k in range(levels)]
        values = [f * away ** max(degree - k, 0) * on @ np.array(sizes) for k, f in enumerate(factors)]
        return np.stack(values, axis=1)[..., None]

    return evaluate


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_jumps_are_found_where_they_are(degree):
    knots, sizes = [0.30303, 0.3031, 1.0, 1.7], [1.0, 0.25, -0.5, 2.0]  # two in one cell; one is an instant looked at
    found = seen_jumps(powers(knots, sizes, degree), 0.0, 2.0, 3)
    np.testing.assert_allclose(found.instants, knots, atol=2e-11)
    np.testing.assert_allclose(found.sizes[:, degree, 0], np.array(sizes) * [1, 1, 2, 6][degree], rtol=1e-7)
    assert not found.sizes[:, :degree].any()
    assert found.everywhere


@pytest.mark.parametrize("power", [1 / 3, 0.5, 2 / 3, 1.5, 2.5])
def test_a_derivative_without_a_limit_jumps_by_infinity(power):
    def law(t):
        x = np.abs(t - 0.77)
        values, factor = [], 1.0
        for k in range(6):
            with np.errstate(divide="ignore"):
                values.append(factor * x ** (power - k) * np.sign(t - 0.77) ** k)
            factor *= power - k
        return np.stack(values, axis=1)[..., None]

    found = seen_jumps(law, 0.0, 2.0, 3)
    assert found.instants.tolist() == pytest.approx([0.77], abs=1e-8)
    sizes = found.sizes[0, :, 0]
    assert np.isinf(sizes[int(power) + 1])
    assert not sizes[: int(power) + 1].any()


@pytest.mark.parametrize("width", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5])
def test_what_is_steep_is_no_jump(width):
    def law(t):
        y = np.tanh((t - 0.77) / width)
        slopes = [np.polynomial.Polynomial([0.0, 1.0])]
        for _ in range(5):
            slopes.append(slopes[-1].deriv() * np.polynomial.Polynomial([1.0, 0.0, -1.0]))
        return np.stack([p(y) / width**k for k, p in enumerate(slopes)], axis=1)[..., None]

    found = seen_jumps(law, 0.0, 2.0, 2)
    assert not len(found.instants)
    assert found.everywhere


def test_a_jump_of_what_cannot_be_told_apart_is_not_looked_for():
    """A sine of 16,000 waves in the time, of which 2,000 instants show nothing."""

    def law(t):
        return np.stack([np.sin(1e5 * t + k * np.pi / 2) * 1e5**k for k in range(6)], axis=1)[..., None]

    found = seen_jumps(law, 0.0, 1.0, 2)
    assert not len(found.instants)
    assert not found.everywhere


@pytest.mark.parametrize("size", [1e-16, 1e-13])
def test_rounding_is_no_jump(size):
    noise = np.random.default_rng(3)

    def law(t):
        levels = [np.sin(3 * t + k * np.pi / 2) * 3.0**k for k in range(6)]
        return np.stack([x + size * 1e2**k * noise.standard_normal(len(t)) for k, x in enumerate(levels)], 1)[..., None]

    assert not len(seen_jumps(law, 0.0, 2.0, 2).instants)


def test_jumps_of_several_laws_are_told_apart():
    first, second = powers([0.4], [1.0], 1), powers([0.4, 1.1], [2.0, -3.0], 2)
    found = seen_jumps(lambda t: np.concatenate([first(t), second(t)], axis=2), 0.0, 2.0, 2)
    np.testing.assert_allclose(found.instants, [0.4, 1.1], atol=2e-11)
    np.testing.assert_allclose(found.sizes[0], [[0, 0], [1, 0], [0, 4]], atol=1e-6)
    np.testing.assert_allclose(found.sizes[1], [[0, 0], [0, 0], [0, -6]], atol=1e-6)
