"""Overconstrained linkages that move, against their closed forms; and overconstrained linkages that cannot."""

import dataclasses
import re

import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import Status
from jounce.kinematics.assembly.redundancy import repetitions
from jounce.mechanism.building import builder
from tests.problems import overconstrained
from tests.problems.overconstrained import Z

TIMES = np.array([0.0, 0.3, 1.0, 2.0])


@pytest.fixture(autouse=True)
def _many_digits():
    with mpmath.mp.workdps(30):
        yield


def exact(motion, times, order):
    """Return a function of mpmath with its derivatives, (time, order + 1)."""
    series = [mpmath.taylor(motion, mpmath.mpf(float(t)), order) for t in times]
    return np.array([[float(mpmath.factorial(k) * c) for k, c in enumerate(row)] for row in series])


def moves_as_told(case, times=TIMES, order=4, tolerance=1e-12):
    """Check the number of redundant equations of a case, and its output against the closed form."""
    motion = jn.solve(case.mechanism, times, order=order)
    rows, _ = motion.model.system.shape
    assert rows - motion.model.system.rank == case.redundant
    whole = motion.outputs[case.output]
    found = whole if case.component is None else whole[..., case.component]
    expected = exact(case.motion, times, order)
    for k in range(order + 1):
        size = np.abs(expected[:, k]).max()
        assert np.abs(found[:, k] - expected[:, k]).max() <= tolerance * size, f"derivative {k}"
        for other in case.still:
            assert np.abs(np.diff(whole[:, :1, other], axis=0)).max() <= tolerance * size
            assert k == 0 or np.abs(whole[:, k, other]).max() <= tolerance * size
    return motion


@pytest.mark.slow
def test_a_bennett_linkage_moves_as_its_closed_form():
    moves_as_told(overconstrained.bennett(), order=6)


@pytest.mark.slow
def test_fronts_and_dense_least_squares_find_the_same(monkeypatch):
    dense = jn.solve(overconstrained.sarrus().mechanism, TIMES, order=1)
    assert dense.model.system.fronts is None
    monkeypatch.setattr("jounce.linear_algebra.fronts.MOST_DENSE", 0)
    builder._layout.cache_clear()
    fronts = jn.solve(overconstrained.sarrus().mechanism, TIMES, order=1)
    builder._layout.cache_clear()
    assert fronts.model.system.fronts is not None
    np.testing.assert_allclose(fronts.outputs["lift"], dense.outputs["lift"], atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    ["bricard", "sarrus", "double_cardan", "scott_russell"],
)
def test_overconstrained_linkages_move_as_their_closed_forms(case):
    moves_as_told(getattr(overconstrained, case)(), order=2)


@pytest.mark.slow
def test_a_parallelogram_with_three_cranks_moves_on_through_its_flat_positions():
    case = overconstrained.parallelogram()
    moves_as_told(case)
    driver = jn.drivers.CoordinateDriver(("ground", "crank1"), "angle", "0.7 + t")
    turning = dataclasses.replace(case.mechanism, drivers={"turn": driver})
    motion = jn.solve(turning, np.linspace(0, 6, 31))
    np.testing.assert_allclose(motion.change_points, [np.pi - 0.7, 2 * np.pi - 0.7], atol=1e-9)
    np.testing.assert_allclose(motion.outputs["coupler"][:, 4, 1], np.sin(0.7 + motion.time), atol=1e-9)


@pytest.mark.slow
def test_random_bennett_linkages_from_bad_guesses_in_any_unit():
    """One program serves all of them: only numbers differ."""
    random = np.random.default_rng(0)
    for _ in range(12):
        first = random.uniform(0.3, 1.2)
        twists = (first, first + random.uniform(0.3, 1.2))
        start, size = random.uniform(0.5, 2.5), 10.0 ** random.uniform(-4, 4)
        case = overconstrained.bennett(twists, start, size=size, guess=0.1, seed=int(random.integers(1000)))
        moves_as_told(case, order=6)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_what_is_nearly_a_bennett_linkage_is_refused_and_what_is_one_to_rounding_is_not(size):
    with pytest.raises(
        jn.errors.AssemblyError, match=r"over-constrained at t = .* joints.R3, joints.R1 and others stay open"
    ) as caught:
        jn.solve(overconstrained.bennett(off=1e-3, size=size).mechanism, TIMES)
    joints = "joints.R3, joints.R1, joints.R4, joints.R2 stay open, by .* mm and .* deg"
    expected = rf"{joints}.*; 3 equations more than coordinates .* contradict each other by that much"
    assert re.search(expected, caught.value.details)
    moves_as_told(overconstrained.bennett(off=1e-12, size=size), order=6, tolerance=1e-10)


