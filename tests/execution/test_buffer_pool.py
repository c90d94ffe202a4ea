"""Blocks of memory that are lent again, and the arrays in them."""

import gc
import threading

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.execution import buffer_pool
from jounce.execution.backends import uses_machine_code
from jounce.execution.buffer_pool import LEAST, LINE, arrays_in, bytes_needed, lend
from jounce.execution.compilation import Compiled
from tests.problems.small import four_bar


@pytest.fixture
def free(monkeypatch):
    blocks = {}
    monkeypatch.setattr(buffer_pool, "_free", blocks)
    return blocks


def address(block):
    return block.ctypes.data


@pytest.mark.parametrize("part", [lambda x: x[8:16].view(float), lambda x: np.ndarray((3, 1), float, x, 64)[1:].T])
def test_memory_comes_back_when_no_array_in_it_is_left(free, part):
    size = LEAST
    block = lend(size)
    first, array = address(block), part(block)
    array[...] = 3.0
    del block
    gc.collect()
    assert not free
    other = lend(size)
    assert address(other) != first
    other[:] = 0
    assert (array == 3.0).all()
    del array
    assert len(free) == 1
    assert address(lend(size - 1)) != first  # it is small: new memory
    assert address(lend(size)) == first


def test_the_smallest_block_that_is_large_enough_is_lent(free):
    sizes = [4 * LEAST, 2 * LEAST, 3 * LEAST]
    blocks = [lend(size) for size in sizes]
    firsts = list(map(address, blocks))
    del blocks
    assert address(lend(2 * LEAST + 1)) == firsts[2]
    assert len(lend(4 * LEAST + 1)) == 4 * LEAST + 1
    assert sorted(map(len, free.values())) == [2 * LEAST, 3 * LEAST, 4 * LEAST, 4 * LEAST + 1]


def test_what_has_been_free_for_longest_makes_room(free, monkeypatch):
    monkeypatch.setattr(buffer_pool, "MOST", 6 * LEAST)
    blocks = [lend(k * LEAST) for k in (1, 2, 3, 4, 7)]
    lengths = []
    while blocks:
        del blocks[0]
        lengths.append([len(block) // LEAST for block in free.values()])
    assert lengths == [[1], [1, 2], [1, 2, 3], [4], []]


def test_a_much_larger_block_stays_free(free):
    lend(2 * LEAST + 1)
    assert len(lend(LEAST)) == LEAST
    assert len(lend(LEAST + 1)) == 2 * LEAST + 1
    assert len(free) == 2


@pytest.mark.parametrize("size", [0, LEAST - 1])
def test_little_memory_is_new(free, size):
    assert len(lend(size)) == size
    assert not free


def test_memory_that_jax_has_taken_over_is_not_lent_again(free):
    array = jnp.asarray(lend(LEAST)[64:128].view(float))
    expected = np.array(array)
    gc.collect()
    for _ in range(3):
        lend(LEAST)[:] = 7
    np.testing.assert_array_equal(array, expected)


def test_results_of_one_call_stay_as_they_are_in_the_next():
    run = Compiled(lambda x: (x + 1.0, jnp.sum(x)), ())
    given = [np.full(LEAST // 8, float(k)) for k in range(5)]
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


def test_motions_are_their_own_beside_others_that_borrow_the_same_memory(free):
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
    assert bool(free) == uses_machine_code()  # it is machine code that borrows
