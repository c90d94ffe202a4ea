"""Trajectories of several joints: values against closed forms, and estimated errors against the true ones."""

import pickle
import warnings

import numpy as np
import pytest

import jounce as jn
from jounce.errors import RecordingWarning, SampleWarning, TrajectoryError
from jounce.jet import Jet
from jounce.trajectory import (
    CycloidalMotion,
    FunctionMotion,
    JointTrajectory,
    PolynomialMotion,
    RestToRestMotion,
    SplineMotion,
    TrapezoidalMotion,
)

SAMPLES = np.linspace(0.0, 2.0, 101)
AT = np.linspace(0.0, 2.0, 701)


def sine(t, k, w=3.0):
    return w**k * np.sin(w * t + k * np.pi / 2)


def gaussian(t, k):
    hermite = np.polynomial.hermite.Hermite([0.0] * k + [1.0])
    x = 3 * (t - 1)
    return (-3.0) ** k * hermite(x) * np.exp(-(x**2))


def quintic(t, k):
    law = np.polynomial.Polynomial([0.1, -1.0, 0.5, 2.0, -1.0, 0.4, -0.2, 0.03])
    return law.deriv(k)(t) if k else law(t)


@pytest.mark.slow
def test_each_law_as_if_alone():
    laws = {
        "a": "0.3*sin(2*t) + 1",
        "b": RestToRestMotion(0.0, 1.0, 1.5, 0.2),
        "c": 0.7,
        "d": "0.3*sin(2*t) + 1",
        "e": RestToRestMotion(2.0, 1.0, 1.0, 0.4),
        "f": CycloidalMotion(0.0, 1.0, 2.0),
        "g": SplineMotion(SAMPLES, sine(SAMPLES, 0)),
        "h": PolynomialMotion(SAMPLES, gaussian(SAMPLES, 0)),
        "i": PolynomialMotion(SAMPLES[::2], sine(SAMPLES[::2], 0)),
        "j": PolynomialMotion(SAMPLES, sine(SAMPLES, 0)),
        "k": TrapezoidalMotion(0.0, 1.0, duration=1.5),
        "l": FunctionMotion(lambda t: t * t),
    }
    trajectory = JointTrajectory(laws, 0.0, 2.0)
    at = np.array([0.0, 0.33, 1.21, 2.0])
    found = trajectory.derivatives(at, 4)
    assert trajectory.names == tuple(laws)
    assert found.shape == (4, 5, 12)
    for column, law in enumerate(trajectory.laws.values()):
        single = np.array(law(Jet.variable(at, 4)).derivatives())
        np.testing.assert_allclose(found[:, :, column].T, single, rtol=1e-13, atol=1e-13)
    chosen = trajectory.derivatives(at, 4, names=["k", "a"])
    np.testing.assert_allclose(chosen, found[:, :, [10, 0]], rtol=1e-14, atol=1e-14)


def test_a_law_may_be_a_function_which_is_read_at_each_call():
    gain = [0.5]
    trajectory = JointTrajectory({"a": lambda t: gain[0] * t**3, "b": 1.0}, 0.0, 2.0)
    for gain[0] in (0.5, 2.0):
        expected = gain[0] * np.array([8.0, 12.0, 12.0, 6.0])
        np.testing.assert_allclose(trajectory.derivatives([2.0], order=3)[0, :, 0], expected, rtol=1e-15)


def test_call_on_a_jet_with_any_batch():
    trajectory = JointTrajectory({"a": "sin(t)", "b": "t**3", "c": "cos(t)"}, 0.0, 2.0)
    jet = trajectory(Jet.variable(np.array([[0.1, 0.2], [0.3, 0.4]]), 2))
    assert jet.shape == (3, 2, 2)
    flat = trajectory.derivatives([0.1, 0.2, 0.3, 0.4], 2)
    np.testing.assert_allclose(np.array(jet.derivatives()).reshape(3, 3, 4), np.moveaxis(flat, 0, -1), atol=1e-15)
    assert trajectory(Jet.variable(np.array(0.1), 2), names=["b"]).shape == (1,)


