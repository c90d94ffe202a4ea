"""Logs of very many samples: laws that are fitted when they are used, and what memory smoothing takes."""

import pickle
import tracemalloc

import numpy as np
import pytest

import jounce as jn
from jounce.trajectory.sampled import deferred


def log(count):
    """Return moves and dwells of one joint with noise, sampled at 1 kHz."""
    times = np.arange(count) * 1e-3
    cycle = np.clip(times % 5.0 / 3.0, 0, 1)
    move = cycle**4 * (35 - 84 * cycle + 70 * cycle**2 - 20 * cycle**3)
    values = np.where(times // 5.0 % 2 == 0, move, 1 - move)
    return times, values + 1e-5 * np.random.default_rng(0).normal(size=count)


@pytest.mark.filterwarnings("ignore::jounce.errors.SampleWarning")
def test_laws_through_very_many_samples_are_the_same_but_fitted_when_used(monkeypatch):
    times, values = log(3000)
    both = np.stack([values, np.sin(times)], axis=1)
    at_once = jn.JointTrajectory.from_samples(times, both, ["a", "b"])
    monkeypatch.setattr(deferred, "LONG", 1000)
    later = jn.JointTrajectory.from_samples(times, both, ["a", "b"])
    again = pickle.loads(pickle.dumps(later.part(["b"])))
    assert all(isinstance(x, deferred.SampledLaw) for x in (*later.laws.given().values(), *again.laws.given().values()))
    smoothed = jn.smooth(later, deviation=5e-5)
    assert all(isinstance(x, deferred.SampledLaw) for x in later.laws.given().values())
    instants = [0.3, 1.234, 2.9]
    expected = at_once.derivatives(instants, 3)
    np.testing.assert_array_equal(later.derivatives(instants, 3), expected)
    np.testing.assert_array_equal(again.derivatives(instants, 3)[..., 0], expected[..., 1])
    assert not any(isinstance(x, deferred.SampledLaw) for x in later.laws.given().values())
    np.testing.assert_array_equal(
        jn.smooth(at_once, deviation=5e-5).derivatives(instants, 4), smoothed.derivatives(instants, 4)
    )


def test_very_many_samples_are_checked_at_once_and_a_spline_that_fails_names_its_joint(monkeypatch):
    monkeypatch.setattr(deferred, "LONG", 10)
    times = np.arange(30.0)
    with pytest.raises(jn.errors.TrajectoryError, match="samples must be finite"):
        jn.JointTrajectory.from_samples(times, np.where(times == 7, np.nan, times)[:, None], ["a"])
    huge = jn.JointTrajectory.from_samples(times, np.where(times % 2 == 0, 1e308, -1e308)[:, None], ["a"])
    with pytest.raises(jn.errors.TrajectoryError, match=r"^a: no spline goes through the samples"):
        huge.derivatives([1.0], 1)


@pytest.mark.slow
def test_smoothing_takes_some_arrays_of_the_length_of_the_log():
    """Beside the samples themselves; a spline through them would take 6 numbers for each, and 20 while it is fitted."""

    def peak(count):
        times, values = log(count)
        tracemalloc.start()
        jn.smooth(jn.JointTrajectory.from_samples(times, values[:, None], ["a"]), deviation=1e-4)
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    peak(12_000)  # imports
    assert peak(360_000) / (8 * 360_000) < 14  # 13.0, of which the choice of pieces takes one
