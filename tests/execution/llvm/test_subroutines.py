"""Parts of a program that are written once and called, against JAX."""

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jounce.base.jax_internals import by_certain_entries, subroutine
from jounce.execution.llvm import modules
from tests.execution.llvm.lanes import COUNT, TRUTH, assert_agree, compiled, ordinary


@subroutine
def curved(pair, x):
    a, b = pair
    return jnp.sin(a) * x[None] + b, jnp.sum(a * b, axis=0), jnp.ones_like(x)


@subroutine
def twice(matrix, x):
    return curved((matrix, x[None] * matrix), x)[0] + curved((matrix, matrix), x)[0]


@subroutine
@by_certain_entries()
def scaled(matrix, x):
    return matrix * x[None, None], jnp.sum(matrix[0], axis=0) / x


def text_of(function, *lanes):
    texts = []
    with pytest.MonkeyPatch.context() as patch:
        made = modules._text
        patch.setattr(modules, "_text", lambda *given, **how: texts.append(made(*given, **how)) or texts[-1])
        compiled(function, lanes)
    return texts[0]


@pytest.mark.parametrize("width", [2, 4, 8])
def test_calls_from_several_places(width):
    def run(x, y):
        first, part, _ = curved((jnp.stack([x, y]), jnp.stack([y, x])), x)
        second, other, one = curved((first, jnp.stack([part, x])), y)
        return second, other + one

    assert_agree(run, ordinary(), ordinary(seed=1), width=width, counts=(COUNT, 1))


def test_calls_within_calls():
    assert_agree(lambda x, y: twice(jnp.stack([x, y]), y), ordinary(), ordinary(seed=1))
    text = text_of(lambda x, y: twice(jnp.stack([x, y]), y), ordinary(), ordinary(seed=1))
    assert text.count("define internal void @part") == 2


def test_calls_in_loops_and_branches():
    def run(x, turned):
        def body(state):
            pair, count = state
            new = lax.cond(turned[0], lambda: curved(pair, x)[0], lambda: curved(pair[::-1], x)[0])
            return (0.3 * new, pair[0]), count + 1

        start = (jnp.stack([x, -x]), jnp.stack([x, x])), jnp.zeros(1, int)
        return lax.while_loop(lambda s: (s[1][0] < 4) & (s[0][0][0, 0] < 1.5), body, start)

    assert_agree(run, ordinary(), TRUTH)


def test_numbers_that_all_instants_share():
    assert_agree(
        lambda a, x: curved((a[:, None] + 0 * x[None], a[:, None]), x), ordinary(), shared=(np.array([0.5, 2.0]),)
    )


def test_certain_zeros_are_part_of_a_subroutine():
    def run(x, y):
        zero = jnp.zeros_like(x)
        one = scaled(jnp.stack([jnp.stack([x, zero]), jnp.stack([zero, y])]), y)
        other = scaled(jnp.stack([jnp.stack([zero, zero]), jnp.stack([y, x])]), x)
        nothing = scaled(jnp.stack([jnp.stack([zero, zero])] * 2), x)
        return one, other, nothing

    lanes = ordinary(), ordinary(seed=1)
    assert_agree(run, *lanes, signs=False)
    text = text_of(run, *lanes)
    assert text.count("define internal void @part") == 3
    assert text.count("call void @part") == 2


def test_other_numbers_than_doubles_are_no_reason_to_refuse():
    @subroutine
    def counted(x, n):
        return x * n.astype(float), n + 1

    assert_agree(lambda x, n: counted(*counted(x, n)), ordinary(), np.arange(COUNT))


def test_a_call_that_is_written_again_leaves_one_text():
    def run(x):
        def body(state):
            (matrix, x), count = state
            return (scaled(matrix, x)[0], jnp.where(count == 1, x, 0.5 * x)), count + 1

        start = (jnp.zeros((5, 5, 1)).at[2, 2].set(x + 1.5), x), jnp.zeros(1, int)
        return lax.while_loop(lambda s: s[1][0] < 2, body, start)[0]

    assert_agree(run, ordinary(), signs=False)
    assert text_of(run, ordinary()).count("define internal void @part") == 1
