"""Laws that follow each other, with ends: held, repeated, advanced, refused, with parameters and negative turns."""

import math

import mpmath
import numpy as np
import pytest

import jounce as jn

WAYS = ("hold", "repeat", "advance")


def derivatives(law, instants, order=4):
    return np.asarray(law(jn.Jet.variable(np.array(instants, float), order)).dense().derivatives())


def geneva(t):
    """The wheel of four slots by its closed form, of the crank angle in mpmath, over any turns."""
    turn = mpmath.floor((t + mpmath.pi) / (2 * mpmath.pi))
    local = t - 2 * mpmath.pi * turn
    if abs(local) >= mpmath.pi / 4:
        return -mpmath.pi / 2 * turn - mpmath.sign(local) * mpmath.pi / 4
    return -mpmath.pi / 2 * turn - mpmath.atan(mpmath.sin(local) / (mpmath.sqrt(2) - mpmath.cos(local)))


GENEVA = jn.laws.PiecewiseMotion(
    ["pi/4", "-atan(sin(t)/(sqrt(2) - cos(t)))", "-pi/4"],
    until=[-math.pi / 4, math.pi / 4, math.pi],
    start=-math.pi,
    beyond="advance",
)


@pytest.mark.parametrize("leader", ["3*t - 0.2", "-2*t - 1", "5*sin(t)"])
def test_a_geneva_of_a_leader_over_many_and_negative_turns(leader):
    law = jn.laws.FollowingMotion(GENEVA, leader)
    instants = [-20.3, -1.0, 0.1, 0.4, 1.03, 2.2, 17.7]
    of_t = {"3*t - 0.2": lambda t: 3 * t - mpmath.mpf("0.2"), "-2*t - 1": lambda t: -2 * t - 1}
    inner = of_t.get(leader, lambda t: 5 * mpmath.sin(t))
    with mpmath.workdps(60):
        exact = [[mpmath.diff(lambda t: geneva(inner(t)), x, k) for x in instants] for k in range(5)]
    expected = np.array(exact, float)
    found = derivatives(law, instants)
    sizes = np.maximum(np.abs(expected).max(axis=1), 1e-9)[:, None]
    np.testing.assert_allclose(found / sizes, expected / sizes, rtol=0, atol=1e-12)


@pytest.mark.parametrize("way", WAYS)
def test_a_law_beyond_its_ends(way):
    law = jn.laws.PiecewiseMotion(["t**2", "2*t - 1", "5 - 2*t"], until=[1.0, 1.5, 2.5], start=0.0, beyond=way)
    inside = derivatives(law, [0.3, 1.2, 2.1])
    np.testing.assert_allclose(inside[:3], [[0.09, 1.4, 0.8], [0.6, 2, -2], [2, 0, 0]], atol=1e-14)
    beyond = derivatives(law, [-3.1, 11.2])
    if way == "hold":
        np.testing.assert_array_equal(beyond[0], [0.0, 0.0])
        assert not beyond[1:].any()
    else:  # of which both are the same, as it closes
        np.testing.assert_allclose(beyond, derivatives(law, [1.9, 1.2]), atol=1e-13)


def test_advance_adds_what_a_repetition_gains():
    law = jn.laws.PiecewiseMotion(["t**3", "1"], until=[1.0, 3.0], beyond="advance")
    np.testing.assert_allclose(derivatives(law, [-2.5, 3.5, 30.5], 3), [
        [-1 + 0.125, 1.125, 10.125], [0.75] * 3, [3.0] * 3, [6.0] * 3
    ], atol=1e-12)  # fmt: skip


def test_both_limits_at_a_knot_are_reported_also_those_between_repetitions():
    law = jn.laws.PiecewiseMotion(["t**2", "2*t - 1"], until=[1.0, 2.0], beyond="advance")
    instants, jumps = law.jumps(2)
    np.testing.assert_allclose(instants, [0.0, 1.0])
    np.testing.assert_allclose(jumps, [[0, 0], [-2, 0], [2, -2]])  # at 2 s speed falls from 2 to 0
    result = jn.laws.continuity(law, 0.5, 8.5)
    assert [(x.order, x.count) for x in result.derivatives if x.count] == [(1, 4), (2, 8)]
    held = jn.laws.PiecewiseMotion(["t"], until=[2.0], start=1.0, beyond="hold").jumps(1)
    np.testing.assert_allclose(held[0], [1.0, 2.0])
    np.testing.assert_allclose(held[1], [[0, 0], [1, -1]])