@pytest.mark.parametrize(
    "degree, errors", [(3, [1e-6, 1e-4, 5e-3]), (5, [1e-9, 1e-7, 1e-5]), (9, [1e-13, 1e-11, 1e-9])]
)
def test_splines_through_samples(degree, errors):
    positions = np.stack([sine(SAMPLES, 0), quintic(SAMPLES, 0)], axis=1)
    trajectory = JointTrajectory.from_samples(SAMPLES, positions, ["a", "b"], degree)
    np.testing.assert_array_equal(trajectory.times, SAMPLES)
    found = trajectory.derivatives(AT, 2)
    for k, error in enumerate(errors):
        for column, law in enumerate((sine, quintic)):
            assert np.abs(found[:, k, column] - law(AT, k)).max() <= error * np.abs(law(AT, k)).max()


def true_errors(samples, law, degree, noise=None):
    values = law(samples, 0) + (0.0 if noise is None else noise)
    trajectory = JointTrajectory.from_samples(samples, values[:, None], ["a"], degree)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        found = trajectory.derivatives(AT, degree)[:, :, 0]
    peaks = [np.abs(law(AT, k)).max() for k in range(degree + 1)]
    true = [np.abs(found[:, k] - law(AT, k)).max() / peaks[k] for k in range(degree + 1)]
    return np.array(true), trajectory.estimate_error(degree)[:, 0]


@pytest.mark.parametrize("law", [sine, gaussian])
@pytest.mark.parametrize("degree", [3, 5, 7])
@pytest.mark.parametrize("count", [41, 101])
def test_estimate_of_the_error_of_interpolation(law, degree, count):
    true, estimate = true_errors(np.linspace(0.0, 2.0, count), law, degree)
    known = (true < 0.3) & (estimate < 1)  # beyond that both say: nothing is known
    assert known[: degree - 1].all()
    ratio = (estimate / true)[known]
    assert (ratio >= 1).all()
    assert (ratio <= (30 if degree == 7 else 10)).all()


@pytest.mark.parametrize("count", [101, 401])
def test_estimate_of_the_error_of_noise(count):
    samples = np.linspace(0.0, 2.0, count)
    for seed in range(3):
        noise = np.random.default_rng(seed).normal(0, 1e-6, count)
        true, estimate = true_errors(samples, sine, 5, noise)
        known = (true < 0.3) & (estimate < 1)
        assert known.sum() >= 2
        ratio = (estimate / true)[known]
        assert (ratio >= 0.7).all()  # the largest of several hundred errors scatters
        assert (ratio <= 15).all()


def test_estimate_sees_the_digits_of_a_file():
    """Positions written with six decimals: the estimate is that of a rounding of 1e-6/sqrt(12)."""
    samples = np.linspace(0.0, 2.0, 401)
    rounding = np.round(sine(samples, 0), 6) - sine(samples, 0)
    true, estimate = true_errors(samples, sine, 5, rounding)
    for k in range(3):
        assert 0.7 * true[k] <= estimate[k] <= 15 * true[k]


def test_estimate_on_uneven_samples():
    rng = np.random.default_rng(5)
    samples = np.linspace(0.0, 2.0, 101)
    samples[1:-1] += rng.uniform(-0.005, 0.005, 99)
    true, estimate = true_errors(samples, sine, 5)
    assert (estimate[:5] >= true[:5]).all()
    assert (estimate[:5] <= 20 * true[:5]).all()


def test_warning_when_samples_do_not_support_the_order():
    positions = np.stack([sine(SAMPLES, 0), sine(SAMPLES, 0, 40.0)], axis=1)
    trajectory = JointTrajectory.from_samples(SAMPLES, positions, ["slow", "fast"])
    supported = trajectory.supported_order()
    assert 0 <= supported < trajectory.supported_order(names=["slow"]) <= 5
    trajectory.derivatives(AT, supported)  # warnings are errors here
    message = f"samples of 'fast' do not support its derivative of order {supported + 1}: its error is about"
    with pytest.warns(SampleWarning, match=message):
        trajectory.derivatives(AT, supported + 1)


