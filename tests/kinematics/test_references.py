"""Solved example files against independent references in thirty digits (tests/oracles/mpmath_kinematics.py)."""

import numpy as np
import pytest

import jounce as jn
from tests.problems.mechanisms import MECHANISMS, example, reference

JOUNCE, HIGH = 1e-14, 1e-12
# In the quick suite are planar joints and gears. In the slow one are all files, to jounce. Orders beyond come by the
# same recursion and take long to compile: a few have them, with loops and rolling in the plane, one in space.
QUICK = ("four_bar", "gear_pair", "slider_crank")
HIGHER = {"rolling_disc": 8, "six_bar_watt": 10, "rsur": 6}


def errors(name, order):
    """Normalized RMSE of every output and derivative: by the maximum absolute value, as S does."""
    time, outputs = reference(name)
    motion = jn.solve(jn.load(example(name)), time, order=order)
    assert not motion.status.any()
    found = {}
    for output, truth in outputs.items():
        values = np.moveaxis(motion.outputs[output], 1, 0)
        assert len(values) == order + 1
        for k, value in enumerate(values):
            scale = np.abs(truth[k]).max()
            found[output, k] = np.sqrt(np.mean((value - truth[k]) ** 2)) / (scale or 1.0)
    return found


@pytest.mark.parametrize("name", QUICK)
def test_to_jounce(name):
    found = errors(name, 4)
    assert max(found.values()) < JOUNCE, found


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
def test_all_files(name):
    for (output, k), error in errors(name, HIGHER.get(name, 4)).items():
        assert error < (JOUNCE if k <= 4 else HIGH), (output, k, error)


@pytest.mark.parametrize("order", [0, 1])
def test_lower_orders_are_the_same_motion(order):
    found = errors("slider_crank", order)
    assert {k for _, k in found} == set(range(order + 1))
    assert max(found.values()) < JOUNCE
