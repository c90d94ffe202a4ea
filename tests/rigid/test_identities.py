"""Differential identities between a body's motion and its coordinates: Negrean 2025, equations 39-40 and 50-58.

The derivative of ``r^(n)`` with respect to ``q_j^(m)`` is taken by JAX through the jets. Where the printed equation
does not hold, the test says by how much, and what holds in its place.
"""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce import jet, rigid
from jounce.jet import Jet

ORDER = 5
SEQUENCE = "ZYX"
LOCAL = np.array([0.3, -0.8, 0.5])
SEEDS = pytest.mark.parametrize("seed", range(3))


def motions(derivatives):
    """Derivatives of a point, of the rotation matrix and of the angular velocity, from those of the coordinates."""
    q = Jet.from_derivatives(derivatives)
    R = rigid.rotation_matrix(SEQUENCE, q[3:])
    point = q[:3] + jet.matvec(R, LOCAL)
    return point.derivatives(), R.derivatives(), rigid.angular_velocity(R).derivatives()


def both(derivatives):
    """The derivatives of the motions, and the motions; not compiled, which would take longer than three calls."""
    return jax.jacfwd(lambda d: (motions(d),) * 2, has_aux=True)(derivatives)


class Case:
    """A random state, and every derivative with respect to every derivative of a coordinate."""

    def __init__(self, seed):
        self.q = np.random.default_rng(seed).normal(size=(ORDER + 1, 6))
        slopes, values = jax.tree.map(np.asarray, both(jnp.asarray(self.q)))
        self.r, self.R, self.w = values
        self.dr, self.dR, self.dw = slopes  # (derivative n, components, derivative m, coordinate j)
        angles = Jet.from_derivatives(jnp.asarray(self.q))[3:]
        self.transfer = rigid.transfer_matrix(SEQUENCE, angles)
        rotation = rigid.rotation_matrix(SEQUENCE, angles)
        arm = jet.matvec(rotation, LOCAL)
        columns = [jet.cross(self.transfer[:, j], arm) for j in range(3)]
        # series in time of dr/dq_j and of the columns of the transfer matrix, by closed form
        self.columns = np.zeros((ORDER + 1, 3, 6))
        self.columns[0, :, :3] = np.eye(3)
        self.columns[:, :, 3:] = jet.transpose(jet.stack(columns)).derivatives()
        self.turns = np.zeros((ORDER + 1, 3, 6))
        self.turns[:, :, 3:] = self.transfer.derivatives()


case_of = functools.cache(Case)


def orders():
    """All m and s with m + s up to the order of the jets."""
    return [(m, s) for m in range(1, ORDER + 1) for s in range(ORDER + 1 - m)]


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * (1 + np.abs(expected).max()))


def off(found, right):
    """Largest difference over the largest entry of the reference."""
    return np.abs(np.asarray(found) - right).max() / np.abs(np.asarray(right)).max()


@pytest.mark.slow
@SEEDS
def test_equations_050_and_051_all_orders_share_one_slope(seed):
    case = case_of(seed)
    for m in range(ORDER + 1):
        close(case.dr[m, :, m], case.columns[0])
    for m in range(1, ORDER + 1):  # psi^(m) is the (m-1)-th derivative of the angular velocity
        close(case.dw[m - 1, :, m], case.turns[0])


@pytest.mark.slow
@SEEDS
def test_equations_052_and_054_rate_of_the_slope_of_position(seed):
    case = case_of(seed)
    for m, s in orders():
        close(case.dr[m + s, :, m] / math.comb(m + s, m), case.columns[s])


@pytest.mark.slow
@SEEDS
def test_equation_053_fails_for_rotations_and_what_holds_instead(seed):
    """Axes of rotation do not commute: the printed rate lacks the vector product of the axis and w."""
    case = case_of(seed)
    w = Jet.from_derivatives(jnp.asarray(case.w))
    lack = jet.transpose(jet.stack([jet.cross(w, axis) for axis in jet.transpose(case.transfer)]))
    lack = np.concatenate([np.zeros((ORDER, 3, 3)), np.asarray(lack.derivatives())], axis=2)
    for m, s in orders():
        slope = case.dw[m + s - 1, :, m]
        printed = slope / math.comb(m + s, m)
        missing = 0 if s == 0 else math.comb(m + s - 1, m) / math.comb(m + s, m) * lack[s - 1]
        close(printed + missing, case.turns[s])
        if s:
            assert off(printed, case.turns[s]) > 0.01