def test_warning_above_the_degree():
    trajectory = JointTrajectory.from_samples(SAMPLES, quintic(SAMPLES, 0)[:, None], ["a"])
    with pytest.warns(SampleWarning, match=r"order [56].*degree 5 .*continuous .*order 4"):
        trajectory.derivatives([1.0], 7)


def test_warning_with_too_few_samples_to_compare():
    few = np.linspace(0.0, 2.0, 7)
    with pytest.warns(SampleWarning, match="cannot be known from them"):
        JointTrajectory.from_samples(few, sine(few, 0)[:, None], ["a"]).derivatives([1.0], 1)


def test_a_gap_between_samples_is_told_of():
    """A pulse that is within the gap leaves the estimate as it is."""
    times = SAMPLES[(SAMPLES < 0.8) | (SAMPLES > 1.25)]
    values = np.sin(times) + np.exp(-(((times - 1.0) / 0.03) ** 2))
    with pytest.warns(RecordingWarning, match=r"no samples between t = 0\.78 and 1\.26 s: the motion there is what a"):
        trajectory = JointTrajectory.from_samples(times, values[:, None], ["a"])
    assert trajectory.estimate_error(0)[0, 0] < 1e-6 < 0.9 < 1 + np.sin(1) - trajectory.derivatives([1.0], 0)[0, 0, 0]


def test_a_joint_that_stands_still_has_no_error():
    positions = np.stack([np.full(101, 0.1), sine(SAMPLES, 0), 0.3 + 0.2 * SAMPLES], axis=1)
    trajectory = JointTrajectory.from_samples(SAMPLES, positions, ["still", "moving", "steady"])
    np.testing.assert_array_equal(trajectory.estimate_error(4)[:, 0], 0)
    trajectory.derivatives(AT, 4, names=["still", "steady"])  # warnings are errors here


def test_exact_laws_have_no_error():
    trajectory = JointTrajectory({"a": "sin(t)"}, 0.0, 1.0)
    np.testing.assert_array_equal(trajectory.estimate_error(9), 0)
    assert trajectory.supported_order() == 30


@pytest.mark.parametrize("profile", ["minimum_jerk", "cycloidal", "polynomial_4_5_6_7", "trapezoidal"])
def test_point_to_point_together_and_within_limits(profile):
    start, end = [0.0, 1.0, 0.5], [1.0, -1.0, 0.5]
    limits = [[1.0, 1.5, 1.0], [2.0, 2.0, 2.0], [20.0, 30.0, 20.0]]
    trajectory = JointTrajectory.point_to_point(["a", "b", "c"], start, end, profile, start_time=0.5, limits=limits)
    assert trajectory.start == 0.5
    found = trajectory.derivatives(np.linspace(0.5, trajectory.stop, 1201), 3)
    np.testing.assert_allclose(found[0, 0], start, atol=1e-15)
    np.testing.assert_allclose(found[-1, 0], end, atol=1e-15)
    ratios = np.abs(found[:, 1:]).max(axis=0) / np.array(limits)
    assert ratios.max() == pytest.approx(1, abs=1e-4)
    assert (ratios <= 1 + 1e-12).all()
    np.testing.assert_array_equal(found[:, 1:, 2], 0)


