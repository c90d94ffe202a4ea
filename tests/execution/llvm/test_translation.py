"""Loops and branches as machine code, in which lanes part, against JAX, which runs one instant after another."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jounce.base import jax_internals
from jounce.execution.llvm import machine, modules, translation
from jounce.execution.llvm.text import code
from jounce.execution.llvm.text.values import Region, UnsupportedOperationError
from jounce.linear_algebra.reflections import ReflectedFactor
from tests.execution.llvm.lanes import (
    COUNT,
    LONG,
    TRUTH,
    WHOLE,
    assert_agree,
    assert_same,
    compiled,
    one_by_one,
    ordinary,
    whole,
)

pytestmark = pytest.mark.long

COUNTS = (1, 3, 8, COUNT)
WIDTHS = (2, 4, 8)


@pytest.fixture(params=["turn after turn", "as a loop"])
def scans(request, monkeypatch):
    if request.param == "as a loop":
        monkeypatch.setattr(translation, "MOST_UNROLLED", -1)


@pytest.mark.parametrize("width", WIDTHS)
def test_lanes_leave_a_loop_at_different_turns(width):
    def collatz(n):
        def body(state):
            n, turns, highest = state
            n = jnp.where(n % 2 == 0, n // 2, 3 * n + 1)
            return n, turns + 1, jnp.maximum(highest, n)

        return lax.while_loop(lambda s: s[0][0] > 1, body, (n, jnp.zeros_like(n), n))

    assert_agree(collatz, np.arange(COUNT), width=width, counts=COUNTS)


def test_a_loop_that_no_lane_or_only_one_enters():
    def run(x):
        return lax.while_loop(lambda s: s[0] > 0.0, lambda s: s - 0.75, x)

    for x in (np.full(COUNT, -1.0), np.where(np.arange(COUNT) == 11, 5.0, -1.0), np.where(TRUTH, np.nan, 3.0)):
        assert_agree(run, x, counts=COUNTS)


def test_a_condition_that_is_the_same_in_all_lanes():
    def run(n, x):
        return lax.fori_loop(0, n[0], lambda k, s: s * 0.5 + k, x)

    for n in (0, 1, 7):
        assert_agree(run, ordinary(), shared=(np.array([n]),), counts=COUNTS)
        assert_agree(run, ordinary(), shared=(np.array([n]),), knowns=((0,),))


def test_a_condition_that_never_or_always_holds():
    assert_agree(lambda x: lax.while_loop(lambda s: False, lambda s: s + 1.0, x), ordinary())
    assert_agree(lambda x: lax.cond(True, jnp.sin, jnp.cos, x), ordinary())


def test_numbers_that_lanes_share_until_they_part():
    def run(shared, x):
        def body(state):
            _, b, c, d, e, k = state
            return b + 0.0 * k, c, d, e + x, e, k + 1

        start = (*(shared * k for k in range(1, 6)), 0)
        found = lax.while_loop(lambda s: s[-1] < 7, body, start)
        return [*found[:-1], found[-1] + 0.0 * x]

    assert_agree(run, ordinary(), shared=(np.array([1.5]),), counts=COUNTS)


def test_carries_that_change_places():
    def run(n, a, b, c):
        state = lax.while_loop(lambda s: s[0][0] > 0, lambda s: (s[0] - 1, s[2], s[3], s[1]), (n, a, b, c))
        return state, lax.fori_loop(0, 5, lambda k, s: (s[1], s[0]), (a, b))

    a = ordinary(3, 2)
    assert_agree(run, np.arange(COUNT), a[0], a[1], a[2], counts=COUNTS)
    assert_agree(run, np.arange(COUNT) % 5, a[0], a[1], np.zeros_like(a[2]))


def test_elements_of_a_carry_change_places():
    def run(n, x):
        return lax.while_loop(lambda s: s[0][0] > 0, lambda s: (s[0] - 1, jnp.roll(s[1], 1, axis=0)), (n, x))

    assert_agree(run, np.arange(COUNT), ordinary(4))


def test_elements_change_places_in_a_loop_that_all_lanes_leave_together():
    def run(n, x):
        return lax.fori_loop(0, n[0], lambda k, x: jnp.roll(x, 1, axis=0), x)

    assert_agree(run, ordinary(4), shared=(np.array([3]),), counts=COUNTS)


def test_numbers_that_lanes_share_after_a_loop():
    def run(n, shared, x):
        return lax.fori_loop(0, n[0], lambda k, s: (shared, s[0]), (x, x))

    for n in (0, 1, 2, 5):
        assert_agree(run, ordinary(), shared=(np.array([n]), np.array([2.5])), counts=COUNTS)


def test_what_a_loop_reads_at_indices_is_what_it_held_before_it_changed():
    def run(n, x):
        def body(state):
            k, x = state
            taken = lax.dynamic_index_in_dim(x, (2 * k + 1) % 4, 0, keepdims=False)
            swapped = x.at[0].set(taken).at[1].set(x[3]).at[3].set(x[0])
            after = lax.dynamic_index_in_dim(swapped, k % 4, 0, keepdims=False)
            return k + 1, swapped.at[2].set(after + 0.5 * lax.dynamic_index_in_dim(x, k % 4, 0, keepdims=False))

        parted = lax.while_loop(lambda s: s[0] < n[0], body, (0, x))
        return parted[1], lax.fori_loop(0, 6, lambda k, x: body((k, x))[1], x)

    assert_agree(run, np.arange(COUNT), ordinary(4), counts=COUNTS)


def test_loops_within_loops():
    def run(n, x):
        def inner(k, x):
            return lax.while_loop(lambda s: s[0] < n[0] - k, lambda s: (s[0] + 1, jnp.sin(s[1]) + k), (0, x))[1]

        def outer(state):
            k, x, kept = state
            new = inner(k, x)
            return k + 1, new, kept + x * new

        return lax.while_loop(lambda s: s[0] < n[0] % 4, outer, (0, x, x))[1:]

    assert_agree(run, np.arange(COUNT), ordinary(), counts=COUNTS, rtol=1e-12)


def test_a_loop_does_not_wait_for_lanes_that_are_not_in_it():
    def forever_unless_positive(x):
        return lax.while_loop(lambda s: jnp.abs(s[0]) < 10.0, lambda s: s * 2.0, x)

    def run(x):
        found = lax.cond(x[0] > 0.0, forever_unless_positive, lambda x: x, x)
        deeper = lax.while_loop(
            lambda s: s[1][0] < 3.0 * jnp.sign(x[0]),
            lambda s: (forever_unless_positive(s[0] * 0.25), s[1] + 1.0),
            (x, jnp.zeros_like(x)),
        )
        return found, deeper

    x = np.where(TRUTH, 0.0, ordinary(low=0.5))
    assert_agree(run, x, counts=COUNTS)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_branches_by_numbers_in_and_out_of_range(dtype, width):
    which = np.array([0, 1, 2, -1, 3, 100, -100, 2, 1, 0, 0, 2, 2, 1, -5, 7, 1], dtype)
    ways = [lambda x: (x + 1.0, x > 0.0), lambda x: (jnp.sin(x), x > 1.0), lambda x: (x * x, x == x)]

    def run(shared, n, x):
        two = lax.switch(n[0], ways[:2], x)
        of_shared = [lax.switch(shared[k], ways, x) for k in range(len(shared))]
        return lax.switch(n[0], ways, x), two, of_shared, lax.switch(n[0], ways[:1], x)

    shared = np.array([-1, 0, 1, 2, 5], dtype)
    assert_agree(run, which, ordinary(2), shared=(shared,), knowns=((), (0,)), width=width, counts=COUNTS)


def test_branches_by_truth_values():
    def run(shared, truth, x):
        lane = lax.cond(truth[0], lambda x: x + 1.0, lambda x: jnp.cos(x), x)
        return lane, lax.cond(shared[0], lambda x: x + 1.0, lambda x: -x, x)

    for value in (True, False):
        assert_agree(run, TRUTH, ordinary(2), shared=(np.array([value]),), counts=COUNTS)
        assert_agree(run, np.full(COUNT, value), ordinary(2), shared=(np.array([value]),), knowns=((0,),))


def test_branches_by_truth_values_that_are_not_converted():
    def run(truth, x):
        branches = [jax.make_jaxpr(f)(jnp.ones(1)) for f in (jnp.sin, jnp.cos)]
        return jax.lax.cond_p.bind(truth[0], x, branches=tuple(branches))

    closed = lambda truth, x: lax.cond(truth[0], jnp.cos, jnp.sin, x)  # noqa: E731
    truth, x = TRUTH, ordinary()
    assert_same(compiled(run, (truth, x))((), (truth, x)), [one_by_one(closed, (truth, x))])


def test_numbers_that_branches_have_in_common_or_hand_on():
    def run(shared, n, x):
        common = jnp.sin(x) * shared
        ways = [
            lambda x, y: (x, y, shared, jnp.zeros_like(x)),
            lambda x, y: (y, x, jnp.sin(x) * shared, common),
            lambda x, y: (jnp.sin(x) * shared, jnp.cos(x), shared, jnp.cos(x)),
        ]
        first = lax.switch(n[0], ways, x, x * x)
        again = lax.switch(2 - n[0], ways, first[0], first[1])
        return first, again, jnp.cos(x), jnp.sin(x) * shared

    assert_agree(run, np.arange(COUNT) % 4 - 1, ordinary(), shared=(np.array([0.5]),), counts=COUNTS)


def test_branches_within_branches_and_loops():
    def run(n, x):
        def way(x):
            return lax.cond(x[0] > 0.5, lambda x: lax.cond(x[0] > 1.0, jnp.exp, jnp.sin, x), lambda x: x - 0.25, x)

        def body(k, state):
            x, total = state
            x = lax.cond((k + n[0]) % 3 == 0, way, lambda x: x * 1.25, x)
            return x, total + lax.cond(k % 2 == 0, lambda x: x, lambda x: -x, x)

        return lax.fori_loop(0, n[0], body, (x, x)), way(x)

    assert_agree(run, np.arange(COUNT) % 7, ordinary(), counts=COUNTS, rtol=1e-12)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("length", [0, 1, 2, 5])
def test_scans(scans, length, reverse):
    def run(shared, x):
        y = x[0, 0]
        rows = (x * shared[:length], jnp.arange(length) + 2, shared[:length, 0, 0] > 0.0)

        def body(carry, given):
            (a, n, b), (row, k, positive) = carry, given
            new = jnp.where(positive, a * row[0] + k.astype(float), b)
            return (new, n + k, a), (new, y * n.astype(float), row, shared[0, 0] * y, n[None] > 3)

        start = (y, jnp.int64(1), jnp.zeros_like(y))
        (a, n, b), made = lax.scan(body, start, rows, reverse=reverse, length=length)
        return a, b, n[None], made

    assert_agree(run, ordinary(1, 1), shared=(ordinary(5, 2)[..., :1],), counts=COUNTS)


def test_scans_over_nothing_but_length(scans):
    assert_agree(lambda x: lax.scan(lambda c, _: (c * 0.5 + 1.0, c), x, None, length=6), ordinary(2))
    assert_agree(lambda x: lax.scan(lambda c, r: (c, r + x), None, jnp.stack([x, 2.0 * x, -x]))[1], ordinary(2))
    assert_agree(lambda x: lax.scan(lambda c, r: (c, r), x, jnp.zeros((4, 0, 1)))[0], ordinary(2))


def test_scans_over_constants_and_what_loops_carry(scans):
    constants = np.linspace(-1.0, 1.0, 4)

    def run(n, x):
        def once(x, row):
            row, constant = row
            return jnp.cos(x) + constant * row, x * constant

        def body(state):
            k, x = state
            last, made = lax.scan(once, x[0], (x, jnp.asarray(constants)))
            return k + 1, made.at[2].set(last)

        return lax.while_loop(lambda s: s[0] < n[0], body, (0, x))[1]

    assert_agree(run, np.arange(COUNT) % 5, ordinary(4), counts=COUNTS)


def test_scans_within_scans(scans):
    def run(x):
        def outer(c, row):
            inner = lambda c, r: (lax.cond(r[0] > 0.0, lambda c: c + r, lambda c: c * 0.5, c), c - r)  # noqa: E731
            c, made = lax.scan(inner, c, row, reverse=True)
            return c, (made, made.sum(axis=0))

        return lax.scan(outer, x[0, 0], x)

    assert_agree(run, ordinary(3, 4), counts=COUNTS)


def test_long_scans_are_loops(monkeypatch):
    def run(x):
        return lax.scan(lambda c, k: (jnp.sin(c) + k * jnp.float64(1e-3), c), x, jnp.arange(300.0))[0]

    monkeypatch.setattr(translation, "MOST_UNROLLED", 500)
    assert_agree(run, ordinary(), rtol=1e-11)


def test_programs_within_programs():
    @jax.custom_jvp
    def squared(x):
        return x * x

    squared.defjvp(lambda x, t: (x[0] ** 2, 3.0 * x[0] * t[0]))

    @jax.custom_vjp
    def cubed(x):
        return x * x * x

    cubed.defvjp(lambda x: (cubed(x), x), lambda x, t: (7.0 * x * x * t,))

    def run(x):
        found = (
            jax.jit(squared)(x),
            cubed(x),
            jax.checkpoint(jnp.sin)(x),
            jax.jit(lambda x: jnp.asarray([[2.0]])[0] * x)(x),
        )
        slopes = jax.jvp(squared, (x,), (x,))[1], jax.grad(lambda x: cubed(x).sum())(x)
        return found, slopes, jax.grad(lambda x: jax.checkpoint(jnp.sin)(x).sum())(x), jax.linearize(jnp.sin, x)[1](x)

    assert_agree(run, ordinary())


def test_derivatives_of_loops(scans):
    def run(x):
        def value(x):
            return lax.scan(lambda c, k: (jnp.sin(c * x) + k, c), x, jnp.arange(4.0))[0].sum()

        return jax.grad(value)(x), jax.jvp(lambda x: lax.fori_loop(0, 3, lambda k, x: x * x, x), (x,), (x,))

    assert_agree(run, ordinary(), rtol=1e-12)


def test_results_that_are_arguments_or_constants_or_given_twice():
    def run(shared, x, n):
        return x, x, shared, jnp.ones((2, 1)), n, jnp.array([True]), x[::-1], shared[..., :1], jnp.zeros((0, 1))

    x, n = ordinary(3), whole(2)
    program = compiled(run, (x, n), (np.array([[2.5]]),))
    for count in (1, 17):
        found = program((np.array([[2.5]]),), (x[..., :count], n[..., :count]))
        expected = x, x, np.full((1, count), 2.5), np.ones((2, count)), n, np.full(count, True), x[::-1]
        for mine, theirs in zip(found, (*expected, np.full((1, count), 2.5), np.zeros((0, count))), strict=True):
            np.testing.assert_array_equal(mine, theirs[..., :count])


def test_results_do_not_depend_on_the_lanes_beside():
    def run(n, x):
        return lax.while_loop(lambda s: s[0] < n[0], lambda s: (s[0] + 1, jnp.sin(s[1]) * 1.7 + x), (0, x))[1]

    n, x = np.random.default_rng(1).integers(0, 40, 100), np.random.default_rng(1).normal(size=100)
    program = compiled(run, (n, x))
    together = program((), (n, x))
    order = np.random.default_rng(2).permutation(100)
    np.testing.assert_array_equal(program((), (n[order], x[order])), together[order])
    for k in (0, 7, 50):
        np.testing.assert_array_equal(program((), (n[k : k + 1], x[k : k + 1])), together[k : k + 1])


def test_conversions_to_and_from_numbers_without_a_sign():
    def run(shared, n, long, x):
        a, b = n.astype(jnp.uint32), long.astype(jnp.uint32)
        of_other_kinds = [a.astype(kind) for kind in (float, jnp.int64, jnp.int32, bool)]
        whole = a.astype(jnp.int32) + n, n + n, a + a, jnp.stack([a, b]).max(0), shared[0] // shared[1] + a
        return of_other_kinds, whole, jnp.abs(x).astype(jnp.uint32), (a > b).astype(jnp.uint32)

    given = WHOLE[None], LONG[None], 1e3 * ordinary()
    assert_agree(run, *given, shared=(np.array([2**31 + 5, 3], np.uint32),), knowns=((), (0,)), counts=COUNTS)


@pytest.mark.parametrize("large", [None, 3])
def test_tables_that_jax_interpolates(large):
    times = np.linspace(0.0, 2.0, 41)

    def run(x):
        return (
            jnp.interp(x, times, jnp.sin(times)),
            jnp.searchsorted(times, x),
            jnp.searchsorted(times, x, side="right"),
        )

    assert_agree(run, np.linspace(-0.3, 2.3, COUNT)[None], counts=COUNTS, larges=(large,))


def transformed(x):
    return jnp.fft.fft(x).real


UNSUPPORTED = {
    "numbers of 32 bits": lambda x: x.astype(jnp.float32).astype(jnp.float64),
    "constants of 32 bits": lambda x: x + jnp.sum(jnp.asarray([1.0, 2.0], jnp.float32)).astype(jnp.float64),
    "whole numbers of 8 bits": lambda x: x.astype(jnp.int8).astype(jnp.float64),
    "unsigned numbers of 16 bits": lambda x: x.astype(jnp.uint16).astype(jnp.float64),
    "sorting many": lambda x: jnp.sort(jnp.arange(20.0) * x)[:1],
    "Fourier's transform": transformed,
    "complex numbers": lambda x: lax.real(lax.complex(x, x)),
    "a callback": lambda x: jax.pure_callback(np.sin, jax.ShapeDtypeStruct(x.shape, x.dtype), x),
    "printing": lambda x: (jax.debug.print("{}", x), x)[1],
    "random numbers": lambda x: x + jax.random.uniform(jax.random.PRNGKey(0), x.shape, jnp.float64),
    "a key of random numbers": lambda x: x + jax.random.uniform(jax.random.key(0), x.shape, jnp.float64),
    "factors": lambda x: jnp.linalg.cholesky(jnp.broadcast_to(x, (2, 2)) + 3.0 * jnp.eye(2))[0, :1],
    "a solution": lambda x: jnp.linalg.solve(jnp.eye(2) * x[0], jnp.ones(2))[:1],
    "indices that differ": lambda x: jnp.eye(2).at[(x[0] > 0.0).astype(int), (x[0] < 0.0).astype(int)].set(x[0])[:1, 0],
    "the largest of some": lambda x: x.at[jnp.array([0])].max(0.0),
    "digits": lambda x: lax.shift_left(x.astype(jnp.int64), jnp.ones_like(x, jnp.int64)),
    "in a loop": lambda x: lax.while_loop(lambda s: s[0] > 0.0, lambda s: transformed(s) - 1.0, x),
    "in a branch": lambda x: lax.cond(x[0] > 0.0, transformed, lambda x: x, x),
    "in a scan": lambda x: lax.scan(lambda c, _: (transformed(c), None), x, None, length=3)[0],
}


@pytest.mark.parametrize("name", UNSUPPORTED)
def test_what_there_is_no_code_for_is_refused(name):
    with pytest.raises(UnsupportedOperationError):
        compiled(UNSUPPORTED[name], (ordinary(),))


def test_what_is_too_long_or_takes_too_much_memory_is_refused(monkeypatch):
    monkeypatch.setattr(modules, "MOST_MEMORY", 10_000)
    monkeypatch.setattr(modules, "MOST_LINES", 1000)
    for run in (
        lambda x: jnp.sin(jnp.arange(1.0, 2000.0) * x).sum()[None],
        lambda x: (jnp.sin(jnp.arange(50.0)[:, None] * x[0]) @ jnp.ones((1, 50))).sum()[None],
        lambda x: lax.while_loop(lambda s: s[0, 0] > 0.0, lambda s: s - 1.0, jnp.broadcast_to(x, (300, 1)))[0],
    ):
        with pytest.raises(UnsupportedOperationError):
            compiled(run, (ordinary(),), large=3000)


def test_where_single_values_are_too_many_large_arrays_are_in_memory(monkeypatch):
    def run(x):
        table = jnp.sin(jnp.arange(1.0, 2000.0)[:, None] * x[None])
        return jnp.stack([table.sum(0), (table * table).sum(0)])

    monkeypatch.setattr(modules, "MOST_LINES_WITHOUT_LOOPS", 1000)
    monkeypatch.setattr(modules, "MOST_LINES", 1000)
    assert_agree(run, ordinary(), rtol=1e-10)


def test_long_scans_within_scans_are_given_up_early(monkeypatch):
    written, back_to = [], code.Code.back_to

    def counted(self, mark):
        written.append(len(self.lines) - mark[0])
        back_to(self, mark)

    def run(x):
        def inner(c, k):
            return lax.fori_loop(0, 200, lambda _, s: jnp.sin(s) * jnp.cos(k), c), None

        return lax.scan(inner, x, jnp.arange(300.0))[0]

    monkeypatch.setattr(translation, "MOST_UNROLLED", 500)
    monkeypatch.setattr(code.Code, "back_to", counted)
    assert_agree(run, ordinary(), rtol=1e-9)
    assert 0 < sum(written) < 2100


def test_a_program_has_one_text():
    def run(x, which):
        for k in range(6):  # the memory of several arrays ends at once, and others take it
            x = jnp.sin(x)[which] + (x * k)[which[::-1]]
        return x

    given = [jax.ShapeDtypeStruct((8,), dtype) for dtype in (jnp.float64, jnp.int64)]
    closed = jax.make_jaxpr(run)(*given)
    kept, texts = [], set()
    for k in range(20):
        kept += [Region("", "f", lanes=False) for _ in range(k)]  # so that what is made next lies elsewhere
        texts.add(modules._text(closed, 0, {}, 8, large=3))
    assert len(texts) == 1


def test_the_text_has_no_loads_of_numbers_that_are_not_needed():
    def run(unread, table, x, index):
        return lax.while_loop(lambda s: s[1] < 1.0, lambda s: (s[0], s[1] + table[index][0]), (unread, x[0]))[1][None]

    lengths = set()
    for size in (300, 3000):
        shapes = ((size,), jnp.float64), ((size,), jnp.float64), ((1,), jnp.float64), ((1,), jnp.int64)
        closed = jax.make_jaxpr(run)(*(jax.ShapeDtypeStruct(*shape) for shape in shapes))
        lengths.add(modules._text(closed, 2, {}, 8).count("\n"))
    assert len(lengths) == 1


@pytest.mark.parametrize("tried", [True, False])
def test_what_another_release_of_jax_says_otherwise_is_left_to_xla(monkeypatch, tried):
    def renamed(*_, **__):
        raise KeyError("length")

    monkeypatch.setattr(modules, "translate", renamed)
    if not tried:
        monkeypatch.setattr(jax_internals, "TRIED", ())
    with pytest.raises(KeyError if tried else UnsupportedOperationError, match="length"):
        modules.object_file(lambda shared, lanes: shared * lanes, np.ones(1), np.ones(1), {})


def masked(x, places):
    """Return a matrix that has the given entries, and certain zeros elsewhere."""
    flat = iter(x)
    return jnp.stack([jnp.stack([next(flat) if here else jnp.zeros_like(x[0]) for here in row]) for row in places])


def test_certain_zeros_have_no_products_and_others_do():
    places = np.array([[1, 0], [1, 1]], bool)

    def product(entries, column):
        return jnp.sum(masked(entries, places) * column[None], axis=1)

    def certain(entries, column):
        with jax_internals.by_certain_entries():
            return product(entries, column)

    entries, column = ordinary(3), np.stack([ordinary(seed=1), np.where(TRUTH, np.inf, np.nan)])
    assert_agree(product, entries, column)
    result = compiled(certain, [entries, column])([], [entries, column])
    np.testing.assert_array_equal(result[0], entries[0] * column[0])
    np.testing.assert_array_equal(np.isnan(result[1]), np.isnan(entries[2] * column[1]))


@pytest.mark.parametrize("width", WIDTHS)
def test_constants_that_a_loop_keeps_and_those_that_it_changes(width):
    def run(x):
        def body(state):
            matrix, turns = state
            changed = matrix.at[1, 1].add(x).at[2, 0].set(matrix[2, 0] - x)
            return jax.lax.cond(
                turns[0] % 2 == 0, lambda: changed, lambda: matrix.at[3, 3].set(-matrix[3, 3])
            ), turns + 1

        start = jnp.zeros((5, 5, 1)).at[0, 4].set(2.5).at[4, 4].set(-0.0), jnp.zeros(1, int)
        matrix, turns = lax.while_loop(lambda s: (s[1][0] < 3) | (s[0][1, 1, 0] < 4.0), body, start)
        return matrix, turns, jnp.sum(matrix, axis=(0, 1))

    assert_agree(run, ordinary(low=0.5), width=width, counts=COUNTS)


def test_constants_that_some_ways_have_in_common():
    def run(n, x):
        ways = [
            lambda: jnp.stack([x, jnp.full_like(x, 3.0), jnp.zeros_like(x), jnp.zeros_like(x)]),
            lambda: jnp.stack([2 * x, jnp.full_like(x, 3.0), -jnp.zeros_like(x), x]),
            lambda: jnp.stack([x, jnp.full_like(x, 3.0), jnp.zeros_like(x), jnp.zeros_like(x)]),
        ]
        return lax.switch(n[0], ways)

    lanes = np.arange(COUNT) % 3
    assert_agree(run, lanes, ordinary(), counts=COUNTS)
    for n in range(3):
        assert_agree(run, np.full(COUNT, n), ordinary())
        assert_agree(lambda n, x: run(n, x), ordinary(), shared=(np.array([n]),))


def test_a_matrix_with_certain_zeros_is_eliminated_with_fewer_lines():
    size, order = 9, (tuple(range(9)), tuple(range(9)))
    places = np.abs(np.subtract.outer(np.arange(size), np.arange(size))) < 2
    lines = []

    def solved(entries, right):
        factor = ReflectedFactor.of(masked(entries, places), order)
        return factor.solve(right), factor.sign(), factor.pivot_ratio()

    def dense(entries, right):
        factor = ReflectedFactor.of(jnp.reshape(entries, (size, size, 1)), order)
        return factor.solve(right), factor.sign(), factor.pivot_ratio()

    entries, right = ordinary(places.sum()), ordinary(size, seed=1)
    matrix = np.zeros((size, size, COUNT))
    matrix[places] = entries
    with pytest.MonkeyPatch.context() as patch:
        made = modules.compiled
        patch.setattr(machine, "compiled", lambda text, **how: lines.append(text.count("\n")) or made(text, **how))
        solution, sign, ratio = compiled(solved, [entries, right])([], [entries, right])
        of_all = compiled(dense, [matrix.reshape(-1, COUNT), right])([], [matrix.reshape(-1, COUNT), right])
    by_lane = np.moveaxis(matrix, -1, 0)
    np.testing.assert_allclose(solution, np.linalg.solve(by_lane, right.T[..., None])[..., 0].T, rtol=1e-10)
    np.testing.assert_array_equal(sign, np.linalg.slogdet(by_lane).sign)
    for mine, theirs in zip((solution, sign, ratio), of_all, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-10)
    assert lines[0] < 0.6 * lines[1]


@pytest.mark.parametrize("width", [2, 8])
def test_branches_that_change_what_a_loop_changes(width):
    def change(kept, x, mode):
        new = jnp.where(mode[None] == 0, kept * 0.5 + x[None], -kept)
        inner = lax.cond(jnp.all(x > 0), lambda: (new, kept), lambda: (kept, kept[::-1] + x[None]))
        return inner[0], inner[1]

    def run(mode, x):
        def body(state):
            a, b, count = state
            before = a, b
            c, d = lax.cond(jnp.any(count % 2 == 1), lambda: change(a, x, mode), lambda: (a, b))
            a, b = lax.cond(jnp.any(c[0] > 1.0), lambda: (c, d + before[0]), lambda: (c, d))
            return a, jnp.where(count[None] == 2, before[1], b), count + 1

        start = jnp.stack([x, 2 * x, x - 1]), jnp.zeros((3, 1)), jnp.zeros(1, int)
        return lax.while_loop(lambda s: (s[2][0] < 5) & (s[0][1, 0] < 6.0), body, start), x

    assert_agree(run, np.arange(COUNT) % 2, ordinary(), width=width, counts=(COUNT, 1))


def test_values_of_a_loop_that_change_places_in_a_branch():
    def run(x):
        def body(state):
            a, b, count = state
            c, d = lax.cond(jnp.any(b[0] > a[0]), lambda: (b, a), lambda: (a, b))
            e = lax.cond(jnp.any(x > 0), lambda: (c + d, a), lambda: (c, b))
            return e[0], a + e[1], count + 1

        start = jnp.stack([x, -x]), jnp.stack([0.5 * x, x]), jnp.zeros(1, int)
        return lax.while_loop(lambda s: s[2][0] < 3, body, start)

    assert_agree(run, ordinary())


def test_what_no_branch_changes_is_handed_on():
    def run(n, x):
        kept = jnp.stack([x, jnp.ones_like(x)])
        ways = [lambda k=k: (kept, x * k, kept[0]) for k in range(3)]
        return lax.switch(n[0], ways)

    assert_agree(run, np.arange(COUNT) % 3, ordinary())


def test_constants_that_a_loop_of_known_length_keeps(scans):
    def run(x):
        @jax_internals.by_certain_entries()
        def turn(matrix, row):
            return matrix @ matrix * 0.5, jnp.stack([row * 2, jnp.zeros_like(row), row, jnp.full_like(row, 7.0)])

        start = jnp.zeros((4, 4)).at[0, 1].set(x[0]).at[1, 0].set(0.5).at[2, 2].set(x[0] + 1)
        matrix, rows = lax.scan(turn, start, jnp.arange(3.0) * x)
        return matrix[..., None], rows[..., None]

    assert_agree(run, ordinary(), signs=False)
