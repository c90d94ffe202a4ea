"""Rounds of a grid: each instant once, after what it starts from; the same motion to the bit as level after level."""

import numpy as np
import pytest

import jounce as jn
from jounce.kinematics import Status, grid
from jounce.kinematics.rounds import Part, phases
from jounce.native.machine import is_usable
from tests.problems.small import four_bar, slider_crank

needs_machine_code = pytest.mark.skipif(
    not is_usable(), reason="there is no compiler, or a system where it was not tried"
)


@pytest.fixture(autouse=True)
def _wanted(monkeypatch):
    monkeypatch.delenv("JOUNCE_NATIVE", raising=False)  # as where all tests run without machine code


@pytest.mark.parametrize("width", [2, 4, 8])
@pytest.mark.parametrize("stride", [1, 2, 8, 64, 256])
@pytest.mark.parametrize("count", [1, 7, 64, 65, 1025, 3000, 20_000])
def test_each_instant_comes_after_what_it_starts_from(count, stride, width):
    solved = np.zeros(count, bool)
    for parts in phases(count, stride, width, 1):
        before = solved.copy()
        for part in parts:
            seen = before.copy()  # what other parts of a list solve, it cannot count on
            for lanes in part.rounds(width, count):
                sources = (lanes & (lanes - 1))[lanes % stride != 0]
                assert seen[sources].all()
                assert not before[lanes].any()
                seen[lanes] = True
            solved |= seen
    assert solved.all()


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_parts_have_no_instant_in_common(threads):
    for parts in phases(20_001, 256, 8, threads):
        lanes = [np.unique(part.rounds(8, 20_001)) for part in parts]
        together = np.concatenate(lanes)
        assert len(np.unique(together)) == len(together)


def test_threads_have_as_many_parts_of_nearly_one_size():
    assert [len(parts) for parts in phases(65_536, 1024, 8, 2)] == [2, 8]
    assert [len(parts) for parts in phases(65_536, 1024, 8, 3)] == [3, 12]
    assert len([*phases(2_000_000, 16_384, 8, 1)][1]) == 245
    sizes = [len(part.starts) for part in [*phases(34_464, 512, 8, 2)][1]]
    assert (len(sizes), min(sizes), max(sizes)) == (8, 8, 9)


def test_lanes_beyond_the_grid_solve_the_first_one_again():
    found = Part(range(1, 2), 2, 1, range(0, 12, 4)).rounds(2, 6)
    np.testing.assert_array_equal(found, [[1, 3], [5, 5]])


def everything(motion):
    return [*motion.outputs.values(), *(motion.poses[1][name] for name in sorted(motion.poses[1])), motion.status]


def assert_same(one, other):
    for found, expected in zip(everything(one), everything(other), strict=True):
        np.testing.assert_array_equal(found, expected)
    assert one.faults == other.faults


def level_after_level(monkeypatch, mechanism, time, **given):
    """The motion of machine code without rounds."""
    with monkeypatch.context() as patch:
        patch.setattr(grid.GridSolver, "_in_rounds", lambda self, left, *_: left)
        return jn.solve(mechanism, time, **given, strict=False, threads=1)


@needs_machine_code
@pytest.mark.parametrize("order", [0, 4, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("count", [1025, 4097])
def test_motions_are_those_of_levels(monkeypatch, count, order):
    time = np.linspace(0, 2, count)
    expected = level_after_level(monkeypatch, four_bar(), time, order=order)
    for threads in (1, 2):
        assert_same(jn.solve(four_bar(), time, order=order, threads=threads), expected)


FAILING = {
    "a dead point": four_bar(motion="30*deg + 3*t", AB=0.12),
    "a law out of its range": slider_crank("3.8 - 2*t"),
    "change points": slider_crank("4 - 0.5*cos(t)**2"),
    "an output without a derivative": slider_crank("4 - 0.4*abs(t - 1)**2.5"),
}


@needs_machine_code
@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.parametrize("name", FAILING)
def test_failures_are_those_of_levels(monkeypatch, name, keep):
    time = np.linspace(0, 2, 2049)
    expected = level_after_level(monkeypatch, FAILING[name], time, order=3, keep=keep)
    found = jn.solve(FAILING[name], time, order=3, keep=keep, strict=False, threads=2)
    assert_same(found, expected)


@needs_machine_code
def test_instants_that_start_from_failures_are_solved_again(monkeypatch):
    """Where machine code tells that some instants failed, they and what starts from them go level after level."""
    time, again = np.linspace(0, 2, 3001), []
    expected = jn.solve(four_bar(), time)
    rounds = grid.GridSolver._in_rounds

    def spoiled(self, left, *given):
        relay = self.solver.relay

        def failing(store, step, instant, status, sources):
            spoil = relay(store, step, instant, status, sources)

            class Spoiled:
                width = spoil.width

                def __call__(self, targets):
                    spoil(targets)
                    status[64], store[0]["angle"][..., 64] = Status.NOT_CONVERGED, np.nan

            return Spoiled()

        object.__setattr__(self.solver, "relay", failing)
        again.append(rounds(self, left, *given))
        return again[-1]

    monkeypatch.setattr(grid.GridSolver, "_in_rounds", spoiled)
    assert_same(jn.solve(four_bar(), time, threads=1), expected)
    np.testing.assert_array_equal(np.flatnonzero(again[0]), np.arange(64, 96))


@needs_machine_code
def test_progress_never_goes_back_and_ends_with_all():
    told = []
    motion = jn.solve(
        FAILING["a dead point"], np.linspace(0, 2, 5000), strict=False, progress=lambda *x: told.append(x)
    )
    assert (motion.status != Status.OK).any()
    assert told == sorted(told)
    assert told[-1] == (5000, 5000)
