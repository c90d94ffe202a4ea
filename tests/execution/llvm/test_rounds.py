"""Instants in rounds, straight from and into arrays of all of them: what a loop over the instants would give."""

import jax.numpy as jnp
import numpy as np
import pytest

from jounce.execution.llvm.machine import vector_width
from jounce.execution.llvm.self_test import is_usable
from jounce.execution.mapped import Mapped, OnLlvm

pytestmark = pytest.mark.skipif(not is_usable(), reason="there is no compiler, or a system where it was not tried")
COUNT = 24


def step(shared, lanes):
    (position, label), time, forward = lanes
    moved = shared * position + time[None, None]
    position = jnp.where(forward[None, None], position + moved, position)
    return {"label": label + 1, "late": time > 3, "position": position, "rest": moved[:1]}


STEP = Mapped(step)


def arrays(behind=1):
    """Return arrays for all instants, with a start behind them, times and where each starts from."""
    generator = np.random.default_rng(1)
    position, label = generator.normal(size=(3, 2, COUNT + behind)), np.zeros(COUNT + behind, np.int64)
    width = vector_width()
    sources = np.where(np.arange(COUNT) < width, COUNT, np.arange(COUNT) - width)
    return position, label, generator.normal(size=COUNT), sources


def in_rounds(position, label, time, sources, found=None, late=None, *, none=False):
    """Return what solves all instants, straight into the arrays unless others are given, or labels into none."""
    lanes = (position, label), time, np.array([True])
    program = STEP.program(np.float64(0.5), ((np.zeros((3, 2, 1)), np.zeros(1, np.int64)), np.zeros(1), lanes[2]))
    assert isinstance(program, OnLlvm)
    results = {
        "label": None if none else label,
        "late": late,
        "position": position if found is None else found,
        "rest": None,
    }
    return program.rounds(lanes, results, sources, (2, 0))


def in_turn(position, label, time, sources):
    """The results of a loop."""
    position, label = position.copy(), label.copy()
    for lane, source in enumerate(sources):
        position[..., lane] = position[..., source] + 0.5 * position[..., source] + time[lane]
        label[lane] = label[source] + 1
    return position, label


def rounds(count=COUNT):
    return np.arange(count).reshape(-1, vector_width())


def test_later_rounds_start_from_earlier_ones():
    given = arrays()
    expected = in_turn(*given)
    in_rounds(*given)(rounds())
    np.testing.assert_allclose(given[0], expected[0], atol=1e-14)
    np.testing.assert_array_equal(given[1], expected[1])


def test_rounds_may_be_run_in_parts_and_in_any_order_within_them():
    given, again = arrays(), arrays()
    in_rounds(*given)(rounds())
    parts, width = in_rounds(*again), vector_width()
    parts(rounds()[:1, ::-1])
    parts(rounds()[1:0])
    parts(np.repeat(rounds()[1:], 2, axis=0)[:, np.arange(width) - 1])
    for one, other in zip(given, again, strict=True):
        np.testing.assert_array_equal(one, other)


def test_arrays_may_be_parts_of_others():
    given = arrays()
    whole = np.full((3, 4, COUNT + 9), 7.0)
    position = whole[:, 1:3, 5 : 5 + COUNT + 1]
    position[...] = given[0]
    in_rounds(*given)(rounds())
    in_rounds(position, *arrays()[1:])(rounds())
    np.testing.assert_array_equal(position, given[0])
    position[...] = 7.0
    assert np.all(whole == 7.0)


def test_results_may_be_put_elsewhere():
    position, label, time, _ = arrays()
    found, before = np.zeros((3, 2, COUNT)), position.copy()
    in_rounds(position, label, time, np.arange(COUNT), found)(rounds())
    np.testing.assert_array_equal(position, before)
    np.testing.assert_allclose(found, (1.5 * before)[..., :COUNT] + time, rtol=1e-14)


def test_what_starts_from_the_round_before_needs_no_array_of_results():
    """Some lanes of a round start from there, others from what is given."""
    position, label, time, sources = arrays()
    expected = in_turn(position, label, time, sources)
    carried = np.where(np.arange(COUNT) % 3 == 0, COUNT, sources)
    mixed = in_turn(position, label, time, carried)
    for source, (positions, _) in ((sources, expected), (carried, mixed)):
        found, starts = np.zeros((3, 2, COUNT)), np.where(source < COUNT, -1, 0)
        in_rounds(position[..., COUNT:].copy(), label[COUNT:].copy(), time, starts, found, none=True)(rounds())
        np.testing.assert_allclose(found, positions[..., :COUNT], atol=1e-14)


@pytest.mark.parametrize(
    "change",
    [
        {"position": np.zeros((3, 2, COUNT))},  # whose start is missing
        {"position": np.zeros((2, 2, COUNT + 1))},
        {"position": np.zeros((3, 2, COUNT + 1), np.float32)},
        {"position": np.zeros((3, 2, 2 * COUNT + 2))[..., ::2]},
        {"time": np.zeros(COUNT - 1)},
        {"sources": np.arange(COUNT) + 2},
        {"sources": np.arange(COUNT).astype(np.int32)},
    ],
)
def test_what_would_be_read_or_written_elsewhere_is_refused(change):
    given = dict(zip(("position", "label", "time", "sources"), arrays(), strict=True)) | change
    with pytest.raises(ValueError, match=r"array of|sources"):
        in_rounds(**given)


@pytest.mark.parametrize("targets", [rounds() + 1, rounds() - 1, rounds()[:, 1:], rounds().astype(np.int32)])
def test_targets_beyond_the_grid_are_refused(targets):
    with pytest.raises(ValueError, match="targets"):
        in_rounds(*arrays())(targets)


def test_the_first_round_starts_from_none_before():
    position, label, time, sources = arrays()
    sources[1] = -1
    with pytest.raises(ValueError, match="before the first"):
        in_rounds(position, label, time, sources)(rounds())


def test_truth_values_have_no_place_of_their_own():
    with pytest.raises(ValueError, match="bool"):
        in_rounds(*arrays(), late=np.zeros(COUNT, bool))


def test_programs_with_instants_along_the_first_axis_have_no_rounds():
    lanes = np.ones((3, 2))
    program = Mapped(lambda shared, x: x + shared, rows=True).program(np.float64(1.0), lanes)
    assert isinstance(program, OnLlvm)
    with pytest.raises(ValueError, match="first axis"):
        program.rounds((lanes, (), ()), lanes, np.arange(3), (0,))
