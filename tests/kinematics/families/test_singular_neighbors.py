"""Families with motions that begin or end next to a change point: outcomes are those of each design solved alone."""

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics.status import Status
from tests.problems.mechanisms import example

CHANGING = jn.load(example("four_bar")).with_parameters(AB=0.0713)  # AB + CD = AD + BC: passes through one line
BESIDE = {"AB": [0.0713, 0.0713]}


@pytest.fixture(scope="module")
def passed():
    """The instant at which all bars are collinear, from the motion through it."""
    return jn.solve(CHANGING, np.linspace(0.0, 1.5, 41), order=2).change_points[0]


@pytest.mark.slow
@pytest.mark.parametrize("side", ["end", "start"])
@pytest.mark.parametrize("gap", [5e-4, 1e-5])
def test_an_instant_next_to_a_change_point_is_refused_as_alone(passed, side, gap):
    time = np.linspace(0.0, passed - gap, 5) if side == "end" else np.linspace(passed + gap, passed + 0.4, 5)
    single = jn.solve(CHANGING, time, order=2, strict=False)
    family = jn.solve_batch(CHANGING, BESIDE, time, order=2)
    assert single.status[-1 if side == "end" else 0] == Status.SINGULAR
    for status in family["status"].values:
        np.testing.assert_array_equal(status, single.status)
