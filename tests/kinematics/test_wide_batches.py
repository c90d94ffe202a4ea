"""Lots of instants in one call: what a lot gives does not depend on the lots beside it, and memory is bounded."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

import jounce as jn
from jounce.execution.device import on_processor
from jounce.kinematics import wide_batches
from jounce.kinematics.grid import _lots
from jounce.kinematics.wide_batches import CALL_ENTRIES, MOST_LOTS, lots_in_a_call
from tests.problems.small import four_bar

GRID = np.linspace(0, 2, 3001)


@given(st.integers(0, 70_000), st.sampled_from([128, 512]), st.integers(1, MOST_LOTS), st.integers(1, 8))
def test_calls_hold_all_lots_and_each_thread_has_as_many(count, width, most, threads):
    lots, size = -(-count // width), _lots(count, width, most, threads)
    assert 1 <= size <= most
    calls = -(-lots // size)
    assert calls <= threads * -(-lots // (most * threads))  # no more rounds than the largest calls would take


@pytest.mark.skipif(not on_processor(), reason="a GPU is filled by one lot")
@pytest.mark.parametrize("entries", [1, 60, 1000, 10**6])
def test_a_call_takes_no_more_memory_than_it_should(entries):
    lots = lots_in_a_call(128, entries)
    assert 1 <= lots <= MOST_LOTS
    assert lots == 1 or lots * 128 * entries <= CALL_ENTRIES


@pytest.mark.slow
def test_results_do_not_depend_on_how_many_lots_go_together(monkeypatch):
    together = jn.solve(four_bar(), GRID, threads=1)
    monkeypatch.setattr(wide_batches, "MOST_LOTS", 1)
    alone = jn.solve(four_bar(), GRID, threads=1)
    np.testing.assert_array_equal(alone.outputs["psi"], together.outputs["psi"])
    np.testing.assert_array_equal(alone.status, together.status)
