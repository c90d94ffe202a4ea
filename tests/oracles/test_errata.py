"""What docs/errata.md says of equations 5, 66 and 69 beyond the other tests of the oracles."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

from tests.oracles import sommer_general as general, sommer_spatial as spatial
from tests.oracles.random_motion import derivatives, spatial_body

jax.config.update("jax_enable_x64", True)

SEEDS = pytest.mark.parametrize("seed", range(3))


def off(found, right):
    """Largest difference over the largest entry of what is right."""
    return np.abs(np.asarray(found) - right).max() / np.abs(np.asarray(right)).max()


def attitude_series(body):
    """Taylor coefficients of A, from A' = A skew(w)."""
    table = [body.A]
    spins = [spatial.equation_060(w) / math.factorial(k) for k, w in enumerate(body.w)]
    for k in range(4):
        table.append(sum(table[m] @ spins[k - m] for m in range(k + 1)) / (k + 1))
    return table


@pytest.mark.slow
@SEEDS
def test_mixed_time_terms_of_jerk_and_jounce_in_body_axes(seed):
    """A constraint on attitude in which time and turning mix, against its derivatives along a motion."""
    rng = np.random.default_rng(seed)
    body = spatial_body(rng)[0]
    a, b, c = rng.normal(size=(3, 3))
    series = attitude_series(body)

    def phi(A, t):
        return (jnp.sin(t) * b + jnp.exp(t) * c) @ (A @ a) * (b @ (A @ c)) + t**3 * (A @ b)[0]

    def along(t):
        return phi(sum(row * t**k for k, row in enumerate(series)), 0.5 + t)

    def tangent(A, w):
        return A @ jnp.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])

    rates, D = [jnp.asarray(w) for w in body.w], general.Derivatives(phi, jnp.asarray(body.A), 0.5, tangent)
    values = [along]
    for _ in range(4):
        values.append(jax.grad(values[-1]))
    jerk, jounce = float(values[3](0.0)), float(values[4](0.0))
    scale = 1 + abs(jounce)
    assert float(D(rates[2]) - general.equation_004_body_axes(D, rates)) == pytest.approx(jerk, abs=1e-12 * scale)
    assert float(D(rates[3]) - general.equation_005_body_axes(D, rates)) == pytest.approx(jounce, abs=1e-12 * scale)
    merged = general.equation_005_body_axes(D, rates) + 8 * D(rates[1], rates[0], times=1)
    merged -= 8 * D(rates[0], rates[1], times=1)  # the time term as printed, 12 of one kind
    assert abs(float(D(rates[3]) - merged) - jounce) > 0.01 * scale


@SEEDS
def test_jounce_of_a_point_without_parentheses_fails(seed):
    with mp.workdps(30):
        body, pose = spatial_body(np.random.default_rng(seed))
        s = np.array([0.4, -1.1, 0.7])
        right = np.array([derivatives(x)[4] for x in pose.point(s.tolist())])
    without = body.r[4] + body.A @ spatial.equation_065(body) @ s + spatial.equation_060(body.w[3]) @ s
    assert off(spatial.equation_066(body, s), right) < 1e-14
    assert off(without, right) > 0.05


@SEEDS
def test_relative_acceleration_with_one_sign_corrected_fails(seed):
    rng = np.random.default_rng(seed)
    (i, _), (j, _) = spatial_body(rng), spatial_body(rng)
    given = (i, j, *rng.normal(size=(2, 3)))
    spin, change = (
        i.A @ m @ given[2]
        for m in (spatial.equation_060(i.w[0]) @ spatial.equation_060(i.w[0]), spatial.equation_060(i.w[1]))
    )
    right, printed = spatial.equation_069(*given), spatial.equation_069_printed(*given)
    np.testing.assert_allclose(printed - 2 * spin - 2 * change, right, atol=1e-13)
    assert off(printed - 2 * change, right) > 0.02
    assert off(printed - 2 * spin, right) > 0.02
