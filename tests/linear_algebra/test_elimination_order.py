"""The order in which bodies are eliminated, by counting the operations on certain entries."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest

from jounce.linear_algebra.elimination_order import elimination_order
from jounce.linear_algebra.reflections import ReflectedFactor
from jounce.mechanism import build
from tests.problems.small import four_bar


def sets(*rows):
    return tuple(map(frozenset, rows))


CHAIN = sets(*[(0,)] * 3, *[(0, 1)] * 2, *[(1, 2)] * 2, *[(2,)] * 2)
STAR = sets(*[(0, 1)] * 2, *[(0, 2)] * 2, *[(0, 3)] * 2, *[(1,)] * 2, *[(2,)] * 2, *[(3,)] * 2)
LOOP = sets(*[(0,)] * 2, *[(0, 1)] * 2, *[(1, 2)] * 2, *[(2, 3)] * 2, *[(0, 3)] * 2, *[(3,)] * 2)


def operations(touched, bodies, width, rows):
    """Eliminate by rows that are sets of columns, one column after another, and count."""
    left = [{(body, k) for body in touched[row] for k in range(width)} for row in rows]
    count = 0
    for column in itertools.product(bodies, range(width)):
        meeting = [k for k, row in enumerate(left) if column in row or k == 0]
        union = set().union(*(left[k] for k in meeting))
        count += len(meeting) * len(union)
        for k in meeting:
            left[k] = union - {column}
        left = left[1:]
    return count


@pytest.mark.parametrize("touched, bodies, width", [(CHAIN, 3, 3), (STAR, 4, 3), (LOOP, 4, 3)])
def test_no_order_of_bodies_takes_fewer_operations(touched, bodies, width):
    rows, columns = elimination_order(touched, bodies, width)
    chosen = [column // width for column in columns[::width]]
    assert columns == tuple(width * body + k for body in chosen for k in range(width))
    assert sorted(rows) == list(range(len(touched)))

    def count(order):
        place = {body: k for k, body in enumerate(order)}
        ends = [sorted(place[body] for body in some) for some in touched]
        return operations(touched, order, width, sorted(range(len(touched)), key=lambda k: (ends[k][0], ends[k][-1])))

    assert count(chosen) == min(map(count, itertools.permutations(range(bodies))))


def test_a_four_bar_begins_with_its_last_body():
    rows, columns = build(four_bar()).system.elimination_order
    assert columns == (3, 4, 5, 0, 1, 2)
    assert sorted(rows) == list(range(6))


def test_a_body_that_few_rows_touch():
    rows, columns = elimination_order(sets((0,), (0,), (0, 1), (0, 1)), 2, 2)
    matrix = (
        np.random.default_rng(0).standard_normal((4, 4, 2)) * np.array([[1, 1, 0, 0]] * 2 + [[1] * 4] * 2)[..., None]
    )
    right = np.ones((4, 2))
    found = ReflectedFactor.of(jnp.asarray(matrix), (rows, columns)).solve(jnp.asarray(right))
    np.testing.assert_allclose(np.einsum("ijk,jk->ik", matrix, found), right, rtol=1e-12)
