"""Blocks of a grid: each instant once, after its source; the same motion as instant by instant."""

import numpy as np
import pytest

import jounce as jn
from jounce.execution.llvm.self_test import is_usable
from jounce.kinematics import Status
from jounce.kinematics.position_analysis import grid, grid_storage, solve_buffers
from jounce.kinematics.position_analysis.grid_blocks import blocks_of, rounds
from tests.problems.small import four_bar, slider_crank

pytestmark = pytest.mark.long

needs_machine_code = pytest.mark.skipif(
    not is_usable(), reason="there is no compiler, or a system where it was not tried"
)


@pytest.fixture(autouse=True)
def _machine_code(monkeypatch):
    monkeypatch.delenv("JOUNCE_NATIVE", raising=False)  # as where all tests run without machine code


@pytest.mark.parametrize("width", [2, 4, 8])
@pytest.mark.parametrize("stride", [1, 2, 8, 64, 256])
@pytest.mark.parametrize("count", [1, 7, 64, 65, 1025, 3000, 20_000])
@pytest.mark.parametrize("full", [False, True])
def test_each_instant_comes_after_what_it_starts_from(count, stride, width, full):
    solved = np.zeros(count, bool)
    for block in blocks_of(0, count, stride, width, full=full):
        seen = np.zeros(count, bool)  # what other blocks solve, it cannot count on
        turns = rounds(block.count, block.stride, width)
        assert not full or turns.size < 2 * max(block.count, width)  # half of a round is in use at least
        for lanes in block.first + turns:
            sources = (lanes & (lanes - 1))[lanes % block.stride != 0]
            assert seen[sources].all()
            assert not solved[lanes].any()
            seen[lanes] = True
        assert seen[block.indices].all()
        assert seen.sum() == block.count
        solved |= seen
    assert solved.all()


def test_lanes_beyond_a_block_solve_the_first_one_again():
    np.testing.assert_array_equal(rounds(5, 2, 4), [[0, 2, 4, 0], [1, 3, 1, 1]])


def everything(motion):
    return [*motion.outputs.values(), *(motion.poses[1][name] for name in sorted(motion.poses[1])), motion.status]


def assert_same(one, other):
    for found, expected in zip(everything(one), everything(other), strict=True):
        np.testing.assert_array_equal(found, expected)
    assert one.faults == other.faults


def in_turn(monkeypatch, mechanism, time, **given):
    """The motion without rounds."""
    with monkeypatch.context() as patch:
        patch.setattr(grid.GridSolver, "_in_blocks", lambda self, left, *_: left)
        return jn.solve(mechanism, time, **given, strict=False, threads=1)


