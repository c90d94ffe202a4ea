"""Elements that are moved, taken and put at indices, in bounds and beyond, as machine code, against JAX."""

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from jax.lax import GatherScatterMode

from jounce.execution.llvm.text.values import UnsupportedOperationError
from tests.execution.llvm.lanes import COUNT, assert_agree, compiled, ordinary, whole

pytestmark = pytest.mark.long

MODES = {"clip": GatherScatterMode.CLIP, "fill": GatherScatterMode.FILL_OR_DROP}
BEYOND = np.array([0, 1, 2, 3, 4, -1, -2, -5, -100, 100, 2, 1, 0, 3, 5, -4, 2])
INDICES = {"64 bits": BEYOND, "32 bits": BEYOND.astype(np.int32)}


@pytest.mark.parametrize("dtype", [np.float64, bool])
def test_moves(dtype):
    x = ordinary(2, 3, 4) > 0.0 if dtype is bool else ordinary(2, 3, 4)
    filler = jnp.asarray(1, dtype)

    def run(x):
        found = {
            "slice": lax.slice(x, (0, 1, 3, 0), (2, 3, 4, 1)),
            "strides": lax.slice(x, (0, 0, 0, 0), (2, 3, 4, 1), (2, 1, 3, 1)),
            "nothing": lax.slice(x, (0, 1, 3, 0), (2, 1, 4, 1)),
            "transpose": x.transpose(2, 0, 1, 3),
            "reshape": x.reshape(4, 6, 1),
            "broadcast": lax.broadcast_in_dim(x, (5, 2, 3, 2, 4, 1), (1, 2, 4, 5)),
            "of one": lax.broadcast_in_dim(x[:, :1], (2, 3, 4, 1), (0, 1, 2, 3)),
            "squeeze": jnp.squeeze(x[:1], 0),
            "expand": jnp.expand_dims(x, (0, 2)),
            "reverse": lax.rev(x, (0, 2)),
            "concatenate": jnp.concatenate([x, x[:, :0], x[:, :2]], axis=1),
            "stack": jnp.stack([x, x[::-1]], axis=1),
            "unstack": jnp.unstack(x, axis=1),
            "split": lax.split(x, (1, 0, 3), axis=2),
            "tile": jnp.tile(x, (2, 1, 3, 1)),
            "repeat": jnp.repeat(x, 2, axis=0),
            "a number": x[1, 2, 3, 0][None],
        }
        for low, high, between in ((1, 2, 0), (-1, 1, 0), (0, -2, 0), (2, 0, 3), (-1, -1, 1), (-3, 1, 2), (-3, -1, 0)):
            padded = lax.pad(
                x, filler, ((0, 0, 0), (low, high, between) if low > -3 else (0, 0, 1), (low, high, between), (0, 0, 0))
            )
            found[f"pad {low} {high} {between}"] = padded
        found["pad nothing"] = lax.pad(x[:, :0], filler, ((0, 0, 0), (1, 2, 3), (0, 0, 0), (0, 0, 0)))
        found["pad by a lane's"] = lax.pad(x, x[0, 0, 0, 0], ((1, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)))
        return found

    assert_agree(run, x)


def test_counting():
    def run(x):
        return [
            lax.broadcasted_iota(dtype, (3, 2, 1), axis) + jnp.zeros_like(x, dtype)
            for dtype in (np.float64, np.int64, np.int32)
            for axis in range(3)
        ] + [lax.broadcasted_iota(np.int64, (0, 1), 0), jnp.eye(3)[..., None]]

    assert_agree(run, ordinary(3, 2))


@pytest.mark.parametrize("kind, width", [("64 bits", 2), ("64 bits", 4), ("32 bits", 8)])
def test_dynamic_slices(kind, width):
    at = INDICES[kind]

    def run(shared, n, x, b):
        found = {}
        for name, k in [("lane", n[0]), *((f"shared {m}", shared[m]) for m in range(len(shared)))]:
            zero = jnp.zeros_like(k)
            found[f"one {name}"] = lax.dynamic_slice(x, (k, zero, zero), (1, 3, 1))
            found[f"some {name}"] = lax.dynamic_slice(x, (zero, k, zero), (4, 2, 1))
            found[f"all {name}"] = lax.dynamic_slice(x, (k, k, k), (4, 3, 1))
            found[f"both {name}"] = lax.dynamic_slice(x, (k, n[0], zero), (2, 1, 1))
            found[f"none {name}"] = lax.dynamic_slice(x, (k, k, zero), (0, 1, 1))
            found[f"of none {name}"] = lax.dynamic_slice(x[:, :0], (k, k, zero), (2, 0, 1))
            found[f"truth {name}"] = lax.dynamic_slice(b, (k, zero, zero), (2, 3, 1))
            found[f"of constants {name}"] = lax.dynamic_slice(jnp.arange(5), (k,), (1,)) + 0
            found[f"of those of {name}"] = lax.dynamic_slice(x * 2.0, (k, zero, zero), (2, 3, 1))
            found[f"a lane's own {name}"] = lax.dynamic_index_in_dim(x[:, 0], k, 0, keepdims=False)
        return found

    x = ordinary(4, 3)
    assert_agree(run, at, x, x > 0.0, shared=(at[[1, 7, 9, 14]],), knowns=((), (0,)), width=width, counts=(3, COUNT))


