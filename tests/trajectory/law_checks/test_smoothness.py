"""To which derivative laws are continuous, and the jumps of the others."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn

JUMPS = {  # of cam profiles of unit rise and duration, at the beginning: order, size
    "harmonic": (2, math.pi**2 / 2),
    "cycloidal": (3, 4 * math.pi**2),
    "polynomial_3_4_5": (3, 60.0),
    "polynomial_4_5_6_7": (4, 840.0),
}


@pytest.mark.parametrize("profile", JUMPS)
def test_segments_jump_as_their_formulas_say(profile):
    order, size = JUMPS[profile]
    law = jn.laws.SegmentedMotion(
        [jn.laws.Segment("dwell", 0.5), jn.laws.Segment(profile, 2.0, by=3.0), jn.laws.Segment("dwell", 1.0)]
    )
    found = jn.laws.continuity(law, 0.0, 4.0)
    assert found.smoothness == order - 1
    jumps = found.derivatives[order]
    assert jumps.count == 2
    assert abs(jumps.size) == pytest.approx(3 * size / 2**order)
    assert jumps.instant == 0.5
    assert all(x.count == 0 for x in found.derivatives[:order])


def test_profiles_jump_as_their_formulas_say():
    for rest in (1, 2, 3):  # the derivative above the rest is (2 r + 1)! / r! of the way, at both ends
        law = jn.laws.RestToRestMotion(1.0, 3.0, duration=0.5, start_time=0.25, rest=rest)
        found = jn.laws.continuity(law, 0.0, 1.0)
        jumps = found.derivatives[rest + 1]
        size = 2.0 * math.factorial(2 * rest + 1) / math.factorial(rest) / 0.5 ** (rest + 1)
        assert (found.smoothness, jumps.count, found.unknown) == (rest, 2, "")
        assert (jumps.size, jumps.instant) == (pytest.approx(size), 0.25)
        assert jn.laws.continuity(law, 0.3, 0.7).smoothness is None
    cycloid = jn.laws.continuity(jn.laws.CycloidalMotion(0.0, -1.0, duration=2.0), -1.0, 3.0)
    assert (cycloid.smoothness, cycloid.derivatives[3].size) == (2, pytest.approx(-(math.pi**2) / 2))


def test_what_follows_jumps_where_its_leader_passes_the_knots():
    lift = jn.laws.SegmentedMotion(
        [jn.laws.Segment("harmonic", math.pi, to=0.02), jn.laws.Segment("harmonic", math.pi, to=0.0)]
    )
    law = jn.laws.FollowingMotion(lift, "2*pi*t + 0.1*sin(2*pi*t)")
    found = jn.laws.continuity(law, -0.2, 1.2)
    assert found.smoothness == 1
    jumps = found.derivatives[2]
    speed = 2 * math.pi * 1.1  # at 0 s and at 1 s
    assert jumps.count == 2
    assert abs(jumps.size) == pytest.approx(0.01 * speed**2)
    assert jumps.instant == pytest.approx(0.0, abs=1e-12)
    assert found.derivatives[3].count == 0  # the leader has no acceleration there
    repeated = jn.laws.SegmentedMotion(
        [jn.laws.Segment("cycloidal", math.pi, to=1.0), jn.laws.Segment("cycloidal", math.pi, to=0.0)], beyond="repeat"
    )
    turning = jn.laws.continuity(jn.laws.FollowingMotion(repeated, "-2*pi*t"), 0.1, 10.1)
    assert turning.smoothness == 2
    assert turning.derivatives[3].count == 20


@pytest.mark.parametrize("leader", ["2*pi*t", "2*pi - 2*pi*t"])
def test_a_leader_that_begins_or_ends_at_a_knot_passes_it(leader):
    """As the same law of the time does: acceleration of a harmonic rise jumps at its beginning and at its end."""
    rise = [jn.laws.Segment("harmonic", math.pi, by=0.02), jn.laws.Segment("dwell", math.pi)]
    for beyond, count in (("hold", 2), ("advance", 3)):
        found = jn.laws.continuity(
            jn.laws.FollowingMotion(jn.laws.SegmentedMotion(rise, beyond=beyond), leader), 0.0, 1.0
        )
        assert (found.smoothness, found.derivatives[2].count) == (1, count)


@pytest.mark.parametrize("leader", ["sqrt(t)", "sqrt(1 - t)"])
def test_a_leader_that_has_no_value_beyond_its_ends_passes_nothing_there(leader):
    rise = [jn.laws.Segment("dwell", 0.5), jn.laws.Segment("harmonic", 0.3, by=0.02), jn.laws.Segment("dwell", 0.7)]
    found = jn.laws.continuity(jn.laws.FollowingMotion(jn.laws.SegmentedMotion(rise), leader), 0.0, 1.0)
    assert (found.smoothness, found.derivatives[2].count) == (1, 2)


def test_pieces_splines_and_expressions():
    pieces = jn.laws.PiecewiseMotion(["t**3", "3*t - 2"], until=[1.0])
    result = jn.laws.continuity(pieces, 0.0, 2.0)
    assert result.smoothness == 1
    assert result.derivatives[2].size == -6.0
    assert jn.laws.continuity(pieces, 0.0, 0.5).smoothness is None  # nothing happens there
    t = np.linspace(0.0, 1.0, 21)
    spline = jn.laws.continuity(jn.laws.SplineMotion(t, np.sin(7 * t), degree=5), 0.0, 1.0)
    assert spline.smoothness == 4
    assert spline.derivatives[5].count > 5
    held = jn.laws.continuity(jn.laws.SplineMotion(t, np.sin(7 * t), beyond="hold"), -1.0, 2.0)
    assert held.smoothness == 0
    assert held.derivatives[1].size == pytest.approx(7.0, rel=1e-3)
    assert jn.laws.continuity(jn.laws.ExpressionMotion("sin(t)"), 0.0, 1.0).unknown == ""
    assert "seen" in jn.laws.continuity(jn.laws.ExpressionMotion("abs(t)"), 0.0, 1.0).unknown
    assert "seen" in jn.laws.continuity(jn.laws.FunctionMotion(lambda t: t), 0.0, 1.0).unknown
    assert "too fast" in jn.laws.continuity(jn.laws.FunctionMotion(lambda t: jnp.sin(1e6 * t)), 0.0, 1.0).unknown
    with pytest.raises(jn.errors.TrajectoryError, match="from 0 to 10"):
        jn.laws.continuity(pieces, 0.0, 1.0, order=11)


KINKS = {  # smoothness, and the first jumps: when, by how much
    "abs(t - 0.3)": (0, [0.3], 2.0),
    "sqrt((t - 0.3)**2)": (0, [0.3], 2.0),
    "((t - 0.3)**2)**0.5": (0, [0.3], 2.0),
    "sin(3*t) + 1e-3*((t - 0.3)**2)**1.5": (2, [0.3], 1.2e-2),
    "acos(cos(10*t))": (0, [np.pi / 10, np.pi / 5, 0.3 * np.pi], -20.0),
    "asin(sin(10*t))": (0, [np.pi / 20, 3 * np.pi / 20, np.pi / 4], -20.0),
    "atan2(sin(10*t), cos(10*t))": (-1, [np.pi / 10, 0.3 * np.pi], -2 * np.pi),
    "atan(1/(t - 0.4))": (-1, [0.4], np.pi),
    "(t + 0.3 - abs(t - 0.3))/2": (0, [0.3], -1.0),
    "t*abs(t - 0.7)*(t - 0.7)": (1, [0.7], 2.8),
    "exp(sin(abs(abs(t - 0.5) - 0.2)))": (0, [0.3, 0.5, 0.7], 2 * math.exp(math.sin(0.2)) * math.cos(0.2)),
    "0.05*cos(6*t) + sqrt(0.05**2 - (0.05*sin(6*t))**2)": (0, [np.pi / 12, np.pi / 4], 0.6),
    "(t - 0.3)*abs(t - 0.3)**0.5": (1, [0.3], np.inf),
}


@pytest.mark.parametrize("text", KINKS)
def test_kinks_of_formulas_are_found_whatever_function_they_come_from(text):
    smoothness, instants, size = KINKS[text]
    found = jn.laws.continuity(jn.laws.ExpressionMotion(text), 0.0, 1.0)
    jumps = found.derivatives[smoothness + 1]
    assert (found.smoothness, jumps.count) == (smoothness, len(instants))
    assert min(abs(jumps.instant - t) for t in instants) < 1e-9
    assert abs(jumps.size) == pytest.approx(abs(size), rel=1e-5)


@pytest.mark.parametrize(
    "function, smoothness, count",
    [
        (lambda t: jnp.minimum(t, 0.3), 0, 1),
        (lambda t: jnp.where(t < 0.3, 0.0, (t - 0.3) ** 3), 2, 1),
        (lambda t: jnp.floor(10 * t + 0.05) / 10, -1, 10),
        (lambda t: jnp.mod(t, 0.3), -1, 3),
        (lambda t: jnp.interp(t, jnp.array([0.0, 0.3, 0.31, 1.0]), jnp.array([0.0, 1.0, 0.0, 1.0])), 0, 2),
        (lambda t: jnp.sign(jnp.sin(7 * t)) * jnp.sin(7 * t) ** 2, 1, 2),
        (lambda t: jnp.sqrt((t - 0.3) ** 2 + 1e-8), None, 0),
        (lambda t: jnp.tanh(1e5 * (t - 0.3)), None, 0),
        (lambda t: jnp.exp(-(((t - 0.3) / 1e-3) ** 2)), None, 0),
        (lambda t: jnp.arccos(0.9999 * jnp.cos(10 * t)), None, 0),
    ],
)
def test_kinks_of_functions_are_found_and_smooth_ones_have_none(function, smoothness, count):
    found = jn.laws.continuity(jn.laws.FunctionMotion(function), 0.0, 1.0)
    assert found.smoothness == smoothness
    assert not count or found.derivatives[smoothness + 1].count == count


def test_kinks_of_a_leader_show_in_what_follows_it():
    """Beside the knots of the law that follows, which the leader passes."""
    bent = jn.laws.PiecewiseMotion(["t", "2*t - 0.25"], until=[0.25])
    found = jn.laws.continuity(jn.laws.FollowingMotion(bent, "abs(t - 0.5)"), 0.0, 1.0)
    assert (found.smoothness, found.derivatives[1].count) == (0, 3)  # the leader is 0.25 at 0.25 s and at 0.75 s
    assert found.derivatives[1].size == pytest.approx(2.0)
    assert found.derivatives[1].instant == pytest.approx(0.5)


@pytest.mark.parametrize("law", ["0.01*(1 - cos(t))", "0.2*sin(3*t) - 0.1*sin(t)**2"])
def test_rounding_is_no_jump_where_a_smooth_law_begins_again(law):
    """sin(2 pi) is 2e-16 and not zero: a derivative that vanishes where laws meet is rounding of any size."""
    result = jn.laws.continuity(jn.laws.ExpressionMotion(law), 0.0, 2 * math.pi, order=6, periodic=True)
    assert result.smoothness is None


def test_rounding_is_no_jump_between_pieces():
    law = jn.laws.PiecewiseMotion(["sin(pi*t)", "pi*(1 - t)", "-pi + sin(t - 2)**3"], until=[1.0, 2.0])
    result = jn.laws.continuity(law, 0.0, 3.0)
    assert [x.count for x in result.derivatives] == [0, 1, 0, 2, 0]
    assert result.derivatives[1].size == pytest.approx(math.pi)
    assert result.derivatives[3].size == pytest.approx(-(math.pi**3))
    share = "(t/0.7)"
    rise = f"10*{share}**3 - 15*{share}**4 + 6*{share}**5"
    for after in ("1", jn.laws.SplineMotion(np.linspace(0.7, 0.9, 11), np.ones(11))):  # these say nothing after 0.9 s
        result = jn.laws.continuity(jn.laws.PiecewiseMotion([rise, after], until=[0.7]), 0.0, 0.9)
        assert result.smoothness == 2
        assert result.derivatives[3].size == pytest.approx(-60 / 0.7**3)


@pytest.mark.parametrize("levels", [1, 3, 5, 9])
def test_hermite_laws_keep_all_derivatives_and_are_as_good_as_their_order(levels):
    def exact(t):
        return np.array([np.cos(3 * t + k * np.pi / 2) * 3.0**k for k in range(levels)]).T

    errors = []
    for count in (9, 17):
        times = np.linspace(0.0, 2.0, count)
        law = jn.laws.HermiteMotion(times, exact(times))
        at_knots = np.array(law(jn.Jet.variable(times, levels - 1)).derivatives())
        np.testing.assert_allclose(at_knots, exact(times).T, rtol=1e-15)
        between = np.linspace(0.0, 2.0, 301)
        errors.append(np.abs(np.asarray(law(jn.Jet([between])).coefficients[0]) - np.cos(3 * between)).max())
    if levels <= 5:
        assert errors[0] / errors[1] > 2 ** (2 * levels - 1)  # order of convergence, less a half
    assert errors[1] < {1: 0.1, 3: 1e-5, 5: 1e-10, 9: 1e-14}[levels] * 3
    smooth = jn.laws.continuity(law, 0.0, 2.0).smoothness
    assert smooth is None or smooth >= min(levels, 6) - 1


@pytest.mark.parametrize(
    "times, rows, name",
    [([0.0, 1.0], [[1.0]], "derivatives"), ([0.0, 0.0], [[1.0], [1.0]], "times"), ([0.0], [[np.nan]], "derivatives")],
)
def test_hermite_laws_refuse_what_does_not_fit(times, rows, name):
    with pytest.raises(jn.errors.TrajectoryError) as caught:
        jn.laws.HermiteMotion(times, rows)
    assert caught.value.name == name


def test_a_law_that_begins_again_counts_its_end_once():
    quarter = math.pi / 2
    rise, rest = jn.laws.Segment("harmonic", quarter, to=0.01), jn.laws.Segment("dwell", quarter)
    fall = jn.laws.Segment("harmonic", quarter, to=0.0)
    for beyond in ("repeat", "hold"):
        law = jn.laws.SegmentedMotion([rise, rest, fall, rest], beyond=beyond)
        found = jn.laws.continuity(law, 0.0, 2 * math.pi, periodic=True)
        assert [(x.order, x.count) for x in found.derivatives if x.order == 2] == [(2, 4)]
