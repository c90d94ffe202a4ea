"""Where laws jump or bend: against the instants at which they were made to."""

import numpy as np
import pytest

import jounce as jn
from jounce.trajectory.law_checks import breaks
from jounce.trajectory.law_checks.breaks import at_breaks, both_sides, law_breaks, may_break, with_sides

BENT = jn.laws.PiecewiseMotion(["t", "2*t - 0.25"], until=[0.25])
RAMP = jn.laws.SegmentedMotion(
    [jn.laws.Segment("dwell", 0.25), jn.laws.Segment("cycloidal", 0.5, by=0.1)], beyond="hold"
)


def expression(text):
    return jn.laws.ExpressionMotion(jn.laws.Expression(text), {})


@pytest.mark.parametrize(
    "law, expected",
    [
        (expression("sin(3*t) + t**5"), []),
        (expression("abs(t - 0.3)"), [0.3]),
        (expression("t*sign(t - 0.3)"), [0.3]),
        (expression("0.1*(t - 0.4)**2*sign(t - 0.4)"), [0.4]),
        (expression("abs(sin(7*t))"), [np.pi / 7, 2 * np.pi / 7]),
        (expression("abs(t - 0.3)**3*t"), [0.3]),
        (expression("((t - 0.3)**2)**0.5"), [0.3]),
        (expression("t + atan(tan(7*t))"), [np.pi / 14, 3 * np.pi / 14]),
        (expression("t/(2 - t)**2.5"), []),
        (jn.laws.FunctionMotion(lambda t: abs(t - 0.7)), [0.7]),
        (jn.laws.PiecewiseMotion(["t**4", "0.2**4 + abs(t - 0.6)"], until=[0.2]), [0.2, 0.6]),
        (RAMP, [0.25, 0.75]),
        (jn.laws.FollowingMotion(BENT, expression("t**2")), [0.5]),
        (jn.laws.FollowingMotion(RAMP, expression("t**2")), [0.5, np.sqrt(0.75)]),
        (jn.laws.FollowingMotion(expression("sin(t)"), BENT), [0.25]),
    ],
)
def test_breaks_are_found(law, expected):
    assert law_breaks([law], 0.0, 1.0, 4).tolist() == pytest.approx(expected, abs=1e-11)
    assert may_break(law) or not expected


def test_those_of_several_laws_are_reported_once():
    laws = [expression("abs(t - 0.5)"), jn.laws.PiecewiseMotion(["t", "0.5"], until=[0.5])]
    assert law_breaks(laws, 0.0, 1.0, 4).tolist() == pytest.approx([0.5], abs=1e-11)


def test_a_leader_of_several_laws_is_looked_at_once(monkeypatch):
    looked, seen = [], breaks.observed_jumps
    monkeypatch.setattr(breaks, "observed_jumps", lambda laws, *x: looked.extend(laws) or seen(laws, *x))
    leader = jn.laws.FunctionMotion(lambda t: abs(t - 0.7))
    laws = [jn.laws.FollowingMotion(own, leader) for own in (expression("sin(t)"), jn.laws.CycloidalMotion(0.0, 1.0))]
    assert law_breaks(laws, 0.0, 0.9, 2).tolist() == pytest.approx([0.7], abs=1e-11)
    assert looked == [leader]


@pytest.mark.parametrize("first, last", [(0.0, 1.0), (-3.0, 1e4), (1e6, 1e6 + 1.0)])
def test_sides_are_beside_and_within(first, last):
    between = np.array([first, (first + last) / 2, last])
    sides, which = both_sides(between, first, last)
    assert which.tolist() == [0, 1, 1, 2]
    assert first < sides[0] < sides[1] < between[1] < sides[2] < sides[3] < last
    np.testing.assert_allclose(sides, between[which], rtol=1e-14, atol=1e-10 * (last - first))
    np.testing.assert_array_equal(at_breaks(sides, between, first, last), between[which])
    assert len(with_sides(np.array([first, last]), between)) == 6
