"""Solved example files against independent references in thirty digits (tests/oracles/mpmath_kinematics.py)."""

import numpy as np
import pytest

import jounce as jn
from tests.problems.mechanisms import MECHANISMS, example, reference

JOUNCE, HIGH = 1e-14, 1e-12
# In the quick suite are planar joints and gears. In the slow one are all files, to order 10 in the plane and to jounce
# in space, where a file takes half a minute to compile beyond: one with an exception is among those, and one besides.
QUICK = ("four_bar", "gear_pair", "slider_crank")
# A driven distance whose high derivatives are 10^4 times smaller than those of the points that it is measured between,
# so that the rounding of the points shows in it: 1.4e-12 was measured at order 10.
CANCELLING = {("rspu_distance", "d"): 1e-11}
HIGH_IN_SPACE = {"rspu_distance": 8, "rsur": 10}


def errors(name, order):
    """Normalised RMSE of every output and derivative: by the maximum absolute value, as S does."""
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
@pytest.mark.parametrize("name", ["rack_pinion"])
def test_order_10(name):
    found = errors(name, 10)
    assert max(e for (_, k), e in found.items() if k <= 4) < JOUNCE
    assert max(found.values()) < HIGH


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
def test_all_files(name):
    space = jn.load(example(name)).space
    found = errors(name, 10 if space == "planar" else HIGH_IN_SPACE.get(name, 4))
    for (output, k), error in found.items():
        limit = JOUNCE if k <= 4 else CANCELLING.get((name, output), HIGH)
        assert error < limit, (output, k, error)


@pytest.mark.parametrize("order", [0, 1])
def test_lower_orders_are_the_same_motion(order):
    found = errors("slider_crank", order)
    assert {k for _, k in found} == set(range(order + 1))
    assert max(found.values()) < JOUNCE