@SEEDS
def test_equation_039_velocity_of_any_order(seed):
    """With the index after the product read as its upper limit r; with the factorials inside the product it fails."""
    case = case_of(seed)
    for k, m in ((1, 2), (2, 3), (2, 4), (3, 3), (4, 2)):
        right, inside = np.zeros(3), np.zeros(3)
        for r in range(k):
            slope = math.factorial(r) * math.factorial(m) / math.factorial(m + r) * case.dr[m + r, :, m]
            falling = math.prod(k - p for p in range(1, r + 1))
            right += slope @ case.q[k - r] * falling / math.factorial(r)
            inside += slope @ case.q[k - r] * falling / math.prod(math.factorial(p) for p in range(1, r + 1))
        close(right, case.r[k])
        if k == 4:  # up to r = 2 both readings are one
            assert off(inside, case.r[k]) > 1e-3


@SEEDS
def test_equation_040_rotation_matrix_of_any_order(seed):
    case = case_of(seed)
    for k, m in ((1, 2), (2, 3), (3, 3), (4, 2)):
        found = np.zeros((3, 3))
        for r in range(k):
            slope = math.factorial(r) * math.factorial(m) / math.factorial(m + r) * case.dR[m + r, :, :, m]
            found += slope @ case.q[k - r] * math.comb(k - 1, r)
        close(found, case.R[k])


@SEEDS
def test_equations_055_and_056_velocities_by_slopes_of_any_order(seed):
    case = case_of(seed)
    for m in range(1, ORDER + 1):
        close(case.dr[m, :, m] @ case.q[1], case.r[1])
        close(case.dw[m - 1, :, m] @ case.q[1], case.w[0])


def products(first, second, k):
    """The k-th derivative of the product of two functions of time given by their derivatives."""
    return sum(math.comb(k, i) * first[i] @ second[k - i] for i in range(k + 1))


@SEEDS
def test_equations_057_and_058_accelerations_by_slopes_of_any_order(seed):
    """With brackets around slope times coordinate; a derivative of the slope alone fails from k = 2 on."""
    case = case_of(seed)
    for m in (1, 2, 3):
        # rates of the slopes, each read off the derivative with respect to the coordinate's m-th
        slopes = [case.dr[m + s, :, m] / math.comb(m + s, m) for s in range(ORDER + 1 - m)]
        close(slopes[1], case.dr[m + 1, :, m] / (m + 1))
        for k in range(1, ORDER - m):
            found = products(slopes, case.q[2:], k - 1) + products(slopes[1:], case.q[1:], k - 1)
            close(found, case.r[k + 1])
            if k > 1:
                assert off(slopes[k - 1] @ case.q[2] + slopes[k] @ case.q[1], case.r[k + 1]) > 0.01
        # for rotations what equation 53 lacks cancels in the sum over the coordinates, since w x w = 0
        found = case.dw[m - 1, :, m] @ case.q[2] + case.dw[m, :, m] @ case.q[1] / (m + 1)
        close(found, case.w[1])


@pytest.mark.slow
def test_equation_058_derivative_of_the_sum():
    """The rate of the right side of equation 58 along the motion equals that of the angular acceleration."""
    m, order = 1, 2
    q = np.random.default_rng(3).normal(size=(order + 2, 6))

    def right(t):
        state = jnp.stack([sum(q[n + i] * t**i / math.factorial(i) for i in range(4 - n)) for n in range(order + 1)])
        slopes = jax.jacfwd(lambda d: motions(d)[2])(state)
        return slopes[m - 1, :, m] @ state[2] + slopes[m, :, m] @ state[1] / (m + 1)

    first, second = jax.jvp(right, (0.0,), (1.0,))
    w = motions(jnp.asarray(q))[2]
    close(first, np.asarray(w[1]))
    close(second, np.asarray(w[2]))