@pytest.mark.slow
def test_a_tolerance_admits_numbers_of_few_digits():
    case = overconstrained.bennett(off=1e-6)
    with pytest.raises(jn.errors.AssemblyError):
        jn.solve(case.mechanism, TIMES, order=6)
    motion = jn.solve(case.mechanism, TIMES, order=6, tolerance=1e-8)
    np.testing.assert_allclose(motion.outputs["out"][:, 0], exact(case.motion, TIMES, 0)[:, 0], atol=1e-5)


def turned(first, second):
    """A crank whose angle has two drivers."""
    laws = {"one": first, "two": second}
    return jn.Mechanism(
        space="planar",
        bodies={"crank": jn.Body([0, 0])},
        joints={"O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
        drivers={name: jn.drivers.CoordinateDriver(("ground", "crank"), "angle", law) for name, law in laws.items()},
        outputs={"angle": jn.outputs.AngleOutput("crank")},
    )


@pytest.mark.slow
def test_drivers_that_agree_are_solved_and_others_refused():
    motion = jn.solve(turned("t", "t"), [0.0, 1.0], order=2)
    np.testing.assert_allclose(motion.outputs["angle"], [[0, 1, 0], [1, 1, 0]], atol=1e-15)
    with pytest.raises(jn.errors.AssemblyError, match=r"drivers\.one, drivers\.two stay open, by .* deg"):
        jn.solve(turned("t", "t + 0.1"), [0.0])
    with pytest.raises(jn.errors.SolveError, match=r"drivers\.two, drivers\.one .*: inconsistent"):
        jn.solve(turned("t", "2*t"), [0.0])


@pytest.mark.slow
def test_drivers_that_part_later_are_reported_where_they_do():
    late = "t + 1e-3*(t - 1)**5*(0.5 + 0.5*tanh(1e6*(t - 1)))"
    motion = jn.solve(turned("t", late), np.linspace(0, 2, 9), strict=False)
    assert motion.status.tolist() == [0] * 5 + [Status.INCONSISTENT] + [Status.NOT_REACHED] * 3
    assert "drivers.two" in motion.faults[5]


@pytest.mark.slow
def test_a_structure_that_is_locked_can_rest_and_not_move():
    random = np.random.default_rng(3)
    axes = random.normal(size=(3, 3))
    hinges = [(np.zeros(3), np.array(Z)), *zip(random.normal(size=(3, 3)), axes, strict=True)]
    driven = [overconstrained.hinged_loop(hinges, jn.laws.ExpressionMotion("rate*t", {"rate": x})) for x in (0.0, 0.1)]
    resting = jn.solve(driven[0], [0.0, 1.0], order=1)
    assert (resting.status == Status.OK).all()
    with pytest.raises(jn.errors.SolveError, match=r"in their rates\): inconsistent"):
        jn.solve(driven[1], [0.0, 1.0], order=1)


@pytest.mark.slow
def test_a_dead_point_is_no_redundancy():
    """A four-bar driven at its rocker runs into its dead point; a start at the dead point is reported as such."""
    linkage = overconstrained.four_bar_of_hinges(law="")
    _, rocker = overconstrained.closing(1.0, 3.0, 2.5, 2.0, 0.7)
    driven = dataclasses.replace(
        linkage, drivers={"turn": jn.drivers.RotationDriver(("ground", "rocker"), Z, f"{rocker} + t")}
    )
    motion = jn.solve(driven, np.linspace(0, 2, 21), order=1, strict=False)
    angle = float(np.arccos((2.0**2 - 2.5**2 - 2.0**2) / (2 * 2.5 * 2.0)))  # crank and coupler overlap, 3 - 1 = 2 long
    solved = motion.status == Status.OK
    np.testing.assert_array_equal(solved, motion.time < angle - rocker)
    assert motion.status[solved.sum()] == Status.SINGULAR
    line = float(np.arctan2(2.0 * np.sin(angle), 2.5 + 2.0 * np.cos(angle)))
    poses = {"crank": ([0.0, 0.0, 0.0], line + np.pi), "rocker": ([2.5, 0.0, 0.0], angle)}
    poses["coupler"] = ([-np.cos(line), -np.sin(line), 0.0], line)
    bodies = {
        name: jn.Body(poses[name][0], orientation={"axis": Z, "angle": float(poses[name][1])})
        for name in linkage.bodies
    }
    law = jn.drivers.RotationDriver(("ground", "rocker"), Z, f"{angle!r} - t")
    dead = dataclasses.replace(linkage, bodies=bodies, drivers={"turn": law})
    message = "18 of them independent; joint D repeats 3 equations of A, B, C, .* a singular position"
    with pytest.raises(jn.errors.MobilityError, match=message):
        jn.solve(dead, [0.0], order=1)


def test_who_repeats_whom_follows_from_the_combinations_that_vanish():
    """Joint c repeats both equations of a; the second of two equal drivers repeats the first."""
    rows = ("joints.a", "joints.b", "joints.a", "joints.c", "joints.c", "drivers.x", "drivers.y")
    combinations = np.zeros((7, 3))
    combinations[[0, 3], 0] = combinations[[2, 4], 1] = combinations[[5, 6], 2] = np.sqrt(0.5) * np.array([1, -1])
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    phrases = [str(x) for x in repetitions(rows, combinations @ turn)]
    assert phrases == ["joint c repeats 2 equations of a", "driver y repeats 1 equation of x"]


@pytest.mark.slow
def test_a_long_grid_in_threads_is_that_of_one():
    case, times = overconstrained.bennett(), np.linspace(0, 2, 1500)
    one, two = (jn.solve(case.mechanism, times, order=2, threads=count) for count in (1, 2))
    np.testing.assert_array_equal(one.outputs["out"], two.outputs["out"])
    few = slice(None, None, 100)
    np.testing.assert_allclose(one.outputs["out"][few, 0], exact(case.motion, times[few], 0)[:, 0], atol=1e-13)


@pytest.mark.slow
def test_a_large_linkage_is_solved_front_by_front():
    """Twelve parallelograms in a row, each with a crank too many: 24 cranks carry a chain of beams."""
    bodies, joints, count = {}, {}, 12
    for k in range(count):
        bodies[f"beam{k}"] = jn.Body([np.cos(0.7) + 2.0 * k, np.sin(0.7)])
        for j in range(3):
            name, foot = f"crank{k}{j}", 2.0 * k + 0.5 * j
            bodies[name] = jn.Body([foot, 0.0], angle=0.7)
            joints[f"O{k}{j}"] = jn.planar.Revolute(("ground", name), [foot, 0.0], [0.0, 0.0])
            joints[f"A{k}{j}"] = jn.planar.Revolute((name, f"beam{k}"), [1.0, 0.0], [0.5 * j, 0.0])
        if k:
            joints[f"link{k}"] = jn.planar.DoubleRevolute(
                (f"beam{k - 1}", f"beam{k}"), [1.0, 0], [0, 0.1], np.hypot(1, 0.1)
            )
    linkage = jn.Mechanism(
        space="planar",
        bodies=bodies,
        joints=joints,
        drivers={"turn": jn.drivers.CoordinateDriver(("ground", "crank00"), "angle", "0.7 + 0.3*t")},
        outputs={"last": jn.outputs.PointOutput(f"beam{count - 1}", [0, 0])},
    )
    motion = jn.solve(linkage, [0.0, 0.5, 1.0])
    assert motion.model.system.fronts is not None
    assert motion.model.system.rank == motion.model.system.shape[1] == motion.model.system.shape[0] - count
    angle = 0.7 + 0.3 * motion.time
    derivatives = np.stack([0.3**k * np.sin(angle + k * np.pi / 2) for k in range(5)], axis=1)
    np.testing.assert_allclose(motion.outputs["last"][..., 1], derivatives, atol=1e-12)
