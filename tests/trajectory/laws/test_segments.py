"""Laws of segments against what cam design prints of them, and against each other's derivatives."""

import math

import jax
import numpy as np
import pytest

import jounce as jn
from jounce.laws import Segment, SegmentedMotion

# peaks of velocity, acceleration and jerk over a way and a time of one, as handbooks of cam design print them
PEAKS = {
    "harmonic": (1.571, 4.935, 15.50),
    "cycloidal": (2.000, 6.283, 39.48),
    "polynomial_3_4_5": (1.875, 5.774, 60.00),
    "polynomial_4_5_6_7": (2.188, 7.513, 52.50),
    "modified_trapezoid": (2.000, 4.888, 61.43),
    "modified_sine": (1.760, 5.528, 69.47),
    "trapezoidal": (1.75, 6.125, 42.875),
}
JUST_BEFORE = 1.0 - 8 * np.finfo(float).eps  # an instant nearer than half of that is at its end
SMOOTH = {"harmonic": 1, "polynomial_4_5_6_7": 3}


def derivatives(law, instants, order=4):
    return np.asarray(law(jn.Jet.variable(np.asarray(instants, float), order)).derivatives())


@pytest.mark.parametrize("profile", PEAKS)
def test_profiles_have_the_peaks_that_are_printed_and_their_smoothness(profile):
    law = SegmentedMotion([Segment(profile, 1.0, to=1.0)])
    found = derivatives(law, np.linspace(0, 1, 20001)[:-1], 3)
    np.testing.assert_allclose(np.abs(found[1:]).max(axis=1), PEAKS[profile], rtol=5e-4)
    assert law.smoothness == SMOOTH.get(profile, 2)
    np.testing.assert_allclose(derivatives(law, [0.5])[0], 0.5, rtol=0, atol=1e-15)  # all are symmetric