@pytest.mark.parametrize("kind, width", [("64 bits", 2), ("64 bits", 4), ("32 bits", 8)])
def test_dynamic_updates(kind, width):
    at = INDICES[kind]

    def run(shared, n, x, y, b):
        found = {}
        for name, k in [("lane", n[0]), *((f"shared {m}", shared[m]) for m in range(len(shared)))]:
            zero = jnp.zeros_like(k)
            found[f"one {name}"] = lax.dynamic_update_slice(x, y[:1], (k, zero, zero))
            found[f"some {name}"] = lax.dynamic_update_slice(x, y[:, :2], (zero, k, zero))
            found[f"all {name}"] = lax.dynamic_update_slice(x, y, (k, k, k))
            found[f"both {name}"] = lax.dynamic_update_slice(x, y[:2, :1], (k, n[0], zero))
            found[f"none {name}"] = lax.dynamic_update_slice(x, y[:0], (k, k, zero))
            found[f"truth {name}"] = lax.dynamic_update_slice(b, b[2:], (k, zero, zero))
            found[f"then read {name}"] = lax.dynamic_slice(found[f"one {name}"], (k, zero, zero), (2, 3, 1))
        return found

    x = ordinary(4, 3)
    given = (at, x, ordinary(4, 3, seed=1), x > 0.0)
    assert_agree(run, *given, shared=(at[[1, 7, 9, 14]],), knowns=((), (0,)), width=width, counts=(3, COUNT))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", INDICES)
def test_elements_at_indices(kind, mode):
    at, jnp_mode = INDICES[kind], mode

    def run(shared, n, x, w, b):
        found = {}
        for name, k in (("lane", n), ("shared", shared), ("sums", n[0] + shared[:2])):
            for array, values in (("doubles", x), ("whole", w), ("short", w.astype(jnp.int32)), ("truth", b)):
                taken = values.at[k].get(mode=jnp_mode)
                found[f"{array} {name}"] = taken
                found[f"{array} {name} second"] = values.at[:, k].get(mode=jnp_mode)
            found[f"filled {name}"] = x.at[k].get(mode=jnp_mode, fill_value=7.5)
            found[f"one {name}"] = x.at[k[0]].get(mode=jnp_mode)
            found[f"pairs {name}"] = x.at[k, jnp.ones_like(k)].get(mode=jnp_mode)
            found[f"constants {name}"] = jnp.arange(5.0).at[k[:1]].get(mode=jnp_mode)
        return found

    x = ordinary(4, 3)
    shared = (at[[1, 7, 9, 14]],)
    assert_agree(run, at.reshape(1, -1), x, whole(4, 3), x > 0.0, shared=shared, knowns=((), (0,)), counts=(3, COUNT))


@pytest.mark.parametrize("mode", [*MODES.values(), GatherScatterMode.PROMISE_IN_BOUNDS])
def test_windows_at_indices(mode):
    promise = mode == GatherScatterMode.PROMISE_IN_BOUNDS
    at = np.clip(BEYOND, 0, 2) if promise else BEYOND

    def run(shared, n, x):
        found = {}
        dimensions = {
            "rows": (lax.GatherDimensionNumbers((1, 2, 3), (), (0,)), (2, 3, 1)),
            "columns": (lax.GatherDimensionNumbers((0, 2, 3), (), (1,)), (4, 1, 1)),
            "collapsed": (lax.GatherDimensionNumbers((1, 2), (0,), (0,)), (1, 3, 1)),
        }
        for name, (numbers, sizes) in dimensions.items():
            found[f"{name} lane"] = lax.gather(x, n[:, None], numbers, sizes, mode=mode)
            found[f"{name} shared"] = lax.gather(x, shared[:, None], numbers, sizes, mode=mode)
        return found

    shared = (at[[1, 2, 3, 7]],)
    assert_agree(run, at.reshape(1, -1), ordinary(4, 3), shared=shared, knowns=((), (0,)))


