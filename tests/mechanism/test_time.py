"""Grids that are doubted, and the nearest of some instants, by whichever way it is found."""

import warnings

import numpy as np
import pytest
from hypothesis import given, strategies as st

import jounce as jn
from jounce.mechanism.time import nearest_instants, time_grid

MOMENTS = st.lists(st.floats(-10, 10).map(lambda x: round(x, 2)), min_size=1, max_size=12)


@given(MOMENTS, MOMENTS, st.booleans())
def test_the_nearest_is_nearest(known, instants, rising):
    known, instants = np.array(known), np.array(sorted(instants) if rising else instants)
    found = nearest_instants(known, instants)
    away = np.abs(instants[:, None] - known)
    np.testing.assert_allclose(away[np.arange(len(instants)), found], away.min(axis=1), rtol=0, atol=1e-14)


@pytest.mark.parametrize("instants", [np.array([0.5]), np.linspace(-1.0, 3.0, 9), np.linspace(3.0, -1.0, 9)])
def test_of_two_it_is_the_earlier(instants):
    """One instant is sought, many rising ones are shared out, others are sought one by one."""
    known = np.array([2.0, 0.0, 1.0])
    expected = [1 if t <= 0.5 else 2 if t <= 1.5 else 0 for t in instants]
    assert nearest_instants(known, instants).tolist() == expected


def test_a_step_that_is_likely_a_number_of_instants_is_warned_of():
    with pytest.warns(jn.errors.UnitWarning, match=r"121 s is longer than the grid: .* count=121 gives") as caught:
        grid = jn.TimeGrid(0, 2, 121)
    assert caught[0].filename == __file__
    assert time_grid(grid, {}).tolist() == [0.0, 2.0]


@pytest.mark.parametrize("field", ["start", "stop", "step"])
def test_what_is_no_number_is_refused_by_its_name(field):
    grid = jn.TimeGrid(**{"start": 0.0, "stop": 1.0, "step": 0.1, field: np.array([0.5])})
    with pytest.raises(jn.errors.MechanismError, match=rf"time\.{field}: must be one number, got array"):
        time_grid(grid, {})


@pytest.mark.parametrize("values", [(0, 2, 0.01), (0, 2, 5.0), (0, 2, "121 s"), (0, 200, 121), (0, 2, None, 121)])
def test_other_steps_are_not_doubted(values):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        jn.TimeGrid(*values)
    assert not caught
