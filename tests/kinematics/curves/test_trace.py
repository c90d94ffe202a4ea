"""Curves of configurations through dead points and change points, against closed forms."""

import dataclasses

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics.curves import path
from jounce.kinematics.curves.limits import roots
from tests.problems import limit_study
from tests.problems.linkages import FourBar
from tests.problems.six_bars import SixBar
from tests.problems.small import crank, slider_crank

pytestmark = pytest.mark.long

FOUR_BAR = FourBar()


def four_bar(a, b, c, d, value=1.0, seed=0):
    """Return a four-bar assembled at a crank angle, in one of its two assemblies."""
    values = {"a": a, "b": b, "c": c, "d": d}
    start = FOUR_BAR.assembly(values, value, np.random.default_rng(seed))
    guess = map(float, FOUR_BAR.guess(values, value, start))
    known = dict(zip(FOUR_BAR.guessed, guess, strict=True))
    return FOUR_BAR.mechanism.with_parameters(**values, start=value, **known)


def uniform(value):
    """Return a law that begins at a value and rises at a uniform rate."""
    return jn.laws.ExpressionMotion("value + t", {"value": float(value)})


def rates_of(way):
    """Return the rotations of crank and rocker, the larger one scaled to one."""
    turns = np.array([way[name][1][0] for name in ("crank", "rocker")])
    return turns / turns[np.argmax(np.abs(turns))]


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3])
def test_limit_positions_of_random_four_bars(number):
    verdict = limit_study.judged(limit_study.random_linkage("four-bar", 7, number))
    assert verdict.error < limit_study.LARGEST_ERROR


@pytest.mark.slow
@pytest.mark.parametrize("name", limit_study.FAMILIES)
def test_limit_positions_of_many_random_linkages(name):
    for seed, number in [*((3, number) for number in range(2)), (0, 828)]:  # the last misses a crossing by 1e-6
        linkage = limit_study.random_linkage(name, seed, number)
        assert limit_study.judged(linkage).error < limit_study.LARGEST_ERROR, linkage


def test_a_crank_that_turns_has_no_limit_positions_and_two_circuits():
    first, second = (jn.trace(four_bar(1.0, 3.0, 2.5, 3.2, seed=k)) for k in (0, 1))
    for curve in (first, second):
        assert curve.closed
        assert not curve.limits
        assert abs(curve.turns) == 1
        assert curve.range == (-np.inf, np.inf)
        assert len(curve.branches) == 1
        assert np.max(np.abs(curve.outputs["C"][0, 0] - curve.outputs["C"][-1, 0])) < 1e-13
    sides = [np.sign(np.sin(np.diff(curve.outputs["C"][0, 0]))) for curve in (first, second)]
    assert first.outputs["C"][0, 0, 1] * second.outputs["C"][0, 0, 1] < 0, sides


def test_a_circuit_with_two_branches_is_that_of_both_assemblies():
    first, second = (jn.trace(four_bar(3.0, 2.0, 2.5, 3.2, seed=k)) for k in (0, 1))
    assert first.closed
    assert [x.kind for x in first.limits] == ["maximum", "minimum"]
    np.testing.assert_allclose([first.length], [second.length], rtol=1e-13)
    np.testing.assert_allclose(
        sorted(x.value for x in first.limits), sorted(x.value for x in second.limits), rtol=1e-13
    )
    here, beyond = first.branches
    assert here.start < 0 < here.stop == beyond.start
    assert (here.low, here.high) == pytest.approx((beyond.low, beyond.high), abs=1e-12)


def test_the_change_points_of_a_parallelogram():
    curve = jn.trace(four_bar(1.0, 2.0, 1.0, 2.0, seed=0))
    along = rates_of(curve.directions(0)[0])
    assert len(curve.change_points) == 2
    assert "2 branches" in repr(curve.change_points[0])
    values = np.sort([curve.value(point.arc_length) for point in curve.change_points]) / np.pi
    np.testing.assert_allclose(values, np.round(values), atol=1e-12)
    assert all(point.decided and point.dimension == 2 for point in curve.change_points)
    # crank and rocker turn alike on one branch; on the other as a contraparallelogram: 1 : -3 or -3 : 1
    other = rates_of(curve.directions(0)[1])
    slopes = sorted([along[1] / along[0], other[1] / other[0]])
    closest = min(np.abs(np.array(slopes) - s).max() for s in ([-3, 1], [-1 / 3, 1]))
    assert closest < 1e-9


def test_the_other_branch_of_a_parallelogram_is_the_contraparallelogram():
    curve = jn.trace(four_bar(1.0, 2.0, 1.0, 2.0, seed=0))
    ratios = [_ratio_of_halves(each) for each in (curve, curve.follow(0))]
    np.testing.assert_allclose(sorted(ratios), [-1 / 3, 1.0], atol=1e-10)


