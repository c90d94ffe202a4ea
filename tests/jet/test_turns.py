"""Whole turns of angles, against angles whose turns are known."""

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce import jet
from jounce.jet.turns import WHOLE_TURN, counted_by_rates, counted_on, principal, shifted_by_turns


def jet_of(coefficients):
    return jn.Jet(jnp.asarray(c) for c in coefficients)


@pytest.mark.parametrize("turns", [-1e6, -3, 0, 1, 50, 1e6])
def test_wrap_takes_whole_periods_away(turns):
    rest = 0.3
    wrapped = jet.wrap(jet_of([rest + turns * 2 * np.pi, 2.0, 3.0]), 2 * np.pi)
    np.testing.assert_allclose(
        wrapped.coefficients, [rest, 2.0, 3.0], rtol=0, atol=4e-16 * (1 + abs(turns) * 2 * np.pi)
    )
    assert float(jet.wrap(rest + turns * 2.0, 2.0)) == pytest.approx(rest, abs=4e-16 * (1 + 2 * abs(turns)))


@pytest.mark.parametrize("value, rest", [(-0.3, -0.3), (3.0, 3.0), (3.5, 3.5 - 2 * np.pi), (-40.0, -40.0 + 12 * np.pi)])
def test_wrap_is_to_the_nearest_multiple(value, rest):
    """A torsional spring a little below its free angle is hardly loaded: not by nearly a whole turn."""
    assert float(jet.wrap(value, 2 * np.pi)) == pytest.approx(rest, abs=1e-14)


@pytest.mark.parametrize("of", [np.asarray, jnp.asarray, lambda angle: jn.Jet([jnp.asarray(angle), jnp.ones(3)])])
def test_an_angle_is_brought_near_to_what_is_expected(of):
    near = shifted_by_turns(of(np.array([0.1, 3.0, -3.0])), np.array([0.2 + 5 * WHOLE_TURN, -3.0, 3.0]))
    value = near.coefficients[0] if isinstance(near, jn.Jet) else near
    expected = np.array([0.1 + 5 * WHOLE_TURN, 3.0 - WHOLE_TURN, -3.0 + WHOLE_TURN])
    np.testing.assert_allclose(value, expected, atol=1e-13)


@pytest.mark.parametrize("of", [np.asarray, jnp.asarray])
def test_half_a_turn_is_pi_on_both_sides(of):
    angles = of(np.array([np.pi, -np.pi, np.nextafter(-np.pi, 0), 4.0, -4.0 - 10 * np.pi]))
    expected = [np.pi, np.pi, np.pi, 4.0 - WHOLE_TURN, 2 * np.pi - 4.0]
    np.testing.assert_allclose(principal(angles), expected, atol=1e-13)


def test_turns_are_counted_on_from_the_first():
    angle = np.stack([np.linspace(1.0, 30.0, 40), np.linspace(-2.0, -50.0, 40)])
    counted = counted_on(np.angle(np.exp(1j * angle)))
    np.testing.assert_allclose(counted, angle, atol=1e-12)
    assert counted_on(angle[:, :0]).shape == (2, 0)


def test_turns_between_samples_are_counted_by_the_rates():
    """A constant acceleration, through more than a turn from one instant to the next."""
    time = np.cumsum(0.5 + 0.2 * np.cos(np.arange(40)))
    angle, rate = 3.0 + 20.0 * time - 0.4 * time**2, 20.0 - 0.8 * time
    assert np.abs(np.diff(angle)).max() > WHOLE_TURN
    found = np.angle(np.exp(1j * angle))
    np.testing.assert_allclose(counted_by_rates(found, rate, time), angle - angle[0] + found[0], atol=1e-10)
