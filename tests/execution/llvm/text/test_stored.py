"""Arrays that stay in memory: what reads one, a part of it or its turns is not disturbed when it is changed later."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jounce.execution.llvm import translation
from tests.execution.llvm import lanes
from tests.execution.llvm.lanes import FEW, ordinary, whole

SIZE = 17
assert_agree = partial(lanes.assert_agree, larges=(FEW,), rtol=1e-11)  # indices that are not known want memory


@pytest.fixture(params=["turn after turn", "as a loop"])
def scans(request, monkeypatch):
    monkeypatch.setattr(translation, "MOST_UNROLLED", 12_000 if request.param == "turn after turn" else -1)


def test_parts_that_are_read_after_a_change():
    def run(x, n):
        a = x * 2.0
        found = [a[::-1], a.transpose(1, 0, 2), a[1:3], jnp.broadcast_to(a[:, :1], (SIZE, 4, 1)), a]
        changed = a.at[n[0]].set(0.0)
        found += [changed.reshape(-1, 1), changed.at[1].set(7.0), a.at[2].add(changed[3])]
        return found, found[::-1], x, x[::-1], changed[0], found[-1]

    assert_agree(run, ordinary(SIZE, 4), whole(low=-2, high=20))


def test_arrays_changed_by_themselves():
    def run(m, n, x):
        found = [lax.dynamic_update_slice(a, a[2:7][::-1], (k, 0)) for a in (x * 2.0, x + 1.0) for k in (n[0], 1)]
        own = m * 1
        found += [own.at[own].set(own[::-1], mode="clip"), (m + 1).at[m + 1].add(m + 1, mode="drop")]
        k = (x * 10.0).astype(int)[:, 0]
        changed = k.at[k[:5]].set(k[3:8], mode="drop")
        found += [changed.at[changed[::-1]].add(changed, mode="clip")[:, None], k[:, None]]
        return [array.reshape(-1, 1) for array in found]

    m = np.random.default_rng(4).integers(0, SIZE, SIZE)
    assert_agree(run, whole(low=-2, high=20), ordinary(SIZE), shared=(m,))


def test_what_scans_make_of_what_they_carry(scans):
    def run(x):
        def body(carry, k):
            c, few = carry
            changed = lax.dynamic_update_slice(c, y[:2] * few[:1], (k, 0))
            made = c, changed, c[::-1], jnp.broadcast_to(c[:1], (5, 1)), jnp.broadcast_to(few, (9, 2, 1))
            return (changed.at[k + 2].add(c[1]), few * 0.5), made

        y = x * 2.0
        found = lax.scan(body, (y, x[:2]), jnp.arange(3))
        return found, lax.scan(body, found[0], jnp.arange(4), reverse=True), y

    assert_agree(run, ordinary(SIZE))


def test_what_later_turns_read_is_not_changed(scans):
    def run(n, x, rows):
        def body(c, row):
            changed = row.at[1].set(c[0])
            other = y.at[n[0]].set(row[2])
            product = jnp.sin(changed) * row
            return lax.dynamic_update_slice(c, product[3:6], (n[0], 0)) + other, (product, row[::-1], c[::2] > 0.0)

        y = x * 0.5
        return lax.scan(body, x, rows * 1.0), lax.scan(body, rows[0], rows[::-1, ::-1], reverse=True)

    assert_agree(run, whole(low=-1, high=20), ordinary(SIZE), ordinary(3, SIZE, seed=1))


def test_carries_that_change_places_and_are_parts_of_one_another(scans):
    def run(n, x):
        z = x * 2.0

        def body(s):
            k, a, b, c = s
            changed = a.at[k].set(b[3])
            part = lax.dynamic_update_slice(changed, changed[1:3], (k, 0))
            return k + 1, b, part, jnp.where(c > 0.0, changed[::-1], a)

        def goes(s):
            return (s[0] < n[0]) & (s[1][::-1].sum() < 60.0) & (s[2][s[0], 0] > -100.0)

        found = [
            lax.while_loop(goes, body, (0, z, z[::-1], x))[1:],
            lax.fori_loop(0, 4, lambda _, s: body(s), (1, z, z, z))[1:],
        ]
        turned = lambda _, s: (s[1], s[1], s[0][::-1], jnp.broadcast_to(s[2][:1], (SIZE, 1)))  # noqa: E731
        found.append(lax.fori_loop(0, 3, turned, (z, z, z, z)))
        moved = lambda c, _: ((c[1], jnp.roll(c[0], 1, axis=0)), (c[0], c[0], c[1][::-1]))  # noqa: E731
        return found, lax.scan(moved, (z, x), length=3)

    assert_agree(run, whole(low=-1, high=20), ordinary(SIZE))


def test_branches_that_change_what_others_read():
    def run(k, n, x):
        ways = [
            lambda a, v: (a.at[0].set(1.0), v),
            lambda a, v: (v, a.at[2].set(v[0])),
            lambda a, v: (v.at[1].set(9.0), a),
        ]
        found = []
        for which in (k[0], n[0]):
            a = x * 2.0
            first = lax.switch(which, ways, a, a[::-1])
            second = lax.switch(which, ways, first[0], first[0])
            found += [first, lax.switch(which, ways[::-1], *second)]
        positive = [lambda z: z.at[0].set(5.0), lambda z: z.at[1].set(4.0)]
        return found, lax.cond(x[0, 0] > 0.0, *positive, found[-1][1])

    for k in (0, 1, 2):
        assert_agree(run, whole(low=-1, high=4), ordinary(SIZE), shared=(np.array([k]),))


def test_loops_and_branches_and_programs_within_one_another(scans):
    called = jax.jit(lambda a, b, k: (a.at[k].set(b[0]), a, b[::-1]))

    def run(m, n, x):
        def inner(k, s):
            s = lax.cond(n[0] > k, lambda a, b, c: called(a, b, k), lambda a, b, c: (c, b.at[k].set(a[1]), a), *s)
            return lax.cond(m[0] > k, lambda a, b, c: (b, c, a), lambda a, b, c: called(c, a, k), *s)

        def outer(s):
            j, a, b, c = s
            half = a * 0.5
            e, _, h = lax.fori_loop(0, 3, inner, (a, b, c))
            last, made = lax.scan(lambda c, k: (inner(k, c), (c[0], c[1][::-1])), (e, h, half), jnp.arange(2))
            return j + 1, last[0] + half, made[0][1] + h, made[1][0] + last[2]

        found = lax.while_loop(lambda s: s[0] < n[0], outer, (0, x, x[::-1], x * 2.0))[1:]
        return found, lax.fori_loop(0, m[0], lambda _, s: outer(s), (0, x * 1.0, x, x[::-1]))[1:]

    assert_agree(run, whole(low=0, high=5), ordinary(9), shared=(np.array([2]),))


def test_arrays_that_turn_out_to_differ_from_lane_to_lane(scans):
    def run(shared, x, n):
        def body(carry, k):
            p, q, r, m = carry
            squared = jnp.cos(p) ** 2
            both = squared[::-1] + jnp.sin(shared)
            after = q.at[k].set(r[0]), p.at[k + 1].set(both[1]), jnp.where(k == 2, x, r), m.at[k].set(m[k + 1] + n[0])
            return after, (both, m, q[::2], after[1])

        start = shared * 2.0, shared[::-1], shared, jnp.zeros((SIZE, 1), int)
        found = lax.scan(body, start, jnp.arange(5))
        return found, lax.scan(body, found[0], jnp.arange(3), reverse=True), start[0]

    assert_agree(run, ordinary(SIZE), whole(1, low=0, high=5), shared=(ordinary(SIZE)[..., :1],))
