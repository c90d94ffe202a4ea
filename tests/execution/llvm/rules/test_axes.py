"""Sums, extremes and products along axes as machine code, against JAX."""

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from tests.execution.llvm.lanes import COUNT, SPECIAL, WHOLE, assert_agree, ordinary, whole

pytestmark = pytest.mark.long

ARRAYS = {
    "doubles": lambda: ordinary(2, 3, 4),
    "whole numbers": lambda: whole(2, 3, 4),
    "whole numbers of 32 bits": lambda: whole(2, 3, 4, dtype=np.int32),
    "truth values": lambda: ordinary(2, 3, 4) > 0.5,
}
REDUCTIONS = {"sum": lax.reduce_sum, "product": lax.reduce_prod, "max": lax.reduce_max, "min": lax.reduce_min}
CUMULATIVE = {"sum": lax.cumsum, "product": lax.cumprod, "max": lax.cummax, "min": lax.cummin}


def reductions(dtype):
    if dtype.kind == "b":
        return {"max": lax.reduce_max, "min": lax.reduce_min, "all": lax.reduce_and, "any": lax.reduce_or}
    return REDUCTIONS if dtype.kind == "f" else REDUCTIONS | {"and": lax.reduce_and, "or": lax.reduce_or}


@pytest.mark.parametrize("name", ARRAYS)
def test_reductions(name):
    array = ARRAYS[name]()

    def run(x):
        found = {}
        for name, reduce in reductions(array.dtype).items():
            found |= {
                f"{name} along {axes}": reduce(x, axes) for axes in ((0,), (1,), (2, 0), (0, 1, 2), (), (1, -2 % 4))
            }
            found[f"{name} of nothing"] = reduce(x[:, :0], (1,))
            found[f"{name} for no one"] = reduce(x[:0], (1,))
        return found

    assert_agree(run, array, rtol=1e-12)
    with_one = lambda x: [reduce(x[..., 0], (0, 1, 2))[None] for reduce in reductions(array.dtype).values()]  # noqa: E731
    assert_agree(with_one, array, rtol=1e-12)


def test_reductions_of_special_numbers():
    x = np.stack([np.roll(SPECIAL, k) for k in range(3)])
    functions = REDUCTIONS | {name: lambda x, axes, f=f: f(x, axes[0]) for name, f in CUMULATIVE.items()}
    functions |= {"argmax": lambda x, axes: jnp.argmax(x, 0), "argmin": lambda x, axes: jnp.argmin(x, 0)}
    assert_agree(lambda x: {name: f(x, (0,)) for name, f in functions.items()}, x, signs=False)


@pytest.mark.parametrize("name", ARRAYS)
@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_places_of_extremes(name, dtype):
    x = np.round(ARRAYS[name]() * 1) if name == "doubles" else ARRAYS[name]()

    def run(shared, x):
        both = shared | x if x.dtype == bool else shared + jnp.zeros_like(x)
        return [(lax.argmax(y, axis, dtype), lax.argmin(y, axis, dtype)) for y in (x, both) for axis in range(3)]

    assert_agree(run, x, shared=(x[..., :1],), knowns=((), (0,)))


def test_the_first_extreme_that_is_not_a_number():
    x = np.random.default_rng(0).choice([np.nan, 1.0, 2.0, np.inf, -np.inf], (5, COUNT))
    assert_agree(lambda x: (jnp.argmax(x, 0), jnp.argmin(x, 0), jnp.nanmax(x, 0), jnp.max(x, 0)), x)


@pytest.mark.parametrize("name", ["doubles", "whole numbers", "whole numbers of 32 bits"])
def test_cumulative_operations(name):
    array = ARRAYS[name]()

    def run(x):
        found = {}
        for name, function in CUMULATIVE.items():
            found |= {f"{name} {axis} {back}": function(x, axis, back) for axis in range(3) for back in (False, True)}
            found[f"{name} of nothing"] = function(x[:, :0], 1)
            found[f"{name} of a list"] = function(x[0, :, 0, 0], 0)[:1]
        return found

    assert_agree(run, array, rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.float64, np.int64, np.int32])
def test_products_of_matrices(dtype):
    def run(shared, a, b):
        found = {
            "batch": lax.dot_general(a, b, (((2,), (1,)), ((0,), (0,)))),
            "batches": lax.dot_general(a, b.transpose(2, 0, 1, 3), (((3,), (3,)), ((0, 2), (1, 2)))),
            "two axes": lax.dot_general(a, b, (((0, 2), (0, 1)), ((3,), (3,)))),
            "none": lax.dot_general(a[0, 0], b[0, 0], (((), ()), ((1,), (1,)))),
            "of nothing": lax.dot_general(a[:, :, :0], b[:, :0], (((2,), (1,)), ((0, 3), (0, 3)))),
            "for no one": lax.dot_general(a[:, :0], b, (((2,), (1,)), ((0, 3), (0, 3)))),
            "shared": lax.dot_general(shared, a, (((1,), (2,)), ((), ()))),
            "a number": lax.dot_general(a[0, 0, :, 0], b[0, :, 0, 0], (((0,), (0,)), ((), ()))),
            "einsum": jnp.einsum("ijkt,iklt->iljt", a, b),
        }
        return {k: x.ravel()[:, None] for k, x in found.items()}

    numbers = ordinary if dtype is np.float64 else lambda *shape, seed: whole(*shape, seed=seed, dtype=dtype)
    shared = numbers(2, 4, seed=2)[..., 0]
    assert_agree(
        run, numbers(2, 3, 4, seed=0), numbers(2, 4, 4, seed=1), shared=(shared,), knowns=((), (0,)), rtol=1e-12
    )


def test_products_of_another_type():
    def run(a, b):
        longer = lax.dot_general(a, b, (((0,), (0,)), ((1,), (1,))), preferred_element_type=jnp.int64)
        return longer, lax.dot_general(a, b, (((0,), (0,)), ((1,), (1,))), preferred_element_type=jnp.float64)

    assert_agree(run, whole(3, dtype=np.int32) * 10**8, whole(3, seed=1, dtype=np.int32) * 10**8)


@pytest.mark.parametrize("axis", [0, 1])
def test_sorting(axis):
    special = np.stack([np.roll(SPECIAL, k) for k in range(12)]).reshape(3, 4, COUNT)
    for numbers in (special, np.stack([np.roll(WHOLE, k) for k in range(12)]).reshape(3, 4, COUNT)):
        assert_agree(lambda x: jnp.sort(x, axis=axis), numbers, signs=False)


def test_sorting_by_another_array():
    assert_agree(lambda x: jnp.argsort(x, axis=0), ordinary(7))
    assert_agree(lambda x, y: lax.sort((x, y), dimension=0, num_keys=1), whole(9, high=-4), ordinary(9))
