"""Damped springs against closed forms, over twelve decades of their time constants, and mpmath."""

import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce.planning.elastic.pieces import resolved
from jounce.planning.elastic.spring_deflection import SpringDeflection, mean_weights

RATES, SIZES, MEAN = np.array([3.0, 11.0]), np.array([5.0, 1.0]), 2.0
STIFFNESS = np.array([100.0, 20.0])


def torques(times):
    phase = RATES * np.asarray(times)[:, None]
    waves = [SIZES * np.real((1j * RATES) ** k * np.exp(1j * phase)) for k in range(3)]
    waves[0] = waves[0] + MEAN
    return np.stack(waves, axis=1)


def closed_form(times, constant, start, level):
    """Return what a sinusoidal torque makes of a spring that begins with a deflection."""
    gain = SIZES / (1 + 1j * RATES * constant) / STIFFNESS

    def lasting(t, k):
        wave = np.real(gain * (1j * RATES) ** k * np.exp(1j * RATES * t[:, None]))
        return wave + (MEAN / STIFFNESS if k == 0 else 0.0)

    fading = (start - lasting(np.zeros(1), 0)[0]) * np.exp(-times[:, None] / constant)
    return lasting(times, level) + fading * (-1 / constant) ** level


@pytest.mark.parametrize("constant", [1e-9, 1e-4, 0.02, 1.0, 1e3])
def test_a_sinusoidal_torque(constant):
    springs = SpringDeflection(torques, STIFFNESS, np.full(2, constant), np.linspace(0, 2, 21), ("a", "b"))
    times = np.sort(np.random.default_rng(1).uniform(0, 2, 40))
    found = springs.at(times)
    start = springs.at(np.zeros(1))[0]
    for level in range(3):
        # what the start fades by is known to rounding, over the constant for each derivative
        noise = 1e-15 * np.abs(start[0]) * np.exp(-times[:1] / constant) / constant**level
        expected = closed_form(times, constant, start[0], level)
        size = np.abs(closed_form(times, constant, start[0], level)).max(axis=0)
        np.testing.assert_allclose(found[:, level], expected, rtol=0, atol=(1e-13 * size + 8 * noise).max())


def test_the_start_is_the_slow_motion():
    """The expansion to order two: at the start off by its third term, and all along if it is long over."""
    constant = 1e-3
    springs = SpringDeflection(torques, STIFFNESS, np.full(2, constant), np.linspace(0, 2, 21), ("a", "b"))
    slow = np.real(SIZES / (1 + 1j * RATES * constant)) / STIFFNESS + MEAN / STIFFNESS
    third = SIZES * (constant * RATES) ** 4 / STIFFNESS  # of a cosine, whose third derivative is zero here
    assert (np.abs(springs.at(np.zeros(1))[0, 0] - slow) < 1.01 * third + 1e-16).all()
    errors = springs.expansion_errors()
    assert (np.diff(np.log10(errors), axis=0) < -1.5).all()
    np.testing.assert_allclose(
        errors[0] * np.abs(springs.solution[:, 0]).max(axis=0), SIZES * RATES * constant / STIFFNESS, rtol=0.02
    )


def test_undamped_springs_follow_at_once():
    springs = SpringDeflection(torques, STIFFNESS, np.array([0.0, 0.1]), np.linspace(0, 2, 21), ("a", "b"))
    times = np.linspace(0.01, 1.99, 7)
    np.testing.assert_array_equal(springs.at(times)[..., 0], (torques(times) / STIFFNESS)[..., 0])
    assert springs.expansion_errors()[0, 0] == 0.0


def test_an_arbitrary_torque_against_mpmath():
    """tau = exp(sin 4t), whose integral has no closed form."""
    with mpmath.workdps(30):
        constant, stiffness = mpmath.mpf(1) / 20, mpmath.mpf(7)

        def exact(t, start):
            integral = mpmath.quad(
                lambda s: mpmath.exp(-(t - s) / constant) * mpmath.exp(mpmath.sin(4 * s)), mpmath.linspace(0, t, 12)
            )
            return start * mpmath.exp(-t / constant) + integral / constant / stiffness

        def smooth(times):
            s, c = np.sin(4 * times), np.cos(4 * times)
            e = np.exp(s)
            return np.stack([e, 4 * c * e, 16 * (c * c - s) * e], axis=1)[..., None]

        springs = SpringDeflection(smooth, np.array([7.0]), np.array([0.05]), np.linspace(0, 1, 6), ("a",))
        start = mpmath.mpf(springs.at(np.zeros(1))[0, 0, 0])
        for t in (0.03, 0.5, 0.98):
            found = springs.at(np.array([t]))[0, 0, 0]
            assert abs(found - exact(mpmath.mpf(t), start)) < 1e-15


@pytest.mark.parametrize("step", [1e-12, 1e-3, 1.0, 60.0, 199.9, 200.1, 1e4, 1e12])
def test_weights_of_the_past_against_mpmath(step):
    weights = mean_weights(np.array(step))
    points = (np.polynomial.legendre.leggauss(10)[0] + 1) / 2
    with mpmath.workdps(40):
        z = mpmath.mpf(step)
        for power in (0, 1, 6):
            # of s^n over a step of one: z exp(-z) sum z^k / k! / (n + k + 1), as an incomplete gamma function
            exact = z * mpmath.hyp1f1(1, power + 2, -z) / (power + 1)
            assert abs(weights @ points**power - exact) < 2e-14 * exact


def test_a_jump_of_the_torque_is_refused_with_its_instant():
    def kinked(times):
        late = times > 0.7312
        values = np.stack([np.where(late, times - 0.7312, 0.0), np.where(late, 1.0, 0.0), np.zeros_like(times)], axis=1)
        return values[..., None]

    with pytest.raises(jn.errors.TrajectoryError, match=r"rate 1 .* 0\.7312") as raised:
        SpringDeflection(kinked, np.ones(1), np.zeros(1), np.linspace(0, 2, 21), ("pin",))
    assert raised.value.name == "pin"


def test_a_jump_at_a_node_is_refused_too():
    def stepped(times):
        late = times >= 1.0
        return np.stack([np.where(late, 2.0, 0.0), np.zeros_like(times), np.zeros_like(times)], axis=1)[..., None]

    with pytest.raises(jn.errors.TrajectoryError, match="torque of the spring jumps by 2 near t = 1 s"):
        SpringDeflection(stepped, np.ones(1), np.ones(1), np.linspace(0, 2, 21), ("pin",))


def test_pieces_are_exact_to_rounding():
    pieces = resolved(lambda t: np.stack([np.sin(20 * t), np.exp(-50 * (t - 0.4) ** 2)], axis=1), np.linspace(0, 1, 3))
    times = np.linspace(0, 1, 57)
    for law, exact in zip(pieces.laws, (np.sin(20 * times), np.exp(-50 * (times - 0.4) ** 2)), strict=True):
        np.testing.assert_allclose(np.asarray(law(jn.Jet([times])).coefficients[0]), exact, rtol=0, atol=2e-12)