BAD = [
    (lambda: JointTrajectory({}, 0.0, 1.0), "at least one joint"),
    (lambda: JointTrajectory({"a": "sin(x)"}, 0.0, 1.0), r"laws\.a: .*'x'"),
    (lambda: JointTrajectory({"a": [1.0]}, 0.0, 1.0), r"laws\.a: must be a law of time"),
    (lambda: JointTrajectory({"a": lambda t: np.sin(t)}, 0.0, 1.0), r"laws\.a: the motion law cannot be used: .*jax"),
    (lambda: JointTrajectory({"a": 1.0}, 1.0, 1.0), "stop: must come after the start, 1 s, got 1.0"),
    (lambda: JointTrajectory({"a": 1.0}, 0.0, 1.0, [0.0, 2.0]), r"times\[1\]: the trajectory goes from 0 to 1 s"),
    (lambda: JointTrajectory({"a": 1.0}, 0.0, 1.0).derivatives([0.5, 1.1], 1), r"times\[1\]: .* got 1.1"),
    (lambda: JointTrajectory({"a": 1.0}, 0.0, 1.0).derivatives([np.nan], 1), r"times: must be finite, got \[nan\]"),
    (lambda: JointTrajectory({"a": 1.0}, 0.0, 1.0).derivatives([0.5], -1), "order: must be a whole number"),
    (lambda: JointTrajectory({"elbow": 1.0}, 0.0, 1.0).derivatives([0.5], 1, ["elbo"]), "did you mean 'elbow'"),
    (lambda: JointTrajectory({"a": 1.0}, 0.0, 1.0).derivatives([0.5], 1, ["a", "a"]), "named twice, got 'a'"),
    (lambda: JointTrajectory({"a": "sqrt(t)"}, 0.0, 1.0).derivatives([0.5, 0.0], 1), r"laws\.a: .* smooth at 0 s"),
    (lambda: JointTrajectory.from_samples(SAMPLES, sine(SAMPLES, 0), ["a"]), r"shape \(samples, 1\)"),
    (lambda: JointTrajectory.from_samples(SAMPLES[:5], np.zeros((5, 1)), ["a"]), "at least 6 samples, got 5"),
    (
        lambda: JointTrajectory.from_samples(SAMPLES, np.zeros((101, 1)), ["a"], 4),
        "degree: .* odd, from 3 to 11, got 4",
    ),
    (lambda: JointTrajectory.from_samples(SAMPLES[::-1], np.zeros((101, 1)), ["a"]), r"times\[1\]: .* must increase"),
    (lambda: JointTrajectory.from_samples([0.0, 1.0], [[0.0], [np.nan]], ["a"], 3), r"values\[1\]\[0\]: .* got nan"),
    (lambda: JointTrajectory.point_to_point(["a"], [0.0], [1.0]), "either limits or a duration"),
    (
        lambda: JointTrajectory.point_to_point(["a"], [0.0, 1.0], [1.0], duration=1.0),
        r"start: must have the shape \(1,\)",
    ),
    (
        lambda: JointTrajectory.point_to_point(["a"], [0.0], [1.0], duration=-1.0),
        "a: must be greater|duration: must be",
    ),
    (lambda: JointTrajectory.point_to_point(["a"], [1.0], [1.0], limits=[1, 1, 1]), "the start is the end"),
    (lambda: JointTrajectory.from_samples(SAMPLES, np.full((101, 1), 1j), ["a"]), "values: must be real numbers, got"),
    (lambda: JointTrajectory.from_samples(SAMPLES + 0j, np.zeros((101, 1)), ["a"]), "times: must be real numbers, got"),
    (lambda: JointTrajectory({"a": np.complex128(1j)}, 0.0, 1.0), r"laws\.a: must be a law of time"),
    (lambda: JointTrajectory({"a": 1.0}, 0.0, 1.0).derivatives(np.array([0.5j]), 1), "times: must be real numbers"),
    (lambda: JointTrajectory.point_to_point(["a"], np.array([1j]), [1.0], duration=1.0), "start: must be real numbers"),
]


@pytest.mark.parametrize("number", range(len(BAD)))
def test_bad_trajectories(number):
    make, message = BAD[number]
    with pytest.raises(TrajectoryError, match=message):
        make()


def test_exported():
    assert issubclass(jn.errors.TrajectoryError, jn.JounceError)


def test_a_trajectory_goes_to_other_processes_whole():
    trajectory = JointTrajectory.from_samples(SAMPLES, np.sin(SAMPLES)[:, None], ["a"])
    again = pickle.loads(pickle.dumps(trajectory))
    assert (again.derivatives(AT, 3) == trajectory.derivatives(AT, 3)).all()
    assert (again.times == trajectory.times).all()
