"""Numbers that are computed where they are used: what they are computed from may have changed by then, or moved."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jounce.execution.llvm import modules
from jounce.execution.llvm.text import views
from tests.execution.llvm import lanes
from tests.execution.llvm.lanes import FEW, ordinary

assert_agree = partial(lanes.assert_agree, larges=(FEW,))


def test_what_is_changed_before_they_are_used():
    def run(x, y):
        product, difference = x * y, x - y
        changed = x.at[0].set(5.0)
        again = lax.dynamic_update_slice(y, x[1:3], (2, 0))
        z = y + 1.0
        squares = z * z
        z = lax.dynamic_update_slice(z, squares[2:4], (0, 0))
        return product + 1.0, changed, again, difference * 2.0, squares.sum(axis=0), z

    assert_agree(run, ordinary(7), ordinary(7, seed=1))


def test_what_is_written_into_what_they_are_computed_from():
    def run(x):
        y = x * 2.0
        y = lax.dynamic_update_slice(y, y[1:5] * y[:4], (2, 0))
        z = lax.dynamic_update_slice(x + 1.0, x[:2] - 3.0, (1, 0))
        return y, z, lax.dynamic_update_slice(z, z[::-1] * 0.5, (0, 0))

    assert_agree(run, ordinary(8))


def test_what_a_loop_carries():
    def run(x, y):
        def turn(k, carry):
            a, b = carry
            product = a * b
            a = a.at[k].add(1.0)
            return jnp.where(b > 0.0, product, a), product[::-1] - a

        def going(carry):
            return jnp.max(carry[0]) < 50.0

        def grown(carry):
            a, b = carry
            c = a + b * b
            b = b.at[0].set(a[1])
            return c + 1.0, b

        rolled = lax.fori_loop(0, 5, turn, (x, y))
        while_ = lax.while_loop(going, grown, (x, y))
        summed, made = lax.scan(lambda carry, row: (carry * 0.5 + row, carry - row), x[0], x[1:] * y[1:])
        return rolled, while_, summed, made

    assert_agree(run, ordinary(9), ordinary(9, seed=3))


@pytest.mark.parametrize("size", [8, 11, 16, 21])
def test_what_is_computed_in_its_own_place(size):
    def run(x, y):
        def turn(_, carry):
            a, b, c = carry
            return a * 1.01 + b, b - 0.001, a[::-1] * 0.5 + c * 0.25

        def going(carry):
            return jnp.max(jnp.abs(carry[0])) < 1e3

        return lax.fori_loop(0, 300, turn, (x, y, x)), lax.while_loop(
            going, lambda z: (z[0] * 1.5 + 1.0, -z[1]), (x, y)
        )

    assert_agree(run, ordinary(size), ordinary(size, seed=5))


def test_what_lies_between_is_a_branch_or_a_loop():
    def run(x, y):
        product = x * y
        chosen = lax.cond(x[0, 0] > 0.0, lambda: x.at[1].set(0.0), lambda: y * 2.0)
        return product - chosen, lax.fori_loop(0, 3, lambda _, z: z.at[2].add(2.0), x) + y

    assert_agree(run, ordinary(6), ordinary(6, seed=2))


def test_long_sums():
    def run(x, y):
        total = x * y
        for k in range(20):  # of more arrays than are read at once
            total = total + jnp.roll(x, k) * (y + float(k))
        return total, (total * x).max(axis=0), jnp.concatenate([x * 2.0, total / 3.0]), jnp.stack([-x, y * y])

    assert_agree(run, ordinary(5), ordinary(5, seed=4))


def test_their_views():
    def run(x):
        y = (x * 3.0).reshape(4, 6, -1)
        z = (x.transpose(1, 0, 2) + 1.0).reshape(3, 8, -1)  # which no strides tell
        w = (x * x)[:, None] * jnp.ones((1, 2, 1, 1))
        narrow = ((x - 1.0).transpose(1, 0, 2)[:, :, None]).squeeze(2)
        return y * 2.0, z - 1.0, w, narrow * 0.5, jnp.broadcast_to((x[0] * 2.0)[None], x.shape) + x, (x * 5.0)[::2]

    assert_agree(run, ordinary(6, 4))


def test_other_kinds():
    def run(x):
        whole = (x * 10.0).astype(np.int32)
        odd = (whole % 2 == 1) & (x > 0.0)
        return (
            jnp.where(odd, whole * 3, whole - 1),
            odd.any(axis=0),
            (odd | (whole > 4)).sum(axis=0),
            whole.astype(float) / 3.0,
        )

    assert_agree(run, ordinary(11))


def test_a_sum_of_products_is_one_loop():
    def loops(terms):
        def total(x):
            return sum((x[k] * x[k + 1] for k in range(terms)), x[0])

        program = jax.make_jaxpr(total)(np.ones((terms + 1, 40, 1)))
        return modules._text(program, 0, {}, 8, large=FEW).count("phi i64")

    assert loops(6) == loops(1)


def test_a_view_that_some_array_lacks_is_none():
    region = views.Region("%m", "f", False)
    column, across = views.contiguous(region, (2, 3)), views.Stored(region, (2, 3), (1, 2))
    whole = views.Deferred((column, across), "f", lambda values: values[0])
    assert whole.in_shape((6,)) is None
    transposed = whole.viewed(lambda x: views.transposed(x, (1, 0)))
    assert (transposed.shape, transposed.size, transposed.lanes) == ((3, 2), 6, False)