def test_laws_known_already_are_the_same():
    segments = [Segment("cycloidal", 2.0, by=3.0), Segment("polynomial_4_5_6_7", 1.5, to=-1.0)]
    law, instants = SegmentedMotion(segments, initial=0.5, start=1.0), np.linspace(0.5, 5.0, 91)
    first = derivatives(jn.laws.CycloidalMotion(0.5, 3.5, 2.0, 1.0), instants)
    second = derivatives(jn.laws.RestToRestMotion(3.5, -1.0, 1.5, 3.0, rest=3), instants)
    expected = np.where(instants < 3.0, first, second)
    np.testing.assert_allclose(derivatives(law, instants), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


CAM = [
    Segment("dwell", 0.3),
    Segment("modified_sine", 0.5, to=2.0),
    Segment("polynomial", 0.4, by=-1.0, end=[-3.0, 0.5, 1.0]),
    Segment("constant_velocity", 0.2, by=-0.6),
    Segment("polynomial", 0.3, to=0.0, begin=[-3.0, 0.0], end=[0.0, 0.0, 0.0]),
]


def test_derivatives_are_those_of_the_law_and_repeat():
    law = SegmentedMotion(CAM, beyond="repeat", start=0.1)
    instants, step = np.linspace(-1.61, 3.21, 293), 1e-5
    found = derivatives(law, instants)
    slopes = (derivatives(law, instants + step) - derivatives(law, instants - step)) / (2 * step)
    np.testing.assert_allclose(slopes[0], found[1], rtol=0, atol=2e-7)
    np.testing.assert_allclose(found[:2], derivatives(law, instants + 1.7)[:2], rtol=0, atol=1e-11)
    at, jumps = law.jumps(3)
    np.testing.assert_allclose(at, [0.1, 0.4, 0.4625, 0.8375, 0.9, 1.3, 1.5])
    assert not jumps[:2].any()
    np.testing.assert_allclose(jumps[2], [0, 0, 0, 0, 0, -0.5, 0], rtol=0, atol=1e-12)
    assert law.smoothness == 1


@pytest.mark.parametrize("beyond, turns", [("hold", 0), ("repeat", 0), ("repeat", 1), ("repeat", 41), ("advance", 7)])
def test_instants_that_decimals_put_beside_a_border_have_the_derivatives_of_the_segment_that_begins(beyond, turns):
    """0.1 + 0.2 is above 0.3, and 0.7 below what ends there: the half wave that begins has -+ (pi / T)^2 h / 2."""
    segments = [Segment("harmonic", 0.1, to=0.1), Segment("harmonic", 0.2, to=0.3), Segment("dwell", 0.4)]
    last = Segment("harmonic", 0.1, to=0.2 if beyond == "advance" else 0.0)
    law = SegmentedMotion([*segments, last], beyond=beyond)
    borders, expected = np.array([0.1, 0.3, 0.7, 0.8]), [0.2, 0.0, last.to - 0.3, 0.1 if beyond != "hold" else 0.0]
    expected = np.array(expected) / 2 * (math.pi / np.array([0.2, 1.0, 0.1, 0.1])) ** 2
    for offset in (-1, 0, 1):
        instants = 0.8 * turns + borders
        instants += offset * np.spacing(instants)
        found = derivatives(law, instants, 2)
        np.testing.assert_allclose(found[2], expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found[1], 0.0, rtol=0, atol=1e-11)
    assert np.abs(derivatives(law, [0.3 * JUST_BEFORE], 2)[2] + (math.pi / 0.2) ** 2 / 10) < 1e-9


def test_a_polynomial_meets_what_it_is_given_at_both_ends():
    law = SegmentedMotion([Segment("polynomial", 0.7, to=2.0, begin=[1.0, -2.0, 3.0], end=[0.5, 4.0])], initial=-1.0)
    pieces = derivatives(law, [0.0, 0.7 * JUST_BEFORE], 3)
    np.testing.assert_allclose(pieces[:, 0], [-1.0, 1.0, -2.0, 3.0], rtol=1e-12)
    np.testing.assert_allclose(pieces[:3, 1], [2.0, 0.5, 4.0], rtol=1e-11)


def test_a_polynomial_begins_with_the_acceleration_that_the_one_before_was_free_to_end_with():
    """3.5 t^3 - 2.5 t^4 comes to 1 with the velocity 0.5, and with the acceleration 21 - 30."""
    first = Segment("polynomial", 1.0, to=1.0, begin=[0.0, 0.0], end=[0.5])
    law = SegmentedMotion([first, Segment("polynomial", 0.5, to=2.0), Segment("dwell", 1.0)])
    before, after = derivatives(law, [JUST_BEFORE, 1.0], 2).T
    np.testing.assert_allclose(after, [1.0, 0.5, -9.0], rtol=1e-12)
    np.testing.assert_allclose(before, after, rtol=1e-12)
    assert law.smoothness == 2
    free = Segment("polynomial", 1.0, to=1.0, begin=[0.0], end=[])  # t^2, on as 2 t - 1 + (t - 1)^2 + ...
    after = derivatives(SegmentedMotion([free, Segment("polynomial", 1.0, to=0.0)]), [1.0], 2)[:, 0]
    np.testing.assert_allclose(after, [1.0, 2.0, 2.0], rtol=1e-12)


def test_it_rests_before_and_after_or_goes_on_from_where_it_ended():
    turn = [Segment("cycloidal", 0.3, by=math.pi / 3), Segment("dwell", 0.2)]
    held, going = SegmentedMotion(turn, 1.0), SegmentedMotion(turn, 1.0, beyond="advance")
    assert derivatives(held, [-5.0, 7.0]).tolist() == [[1.0, 1.0 + math.pi / 3], *[[0.0, 0.0]] * 4]
    np.testing.assert_allclose(derivatives(going, [-0.1, 2.4])[0], 1 + math.pi / 3 * np.array([0, 5]), rtol=1e-14)
    assert going.smoothness == 2


def test_limits_are_kept_by_a_trapezoidal_segment():
    law = SegmentedMotion([Segment("trapezoidal", to=4.0, limits=[1.0, 1.0, 1.0]), Segment("dwell", 1.0)])
    found = np.abs(derivatives(law, np.linspace(0, 8, 4001), 3)[1:]).max(axis=1)
    np.testing.assert_allclose(found, 1.0, rtol=1e-9)
    assert law.stop == pytest.approx(7.0)


@pytest.mark.slow
def test_slopes_in_durations_and_ways_are_those_of_differences():
    def acceleration(duration, way):
        law = SegmentedMotion([Segment("modified_trapezoid", duration, by=way), Segment("polynomial", 1.0, to=0.0)])
        return law(jn.Jet.variable(np.asarray(0.7), 2)).derivatives()[2]

    found = jax.grad(acceleration, argnums=(0, 1))(0.6, 2.0)
    step = 1e-6
    for k, shift in enumerate(np.eye(2) * step):
        one, other = acceleration(0.6 + shift[0], 2 + shift[1]), acceleration(0.6 - shift[0], 2 - shift[1])
        np.testing.assert_allclose(found[k], (one - other) / (2 * step), rtol=1e-6)


def test_a_law_of_another_coordinate_has_the_derivatives_of_the_chain_rule():
    lift = SegmentedMotion([Segment("modified_sine", 2.0, to=1.0), Segment("cycloidal", 3.0, to=0.0)], beyond="repeat")
    follower, t = jn.laws.FollowingMotion(lift, "0.4*t + 0.3*sin(t)"), np.linspace(0.1, 9.0, 60)
    angle = derivatives(jn.laws.ExpressionMotion("0.4*t + 0.3*sin(t)"), t, 2)
    own = derivatives(lift, angle[0], 2)
    found = derivatives(follower, t, 2)
    np.testing.assert_allclose(found[1], own[1] * angle[1], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found[2], own[2] * angle[1] ** 2 + own[1] * angle[2], rtol=1e-11, atol=1e-13)


def test_pieces_follow_each_other_also_where_the_others_have_no_value():
    law = jn.laws.PiecewiseMotion(["sqrt(1 - t)", "log(t)", "t - 2"], until=[0.5, 2.0])
    found = derivatives(law, [0.0, 0.49, 0.5, 1.9, 2.0, 30.0], 1)
    np.testing.assert_allclose(found[0], [1.0, np.sqrt(0.51), np.log(0.5), np.log(1.9), 0.0, 28.0], rtol=1e-15)
    np.testing.assert_allclose(found[1, 2:5], [2.0, 1 / 1.9, 1.0], rtol=1e-15)
    instants, jumps = law.jumps(1)
    assert instants.tolist() == [0.5, 2.0]
    np.testing.assert_allclose(jumps[:, 1], [-np.log(2.0), 0.5], rtol=1e-15)


@pytest.mark.parametrize(
    "segments, options, name, words",
    [
        ([Segment("cycloid", 1.0, to=1.0)], {}, "segments[0].profile", "cycloidal"),
        ([Segment("cycloidal", 1.0)], {}, "segments[0]", "where it goes"),
        ([Segment("dwell", 1.0, to=2.0)], {}, "segments[0].to", "goes nowhere"),
        ([Segment("dwell")], {}, "segments[0].duration", "is missing"),
        ([Segment("cycloidal", -1.0, to=1.0)], {}, "segments[0].duration", "greater than zero"),
        ([Segment("cycloidal", 1.0, to=1.0, begin=[0.0])], {}, "segments[0].begin", "polynomial only"),
        ([Segment("trapezoidal", to=1.0, limits=[1.0])], {}, "segments[0].limits", "three numbers"),
        ([Segment("cycloidal", 1.0, to=1.0)], {"beyond": "repeat"}, "segments", "do not end where they begin"),
        ([], {}, "segments", "at least one"),
    ],
)
def test_what_is_no_law_is_refused_by_name(segments, options, name, words):
    with pytest.raises(jn.errors.TrajectoryError, match=words) as caught:
        SegmentedMotion(segments, **options)
    assert caught.value.name == name
