"""Blocks of memory that are lent again, and the arrays in them."""

import gc
import threading
from collections import deque

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.execution import buffer_pool
from jounce.execution.backends import uses_machine_code
from jounce.execution.buffer_pool import LENT, LINE, MOST_RETURNED, acquire, arrays_in, bytes_needed, lend, release
from jounce.execution.compilation import Compiled
from tests.problems.small import four_bar


@pytest.fixture
def kept(monkeypatch):
    blocks = []
    monkeypatch.setattr(buffer_pool, "_free", blocks)
    return blocks


def test_what_was_given_back_is_lent_again(kept):
    block = acquire(1000)
    release(block)
    assert acquire(900) is block
    assert not kept


def test_a_block_that_is_too_small_makes_room_for_another(kept):
    release(acquire(1000))
    assert len(acquire(1001)) >= 1001
    assert not kept


def test_no_more_is_kept_than_is_allowed(kept, monkeypatch):
    monkeypatch.setattr(buffer_pool, "MOST", 1000)
    for block in [acquire(600), acquire(401), acquire(300), acquire(200), acquire(100)]:
        release(block)
    assert list(map(len, kept)) == [600, 300, 100]


@pytest.fixture
def returned(monkeypatch):
    blocks = deque(maxlen=MOST_RETURNED)
    monkeypatch.setattr(buffer_pool, "_returned", blocks)
    return blocks


def address(block):
    return block.ctypes.data


@pytest.mark.parametrize("part", [lambda x: x[8:16].view(float), lambda x: np.ndarray((3, 1), float, x, 64)[1:].T])
def test_memory_comes_back_when_no_array_in_it_is_left(returned, part):
    size = LENT[0]
    block = lend(size)
    first, array = address(block), part(block)
    array[...] = 3.0
    del block
    gc.collect()
    assert not returned
    other = lend(size)
    assert address(other) != first
    other[:] = 0
    assert (array == 3.0).all()
    del array
    assert len(returned) == 1
    assert address(lend(size - 1)) != first  # it is small: new memory
    assert address(lend(size)) == first


def test_few_blocks_are_kept(returned):
    blocks = [lend(LENT[0]) for _ in range(5)]
    assert len({address(block) for block in blocks}) == 5
    del blocks
    assert len(returned) == MOST_RETURNED


@pytest.mark.parametrize("size", [0, LENT[0] - 1, LENT[1] + 1])
def test_little_and_very_much_memory_is_new(returned, size):
    assert len(lend(size)) == size
    assert not returned


def test_a_block_that_came_back_and_is_too_small_makes_room_for_another(returned):
    lend(LENT[0])
    assert len(lend(LENT[0] + 1)) == LENT[0] + 1
    assert [len(block) for block in returned] == [LENT[0] + 1]


def test_memory_that_jax_has_taken_over_is_not_lent_again(returned):
    array = jnp.asarray(lend(LENT[0])[64:128].view(float))
    expected = np.array(array)
    gc.collect()
    for _ in range(3):
        lend(LENT[0])[:] = 7
    np.testing.assert_array_equal(array, expected)


def test_results_of_one_call_stay_as_they_are_in_the_next():
    run = Compiled(lambda x: (x + 1.0, jnp.sum(x)), ())
    given = [np.full(LENT[0] // 8, float(k)) for k in range(5)]
    for k, (more, total) in enumerate([run(x) for x in given]):
        np.testing.assert_array_equal(more, k + 1.0)
        assert total == k * len(more)
    part = run(given[2])[0][5:6]
    run(given[3])
    assert part == [3.0]


def test_arrays_begin_at_lines_and_have_nothing_in_common():
    shapes, kinds = [(3, 5), (2, 2, 7), (0,), (9,)], [float, float, float, int]
    block = np.empty(bytes_needed(shapes) + 3, np.uint8)[3:]
    arrays = arrays_in(block, shapes, kinds)
    assert [(x.shape, x.dtype) for x in arrays] == [(s, np.dtype(k)) for s, k in zip(shapes, kinds, strict=True)]
    assert not any(x.ctypes.data % LINE for x in arrays if x.size)
    for k, array in enumerate(arrays):
        array[...] = k
    assert [set(x.ravel().tolist()) for x in arrays] == [{0}, {1}, set(), {3}]


def test_motions_are_their_own_beside_others_that_borrow_the_same_memory(kept):
    """What one motion has found is not what the next writes, in several threads as in one."""
    lengths = [0.038, 0.039, 0.04]
    grid = np.linspace(0.0, 2.0, 3001)
    expected = [jn.solve(four_bar(AB=x), grid, threads=1).outputs["psi"].copy() for x in lengths]
    found = {}

    def solve(k):
        found[k] = jn.solve(four_bar(AB=lengths[k % 3]), grid, threads=2).outputs["psi"]

    threads = [threading.Thread(target=solve, args=(k,)) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k, values in found.items():
        np.testing.assert_array_equal(values, expected[k % 3])
    assert bool(kept) == uses_machine_code()  # it is machine code that borrows
