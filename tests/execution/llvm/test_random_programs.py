"""Random programs with loops and branches within one another as machine code, against JAX: exact, as all is whole."""

import operator

import hypothesis
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import strategies as st
from jax import lax

from jounce.execution.llvm import translation
from tests.execution.llvm.lanes import COUNT, FEW, assert_agree

pytestmark = pytest.mark.long

MODULUS = 1009
SIZE = 9  # numbers of an array: more than are single values, and than a vector has


def bounded(product):
    return lambda a, b: lax.rem(product(a, b), jnp.full_like(a, MODULUS))


def divided(operation):
    """An operation that divides: JAX ends the process where whole numbers that it knows are divided by zero."""
    return lambda a, b: operation(a, b if b.dtype.kind == "f" else jnp.where(b == 0, 1, b).astype(b.dtype))


PAIRS = [
    bounded(operator.add), bounded(operator.sub), bounded(operator.mul), divided(lax.rem), lax.max, lax.min,
    lambda a, b: jnp.where(a < b, a, b + b), lambda a, b: -a, lambda a, b: jnp.sign(a), lambda a, b: abs(b),
]  # fmt: skip
OF_WHOLE = [
    divided(lax.div),
    lax.bitwise_and,
    lax.bitwise_or,
    lax.bitwise_xor,
    lambda a, b: ~a,
    lambda a, b: a + (a == b).astype(int),
]


class Pool:
    """Numbers that a program has found."""

    def __init__(self, doubles, whole, arrays=()):
        self.doubles, self.whole, self.arrays = list(doubles), list(whole), list(arrays)

    def double(self, k):
        return self.doubles[k % len(self.doubles)]

    def number(self, k):
        return self.whole[k % len(self.whole)]

    def array(self, k):
        return self.arrays[k % len(self.arrays)]

    def state(self):
        return tuple(self.doubles[-3:]), tuple(self.whole[-2:]), tuple(self.arrays[-3:])

    def within(self, state):
        return Pool((*self.doubles, *state[0]), (*self.whole, *state[1]), (*self.arrays, *state[2]))

    def take(self, state):
        self.doubles += state[0]
        self.whole += state[1]
        self.arrays += state[2]


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


VIEWS = [
    lambda a: a[::-1],
    lambda a: a.reshape(3, 3, 1).transpose(1, 0, 2).reshape(SIZE, 1),
    lambda a: jnp.roll(a, 2, axis=0),
    lambda a: jnp.broadcast_to(a[4:5], (SIZE, 1)),
    lambda a: jnp.concatenate([a[1::2], a[::2]]),
    lambda a: lax.pad(a, jnp.float64(3.0), ((-2, 2, 0), (0, 0, 0))),
    lambda a: lax.pad(a[:5], a[5, 0], ((0, 0, 1), (0, 0, 0))),
    lambda a: jnp.broadcast_to(a.reshape(3, 3, 1)[:, 1], (3, 3, 1)).reshape(SIZE, 1),
]


def combined(pool, i, j, k, parts):
    pool.arrays.append(PAIRS[k % len(PAIRS)](pool.array(i), pool.array(j)))


def viewed(pool, i, j, k, parts):
    pool.arrays.append(VIEWS[k % len(VIEWS)](pool.array(i)))


def updated(pool, i, j, k, parts):
    array, part, at = pool.array(i), pool.array(j)[k % 6 :][: 1 + i % 3], pool.number(k)[0]
    pool.arrays.append(lax.dynamic_update_slice(array, part, (at, 0)))


def put(pool, i, j, k, parts):
    mode, where = ("clip", "drop")[k % 2], jnp.concatenate([pool.number(k + n) for n in range(2)])
    where = (pool.number(k)[0], where, lax.rem(pool.array(k), jnp.full((SIZE, 1), 10.0)).astype(int)[: 1 + i % 4, 0])[
        j % 3
    ]
    new = pool.double(j) if where.ndim == 0 else pool.array(j)[: len(where)]
    at = pool.array(i).at[where]
    pool.arrays.append(
        lax.rem(at.add(new, mode=mode), jnp.full((SIZE, 1), 1009.0)) if k % 3 else at.set(new, mode=mode)
    )


def taken(pool, i, j, k, parts):
    where = lax.rem(pool.array(j), jnp.full((SIZE, 1), 11.0)).astype(int)[:, 0]
    pool.arrays.append(pool.array(i).at[where].get(mode=("clip", "fill")[k % 2], fill_value=1.0))
    pool.doubles.append(pool.array(i)[pool.number(k)[0]])


def reduced(pool, i, j, k, parts):
    a, axis = pool.array(i).reshape(3, 3, 1), k % 2
    total = lax.rem(a.sum(axis=axis), jnp.full((3, 1), 1009.0))
    pool.arrays.append(jnp.tile(total, (3, 1)))
    pool.doubles += [pool.array(j).max(axis=0), a.min(axis=(0, 1))]
    pool.arrays.append(jnp.where(pool.array(j) < a.max(axis=axis)[:1], pool.array(i), pool.array(k)))


def filled(pool, i, j, k, parts):
    pool.arrays.append(jnp.broadcast_to(pool.double(i), (SIZE, 1)))
    pool.arrays.append(jnp.concatenate([pool.double(j + n) for n in range(SIZE)])[:, None])


