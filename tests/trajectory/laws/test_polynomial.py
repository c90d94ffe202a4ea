"""Polynomial motion functions: SciPy's splines, closed forms, and the formulas of Negrean 2025, equations 61-64."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.jet import Jet
from jounce.trajectory import PolynomialMotion
from tests.problems.small import crank

RNG = np.random.default_rng(3)
KNOTS = np.linspace(0.4, 3.0, 12) + RNG.uniform(-0.06, 0.06, 12)  # a quarter of the step
VALUES = RNG.normal(size=12)
INSTANTS = np.linspace(KNOTS[0], KNOTS[-1], 41)


def derivatives(law, order, at=INSTANTS):
    return np.array(law(Jet.variable(jnp.asarray(at), order)).derivatives())


def close(found, expected, relative=1e-12):
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * max(np.abs(expected).max(), 1e-300))


def sine(t, k):
    return 2.0**k * np.sin(2 * t + k * np.pi / 2)


@pytest.mark.parametrize("ends", ["not-a-knot", "natural", "clamped"])
def test_order_two_is_the_cubic_spline(ends):
    found = derivatives(PolynomialMotion(KNOTS, VALUES, 2, ends=ends), 3)
    expected = CubicSpline(KNOTS, VALUES, bc_type=ends)
    for k in range(4):
        close(found[k], expected(INSTANTS, k))


@pytest.mark.parametrize("m", [2, 4, 6])
def test_not_a_knot_is_that_of_scipy(m):
    found = derivatives(PolynomialMotion(KNOTS, VALUES, m), 4)
    expected = make_interp_spline(KNOTS, VALUES, k=m + 1)
    for k in range(min(m, 4) + 1):
        close(found[k], expected(INSTANTS, k), 1e-9)  # the knots are uneven, and both solve their own system


@pytest.mark.parametrize("m", range(1, 10))
@pytest.mark.parametrize("derivative", [0, 2])
def test_continuous_to_order_m_and_through_the_knots(m, derivative):
    if derivative > m:
        derivative = m
    law = PolynomialMotion(KNOTS, VALUES, m, derivative, ends="clamped")
    lengths = np.diff(law.knots)
    c = law.coefficients
    for k in range(m + 1):
        ending = sum(math.perm(j, k) * c[j] * lengths ** (j - k) for j in range(k, m + 2))
        close(ending[:-1], math.factorial(k) * c[k, 1:], 1e-9)  # powers of unequal segments cancel
    close(math.factorial(derivative) * c[derivative], VALUES[:-1], 1e-10)


@pytest.mark.parametrize("m", range(1, 10))
def test_printed_formula_gives_every_derivative(m):
    """Equation 61 with p = 0..m, and equation 62 (p = m), on each segment, with tau from an instant near by."""
    law = PolynomialMotion(KNOTS, VALUES, m, ends="natural")
    origin = 1.5
    constants, highest, knots = law.integration_constants(origin), law.knot_values, law.knots
    for i in range(1, len(knots)):
        t = np.linspace(knots[i - 1], knots[i], 4)[:-1]
        found = derivatives(law, 9, t)
        tau, first, last = t - origin, knots[i - 1] - origin, knots[i] - origin
        length = last - first
        for p in range(m + 1):
            fall = (-1) ** p * (last - tau) ** (p + 1) / (length * math.factorial(p + 1)) * highest[i - 1]
            rise = (tau - first) ** (p + 1) / (length * math.factorial(p + 1)) * highest[i]
            rest = [tau ** (p - k) / math.factorial(p - k) * constants[k - 1, i - 1] for k in range(1, p + 1)]
            size = max(np.abs(x).max() for x in (fall, rise, *rest))
            np.testing.assert_allclose(
                fall + rise + sum(rest), found[m - p], rtol=0, atol=1e-11 * size
            )  # the knots' m-th derivatives


def test_number_of_unknowns_and_constants():
    """Equation 63: m + 1 unknowns a segment, m constants of integration and a knot value of the m-th derivative."""
    law = PolynomialMotion(KNOTS, VALUES, 4)
    assert law.integration_constants().shape == (4, 11)
    assert law.knot_values.shape == law.knots.shape == (12,)
    assert law.continuity == 4


@pytest.mark.parametrize("m", [2, 3, 4, 5, 9])
def test_derivatives_at_both_ends(m):
    """Equation 64: the derivatives given at the first and the last knot, positions at all."""
    first, last = (m + 1) // 2, m // 2
    start, end = {k: 0.3 * k for k in range(1, first + 1)}, {k: -0.1 * k for k in range(1, last + 1)}
    law = PolynomialMotion(KNOTS, VALUES, m, start=start, end=end)
    scale = [np.abs(level).max() for level in derivatives(law, 9)]
    found = derivatives(law, 9, KNOTS)
    close(found[0], VALUES, 1e-11)
    for k, value in start.items():
        assert abs(found[k, 0] - value) <= 1e-11 * scale[k]
    for k, value in end.items():
        assert abs(found[k, -1] - value) <= 1e-11 * scale[k]


def equation_064(segments, m=4):
    """Return the conditions of equation 64, read literally, on the coefficients of segments of a unit of time.

    Rows of all but the last two conditions, q and q^(m) at the last knot; then those.
    """
    size = m + 2

    def value(segment, place, order):
        row = np.zeros(segments * size)
        row[segment * size : (segment + 1) * size] = [
            math.perm(j, order) * float(place) ** (j - order) if j >= order else 0.0 for j in range(size)
        ]
        return row

    rows = [value(0, 0, order) for order in range(m + 1)]
    for i in range(1, segments):
        rows += [value(i - 1, 1, order) - value(i, 0, order) for order in range(m + 1)]
        rows.append(value(i, 0, 2))
    return np.array(rows), np.array([value(segments - 1, 1, order) for order in (0, m)])


def test_equation_064_as_printed_has_one_condition_more_than_unknowns():
    """Errata: 255 conditions for the 254 unknowns of equation 63, with 51 segments and m = 4."""
    s, m = 51, 4
    continuity, at_the_ends, accelerations = m * (s - 1), m + 1, s - 1  # q^(m) is that of the knots on both sides
    assert m * s + s - 1 == 254
    assert continuity + at_the_ends + accelerations == 255
    rows, last = equation_064(6)
    assert len(rows) + len(last) == rows.shape[1] + 1
    assert np.linalg.matrix_rank(np.concatenate([rows, last])) == rows.shape[1]


def test_equation_064_without_its_last_position_grows_at_every_knot():
    """An error of the jerk at the start grows by 2 + sqrt 3 a knot, as nothing at the end holds against it."""
    rows, last = equation_064(12)
    error = np.zeros(len(rows) + 1)
    error[3] = 1.0
    jerk = np.linalg.solve(np.concatenate([rows, last[1:]]), error).reshape(12, 6)[:, 3]
    growth = jerk[2:8] / jerk[1:7]
    assert np.abs(growth).max() > 3.7
    np.testing.assert_allclose(growth[2:5], -(2 + math.sqrt(3)), rtol=0.02)
    t = np.linspace(0.0, 1.7, 52)
    zeros: dict[int, float] = dict.fromkeys((0, 1, 3, 4), 0.0)
    for end in ({}, {4: 0.0}, {0: np.pi, 4: 0.0}):
        with pytest.raises(TrajectoryError, match="conditions"):
            PolynomialMotion.from_accelerations(t, np.sin(3 * t), 4, start=zeros, end=end)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_law_of_the_paper_from_accelerations_at_52_knots(noise):
    """Section 4: 51 segments of degree 5 in 1.7 s from accelerations; noise of samples does not grow along them."""
    t = np.linspace(0.0, 1.7, 52)
    angle = lambda x, k: 9.0 * 3.0 ** (k - 2) * np.sin(3 * x + k * np.pi / 2)  # noqa: E731 - derivative k of sin 3 t
    wrong = noise * np.random.default_rng(1).uniform(-1, 1, 52)
    start, end = {0: 0.0, 3: angle(0.0, 3)}, {0: angle(1.7, 0), 3: angle(1.7, 3)}
    law = PolynomialMotion.from_accelerations(t, angle(t, 2) + wrong, 4, start=start, end=end)
    assert law.degree == 5
    x = np.linspace(0.0, 1.7, 501)
    found = derivatives(law, 4, x)
    for k, bound in enumerate((3e-7, 1e-6, 1e-5, 2e-3, 0.1)):
        grown = noise * (0.5, 1.0, 2.0, 500.0, 1e5)[k]  # of differences over 0.033 s from the third on
        assert np.abs(found[k] - angle(x, k)).max() <= bound * 3.0**k + grown


@pytest.mark.parametrize("m", [2, 3, 4, 6])
def test_polynomial_of_the_degree_is_itself(m):
    polynomial = np.polynomial.Polynomial(RNG.uniform(-1, 1, m + 2))
    for derivative in range(m + 1):
        values = polynomial.deriv(derivative)(KNOTS)
        start = {k: polynomial.deriv(k)(KNOTS[0]) for k in range(derivative)}
        found = derivatives(PolynomialMotion(KNOTS, values, m, derivative, start=start), 9)
        for k in range(m + 2):
            close(found[k], polynomial.deriv(k)(INSTANTS), 1e-9)
        np.testing.assert_array_equal(found[m + 2 :], 0)


@pytest.mark.parametrize("m, error", [(2, 1e-2), (4, 2e-5), (6, 1e-6), (8, 1e-8)])
def test_measured_accelerations(m, error):
    t = np.linspace(0.5, 2.2, 52)  # 51 segments of 1.7 s
    law = PolynomialMotion.from_accelerations(t, sine(t, 2), m, start={0: sine(t[0], 0), 1: sine(t[0], 1)})
    at = np.linspace(t[0], t[-1], 41)
    found = derivatives(law, 2, at)
    for k in range(3):
        close(found[k], sine(at, k), error)
    on_knots = derivatives(law, 2, np.append(t[:-1:10], t[-1]))
    close(on_knots[2], sine(np.append(t[:-1:10], t[-1]), 2), 1e-12)


@pytest.mark.parametrize(
    "start, end", [({0: 1.0, 1: 2.0}, {}), ({0: 1.0}, {0: 3.0}), ({0: 1.0}, {1: -1.0}), ({}, {0: 3.0, 1: -1.0})]
)
def test_conditions_on_the_constants_of_integration(start, end):
    law = PolynomialMotion.from_accelerations(KNOTS, VALUES, 4, start=start, end=end)
    found = derivatives(law, 2, KNOTS)
    close(found[2], VALUES)
    for k, value in start.items():
        assert found[k, 0] == pytest.approx(value, abs=1e-13)
    for k, value in end.items():
        assert found[k, -1] == pytest.approx(value, abs=1e-13)


def test_default_is_at_rest_at_the_start():
    found = derivatives(PolynomialMotion.from_accelerations(KNOTS, VALUES), 1, KNOTS)
    np.testing.assert_array_equal(found[:, 0], 0)


def test_linear_highest_derivative_integrates_in_closed_form():
    law = PolynomialMotion([0.0, 2.0], [6.0, -6.0], continuity=2, derivative=2, start={0: 1.0, 1: 0.5})
    t = np.array([0.0, 0.7, 1.9])
    close(derivatives(law, 0, t)[0], 1 + 0.5 * t + 3 * t**2 - t**3, 1e-15)


@pytest.mark.slow
def test_it_drives_a_mechanism():
    law = PolynomialMotion(KNOTS, VALUES, 4)
    found = jn.solve(crank(law), KNOTS[1:4], order=3).outputs["angle"]
    np.testing.assert_allclose(np.asarray(found).T, derivatives(law, 3, KNOTS[1:4]), rtol=1e-10)


def test_outside_the_knots_the_end_segments_go_on():
    law = PolynomialMotion([0.0, 1.0, 2.0, 3.0], np.array([0.0, 1.0, 8.0, 27.0]), 2, beyond="continue")
    close(derivatives(law, 0, [-1.0, 4.0])[0], np.array([-1.0, 64.0]), 1e-13)


@pytest.mark.parametrize(
    "arguments, message",
    [
        (([0.0, 1.0], [0.0]), "one value for each time"),
        (([0.0], [0.0]), "at least two samples are needed, got 1"),
        (([0.0, 1.0, 1.0], [0.0] * 3), r"times\[2\]: times of samples must increase, got 1.0; this one repeats"),
        (([0.0, 2.0, 1.0], [0.0] * 3), r"times\[2\]: .*got 1.0; this one comes before"),
        (([0.0, 1.0, 2.0], [0.0, math.nan, 0.0]), r"values\[1\]: samples must be finite, got nan"),
        ((["a", 1.0], [0.0, 1.0]), "times: must be real numbers"),
        ((KNOTS[:5], VALUES[:5], 4), "at least 6 knots, got 5; give more, or conditions"),
        ((KNOTS, VALUES, 0), "continuity: must be a whole number from 1 to 10, got 0"),
        ((KNOTS, VALUES, 4, 5), "derivative: must be a whole number from 0 to 4, got 5"),
        ((KNOTS, VALUES, 4, 0, {1: 0.0}), "4 conditions .* close the system, or none, got 1"),
        ((KNOTS, VALUES, 4, 0, {0: 0.0}), "start: the knots carry the derivative of order 0"),
        ((KNOTS, VALUES, 4, 2, {0: 0.0}), "2 conditions on the derivatives below order 2 .* got 1"),
        ((KNOTS, VALUES, 4, 2, {1: 0.0}, {1: 0.0}), "one at least must be on the position"),
        ((KNOTS, VALUES, 4, 0, {5: 0.0}), "from 0 to 4, got 5"),
        ((KNOTS, VALUES, 4, 0, {1: math.inf}), r"start\[1\]: the value of a condition must be a finite number"),
        ((KNOTS, VALUES, 4, 0, None, None, "naturel"), "did you mean 'natural'"),
        ((KNOTS, VALUES, 4, 0, dict.fromkeys((1, 2, 3, 4), 0.0)), "start: .* 4 .* start and 0 at the end: .* grows by"),
        ((KNOTS, VALUES, 4, 0, {1: 0.0}, dict.fromkeys((1, 2, 3), 0.0)), "end: .* every knot.*; give 2 at each end"),
        ((KNOTS, VALUES, 2, 0, {1: 0.0, 2: 0.0}), "start: .* grows by a factor at every knot.*; give 1 at each end"),
        ((KNOTS, VALUES, 3, 0, {1: 0.0, 2: 0.0, 3: 0.0}), "start: .*; give 2 at one end and 1 at the other"),
        ((KNOTS, VALUES, 4, 2, {0: 0.0, 1: 0.0, 3: 0.0, 4: 0.0}), "start: .*derivatives above that of the knots"),
    ],
)
def test_bad_knots_and_conditions(arguments, message):
    with pytest.raises(TrajectoryError, match=message):
        PolynomialMotion(*arguments)


@pytest.mark.parametrize("m, shares", [(4, (2, 2)), (3, (2, 1)), (3, (1, 2)), (2, (1, 1)), (6, (3, 3))])
def test_evenly_shared_conditions_give_the_law_of_smooth_data(m, shares):
    t = np.linspace(0.0, 1.7, 52)
    start, end = ({k: sine(x, k) for k in range(1, n + 1)} for x, n in zip((t[0], t[-1]), shares, strict=True))
    at = np.linspace(0.0, 1.7, 1001)
    found = derivatives(PolynomialMotion(t, sine(t, 0), m, start=start, end=end), 1, at)
    close(found[0], sine(at, 0), 1e-5)
    close(found[1], sine(at, 1), 1e-3)


def test_one_segment_takes_any_shares():
    law = PolynomialMotion([0.0, 2.0], [0.0, 32.0], 4, start=dict.fromkeys((1, 2, 3, 4), 0.0))
    close(derivatives(law, 0, [0.5, 1.0, 2.0])[0], np.array([0.5, 1.0, 2.0]) ** 5)


def test_knots_so_uneven_that_the_law_leaves_them_are_refused():
    knots = np.array([0.0, 1.0, 1.0001, 2.0, 3.0, 4.0, 5.0])
    with pytest.raises(TrajectoryError, match=r"(grows to|misses) .*shortest segment is 0.00012 of the mean .*evenly"):
        PolynomialMotion(knots, [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0], 4, ends="natural")


def test_conditions_that_determine_nothing():
    with pytest.raises(TrajectoryError, match="do not determine the law"):
        PolynomialMotion([0.0, 1.0], [0.0, 1.0], 4, start={3: 0.0, 4: 0.0}, end={3: 0.0, 4: 0.0})


def test_accelerations_need_continuity_two():
    with pytest.raises(TrajectoryError, match=r"continuous, got 1; .*at least 2"):
        PolynomialMotion.from_accelerations(KNOTS, VALUES, 1)
