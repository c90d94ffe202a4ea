"""Equations 1-8 for any constraint, and the derivations of appendix A."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.oracles import (
    sommer_appendix as appendix,
    sommer_general as general,
    sommer_planar as planar,
    sommer_spatial as spatial,
)
from tests.oracles.random_motion import planar_body, spatial_body

jax.config.update("jax_enable_x64", True)


def turned(A, w):
    """Return A skew(w)."""
    x, y, z = w
    return A @ jnp.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def spatial_tangent(q, v):
    """Return the velocity of (r_i, A_i, r_j, A_j) for v = (r_i', w_i', r_j', w_j')."""
    return v[0], turned(q[1], v[1]), v[2], turned(q[3], v[3])


def spatial_state(seed):
    rng = np.random.default_rng(seed)
    i, j = spatial_body(rng)[0], spatial_body(rng)[0]
    s_i, s_j, a_i, a_j = rng.normal(size=(4, 3))
    q = tuple(jnp.asarray(x) for x in (i.r[0], i.A, j.r[0], j.A))
    rates = [tuple(jnp.asarray(x) for x in (i.r[k], i.w[k - 1], j.r[k], j.w[k - 1])) for k in range(1, 5)]
    return i, j, s_i, s_j, a_i, a_j, q, rates


def planar_state(seed):
    rng = np.random.default_rng(seed)
    i, j = planar_body(rng)[0], planar_body(rng)[0]
    s_i, s_j, a_i = rng.normal(size=(3, 2))
    q = [jnp.asarray(np.concatenate([i.r[k], [i.phi[k]], j.r[k], [j.phi[k]]])) for k in range(5)]
    return i, j, s_i, s_j, a_i, q[0], q[1:]


def planar_point(q, s):
    c, n = jnp.cos(q[2]), jnp.sin(q[2])
    return q[:2] + jnp.array([c * s[0] - n * s[1], n * s[0] + c * s[1]])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_general_equations_give_the_planar_slide_driver(seed):
    i, j, s_i, s_j, a_i, q, rates = planar_state(seed)
    t = 0.3

    def f(t):
        return jnp.sin(2 * t) + t**3

    def phi(q, t):
        d = planar_point(q[3:], s_j) - planar_point(q[:3], s_i)
        a = planar_point(q[:3], a_i) - q[:2]
        return a @ d / np.linalg.norm(a_i) - f(t)

    drive = [f(t)]
    slope = f
    for _ in range(4):
        slope = jax.grad(slope)
        drive.append(slope(t))
    drive, five = np.array(drive), (i, j, s_i, s_j, a_i)
    D = general.Derivatives(phi, q, t)
    assert general.equation_001(phi, q, t) == pytest.approx(planar.equation_044(*five, drive), abs=1e-13)
    assert general.equation_002(D) == pytest.approx(planar.equation_046(drive), abs=1e-13)
    assert general.equation_003(D, rates) == pytest.approx(planar.equation_047(*five, drive), abs=1e-12)
    assert general.equation_004(D, rates) == pytest.approx(planar.equation_048(*five, drive), abs=1e-12)
    assert general.equation_005(D, rates) == pytest.approx(planar.equation_049(*five, drive), abs=1e-12)
    assert general.equation_004_body_axes(D, rates) == pytest.approx(planar.equation_048(*five, drive), abs=1e-12)
    assert general.equation_005_body_axes(D, rates) == pytest.approx(planar.equation_049(*five, drive), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("rheonomic", [False, True])
def test_general_equations_with_mixed_derivatives(rheonomic):
    """A constraint where time and coordinates mix, against the derivatives along a polynomial motion."""
    rng = np.random.default_rng(3)
    table = rng.normal(size=(5, 3))

    def phi(q, t):
        t = t if rheonomic else 1.0
        return jnp.sin(q[0] * t) + q[1] ** 2 * jnp.exp(t) * q[2] + q[2] * t**4

    def along(t):
        q = sum(row * t**k / float(math.factorial(k)) for k, row in enumerate(table))
        return phi(q, 0.5 + t)

    rates, D = [jnp.asarray(row) for row in table[1:]], general.Derivatives(phi, jnp.asarray(table[0]), 0.5)
    rights = [
        general.equation_002(D),
        general.equation_003(D, rates),
        general.equation_004(D, rates),
        general.equation_005(D, rates),
    ]
    derivative = along
    for rate, right in zip(rates, rights, strict=True):
        derivative = jax.grad(derivative)
        assert D(rate) - right == pytest.approx(float(derivative(0.0)), rel=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_simplified_equations_give_revolute_and_spherical(seed):
    i, j, s_i, s_j, _, q, rates = planar_state(seed)
    D = general.Derivatives(lambda q, t: planar_point(q[3:], s_j) - planar_point(q[:3], s_i), q, 0.0)
    two = (i, j, s_i, s_j)
    np.testing.assert_allclose(general.equation_006(D, rates), planar.equation_023(*two), atol=1e-12)
    np.testing.assert_allclose(general.equation_007(D, rates), planar.equation_024(*two), atol=1e-12)
    np.testing.assert_allclose(general.equation_008(D, rates), planar.equation_025(*two), atol=1e-12)
    i, j, s_i, s_j, _, _, q, rates = spatial_state(seed)
    D = general.Derivatives(lambda q, t: q[2] + q[3] @ s_j - q[0] - q[1] @ s_i, q, 0.0, spatial_tangent)
    two = (i, j, s_i, s_j)
    np.testing.assert_allclose(general.equation_006(D, rates), spatial.equation_080(*two), atol=1e-12)
    np.testing.assert_allclose(general.equation_007(D, rates), spatial.equation_081(*two), atol=1e-12)
    np.testing.assert_allclose(general.equation_008(D, rates), spatial.equation_082(*two), atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_printed_general_equations_fail_in_body_axes(seed):
    """S says that 4 and 5 hold for spatial methods: with body-fixed angular velocities they do not, as printed."""
    i, j, s_i, s_j, a_i, a_j, q, rates = spatial_state(seed)
    cases = [
        (lambda q, t: q[2] + q[3] @ s_j - q[0] - q[1] @ s_i, spatial.equation_081, spatial.equation_082, (s_i, s_j)),
        (lambda q, t: (q[1] @ a_i) @ (q[3] @ a_j), spatial.equation_093, spatial.equation_094, (a_i, a_j)),
    ]
    for phi, eta, sigma, vectors in cases:
        D = general.Derivatives(phi, q, 0.0, spatial_tangent)
        right = eta(i, j, *vectors), sigma(i, j, *vectors)
        np.testing.assert_allclose(general.equation_004_body_axes(D, rates), right[0], atol=1e-11)
        np.testing.assert_allclose(general.equation_005_body_axes(D, rates), right[1], atol=1e-11)
        assert np.abs(general.equation_004(D, rates) - right[0]).max() > 0.1
        assert np.abs(general.equation_005(D, rates) - right[1]).max() > 0.1


def slope_in_time(function, moved, h=2e-3):
    """Return the time derivative of a function of a state by equation 58."""
    return planar.equation_058([function(*moved(h * k)) for k in (-2, -1, 0, 1, 2)], h)[0]


def later(body, t):
    """Return the planar state after a time, all derivatives beyond the fourth being zero."""

    def shift(table):
        out = np.zeros_like(table)
        for k in range(len(table)):
            for n in range(k, len(table)):
                out[k] += table[n] * t ** (n - k) / math.factorial(n - k)
        return out

    return planar.Body(shift(body.r), shift(body.phi))


@pytest.mark.parametrize("seed", range(3))
def test_appendix_of_the_revolute(seed):
    i, j, s_i, s_j, *_ = planar_state(seed)
    two = (i, j, s_i, s_j)

    def moved(t):
        return later(i, t), later(j, t), s_i, s_j

    np.testing.assert_allclose(appendix.appendix_04(*two), slope_in_time(appendix.appendix_03, moved), atol=1e-7)
    np.testing.assert_allclose(appendix.appendix_11(*two), slope_in_time(appendix.appendix_09, moved), atol=1e-7)
    J = np.column_stack(appendix.appendix_02(*two))
    for rates, product, slopes, along in (
        (appendix.appendix_05, appendix.appendix_06, appendix.appendix_07, appendix.appendix_08),
        (appendix.appendix_12, appendix.appendix_13, appendix.appendix_14, appendix.appendix_15),
    ):
        np.testing.assert_allclose(product(*two), J @ np.concatenate([rates(i), rates(j)]), atol=1e-13)
        velocity = np.concatenate([i.r[1], [i.phi[1]], j.r[1], [j.phi[1]]])
        np.testing.assert_allclose(along(*two), np.column_stack(slopes(*two)) @ velocity, atol=1e-13)

        def frozen(t, k=rates):
            turned = [planar.Body(b.r, np.array([b.phi[0] + t * b.phi[1], *b.phi[1:]])) for b in (i, j)]
            return (*turned, s_i, s_j)

        np.testing.assert_allclose(along(*two), slope_in_time(product, frozen), atol=1e-8)
    np.testing.assert_allclose(
        appendix.appendix_01(appendix.appendix_04(*two), appendix.appendix_08(*two)),
        appendix.appendix_09(*two),
        atol=1e-13,
    )
    np.testing.assert_allclose(
        appendix.appendix_10(appendix.appendix_11(*two), appendix.appendix_15(*two)),
        appendix.appendix_16(*two),
        atol=1e-12,
    )
    np.testing.assert_allclose(appendix.appendix_09(*two), planar.equation_024(*two), atol=1e-13)
    np.testing.assert_allclose(appendix.appendix_16(*two), planar.equation_025(*two), atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_appendix_of_the_spherical(seed):
    i, j, s_i, s_j, *_ = spatial_state(seed)
    two = (i, j, s_i, s_j)

    def body(r, A, w):
        return spatial.Body(np.asarray(r), A, w)

    def by_jvp(function, bodies_rates):
        """Return the derivative of a function of both bodies along given changes of (A, w)."""

        def moved(e):
            turned_ = []
            for b, (spin, dw) in zip((i, j), bodies_rates, strict=True):
                A = b.A + e * np.asarray(turned(b.A, spin)) + e**2 / 2 * np.asarray(turned(turned(b.A, spin), spin))
                turned_.append(body(b.r, A, b.w + e * dw))
            return (*turned_, s_i, s_j)

        return slope_in_time(function, moved, 1e-4)

    moving = [(b.w[0], np.vstack([b.w[1:], np.zeros((1, 3))])) for b in (i, j)]
    turning = [(b.w[0], np.zeros((4, 3))) for b in (i, j)]
    np.testing.assert_allclose(appendix.appendix_21(*two), by_jvp(appendix.appendix_20, moving), atol=1e-6)
    np.testing.assert_allclose(appendix.appendix_28(*two), by_jvp(appendix.appendix_26, moving), atol=1e-6)
    blocks = [*appendix.appendix_18(), *appendix.appendix_19(*two)]
    J = np.column_stack([blocks[0], blocks[2], blocks[1], blocks[3]])
    for rate, product, slopes, along in (
        (appendix.appendix_22, appendix.appendix_23, appendix.appendix_24, appendix.appendix_25),
        (appendix.appendix_30, appendix.appendix_31, appendix.appendix_32, appendix.appendix_33),
    ):
        np.testing.assert_allclose(product(*two), J @ np.concatenate([rate(i), rate(j)]), atol=1e-13)
        np.testing.assert_allclose(along(*two), slopes(*two)[0] @ i.w[0] + slopes(*two)[1] @ j.w[0], atol=1e-12)
        np.testing.assert_allclose(along(*two), by_jvp(product, turning), atol=1e-7)
    np.testing.assert_allclose(
        appendix.appendix_17(appendix.appendix_21(*two), appendix.appendix_25(*two)),
        appendix.appendix_26(*two),
        atol=1e-12,
    )
    np.testing.assert_allclose(
        appendix.appendix_27(appendix.appendix_28(*two), appendix.appendix_33(*two)),
        appendix.appendix_34(*two),
        atol=1e-12,
    )
    np.testing.assert_allclose(appendix.appendix_26(*two), spatial.equation_081(*two), atol=1e-12)
    np.testing.assert_allclose(appendix.appendix_34(*two), spatial.equation_082(*two), atol=1e-12)
