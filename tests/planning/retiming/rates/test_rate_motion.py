"""The motion of a parameter whose squared rate is a polynomial: closed forms, of all orders, and across pieces."""

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.jet import tan
from jounce.planning.retiming.rates.rate_motion import RateMotion


def test_the_root_of_a_linear_rate_grows_evenly():
    motion = RateMotion([0.0, 0.25, 1.0], [[1.0, 1.5], [2.0, 2.0]])  # z = 1 + 2 u: u = t + t^2 / 2
    times = np.linspace(0.0, np.sqrt(3) - 1, 7)
    found = np.asarray(motion(jn.Jet.variable(jnp.asarray(times), 4)).derivatives())
    expected = [times + times**2 / 2, 1 + times, np.ones(7), np.zeros(7), np.zeros(7)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
    assert motion.duration == pytest.approx(np.sqrt(3) - 1, abs=1e-15)


@pytest.mark.parametrize("time", [0.1, 0.7])
def test_derivatives_of_a_tangent_are_exact_to_order_8(time):
    motion = RateMotion([0.0, 1.0], [[1.0], [0.0], [2.0], [0.0], [1.0]])  # z = (1 + u^2)^2: u = tan t
    jet = jn.Jet.variable(time, 8)
    np.testing.assert_allclose(motion(jet).derivatives(), tan(jet).derivatives(), rtol=1e-13)
    bent = jet * jet + 0.1 * jet
    np.testing.assert_allclose(motion(bent).derivatives(), tan(bent).derivatives(), rtol=1e-12)


def test_pieces_of_a_steep_rate_are_halved_until_the_time_is_exact():
    motion = RateMotion([0.0, 1.0], [[1e-6], [0.0], [1.0]])  # z = e^2 + u^2: u = e sinh t
    assert motion.duration == pytest.approx(np.arcsinh(1e3), rel=1e-13)
    found = motion(jn.Jet.variable(jnp.asarray([3.0]), 2)).derivatives()
    np.testing.assert_allclose(np.ravel(found), 1e-3 * np.array([np.sinh(3), np.cosh(3), np.sinh(3)]), rtol=1e-11)


def test_instants_outside_are_refused():
    motion = RateMotion([0.0, 1.0], [[4.0]])
    with pytest.raises(TrajectoryError, match=r"from 0 to 0\.5 s"):
        motion.check_instants(0.0, 0.6)
    assert np.isnan(float(motion(jn.Jet.variable(0.6, 0)).derivatives()[0]))


def test_a_square_that_is_not_positive_is_refused():
    with pytest.raises(TrajectoryError, match="positive"):
        RateMotion([0.0, 1.0], [[1.0], [-2.0]])