@needs_machine_code
@pytest.mark.parametrize("order", [0, 4, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("count", [1025, 4097])
def test_motions_are_those_without_rounds(monkeypatch, count, order):
    time = np.linspace(0, 2, count)
    expected = in_turn(monkeypatch, four_bar(), time, order=order)
    for threads in (1, 2):
        assert_same(jn.solve(four_bar(), time, order=order, threads=threads), expected)


FAILING = {
    "a dead point": four_bar(motion="30*deg + 3*t", AB=0.12),
    "a law out of its range": slider_crank("3.8 - 2*t"),
    "change points": slider_crank("4 - 0.5*cos(t)**2"),
    "an output without a derivative": slider_crank("4 - 0.4*abs(t - 1)**2.5"),
}


@needs_machine_code
@pytest.mark.parametrize("keep", [pytest.param(True, marks=pytest.mark.slow), False])
@pytest.mark.parametrize("name", FAILING)
def test_failures_are_those_without_rounds(monkeypatch, name, keep):
    time = np.linspace(0, 2, 2049)
    expected = in_turn(monkeypatch, FAILING[name], time, order=3, keep=keep)
    found = jn.solve(FAILING[name], time, order=3, keep=keep, strict=False, threads=2)
    assert_same(found, expected)


@pytest.mark.parametrize(
    "native", [pytest.param("1", marks=needs_machine_code), pytest.param("0", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", ["nothing", "a dead point", "a law out of its range", "change points"])
def test_xla_has_the_same_outcome(monkeypatch, name, native):
    """By rounds as wide as the cache holds: the same statuses, and numbers to rounding."""
    mechanism, time = FAILING.get(name, four_bar()), np.linspace(0, 2, 1500)
    expected = jn.solve(mechanism, time[::100], order=2, strict=False)
    monkeypatch.setenv("JOUNCE_NATIVE", native)
    found = jn.solve(mechanism, time, order=2, strict=False)
    np.testing.assert_array_equal(found.status[::100] == Status.OK, expected.status == Status.OK)
    for output, exact in expected.outputs.items():
        peak = np.nanmax(np.abs(exact), axis=0) + 1e-300
        np.testing.assert_allclose(found.outputs[output][::100] / peak, exact / peak, rtol=0, atol=1e-9)


@needs_machine_code
def test_instants_that_start_from_failures_are_solved_again(monkeypatch):
    """Instants reported as failed, and all that start from them, are solved once more."""
    time, again = np.linspace(0, 2, 3001), []
    expected = jn.solve(four_bar(), time)
    in_blocks, solve = grid.GridSolver._in_blocks, solve_buffers.SolveBuffer.solve

    def spoiling(room):
        solve(room)
        if room.time[0] == 0.0:
            room.status[64], room.state[0]["angle"][..., 64] = Status.NOT_CONVERGED, np.nan

    def spoiled(self, *given):
        again.append(in_blocks(self, *given))
        return again[-1]

    monkeypatch.setattr(solve_buffers.SolveBuffer, "solve", spoiling)
    monkeypatch.setattr(grid.GridSolver, "_in_blocks", spoiled)
    assert_same(jn.solve(four_bar(), time, threads=1), expected)
    np.testing.assert_array_equal(np.flatnonzero(again[0]), np.arange(64, 96))


@needs_machine_code
def test_progress_never_goes_back_and_ends_with_all():
    reports = []
    motion = jn.solve(
        FAILING["a dead point"], np.linspace(0, 2, 5000), strict=False, progress=lambda *x: reports.append(x)
    )
    assert (motion.status != Status.OK).any()
    assert reports == sorted(reports)
    assert reports[-1] == (5000, 5000)


@needs_machine_code
@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.parametrize("name", ["nothing", *FAILING])
def test_chunks_solved_at_once_are_those_solved_one_after_another(monkeypatch, name, keep):
    mechanism, time, solved = FAILING.get(name, four_bar()), np.linspace(0, 2, 5000), []
    monkeypatch.setattr(grid_storage, "CHUNK", 1100)
    with monkeypatch.context() as patch:
        patch.setattr(grid_storage, "_solved_at_once", lambda *_: frozenset())
        expected = jn.solve(mechanism, time, order=3, keep=keep, strict=False)
    at_once = grid_storage._solved_at_once
    monkeypatch.setattr(grid_storage, "_solved_at_once", lambda *given: solved.append(at_once(*given)) or solved[-1])
    assert_same(jn.solve(mechanism, time, order=3, keep=keep, strict=False, threads=2), expected)
    firsts = range(0, 4400, 1100)  # the last chunk is a short grid
    fine = {first for first in firsts if np.all(expected.status[first : first + 1100] == Status.OK)}
    assert solved[0] < fine if name == "change points" else solved[0] == fine


@needs_machine_code
@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.parametrize("always", [True, False])
def test_a_chunk_in_which_some_instant_fails_is_solved_again(monkeypatch, always, keep):
    """Nothing of a failed chunk is kept, everything of the other chunks is, and progress does not decrease."""
    time, reports, spoiled = np.linspace(0, 2, 4400), [], []
    monkeypatch.setattr(grid_storage, "CHUNK", 1100)
    expected = jn.solve(four_bar(), time, keep=keep)
    solve = solve_buffers.SolveBuffer.solve

    def spoiling(room):
        solve(room)
        if room.time[0] == time[1100] and (always or not spoiled):
            room.status[5], room.state[0]["angle"][..., 5] = Status.NOT_CONVERGED, np.nan
            room.state[1][0][..., 5] = 1e308  # 24 times that is no number
            spoiled.append(True)

    monkeypatch.setattr(solve_buffers.SolveBuffer, "solve", spoiling)
    found = jn.solve(four_bar(), time, threads=1, keep=keep, progress=lambda *x: reports.append(x))
    assert len(spoiled) == 1 + always
    assert_same(found, expected)
    assert reports == sorted(reports)
    assert reports[-1] == (4400, 4400)