def _ratio_of_halves(curve):
    """Return the ratio of the tangents of half the angles, which is constant on both branches."""
    rocker = curve.outputs["C"][:, 0] - np.array([2.0, 0.0])
    halves = 0.5 * np.stack([curve.values[:, 0], np.arctan2(rocker[:, 1], rocker[:, 0])])
    away = (np.abs(np.sin(2 * halves)) > 0.2).all(axis=0)
    first, second = np.tan(halves[:, away])
    assert np.ptp(first / second) < 1e-10
    return float(first[0] / second[0])


def test_the_folded_branch_of_a_kite():
    curve = jn.trace(four_bar(1.0, 1.0, 2.0, 2.0))  # crank and rod alike, rocker and ground alike
    assert len(curve.change_points) == 2
    assert "2 branches" in repr(curve.change_points[0])
    (folded,) = (k for k, x in enumerate(curve.change_points) if abs(np.cos(curve.value(x.arc_length)) - 1) < 1e-9)
    turns = rates_of(curve.directions(folded)[1])
    np.testing.assert_allclose(turns, [1.0, 0.0], atol=1e-9)  # crank and rod turn together about their hinge
    other = curve.follow(folded)
    assert other.closed
    np.testing.assert_allclose(np.ptp(other.outputs["C"][:, 0], axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(other.length, 2 * np.pi, rtol=1e-12)


@pytest.mark.parametrize("place", [-8.0, -1.1, 0.25, 1.0, 1.1, 8.0])
def test_rounding_at_the_end_of_a_series_makes_no_roots(place):
    for last in (-3e-18, 3e-18, 1e-17):  # of the largest coefficient
        series = max(1.0, abs(place)) * np.array([-place / abs(place), 1 / abs(place), last])
        np.testing.assert_allclose(roots(series), [place] if 0 <= place <= 1 else [], rtol=0, atol=1e-15)


@pytest.mark.parametrize("gap", [1e-2, 1e-5, -1e-5, 1e-8])
def test_branches_that_nearly_cross_are_not_taken_for_one(gap):
    # a little off the parallelogram there is no change point: b + c < a + d turns the crank back, else it folds over
    curve = jn.trace(four_bar(1.0, 2.0, 1.0, 2.0 + gap))
    expected = np.abs(limit_study.EXPECTED["four-bar"]({"a": 1.0, "b": 2.0, "c": 1.0, "d": 2.0 + gap}))
    assert not curve.change_points
    assert curve.closed
    found = np.abs(np.angle(np.exp(1j * np.array([x.value for x in curve.limits]))))
    np.testing.assert_allclose(np.sort(found), np.sort(expected), atol=1e-8 if abs(gap) < 1e-6 else 1e-10)


@pytest.mark.slow
def test_halved_steps_give_the_same_curve(monkeypatch):
    mechanism = four_bar(1.7, 2.0, 1.4, 2.2)
    curve = jn.trace(mechanism)
    monkeypatch.setattr(path, "TAIL", path.TAIL * 2.0**-path.ORDER)
    finer = jn.trace(mechanism)
    assert len(finer._track) > 1.7 * len(curve._track)
    np.testing.assert_allclose(finer.length, curve.length, rtol=1e-13)
    np.testing.assert_allclose([x.value for x in finer.limits], [x.value for x in curve.limits], atol=1e-13)
    np.testing.assert_allclose(finer.outputs["C"], curve.outputs["C"], atol=1e-10)


@pytest.mark.slow
def test_arc_length_and_limits_do_not_depend_on_units():
    small = jn.trace(four_bar(1.7, 2.0, 1.4, 2.2))
    large = jn.trace(four_bar(1.7e3, 2.0e3, 1.4e3, 2.2e3))
    np.testing.assert_allclose(large.length, small.length, rtol=1e-13)
    np.testing.assert_allclose([x.value for x in large.limits], [x.value for x in small.limits], atol=1e-13)


def _against_time(mechanism, name, driver):
    """Compare derivatives along a curve with those in time for a driver with uniform rate."""
    curve = jn.trace(mechanism, order=3, count=41)
    away = np.flatnonzero(np.abs(curve.values[:, 1]) > 0.2)[2:14:4]
    for k in away:
        value, first, second = curve.values[k, :3]
        law = {driver: dataclasses.replace(mechanism.drivers[driver], motion=uniform(value))}
        there = dataclasses.replace(
            curve.at(curve.arc_lengths[k]), drivers=law, outputs={name: mechanism.outputs[name]}
        )
        motion = jn.solve(there, [0.0, 1e-3], order=2)
        q = curve.outputs[name][k]
        np.testing.assert_allclose(motion.outputs[name][0, 1], q[1] / first, atol=1e-10)
        np.testing.assert_allclose(motion.outputs[name][0, 2], (q[2] * first - q[1] * second) / first**3, atol=1e-8)


@pytest.mark.slow
def test_rates_along_a_curve_are_those_in_time():
    _against_time(four_bar(1.7, 2.0, 1.4, 2.2), "C", "drive")


@pytest.mark.slow
def test_rates_along_a_curve_in_space_are_those_in_time():
    mechanism = jn.load("examples/rspu_slide.yaml")
    (driver,) = mechanism.drivers
    _against_time(mechanism, next(iter(mechanism.outputs)), driver)


def test_arc_length_is_that_of_all_bodies():
    curve = jn.trace(four_bar(1.7, 2.0, 1.4, 2.2))
    turns = np.stack([curve.evaluate(jn.outputs.AngleOutput(body)).values[:, 1] for body in ("crank", "rocker")])
    np.testing.assert_allclose(np.sum(turns**2, axis=0), 1.0, rtol=1e-12)  # both turn about fixed hinges


def test_a_mechanism_of_one_degree_of_freedom_without_a_driver():
    driven = crank("t")
    free = dataclasses.replace(driven, drivers={})
    curve = jn.trace(free)
    assert curve.driver is None
    assert curve.closed
    assert not curve.limits
    assert "driver_value" not in curve.dataset.coords
    np.testing.assert_allclose(curve.length, 2 * np.pi, rtol=1e-12)


def test_the_dataset_names_its_points():
    data = jn.trace(four_bar(3.0, 2.0, 2.5, 3.2), count=50).dataset
    assert data["C"].dims == ("point", "derivative", "component")
    assert data.sizes["point"] == 52  # with both limit positions
    assert data["driver_value"].attrs["units"] == "rad"
    away = data.attrs["limit_positions"][:, None] - data["driver_value"].values
    np.testing.assert_allclose(np.abs(away).min(axis=1), 0.0, atol=1e-13)


@pytest.mark.slow
def test_a_dead_point_of_a_motion_says_where_it_is_and_where_the_other_branch_leads():
    with pytest.raises(jn.errors.SolveError, match=r"drive can go no further than 4 m: .* leads to 2 m"):
        jn.solve(slider_crank("3.52 + 0.2*t"), np.linspace(0, 4, 9))


@pytest.mark.slow
def test_which_driver_is_free_must_be_said():
    excavator = jn.load("examples/excavator.yaml")
    with pytest.raises(jn.errors.MechanismError, match="several drivers, boom_cylinder"):
        jn.trace(excavator)
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'stick_cylinder'"):
        jn.trace(excavator, driver="stik_cylinder")


@pytest.mark.slow
def test_more_than_one_degree_of_freedom():
    with pytest.raises(jn.errors.MobilityError, match=r"2, with which .* can move"):
        jn.trace(dataclasses.replace(jn.load("examples/double_pendulum.yaml"), initial={}))


@pytest.mark.slow
def test_nothing_that_moves():
    braced = four_bar(1.7, 2.0, 1.4, 2.2)
    hinges = {**braced.joints, "brace": jn.planar.Parallel1(("ground", "crank"), [1.0, 0.0], [1.0, 0.0])}
    with pytest.raises(jn.JounceError):
        jn.trace(dataclasses.replace(braced, joints=hinges, drivers={}))


def test_a_start_at_a_change_point():
    with pytest.raises(jn.errors.SingularityError, match="change point"):
        jn.trace(four_bar(1.0, 2.0, 1.0, 2.0).with_parameters(start=0.0, crank=0.0, rocker=0.0))


@pytest.mark.parametrize(
    "name, value", [("order", 9), ("count", 1), ("length", 0.0), ("length", np.nan), ("time", np.inf)]
)
def test_options_out_of_range(name, value):
    options = {name: value}
    with pytest.raises(jn.errors.MechanismError, match=name):
        jn.trace(four_bar(1.7, 2.0, 1.4, 2.2), options.pop("time", None), **options)


def test_a_change_point_that_is_not_there():
    curve = jn.trace(four_bar(1.7, 2.0, 1.4, 2.2))
    with pytest.raises(jn.errors.MechanismError, match="there are none"):
        curve.follow(0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "family", [SixBar("Watt I", "coupler", "rocker"), SixBar("Stephenson III", "coupler", "ground")]
)
def test_limit_positions_of_six_bars_are_singular_and_the_same_from_anywhere(family):
    for seed in range(2):
        linkage = family.linkage(np.random.default_rng(seed), False)[0]
        curve = jn.trace(linkage.mechanism, 0.0)
        assert curve.closed
        again = jn.trace(
            dataclasses.replace(curve.at(0.37 * curve.length), drivers=_held(linkage.mechanism, curve, 0.37)), 0.0
        )
        assert again.closed  # its length is another: the size of the mechanism is that of its starting guess
        first, second = (np.sort(np.cos([x.value for x in c.limits])) for c in (curve, again))
        np.testing.assert_allclose(first, second, atol=1e-11)


def _held(mechanism, curve, part):
    value = float(curve.value(part * curve.length))
    return {name: dataclasses.replace(d, motion=uniform(value)) for name, d in mechanism.drivers.items()}
