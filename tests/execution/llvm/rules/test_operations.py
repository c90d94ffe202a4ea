"""Operations of each element as machine code, against JAX, for numbers of all kinds and special ones."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from tests.execution.llvm.lanes import COUNT, LONG, SPECIAL, TRUTH, WHOLE, assert_agree, ordinary, whole

pytestmark = pytest.mark.long

WIDTHS = (2, 4, 8)
COUNTS = (1, 3, 8, COUNT)
UNARY = {
    "sin": lax.sin, "cos": lax.cos, "tan": lax.tan, "asin": lax.asin, "acos": lax.acos, "atan": lax.atan,
    "sinh": lax.sinh, "cosh": lax.cosh, "tanh": lax.tanh, "asinh": lax.asinh, "acosh": lax.acosh, "atanh": lax.atanh,
    "exp": lax.exp, "exp2": lax.exp2, "expm1": lax.expm1, "log": lax.log, "log1p": lax.log1p, "cbrt": lax.cbrt,
    "erf": lax.erf, "erfc": lax.erfc, "sqrt": lax.sqrt, "rsqrt": lax.rsqrt, "logistic": lax.logistic,
}  # fmt: skip
EXACT = {
    "neg": lax.neg, "abs": lax.abs, "sign": lax.sign, "square": lax.square, "floor": lax.floor, "ceil": lax.ceil,
    "away": lambda x: lax.round(x, lax.RoundingMethod.AWAY_FROM_ZERO),
    "even": lambda x: lax.round(x, lax.RoundingMethod.TO_NEAREST_EVEN),
    "finite": lax.is_finite, "nan": jnp.isnan, "copy": lambda x: lax.optimization_barrier(jnp.array(x, copy=True)),
    **{f"power {n}": (lambda x, n=n: lax.integer_pow(x, n)) for n in (-3, -2, -1, 0, 1, 2, 3, 5, 8)},
}  # fmt: skip
PAIRS = {
    "add": lax.add, "sub": lax.sub, "mul": lax.mul, "div": lax.div, "rem": lax.rem, "max": lax.max, "min": lax.min,
    "eq": lax.eq, "ne": lax.ne, "lt": lax.lt, "le": lax.le, "gt": lax.gt, "ge": lax.ge,
}  # fmt: skip
OF_TRUTH_VALUES = ("max", "min", "eq", "ne", "lt", "le", "gt", "ge")
LOGIC = {"and": lax.bitwise_and, "or": lax.bitwise_or, "xor": lax.bitwise_xor}


def paired(values):
    """Return each value with each other, along the lanes."""
    return tuple(np.array(part, values.dtype) for part in zip(*itertools.product(values, values), strict=True))


def table(functions):
    return lambda *x: {name: function(*x) for name, function in functions.items()}


@pytest.mark.parametrize("width", WIDTHS)
def test_functions_of_one_number(width):
    special = np.concatenate([SPECIAL, np.linspace(-3, 3, 31)])
    assert_agree(table(UNARY | EXACT), special, width=width, counts=(1, 3, 8, 17, 48), rtol=2e-13)


@pytest.mark.parametrize("width", WIDTHS)
def test_functions_of_two_numbers(width):
    in_total_order = {name: getattr(lax, name).bind for name in ("eq_to_p", "lt_to_p", "le_to_p")}
    functions = PAIRS | in_total_order | {"atan2": lax.atan2, "pow": lax.pow}
    assert_agree(table(functions), *paired(SPECIAL), width=width, counts=(3, 289))


@pytest.mark.parametrize("values", [WHOLE, LONG, WHOLE.astype(np.uint32)], ids=["32 bits", "64 bits", "without a sign"])
@pytest.mark.parametrize("width", WIDTHS)
def test_functions_of_whole_numbers(values, width):
    assert_agree(table(PAIRS | LOGIC), *paired(values), width=width, counts=(5, 289))
    one = {"neg": lax.neg, "abs": jnp.abs, "sign": lax.sign, "not": lax.bitwise_not, "square": lax.square}
    powers = {f"power {n}": (lambda x, n=n: lax.integer_pow(x, n)) for n in (0, 1, 2, 3, 7)}
    assert_agree(table(one | powers), values, width=width)


def test_truth_values():
    compare = {name: PAIRS[name] for name in OF_TRUTH_VALUES}
    for width in WIDTHS:
        assert_agree(table(compare | LOGIC), *paired(np.array([False, True])), width=width)
        assert_agree(lambda x: ~x, TRUTH, width=width, counts=COUNTS)


@pytest.mark.parametrize("dtype", [np.float64, np.int64, np.int32, bool])
def test_one_operand_is_the_same_in_all_lanes(dtype):
    numbers = {np.dtype(float): SPECIAL, np.dtype(np.int64): LONG, np.dtype(np.int32): WHOLE, np.dtype(bool): TRUTH}
    values = numbers[np.dtype(dtype)]
    names = OF_TRUTH_VALUES if dtype is bool else tuple(PAIRS)
    shared = tuple(values[k : k + 1] for k in range(0, COUNT, 4))

    def run(*given):
        *constants, x = given
        found = {}
        for name, (k, c) in itertools.product(names, enumerate(constants)):
            found[f"{name} of lane and shared {k}"] = PAIRS[name](x, c)
            found[f"{name} of shared {k} and lane"] = PAIRS[name](c, x)
            found[f"{name} of shared {k} and the next"] = PAIRS[name](c, constants[k - 1])
        return found

    assert_agree(run, values, shared=shared)
    # of a sum with nothing, neither XLA cares for the sign of zero
    assert_agree(run, values, shared=shared, knowns=(range(len(shared)), (0, 3)), signs=False)


def test_functions_of_constants_and_of_what_all_lanes_share():
    functions = UNARY | EXACT
    shared = (np.array([0.75]), np.array([-1.5]), np.array([np.nan]))
    assert_agree(
        lambda a, b, c, x: [table(functions)(v) for v in (a, b, c)] + [x],
        SPECIAL,
        shared=shared,
        knowns=((), (0, 1, 2)),
    )


def test_powers_of_whole_exponents():
    functions = {"pow": lax.pow, "of a constant": lambda x, n: lax.pow(jnp.full_like(x, 1.5), n)}
    assert_agree(table(functions), np.repeat(SPECIAL, 3), np.tile(np.array([-2, 0, 3], np.int32), COUNT))


def test_conversions():
    beyond = np.array([np.nan, np.inf, -np.inf, 3e9, -3e9, 1e19, -1e19, 2.0**63, -(2.0**63), 2.9, -2.9, 0.0, -0.0])
    kinds = {"f": jnp.float64, "l": jnp.int64, "i": jnp.int32, "b": jnp.bool_}

    def run(*given):
        return [{k: lax.convert_element_type(x, kind) for k, kind in kinds.items()} for x in given]

    assert_agree(run, beyond, LONG[:13], WHOLE[:13], TRUTH[:13])
    shared = (*beyond.reshape(-1, 1), LONG[12:13], LONG[13:14], WHOLE[13:14], TRUTH[:1])
    assert_agree(run, TRUTH, shared=shared, knowns=((), range(len(shared))))


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_select_by_whole_numbers(dtype):
    which = np.arange(COUNT, dtype=dtype) % 3
    cases = ordinary(3, 2, seed=3)
    assert_agree(lambda n, x: lax.select_n(jnp.stack([n, n]), *x), which, cases)
    assert_agree(lambda n, x: lax.select_n(jnp.stack([n, n]), *(x > 0.0)), which, cases)
    assert_agree(lambda n, x: lax.select_n(jnp.stack([n, n]), *(x > 0.0)), which, cases)
    assert_agree(lambda k, n, x: lax.select_n(k[0], *x[:2]), which, cases, shared=(np.array([1], dtype),))


def test_select_by_truth_values():
    a, b = ordinary(2, 2), whole(2, 2)

    def run(shared, which, a, b):
        one = {"shared": jnp.where(shared > 0.0, a[0], a[1]), "lane": jnp.where(which, a[0], a[1])}
        scalar = {"scalar": lax.select_n(shared[0] > 0.0, a[0], a[1]), "of whole": jnp.where(which, b[0], b[1])}
        single = {"of one": lax.select_n(which, jnp.array([np.nan]), shared), "both": jnp.where(which, a[0], a[0])}
        zeros = {"zeros": jnp.where(which, jnp.array([0.0]), jnp.array([-0.0]))}
        only = {"one case": lax.select_n(which, a[0, 0])}
        return one | scalar | single | zeros | only

    assert_agree(run, TRUTH, a, b, shared=(np.array([1.0]),))


def test_clamp():
    low, x, high = (ordinary(2, seed=k) for k in range(3))
    low[0, 0] = high[0, 1] = x[0, 2] = np.nan
    assert_agree(lambda a, b, c: lax.clamp(a, b, c), low, x, high)
    assert_agree(lambda a, b: lax.clamp(a[0], b, jnp.float64(0.5)), x, shared=(np.array([-0.25]),))
    assert_agree(lambda a: lax.clamp(jnp.int64(-3), a, jnp.int64(4)), whole(2))


def test_a_thing_found_twice_is_written_once():
    import jounce.execution.llvm.modules as modules

    closed = jax.make_jaxpr(lambda x: (jnp.sin(x) * x + 1.0, x * jnp.sin(x), jnp.sin(x * 1.0)))(np.ones(1))
    text = modules._text(closed, 0, {}, 8)
    run = text[text.index("@run(") :]
    assert run.count("@sine_and_cosine") == 1
    assert run.count("fmul") == 1
