"""Random programs with loops and branches within one another as machine code, against JAX: exact, as all is whole."""

import operator

import hypothesis
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import strategies as st
from jax import lax

from jounce.native import translation
from tests.native.lanes import COUNT, assert_agree

MODULUS = 1009


def bounded(product):
    return lambda a, b: lax.rem(product(a, b), jnp.full_like(a, MODULUS))


PAIRS = [
    bounded(operator.add), bounded(operator.sub), bounded(operator.mul), lax.rem, lax.max, lax.min,
    lambda a, b: jnp.where(a < b, a, b + b), lambda a, b: -a, lambda a, b: jnp.sign(a), lambda a, b: abs(b),
]  # fmt: skip
OF_WHOLE = [
    lax.div,
    lax.bitwise_and,
    lax.bitwise_or,
    lax.bitwise_xor,
    lambda a, b: ~a,
    lambda a, b: a + (a == b).astype(int),
]


class Pool:
    """Numbers that a program has found."""

    def __init__(self, doubles, whole):
        self.doubles, self.whole = list(doubles), list(whole)

    def double(self, k):
        return self.doubles[k % len(self.doubles)]

    def number(self, k):
        return self.whole[k % len(self.whole)]

    def state(self):
        return tuple(self.doubles[-3:]), tuple(self.whole[-2:])

    def within(self, state):
        return Pool((*self.doubles, *state[0]), (*self.whole, *state[1]))

    def take(self, state):
        self.doubles += state[0]
        self.whole += state[1]


def run(program, pool):
    """Run a program, which is a list of a name, three numbers and programs within it."""
    for name, i, j, k, parts in program:
        RUN[name](pool, i, j, k, parts)
    return pool.state()


def doubles(pool, i, j, k, parts):
    pool.doubles.append(PAIRS[k % len(PAIRS)](pool.double(i), pool.double(j)))


def whole(pool, i, j, k, parts):
    functions = PAIRS + OF_WHOLE
    pool.whole.append(functions[k % len(functions)](pool.number(i), pool.number(j)).astype(jnp.int64))


def converted(pool, i, j, k, parts):
    pool.whole.append(lax.rem(pool.double(i), jnp.full_like(pool.double(i), 7)).astype(jnp.int64))
    pool.doubles.append(lax.rem(pool.number(j), jnp.full_like(pool.number(j), 7)).astype(float))


def chosen(pool, i, j, k, parts):
    pool.doubles.append(jnp.where(pool.number(i) <= pool.number(j), pool.double(k), pool.double(i)))


def indexed(pool, i, j, k, parts):
    rows, at = jnp.stack([pool.double(i + n) for n in range(4)]), pool.number(k)[0]
    pool.doubles.append(lax.dynamic_slice(rows, (at, 0), (2, 1)).sum(axis=0))
    pool.doubles.append(rows.at[pool.number(j)].get(mode=("clip", "fill")[k % 2], fill_value=1.0)[0])
    changed = lax.dynamic_update_slice(rows, pool.double(j)[None], (at, 0))
    pool.doubles += [changed[0], changed[2], rows.at[k % 4].add(pool.double(k))[1]]


def loop(pool, i, j, k, parts):
    turns = lax.rem(abs(pool.number(i)), jnp.full_like(pool.number(i), 4))

    def body(state):
        turn, inner = state
        return turn + 1, run(parts[0], pool.within(inner))

    _, state = lax.while_loop(lambda s: s[0] < turns[0], body, (0, pool.state()))
    pool.take(state)


def branch(pool, i, j, k, parts):
    ways = [lambda state, part=part: run(part, pool.within(state)) for part in parts[: 2 + k % 2]]
    pool.take(lax.switch(pool.number(i)[0], ways, pool.state()))


def scan(pool, i, j, k, parts):
    rows = jnp.stack([pool.double(j + n) for n in range(3)])

    def body(state, row):
        inner = pool.within(state)
        inner.doubles.append(row)
        state = run(parts[0], inner)
        return state, state[0][-1] - row

    state, made = lax.scan(body, pool.state(), rows, reverse=k % 2 == 0)
    pool.take(state)
    pool.doubles += [made[0], made[2]]


RUN = {f.__name__: f for f in (doubles, whole, converted, chosen, indexed, loop, branch, scan)}
NUMBERS = st.integers(0, 30)
LINES = st.sampled_from(["doubles", "whole", "converted", "chosen", "indexed"])
PLAIN = st.lists(st.tuples(LINES, NUMBERS, NUMBERS, NUMBERS, st.none()), min_size=1, max_size=3)


def programs(inner):
    one = st.tuples(st.sampled_from(["loop", "scan"]), NUMBERS, NUMBERS, NUMBERS, st.tuples(inner))
    ways = st.tuples(st.just("branch"), NUMBERS, NUMBERS, NUMBERS, st.tuples(inner, inner, inner))
    return st.tuples(PLAIN, one | ways, PLAIN).map(lambda parts: [*parts[0], parts[1], *parts[2]])


PROGRAMS = programs(programs(programs(PLAIN) | PLAIN) | PLAIN)


def assert_exact(program, seed, unrolled, width=8):
    random = np.random.default_rng(seed)
    lanes = random.integers(-9, 10, (2, COUNT)).astype(float), random.integers(-5, 6, (2, COUNT))
    shared = random.integers(-9, 10, (2, 1)).astype(float), random.integers(-5, 6, (2, 1))

    def function(a, n, x, m):
        pool = Pool((*a, *x), (*n, *m)) if seed % 2 else Pool((*x, *a), (*m, *n))
        run(program, pool)
        return jnp.stack(pool.doubles[-20:]), jnp.stack(pool.whole[-20:])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(translation, "MOST_UNROLLED", 12_000 if unrolled else -1)
        known = (1,) if seed % 3 == 0 else ()
        assert_agree(function, *lanes, shared=shared, known=known, width=width, rtol=0, signs=False)


@hypothesis.settings(max_examples=8)
@hypothesis.given(PROGRAMS, st.integers(0, 99), st.booleans())
def test_random_programs(program, seed, unrolled):
    assert_exact(program, seed, unrolled)


@pytest.mark.slow
@hypothesis.settings(max_examples=300)
@hypothesis.given(PROGRAMS, st.integers(0, 99), st.booleans(), st.sampled_from([2, 4, 8]))
def test_many_random_programs(program, seed, unrolled, width):
    assert_exact(program, seed, unrolled, width)