def test_what_is_not_defined_is_refused_by_name():
    law = jn.laws.PiecewiseMotion(["t"], until=[2.0])
    for instant in (-0.1, 2.1):
        with pytest.raises(
            jn.errors.MechanismError, match=r"the laws go from 0 to 2 s, and the law is not defined beyond"
        ):
            law(jn.Jet.variable(instant, 1))
        with pytest.raises(jn.errors.MechanismError, match="choose beyond: hold, repeat or advance"):
            law.check_instants(0.0, instant) if instant > 0 else law.check_instants(instant, 1.0)
    follower = jn.laws.FollowingMotion(law, "1 + t")
    follower.check_instants(-1.0, 1.0)
    with pytest.raises(jn.errors.MechanismError, match=r"its leader goes from 0.5 to 2.5: of that coordinate"):
        follower.check_instants(-0.5, 1.5)


def test_repetition_must_close_and_needs_an_end():
    with pytest.raises(jn.errors.TrajectoryError, match="do not end where they begin, but 1 from there"):
        jn.laws.PiecewiseMotion(["t"], until=[1.0], beyond="repeat")
    with pytest.raises(jn.errors.TrajectoryError, match="the last law has no end, got 'advance'; say until"):
        jn.laws.PiecewiseMotion(["t", "1"], until=[1.0], beyond="advance")
    with pytest.raises(jn.errors.TrajectoryError, match="give start, which is 0 unless given"):
        jn.laws.PiecewiseMotion(["t"], until=[-1.0], beyond="hold")


def test_instants_follow_parameters():
    law = jn.laws.PiecewiseMotion(["a*t", "a*T"], until=["T", "3*T"], beyond="advance").resolved({"a": 2.0, "T": 0.5})
    np.testing.assert_allclose(derivatives(law, [0.25, 1.0, 1.75], 1), [[0.5, 1.0, 1.5], [2, 0, 2]])


@pytest.mark.parametrize("way", ["repeat", "advance"])
def test_samples_repeat_and_advance_smoothly(way):
    """Samples of a function whose periodic part is a sine; to the error of the spline."""
    t = np.linspace(0.0, 2.0, 81)
    slope = 0.7 if way == "advance" else 0.0

    def exact(t):
        return slope * t + 0.1 * np.sin(np.pi * t), slope + 0.1 * np.pi * np.cos(np.pi * t)

    law = jn.laws.SplineMotion(t, exact(t)[0], beyond=way)
    instants = np.array([-5.3, 0.4, 2.0, 23.1])
    np.testing.assert_allclose(derivatives(law, instants, 1), exact(instants), rtol=0, atol=1e-7)
    measured = jn.laws.MeasuredMotion(t, exact(t)[1], derivative=1, beyond=way)
    np.testing.assert_allclose(derivatives(measured, instants, 1), exact(instants), rtol=0, atol=1e-7)


def test_samples_of_a_derivative_that_repeat_must_close():
    t = np.linspace(0.0, 1.0, 21)
    with pytest.raises(jn.errors.MechanismError, match="the law ends 1 from where it began, got 'repeat'"):
        jn.laws.MeasuredMotion(t, np.ones(21), derivative=1, beyond="repeat")
    with pytest.raises(jn.errors.MechanismError, match="its derivative 1 ends 1 from where it began"):
        jn.laws.MeasuredMotion(t, np.ones(21), derivative=2, beyond="advance")
    with pytest.raises(jn.errors.MechanismError, match="must end at the value they begin with"):
        jn.laws.MeasuredMotion(t, 2 * np.pi * t, derivative=1, beyond="repeat")


@pytest.mark.parametrize("beyond", ["repeat", "hold"])
def test_a_law_that_is_undefined_before_its_piece_begins_is_not_evaluated_there(beyond):
    """0.7 lies by rounding before 0.1 + 0.6, 2.1 before three times 0.7: sqrt(0) and its value count, no NaN."""
    law = jn.laws.PiecewiseMotion(["sqrt(t)", "sqrt(0.7 - t)"], until=[0.35, 0.1 + 0.6], beyond=beyond)
    lasting = jn.laws.PiecewiseMotion(["1 - t", "sqrt(t - (0.1 + 0.2)) + 0.7"], until=[0.1 + 0.2])
    assert lasting(jn.Jet([np.array([0.3, 0.3 - 1e-15])])).coefficients[0].tolist() == [0.7, 1 - (0.3 - 1e-15)]
    assert np.isfinite(derivatives(law, 0.7 * np.arange(1, 40) * (1 - 2.0**-53), 0)).all()
