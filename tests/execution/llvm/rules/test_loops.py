"""Operations on arrays that stay in memory as loops: sizes around that of a vector, kinds, axes and indices."""

from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from jax.lax import GatherDimensionNumbers, GatherScatterMode, ScatterDimensionNumbers

from tests.execution.llvm import lanes
from tests.execution.llvm.lanes import FEW, ordinary, whole

pytestmark = pytest.mark.long

assert_agree = partial(lanes.assert_agree, larges=(FEW,))
KINDS = [np.float64, np.int64, np.int32, bool]


def of_kind(x, kind):
    return x > 0.0 if kind is bool else (x * 10.0).astype(kind)


@pytest.mark.parametrize("size", [4, 8, 9, 16, 23])
def test_numbers_one_after_another(size):
    paddings = [(-2, 1, 1), (2, -3, 2), (-3, -1, 2), (0, 0, 0), (-1, 4, 0)]

    def run(x):
        found = []
        for kind in KINDS:
            y = of_kind(x, kind)
            found += [jnp.where(x > 0.3, y, y[::-1]), y == y[::-1], *(y.astype(other) for other in KINDS)]
            found += [lax.pad(y, jnp.asarray(1, kind), (padding, (0, 0, 0))) for padding in paddings]
            found += [y[::2], y[1::3], y[::-2], jnp.concatenate([y, y[::-1], y[:1]]), jnp.stack([y, y[::-1]], 1)]
            found += [jnp.broadcast_to(y[0], (size, 1)), jnp.tile(y, (3, 1)), y[::-1].reshape(-1, 1, 1)]
        return found

    assert_agree(run, ordinary(size))


@pytest.mark.parametrize("shape", [(3, 8), pytest.param((9, 2), marks=pytest.mark.slow), (1, 17)])
def test_reductions(shape):
    def run(x):
        found = []
        for kind in KINDS:
            y = of_kind(x, kind)
            for z in (y, y.transpose(1, 0, 2), y[:, ::-1], y[::2], jnp.broadcast_to(y[:1], y.shape)):
                for axes in ((0,), (1,), (0, 1)):
                    found += [z.max(axes), z.any(axes), z.all(axes)]
                    if kind in (np.int64, np.int32):
                        found += [z.sum(axes), z.prod(axes)]
        return found

    assert_agree(run, ordinary(*shape))


@pytest.mark.parametrize("size", [1, 8, 17])
def test_products_of_matrices(size):
    def run(x):
        a = x.astype(float)[..., 0]
        found = [a @ a.T, a.T @ a, a @ a[0], a.T @ a[:, 0], jnp.outer(a[0], a[:, 1])]
        found += [jnp.einsum(f"ij,{other}", a, a[::-1]) for other in ("ij->i", "ij->j", "kj->ikj", "ik->jk")]
        return [product[..., None] for product in found]

    assert_agree(run, whole(size, 5), signs=False)


def test_arrays_of_nothing():
    def run(x):
        y, nothing = x * 2.0, x[:0] * 2.0
        return [
            lax.tile(y, (0, 1)),
            nothing.reshape(0, 3, 1),
            jnp.zeros(0).at[jnp.arange(5)].add(jnp.arange(5.0), mode="drop")[:, None],
            jnp.concatenate([nothing, y, nothing]),
            jnp.zeros((6, 0)) @ jnp.zeros((0, 1)),
            jnp.broadcast_to(nothing.sum(0), (7, 1)),
            lax.pad(nothing, jnp.float64(0.5), ((3, 4, 0), (0, 0, 0))),
            lax.dynamic_update_slice(y, nothing, (3, 0)),
        ]

    assert_agree(run, ordinary(5))


@pytest.mark.parametrize(
    "mode", [GatherScatterMode.CLIP, GatherScatterMode.FILL_OR_DROP, GatherScatterMode.PROMISE_IN_BOUNDS]
)
@pytest.mark.parametrize("kind", KINDS)
def test_indices(kind, mode):
    promise = mode == GatherScatterMode.PROMISE_IN_BOUNDS

    def run(shared, x, lane):
        y, found = of_kind(x, kind), []
        changes = [lax.scatter] if kind is bool else [lax.scatter, lax.scatter_add]
        for n in (lane[..., 0], shared.astype(np.int32)):
            for indices, numbers, sizes in (
                (n[:, 0, :1], ((1, 2), (0,), (0,)), (1, 6, 1)),
                (n[:, 0], ((1, 2), (0,), (0, 1)), (1, 3, 1)),
                (n[:, 0], ((1, 2, 3), (), (1, 0)), (2, 3, 1)),
                (n[..., :1], ((2, 3), (1,), (1,)), (3, 1, 1)),
            ):
                found.append(lax.gather(y, indices, GatherDimensionNumbers(*numbers), sizes, mode=mode))
                if indices.ndim == 2:
                    part = jnp.stack([y[k : k + sizes[0], : sizes[1]] for k in range(3)])
                    part = part if sizes[0] > 1 else part[:, 0]
                    found += [
                        change(array, indices, part, ScatterDimensionNumbers(*numbers), mode=mode)
                        for change in changes
                        for array in (y, y == y[::-1] if kind is bool else y * y)
                    ]
            batches = (1,), (1,), (0,), (0,)
            rows = GatherDimensionNumbers((2,), *batches)
            found.append(lax.gather(y[:3], n[..., :1], rows, (1, 1, 1), mode=mode))
            numbers = ScatterDimensionNumbers((2,), *batches)
            found += [change(y[:3], n[..., :1], y[2:5, :2], numbers, mode=mode) for change in changes]
        return found

    low, high = (0, 3) if promise else (-3, 9)
    shared = np.random.default_rng(5).integers(low, high, (3, 2, 2))
    assert_agree(run, ordinary(5, 6), whole(3, 2, 2, low=low, high=high), shared=(shared,))


def test_arrays_too_large_for_the_stack():
    def run(n, m, x):
        found = []
        for kind in KINDS:
            y = jnp.concatenate([of_kind(x, kind)] * 40)
            y = jnp.where(y == y[::-1], y, y[::-1])
            found += [y[n[0]][None], y.at[n].set(y[m[:, 0]][:1]), lax.dynamic_slice(y, (n[0], 0), (5, 1))]
            found += [lax.dynamic_update_slice(y, y[7:19], (n[0], 0)), y.at[m].get(mode="fill")[:, 0]]
            found.append(y.reshape(40, 17, 1).transpose(1, 0, 2).any(axis=0))
        return found

    assert_agree(run, whole(low=-5, high=700), whole(11, low=-800, high=800), ordinary(17))
