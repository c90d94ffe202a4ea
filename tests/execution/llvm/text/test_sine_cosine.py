"""Sines and cosines of vectors against mpmath: to the last digit, and where C's library has to help."""

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from tests.execution.llvm.lanes import COUNT, SPECIAL, assert_agree, compiled, ordinary


def both(x):
    return jnp.sin(x), jnp.cos(x)


def errors(found, function, angles):
    """Return how far results are from those of mpmath, in units of their last digit."""
    with mpmath.workprec(300):
        right = [function(mpmath.mpf(float(x))) for x in angles]
        off = [abs(mpmath.mpf(float(y)) - z) for y, z in zip(found, right, strict=True)]
        return np.array([float(e / np.spacing(abs(float(z)))) for e, z in zip(off, right, strict=True)])


ANGLES = {
    "turns": np.random.default_rng(0).uniform(-7.0, 7.0, 1200),
    "many turns": np.random.default_rng(1).uniform(-1e5, 1e5, 1200),
    "beyond": np.random.default_rng(2).uniform(-1e12, 1e12, 200),
    "quarter turns": np.arange(-400, 400, 3) * (np.pi / 2),
    "many quarter turns": np.arange(1, 64_000, 531) * (np.pi / 2),
    "eighths of turns": np.nextafter(np.arange(1, 200, 2) * (np.pi / 4), np.tile([-np.inf, np.inf], 50)),
    "small": np.geomspace(1e-300, 1e-2, 200) * np.tile([1.0, -1.0], 100),
}


@pytest.mark.parametrize("name", ANGLES)
@pytest.mark.parametrize("width", [2, 8])
def test_results_are_right_to_the_last_digit(name, width):
    angles = ANGLES[name]
    sine, cosine = compiled(both, [angles], width=width)([], [angles])
    assert errors(sine, mpmath.sin, angles).max() < 0.8
    assert errors(cosine, mpmath.cos, angles).max() < 0.8


def test_results_depend_on_no_other_lane():
    angles = ordinary(low=-9.0, high=9.0)
    single = compiled(both, [angles])([], [angles])
    angles[3::4] = np.resize([np.pi, np.nan, 1e20, np.inf], len(angles[3::4]))
    for mine, theirs in zip(compiled(both, [angles])([], [angles]), single, strict=True):
        kept = np.arange(COUNT) % 4 != 3
        np.testing.assert_array_equal(mine[kept], theirs[kept])


def test_special_numbers_have_the_results_of_the_library():
    assert_agree(both, SPECIAL)
    assert_agree(lambda x: (jnp.sin(x), jnp.cos(2 * x), jnp.sin(2 * x)), np.pi * ordinary())
