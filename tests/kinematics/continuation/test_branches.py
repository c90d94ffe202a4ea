"""Motions stay on the branch on which they start, for any order and grid, and end at their last reachable position.

The branch of a slider-crank and of a four-bar is the sign of the root in its closed form, which nothing but a zero of
the root can change. `benchmarks/branches.py` asks the same of thousands of linkages of eleven kinds.
"""

from collections import Counter

import numpy as np
import pytest

import jounce as jn
from tests.oracles.linkage_paths import Law
from tests.problems.branch_study import NEAR, judged, random_cases, solved
from tests.problems.linkages import FourBar, Linkage, SliderCrank

SLIDER_CRANK, FOUR_BAR = SliderCrank(), FourBar()
LONG = [pytest.param(instants, marks=pytest.mark.slow) for instants in (1001, 10_001)]
GRIDS = [31, 301, *LONG]
ORDERS = [2, 4, pytest.param(8, marks=pytest.mark.slow)]


def uniform(start, rate):
    return Law(start, rate, 0.0, 0.0, 0.0)


def mechanism(family, values, law, guess):
    guess = dict(zip(family.guessed, guess, strict=True))
    return Linkage(family, values, law, np.zeros(0), guess, None).mechanism


@pytest.mark.slow
@pytest.mark.parametrize("instants", GRIDS)
@pytest.mark.parametrize("order", ORDERS)
def test_slider_crank_that_misses_its_dead_point_by_three_hundredths(order, instants):
    a, b = 0.8, 1.0
    e = a - np.sqrt(b**2 - 0.03**2)
    time = np.linspace(0, 1, instants)
    guess = (0.0, np.arcsin(e / b), a + np.sqrt(b**2 - e**2))
    motion = jn.solve(mechanism(SLIDER_CRANK, {"a": a, "b": b, "e": e}, uniform(0.0, 6.0), guess), time, order=order)
    expected = a * np.cos(6 * time) + np.sqrt(b**2 - (a * np.sin(6 * time) - e) ** 2)
    np.testing.assert_allclose(motion.outputs["B"][:, 0, 0], expected, rtol=0, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("instants", GRIDS)
@pytest.mark.parametrize("order", ORDERS)
def test_four_bar_that_cannot_pass_its_dead_point(order, instants):
    a, b, c, d = 0.237014, 1.091810, 1.987872, 1.116757
    law = uniform(-1.939155, 2.098682)
    time = np.linspace(0, 3, instants)
    family_mechanism = mechanism(FOUR_BAR, {"a": a, "b": b, "c": c, "d": d}, law, (law.start, -2.455015))
    motion = jn.solve(family_mechanism, time, order=order, strict=False)
    # crank and ground fold to a diagonal shorter than the difference of rod and rocker
    end = -np.arccos((a**2 + d**2 - (c - b) ** 2) / (2 * a * d))
    reached = law(time) < end
    assert 0 < reached.sum() < instants
    tip = a * np.exp(1j * law(time))
    way = d - tip
    along = (abs(way) ** 2 + b**2 - c**2) / (2 * abs(way) ** 2)
    with np.errstate(invalid="ignore"):
        expected = tip + way * (along - 1j * np.sqrt(b**2 / abs(way) ** 2 - along**2))
    found = motion.outputs["C"][:, 0] @ np.array([1, 1j])
    np.testing.assert_array_equal(motion.status == jn.Status.OK, reached)
    np.testing.assert_allclose(found[reached], expected[reached], rtol=0, atol=1e-10)
    assert np.isnan(found[~reached]).all()


@pytest.mark.slow
@pytest.mark.parametrize("family", [SLIDER_CRANK, FOUR_BAR], ids=["slider-crank", "four-bar"])
def test_random_linkages_are_followed_as_far_as_they_go_and_no_further(family):
    total = Counter()
    for case, verdict in judged([solved(case) for case in random_cases(family, 24, [7], [0, 2, 4])]):
        assert verdict.tally["wrong"] == 0, case
        assert verdict.tally["given up"] == verdict.tally["of them near"], (case, verdict.reasons, f"above {NEAR}")
        total += verdict.tally
    assert total["OK"] > 1000
    assert total["rightly refused"] > 300
    assert total["derivatives"] > 20


@pytest.mark.parametrize("side", [1, -1], ids=["parallelogram", "antiparallelogram"])
@pytest.mark.parametrize("instants", [30, 301])
def test_smooth_passage_of_a_change_point_keeps_to_its_own_curve(side, instants):
    """Where crank, rod and rocker are collinear, two smooth curves cross; the motion stays on its curve."""
    a, d = 0.5, 1.2
    law, time = uniform(0.4, 1.0), np.linspace(0, 2 * np.pi, instants)
    tip = a * np.exp(1j * law(time))
    if side == 1:
        expected = d + tip
    else:  # C is A mirrored on the line that halves the way from B to D at a right angle
        normal = (d - tip) / abs(d - tip)
        expected = 2 * ((tip + d) / 2 * normal.conj()).real * normal
    start = expected[0] - d
    family_mechanism = mechanism(FOUR_BAR, {"a": a, "b": d, "c": a, "d": d}, law, (law.start, np.angle(start)))
    motion = jn.solve(family_mechanism, time, order=2, strict=False)
    fine = motion.status == jn.Status.OK
    found = motion.outputs["C"][:, 0] @ np.array([1, 1j])
    np.testing.assert_allclose(found[fine], expected[fine], rtol=0, atol=1e-7)
    assert fine.mean() > 0.95  # all but a few next to the change points
