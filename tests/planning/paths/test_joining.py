"""Paths that begin off another one, and go on as that."""

import numpy as np
import pytest

import jounce as jn
from jounce.planning.paths.joining import extended_path, joined_from_rest
from jounce.planning.paths.paths import path_of
from jounce.planning.pieces import SmoothPieces

POINTS = np.array([[0.0, 0.2], [0.5, 1.0], [1.5, 0.4], [2.0, -0.3], [2.2, 0.1], [2.0, 0.9]])
WAVES = {"x": "sin(3*s)", "y": "s**2 - s"}


def steady(power):
    return [SmoothPieces(np.zeros(1), np.array([[1.0 + k], [power]]), 0.5) for k in range(2)]


@pytest.mark.parametrize("given", [POINTS, WAVES])
@pytest.mark.parametrize("share", [0.0, 0.05, 0.37, 0.8])
def test_what_follows_is_the_other_path_at_a_steady_rate(given, share):
    path = path_of(given, ("x", "y"), 2)
    at, rate = path.start + share * (path.stop - path.start), 0.7
    whole = extended_path(path, at, rate, steady(2.0), 0.5)
    assert whole.stop == pytest.approx(0.5 + (path.stop - at) / rate)
    s = np.linspace(0.5, whole.stop, 61)
    here = whole.derivatives(s, 4)
    there = path.derivatives(at + rate * (s - 0.5), 4) * rate ** np.arange(5)[:, None]
    inside = slice(None) if given is WAVES else np.abs(s[:, None] - (0.5 + (own_knots(path) - at) / rate)).min(1) > 1e-9
    np.testing.assert_allclose(here[inside], there[inside], atol=1e-9 * np.abs(there).max())
    np.testing.assert_allclose(whole.derivatives(np.array([0.25]), 1)[0], [[1.5, 2.5], [2.0, 2.0]], atol=1e-12)


def own_knots(path):
    return np.asarray(path.laws["x"].breakpoints)


def test_a_law_that_repeats_beyond_its_samples_goes_on_so():
    times = np.linspace(0.0, 0.5, 21)
    law = jn.laws.SplineMotion(times, np.sin(4 * np.pi * times), 5, beyond="repeat")
    path = path_of({"x": law, "y": "s"}, None, 2)
    whole = extended_path(path, 0.2, 1.0, steady(0.0), 0.5)
    np.testing.assert_allclose(whole.derivatives(np.array([1.2]), 0)[0, 0, 0], np.sin(4 * np.pi * 0.9), atol=1e-4)


def test_from_rest_it_begins_straight_toward_the_other_path():
    path = path_of(POINTS, ("x", "y"), 2)
    start = np.array([-0.5, 0.5])
    whole = joined_from_rest(path, start, 0.2)
    first = whole.derivatives(np.array([0.0, 1.0]), 3)
    there = path.derivatives(np.array([0.2]), 3)[0]
    np.testing.assert_allclose(first[0, :2], [start, there[0] - start], atol=1e-12)
    rate = np.linalg.norm(there[0] - start) / np.linalg.norm(there[1])
    np.testing.assert_allclose(first[1], there * rate ** np.arange(4)[:, None], rtol=1e-9, atol=1e-9)