def called(pool, i, j, k, parts):
    pool.take(jax.jit(lambda state: run(parts[0], pool.within(state)))(pool.state()))


def loop(pool, i, j, k, parts):
    turns = lax.rem(abs(pool.number(i)), jnp.full_like(pool.number(i), 4))

    def goes(state):
        turn, (*_, arrays) = state
        return (turn < turns[0]) & (arrays[-1][k % SIZE, 0] < 900 if arrays and k % 2 else True)

    def body(state):
        turn, inner = state
        return turn + 1, run(parts[0], pool.within(inner))

    _, state = lax.while_loop(goes, body, (0, pool.state()))
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


def scan_of_arrays(pool, i, j, k, parts):
    rows = jnp.stack([pool.array(j + n) for n in range(3)]), pool.array(i)[:3]

    def body(state, given):
        inner = pool.within(state)
        inner.arrays.append(given[0])
        inner.doubles.append(given[1])
        after = run(parts[0], inner)
        return after, (state[2][0], after[2][-1], after[2][k % 3][::-1], given[0])

    state, made = lax.scan(body, pool.state(), rows, reverse=k % 2 == 0)
    pool.take(state)
    pool.arrays += [array[n] for n, array in zip((0, 1, 2, 1), made, strict=True)]


OF_NUMBERS = (doubles, whole, converted, chosen, indexed)
OF_ARRAYS = (combined, viewed, updated, put, taken, reduced, filled)
RUN = {f.__name__: f for f in (*OF_NUMBERS, *OF_ARRAYS, called, loop, branch, scan, scan_of_arrays)}
NUMBERS = st.integers(0, 30)


def programs_of(lines, loops):
    """Return random programs of some lines, and of loops and branches two and three deep."""
    plain = st.lists(st.tuples(st.sampled_from(lines), NUMBERS, NUMBERS, NUMBERS, st.none()), min_size=1, max_size=3)

    def programs(inner):
        one = st.tuples(st.sampled_from(loops), NUMBERS, NUMBERS, NUMBERS, st.tuples(inner))
        ways = st.tuples(st.just("branch"), NUMBERS, NUMBERS, NUMBERS, st.tuples(inner, inner, inner))
        return st.tuples(plain, one | ways, plain).map(lambda parts: [*parts[0], parts[1], *parts[2]])

    return programs(programs(programs(plain) | plain) | plain)


NUMBER_NAMES, ARRAY_NAMES = ([f.__name__ for f in functions] for functions in (OF_NUMBERS, OF_ARRAYS))
PROGRAMS = programs_of(NUMBER_NAMES, ["loop", "scan"])
PROGRAMS_OF_ARRAYS = programs_of(
    [*ARRAY_NAMES, *ARRAY_NAMES, *NUMBER_NAMES], ["loop", "scan", "scan_of_arrays", "called"]
)


def assert_exact(program, seed, unrolled, width=8, arrays=False):
    random = np.random.default_rng(seed)
    lanes = random.integers(-9, 10, (2, COUNT)).astype(float), random.integers(-5, 6, (2, COUNT))
    shared = random.integers(-9, 10, (2, 1)).astype(float), random.integers(-5, 6, (2, 1))
    many = random.integers(-9, 10, (2, SIZE, COUNT)).astype(float), random.integers(-9, 10, (2, SIZE, 1)).astype(float)

    def function(a, n, *given):
        x, m = given[-2:]
        pool = Pool((*a, *x), (*n, *m)) if seed % 2 else Pool((*x, *a), (*m, *n))
        if arrays:
            pool.arrays += (*given[0], *given[1]) if seed % 5 else (*(2.0 * given[1]), *(given[0] + 1.0))
        run(program, pool)
        results = jnp.stack(pool.doubles[-20:]), jnp.stack(pool.whole[-20:])
        return results, pool.arrays[-20:]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(translation, "MOST_UNROLLED", 12_000 if unrolled else -1)
        known = (1,) if seed % 3 == 0 else ()
        options = {"width": width, "rtol": 0, "signs": False, "knowns": (known,)}
        if arrays:
            assert_agree(function, many[0], *lanes, shared=(*shared, many[1]), larges=(FEW,), **options)
        else:
            assert_agree(function, *lanes, shared=shared, **options)


@hypothesis.settings(max_examples=8)
@hypothesis.given(PROGRAMS, st.integers(0, 99), st.booleans())
def test_random_programs(program, seed, unrolled):
    assert_exact(program, seed, unrolled)


@hypothesis.settings(max_examples=2)
@hypothesis.given(PROGRAMS_OF_ARRAYS, st.integers(0, 99), st.booleans())
def test_random_programs_of_arrays(program, seed, unrolled):
    assert_exact(program, seed, unrolled, arrays=True)


@pytest.mark.slow
@hypothesis.settings(max_examples=300)
@hypothesis.given(PROGRAMS, st.integers(0, 99), st.booleans(), st.sampled_from([2, 4, 8]))
def test_many_random_programs(program, seed, unrolled, width):
    assert_exact(program, seed, unrolled, width)


@pytest.mark.slow
@hypothesis.settings(max_examples=200)
@hypothesis.given(PROGRAMS_OF_ARRAYS, st.integers(0, 99), st.booleans(), st.sampled_from([2, 4, 8]))
def test_many_random_programs_of_arrays(program, seed, unrolled, width):
    assert_exact(program, seed, unrolled, width, arrays=True)