def test_batches_of_indices():
    def run(n, x):
        constant = jnp.array([[0, -1, 5]])[..., None]
        return jnp.take_along_axis(x, n, axis=0), jnp.take_along_axis(x, constant, axis=0)

    assert_agree(run, whole(2, 3, low=-4, high=4), ordinary(4, 3))


def test_elements_of_many_at_an_index():
    x = ordinary(100)
    assert_agree(lambda k, x: x[k[0]], x, shared=(np.array([99]),))
    assert_agree(lambda n, x: (x[n[0]], (x > 0.0)[n[0]], x.at[n].get(mode="fill")), 20 * BEYOND, x)


def test_elements_at_two_indices_that_are_not_known_want_memory():
    with pytest.raises(UnsupportedOperationError, match="more than one"):
        compiled(lambda n, x: x.at[n, n].get(mode="clip"), (BEYOND, ordinary(3, 3)))


@pytest.mark.parametrize("mode", MODES)
def test_changes_at_known_indices(mode):
    def run(shared, x, y, w):
        found, k = {}, np.array([2, 0, 2, -1, 9, 2])
        for name, array, new in (("doubles", x, y), ("whole", w, w * 2), ("truth", x > 0.0, y > 0.0)):
            new = jnp.concatenate([new, new])[:6]
            found[f"set {name}"] = array.at[k].set(new, mode=mode)
            if name != "truth":
                found[f"add {name}"] = array.at[k].add(new, mode=mode)
            found[f"a column of {name}"] = array.at[:, 1].set(new[:4, 0], mode=mode)
            found[f"pairs of {name}"] = array.at[k, np.array([0, 1, 2, 0, 0, 7])].set(new[:, 0], mode=mode)
            found[f"nothing of {name}"] = array.at[k[:0]].set(new[:0], mode=mode)
            found[f"of nothing of {name}"] = array[:0].at[jnp.array([], int)].set(new[:0], mode=mode)
            found[f"one number of {name}"] = array.at[1, 2, 0].set(new[0, 0, 0], mode=mode)
            found[f"a part of {name}"] = array.at[1:3].set(new[:2], mode=mode)
        found["known"] = x.at[shared].set(y[:2], mode=mode)
        found["adds what is known"] = x.at[shared].add(1.5, mode=mode)
        return found

    x, y = ordinary(4, 3), ordinary(4, 3, seed=1)
    for shared in ([1, 3], [1, 1], [-1, 7]):
        assert_agree(run, x, y, whole(4, 3), shared=(np.array(shared),), knowns=((), (0,)))


@pytest.mark.parametrize("mode", [*MODES.values(), GatherScatterMode.PROMISE_IN_BOUNDS])
def test_windows_of_batches(mode):
    """Each of three tables has four windows of its own, of one row and of two, with their axes among the others.

    No two have a row in common: which of them is put there last is not told.
    """
    ends = (0, 7) if mode == GatherScatterMode.PROMISE_IN_BOUNDS else (-3, 12)
    at = np.random.default_rng(7).permuted([[ends[0], 2, 4, ends[1]]] * 3, axis=1)[..., None]
    kinds = {"lines": ((2,), (1,), (1,), (0,), (0,)), "parts": ((1, 3), (), (1,), (0,), (0,))}
    sizes = {"lines": (1, 1, 3), "parts": (1, 2, 3)}

    def run(shared, x, lines, parts):
        found, x = {}, x[..., 0]
        for name, new in (("lines", lines[..., 0]), ("parts", parts[..., 0])):
            numbers = kinds[name]
            found[name] = lax.gather(x, shared, lax.GatherDimensionNumbers(*numbers), sizes[name], mode=mode)
            found[f"put {name}"] = lax.scatter(x, shared, new, lax.ScatterDimensionNumbers(*numbers), mode=mode)
            found[f"added {name}"] = lax.scatter_add(x, shared, new, lax.ScatterDimensionNumbers(*numbers), mode=mode)
        return [part[..., None] for part in found.values()]

    given = ordinary(3, 9, 3), ordinary(3, 4, 3, seed=1), ordinary(3, 2, 4, 3, seed=2)
    assert_agree(run, *given, shared=(at,), knowns=((), (0,)))
