"""Laws through instants with derivatives: what they are at their last instant."""

import numpy as np
import pytest

import jounce as jn


def derivatives(law, instant, order):
    return np.array(law(jn.Jet.variable(np.array(instant), order)).dense().derivatives())


@pytest.mark.parametrize("beyond", ["refuse", "hold"])
@pytest.mark.parametrize("levels", [1, 2, 3, 4])
def test_derivatives_that_are_not_given_end_as_the_polynomial_does(levels, beyond):
    """A polynomial of the degree that each piece has is the law, also at its last instant."""
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 0.7, 2.0, -1.5, 0.4, 0.6, -0.2][: 2 * levels])
    times = np.array([0.0, 0.5, 1.2, 2.0])
    given = np.stack([(polynomial.deriv(k) if k else polynomial)(times) for k in range(levels)], axis=1)
    law = jn.laws.HermiteMotion(times, given, beyond)
    expected = [(polynomial.deriv(k) if k else polynomial)(2.0) for k in range(2 * levels)]
    np.testing.assert_allclose(derivatives(law, 2.0, 2 * levels - 1), expected, rtol=1e-9)
    continued = derivatives(jn.laws.HermiteMotion(times, given, "continue"), 2.0, 2 * levels - 1)
    np.testing.assert_allclose(continued, [*expected[:levels], *np.zeros(levels)], rtol=1e-12)


def test_the_last_instant_of_a_recording_without_accelerations_has_that_of_its_cubic():
    """t^3 by positions and velocities; of the last row, the acceleration is unknown."""
    times = np.array([0.0, 1.0, 2.0])
    rows = np.stack([times**3, 3 * times**2, [0.0, np.nan, np.nan]], axis=1)
    law = jn.laws.HermiteMotion(times, rows, incomplete=True)
    np.testing.assert_allclose(derivatives(law, 2.0, 3), [8.0, 12.0, 12.0, 6.0], rtol=1e-12)
