"""Splines through positions with their rates: exact on polynomials, convergence, continuity, and estimated errors."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import SampleWarning, TrajectoryError
from jounce.trajectory import HermiteMotion, HermiteSplineMotion

EVEN = np.linspace(0.0, 2.0, 41)


def table(times, levels, wave=3.0):
    return np.stack([wave**k * np.sin(wave * times + k * np.pi / 2) for k in range(levels)], axis=1)


@pytest.mark.parametrize("levels", [2, 3])
def test_it_goes_through_all_that_is_given_and_is_smooth(levels):
    times = np.arange(30) / 15 + np.random.default_rng(1).uniform(0, 0.04, 30)  # no steps so short that rounding counts
    law = HermiteSplineMotion(times, table(times, levels))
    for k in range(levels):
        np.testing.assert_allclose(law.at(times, k), table(times, levels)[:, k], rtol=0, atol=1e-9 * 3**k)
    inside = times[1:-1]
    for k in range(levels + 2):  # one derivative more than is known, and the next
        size = np.abs(law.at(times, k)).max()
        assert np.abs(law.at(inside, k) - law.at(np.nextafter(inside, 0), k)).max() <= 1e-6 * size
    assert law.joined == levels + 1


@pytest.mark.parametrize("levels", [2, 3])
def test_polynomials_are_exact(levels):
    degree = 2 * levels  # the first and the last piece have no higher power
    polynomial = np.polynomial.Polynomial(np.arange(1.0, degree + 2))
    times = np.array([0.0, 0.3, 0.5, 1.1, 1.2, 2.0])
    rates = [polynomial.deriv(k) if k else polynomial for k in range(degree + 1)]
    law = HermiteSplineMotion(times, np.stack([rates[k](times) for k in range(levels)], axis=1))
    at = np.linspace(0, 2, 33)
    for k in range(degree):
        np.testing.assert_allclose(law.at(at, k), rates[k](at), rtol=1e-7, atol=1e-7 * np.abs(rates[k](at)).max())


@pytest.mark.parametrize("levels, noise", [(2, 0.0), (3, 0.0), (2, 1e-6), (3, 1e-6)])
def test_estimated_errors_are_those_that_there_are(levels, noise):
    generator, at = np.random.default_rng(3), np.linspace(0, 2, 801)
    given = table(EVEN, levels) + noise * generator.normal(size=(len(EVEN), levels)) * 10.0 ** np.arange(levels)
    law = HermiteSplineMotion(EVEN, given)
    for k in range(levels + 2):
        true = np.abs(law.at(at, k) - 3.0**k * np.sin(3 * at + k * np.pi / 2)).max() / 3.0**k
        assert true <= 2 * law.errors[k] + 1e-8 or law.errors[k] == 1
        assert law.errors[k] <= min(1.0, 60 * true + 1e-6)


def test_what_is_refused():
    with pytest.raises(TrajectoryError, match=r"shape \(samples, 2\)"):
        HermiteSplineMotion(EVEN, np.zeros((41, 1)))
    with pytest.raises(TrajectoryError, match="at least three"):
        HermiteSplineMotion([0.0, 1.0], np.zeros((2, 2)))
    with pytest.raises(TrajectoryError, match="must increase"):
        HermiteSplineMotion([0.0, 1.0, 1.0], np.zeros((3, 2)))


def test_points_that_know_fewer_derivatives_than_others():
    nan = np.nan
    law = HermiteMotion([0, 1, 2, 3], [[0, 0, 0], [1, 0, 0], [2, 1, nan], [3, nan, nan]], incomplete=True)
    pieces = np.asarray(law.coefficients)
    np.testing.assert_allclose(pieces[:, 0], [0, 0, 0, 10, -15, 6])  # rest to rest: a quintic
    np.testing.assert_allclose(pieces[:, 1], [1, 0, 2, -1, 0, 0])  # a cubic
    np.testing.assert_allclose(pieces[:, 2], [2, 1, 0, 0, 0, 0])  # a line
    with pytest.raises(TrajectoryError, match="known only where those below it are"):
        HermiteMotion([0, 1], [[0, nan, 0], [1, 0, 0]], incomplete=True)
    with pytest.raises(TrajectoryError, match="finite"):
        HermiteMotion([0, 1], [[0, nan], [1, 0]])
    with pytest.raises(TrajectoryError, match="finite"):
        HermiteMotion([0, 1], [[0, np.inf], [1, 0]], incomplete=True)
    assert isinstance(jn.laws.HermiteMotion([0.0, 1.0], [[0.0], [1.0]]), HermiteMotion)


def test_rounded_rates_are_worse_than_none_which_the_warning_says():
    times = np.linspace(0.0, 2.0, 201)
    rounded = np.round(table(times, 2), 8)
    inside = times[5:-5]

    def error(law):
        jounce = jn.JointTrajectory({"elbow": law}, 0.0, 2.0).derivatives(inside, 4)[:, 4, 0]
        return np.abs(jounce - 81 * np.sin(3 * inside)).max()

    with pytest.warns(SampleWarning, match="order 4: .*sample more .*leave out the rates beside them"):
        with_rates = error(HermiteSplineMotion(times, rounded))
    with pytest.warns(SampleWarning, match="or smooth the samples by jn.smooth or jounce smooth$"):
        alone = error(jn.laws.SplineMotion(times, rounded[:, 0]))
    assert alone < with_rates / 3


def test_above_its_degree_the_rates_are_what_is_too_much():
    times = np.linspace(0.0, 2.0, 81)
    law = HermiteSplineMotion(times, table(times, 2))
    with pytest.warns(SampleWarning, match="degree 5 .*to order 3; leave out the rates beside them"):
        jn.JointTrajectory({"elbow": law}, 0.0, 2.0).derivatives(times, 6)
