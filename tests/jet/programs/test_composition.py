"""Composition of jets with JAX functions: against mpmath, or against the same function written on jets."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from jounce import jet
from jounce.jet.programs import composition
from jounce.jet.programs.operations import COMPOSED, REARRANGING
from tests.oracles.mp_taylor import DIGITS, composed, worst

pytestmark = pytest.mark.long

AT = 0.7
X, Y = jnp.array([0.0, 1.0, 3.0]), jnp.array([0.0, 2.0, -1.0])
M = jnp.array([[1.0, 2.0], [3.0, 4.0]])


@jax.custom_jvp
def own_derivative(t):
    return jnp.sin(t)


own_derivative.defjvp(lambda p, d: (jnp.sin(p[0]), jnp.cos(p[0]) * d[0]))


@jax.custom_vjp
def own_reverse(t):
    return jnp.sin(t)


own_reverse.defvjp(lambda t: (jnp.sin(t), t), lambda t, g: (jnp.cos(t) * g,))

SMOOTH = {
    "elementary": (
        lambda t: jnp.exp(-t) * jnp.sin(3 * t) + jnp.cosh(t) / jnp.sqrt(t),
        lambda t: mp.exp(-t) * mp.sin(3 * t) + mp.cosh(t) / mp.sqrt(t),
    ),
    "inverse_functions": (
        lambda t: jnp.arcsin(t) + jnp.arccos(t / 2) * jnp.arctan(t),
        lambda t: mp.asin(t) + mp.acos(t / 2) * mp.atan(t),
    ),
    "atan2": (lambda t: jnp.arctan2(jnp.sin(t), 1 + t * t), lambda t: mp.atan2(mp.sin(t), 1 + t * t)),
    "powers": (
        lambda t: t**3 + t**-2 + t**2.5 + 2.0**t + t**t,
        lambda t: t**3 + t**-2 + t ** mp.mpf(2.5) + mp.mpf(2) ** t + t**t,
    ),
    "hypot": (lambda t: jnp.hypot(t, 2.0), lambda t: mp.sqrt(t * t + 4)),
    "dot": (
        lambda t: jnp.dot(jnp.array([1.0, 2.0, 3.0]), jnp.stack([t, t**2, jnp.sin(t)])),
        lambda t: t + 2 * t**2 + 3 * mp.sin(t),
    ),
    "matrix": (
        lambda t: (M @ jnp.stack([t, jnp.cos(t)])) @ jnp.stack([t, t * t]),
        lambda t: (t + 2 * mp.cos(t)) * t + (3 * t + 4 * mp.cos(t)) * t * t,
    ),
    "jitted_inside": (lambda t: jax.jit(lambda u: jnp.exp(u) * u)(t), lambda t: mp.exp(t) * t),
    "vmapped_inside": (
        lambda t: jnp.sum(jax.vmap(lambda a: jnp.sin(a * t))(jnp.array([1.0, 2.0]))),
        lambda t: mp.sin(t) + mp.sin(2 * t),
    ),
    "gradient_inside": (jax.grad(lambda t: jnp.sin(t) ** 2), lambda t: mp.sin(2 * t)),
    "custom_jvp": (own_derivative, mp.sin),
    "custom_vjp": (own_reverse, mp.sin),
    "silu": (jax.nn.silu, lambda t: t / (1 + mp.exp(-t))),
    "sigmoid": (jax.nn.sigmoid, lambda t: 1 / (1 + mp.exp(-t))),
    "softplus": (jax.nn.softplus, lambda t: mp.log(1 + mp.exp(t))),
    "gelu": (jax.nn.gelu, lambda t: t / 2 * (1 + mp.tanh(mp.sqrt(2 / mp.pi) * (t + mp.mpf(0.044715) * t**3)))),
    "erf": (jax.scipy.special.erf, mp.erf),
    "expm1_log1p": (lambda t: jnp.expm1(t) * jnp.log1p(t), lambda t: mp.expm1(t) * mp.log(1 + t)),
    "tangent": (lambda t: jnp.tan(t) + jnp.sinh(t) * jnp.log(t), lambda t: mp.tan(t) + mp.sinh(t) * mp.log(t)),
    "inverse_hyperbolic": (
        lambda t: jnp.arcsinh(t) + jnp.arccosh(1 + t) * jnp.arctanh(t / 2),
        lambda t: mp.asinh(t) + mp.acosh(1 + t) * mp.atanh(t / 2),
    ),
    "roots": (lambda t: jnp.cbrt(t) * t + jax.lax.rsqrt(t), lambda t: mp.cbrt(t) * t + 1 / mp.sqrt(t)),
    "exp2_erfc": (lambda t: jnp.exp2(t) * jax.lax.erfc(t), lambda t: mp.mpf(2) ** t * mp.erfc(t)),
    "gradient_of_a_product": (jax.grad(lambda t: t * jnp.sin(t)), lambda t: mp.sin(t) + t * mp.cos(t)),
    "beside_constants": (
        lambda t: jnp.pad(jnp.stack([t * t, 2.0]), 1, constant_values=3.0) @ jnp.array([1.0, 2.0, 5.0, 7.0]),
        lambda t: 2 * t * t + 34,
    ),
    "moved": (
        lambda t: jnp.sum(jnp.stack([t, t * t, t**3, jnp.sin(t)]).reshape(2, 2).T[:, ::-1] * M),  # [[t3, t], [s, t2]]
        lambda t: t**3 + 2 * t + 3 * mp.sin(t) + 4 * t * t,
    ),
    "gathered": (
        lambda t: jnp.sum(jnp.stack([t, t * t, jnp.sin(t)])[jnp.array([2, 0, 2])] * jnp.array([1.0, 2.0, 4.0])),
        lambda t: 5 * mp.sin(t) + 2 * t,
    ),
    "polyval": (lambda t: jnp.polyval(jnp.array([1.0, -2.0, 3.0]), t), lambda t: t**2 - 2 * t + 3),
    "scan": (
        lambda t: jax.lax.scan(lambda c, x: (c * t + x, None), jnp.zeros_like(t), jnp.array([1.0, 2.0, 3.0]))[0],
        lambda t: t * t + 2 * t + 3,
    ),
    "fori_loop": (lambda t: jax.lax.fori_loop(0, 3, lambda _, c: jnp.sin(c), t), lambda t: mp.sin(mp.sin(mp.sin(t)))),
    "cond": (lambda t: jax.lax.cond(t < 1, jnp.sin, jnp.cos, t), mp.sin),
    "switch": (lambda t: jax.lax.switch(1, [jnp.sin, jnp.cos], t), mp.cos),
    "product": (lambda t: jnp.prod(jnp.stack([t, t * t, jnp.sin(t)])), lambda t: t**3 * mp.sin(t)),
    "sums": (
        lambda t: jnp.cumsum(jnp.stack([t, t * t, jnp.sin(t)]))[2] + jnp.mean(jnp.stack([t, t * t])),
        lambda t: t + t * t + mp.sin(t) + (t + t * t) / 2,
    ),
    "updated_array": (lambda t: jnp.sum(jnp.zeros(3).at[1].set(t * t) * jnp.arange(3.0)), lambda t: t * t),
    "smooth_step": (lambda t: jnp.where(t > 0, jnp.exp(-1 / jnp.where(t > 0, t, 1.0)), 0.0), lambda t: mp.exp(-1 / t)),
}
PIECEWISE = {
    "where": (lambda t: jnp.where(t < 1, t**3, jnp.exp(-t)), lambda t: t**3),
    "select": (lambda t: jnp.select([t < 0.5, t < 1], [t, t * t], t**3), lambda t: t * t),
    "piecewise": (lambda t: jnp.piecewise(t, [t < 0.5, t >= 0.5], [lambda t: t**2, jnp.sin]), mp.sin),
    "interp": (lambda t: jnp.interp(t, X, Y), lambda t: 2 * t),
    "relu6": (jax.nn.relu6, lambda t: t),
    "mod": (lambda t: jnp.mod(t, 0.3) ** 2, lambda t: (t - 2 * mp.mpf(0.3)) ** 2),
    "mod_of_negative": (lambda t: jnp.mod(-t, 0.3) ** 2, lambda t: (-t + 3 * mp.mpf(0.3)) ** 2),
    "fmod": (lambda t: jnp.fmod(-t, 0.3) ** 2, lambda t: (-t + 2 * mp.mpf(0.3)) ** 2),
    "clip": (lambda t: jnp.clip(t, 0.0, 1.0) * jnp.clip(t, 0.8, 1.0), lambda t: t * mp.mpf(0.8)),
    "abs": (lambda t: jnp.abs(t - 2) ** 3, lambda t: (2 - t) ** 3),
    "max_and_min": (lambda t: jnp.maximum(t, t * t) * jnp.minimum(jnp.sin(t), 0.5), lambda t: t * mp.mpf(0.5)),
    "rounding": (lambda t: t * jnp.floor(3 * t) + jnp.sign(t) * jnp.ceil(t) * jnp.round(t), lambda t: 2 * t + 1),
    "logic": (
        lambda t: jnp.where((jnp.isfinite(t) & ~(t > 1)) ^ (t > 5), t**2, t) * jax.lax.stop_gradient(jnp.ceil(t)),
        lambda t: t**2,
    ),
    "largest": (lambda t: jnp.max(jnp.stack([t, t * t])) * t, lambda t: t * t),
}


def derivatives(function, t, order):
    """Coefficients of the composition, under one jit (the rules run eagerly would compile one by one)."""
    result = jax.jit(lambda t: jn.jet.compose(function, jn.Jet.variable(t, order)).derivatives())(jnp.asarray(t))
    factorials = np.cumprod([1.0, *range(1, order + 1)])
    return np.array(result) / factorials


@pytest.mark.parametrize("name", [*SMOOTH, *PIECEWISE])
def test_composition_against_mpmath(name):
    function, reference = (SMOOTH | PIECEWISE)[name]
    order = 5
    with mp.workdps(DIGITS):
        values, scale = composed(reference, [AT, 1.0, *[0.0] * (order - 1)])
        scale = [max(scale[max(k - 1, 0) : k + 2]) or 1 for k in range(order + 1)]
        assert worst(derivatives(function, AT, order), values, scale) < 1e-14


def test_every_rule_is_tried():
    tried = set()
    for function, _ in (SMOOTH | PIECEWISE).values():
        tried.update(composition._operations(jax.make_jaxpr(function)(AT).jaxpr))
    tables = REARRANGING, COMPOSED, composition._BILINEAR, composition._WITHOUT_RATES
    assert set(composition._RULES).union(*tables) <= tried


def slider(t):
    """A typical law of a user: a dwell, a rise by a polynomial, a harmonic, all in one function."""
    s = jnp.clip(t / 2, 0.0, 1.0)
    rise = s**3 * (10 - 15 * s + 6 * s * s)
    return jnp.where(t < 0.2, 0.1, 0.1 + 0.3 * rise) + 0.01 * jnp.sin(2 * jnp.pi * t)


def test_high_order_of_a_law_with_rules_is_as_exact_as_jets_written_directly():
    t = jn.Jet.variable(jnp.asarray(AT), 12)
    s = t / 2
    expected = 0.1 + 0.3 * (s**3 * (10 - 15 * s + 6 * s * s)) + 0.01 * jet.sin(2 * np.pi * t)
    np.testing.assert_allclose(
        derivatives(slider, AT, 12) * np.cumprod([1.0, *range(1, 13)]), expected.derivatives(), rtol=1e-12, atol=1e-12
    )


def test_argument_is_any_jet_of_any_batch():
    x = jn.Jet([jnp.array([[0.1, 0.2, 0.3]]), jnp.full((1, 3), 2.0), None, jnp.ones((1, 3))])
    result = jn.jet.compose(lambda t: jnp.exp(jnp.sin(t)), x)
    assert result.shape == (1, 3)
    np.testing.assert_allclose(result.derivatives(), jet.exp(jet.sin(x)).derivatives(), rtol=1e-13)


def test_every_instant_takes_its_own_branch():
    t = jn.Jet.variable(jnp.array([0.5, 1.5]), 2)
    result = jn.jet.compose(lambda t: jnp.where(t < 1, t**2, 3 * t), t)
    np.testing.assert_allclose(result.derivatives(), [[0.25, 4.5], [1.0, 3.0], [2.0, 0.0]])


@pytest.mark.parametrize("function", [lambda t: 3.0, lambda t: 3, lambda t: jnp.asarray(3.0)])
def test_constant_law(function):
    np.testing.assert_array_equal(
        jn.jet.compose(function, jn.Jet.variable(jnp.zeros(2), 2)).derivatives(), [[3, 3], [0, 0], [0, 0]]
    )


def test_order_zero_is_the_function():
    assert float(jn.jet.compose(slider, jn.Jet.variable(AT, 0)).coefficients[0]) == pytest.approx(
        float(slider(AT)), rel=1e-15
    )


@pytest.mark.parametrize(
    "function", [lambda t: jnp.sin(t.astype("f4")), jax.jit(lambda t: jnp.cos(2 * t).astype("f4"))]
)
def test_a_law_in_single_precision_is_told_of_once(function):
    time = jn.Jet.variable(0.3, 1)
    with pytest.warns(jn.errors.PrecisionWarning, match="computes in float32: results have 6 digits"):
        first = jet.compose(function, time)
    second = jet.compose(function, time)  # warnings are errors here
    assert [float(x) for x in second.coefficients] == [float(x) for x in first.coefficients]


@pytest.mark.parametrize(
    "function", [lambda t: jnp.stack([t, t]), lambda t: (t, t), lambda t: None], ids=["vector", "tuple", "none"]
)
def test_law_that_does_not_return_one_scalar(function):
    with pytest.raises(TypeError, match="one scalar"):
        jn.jet.compose(function, jn.Jet.variable(0.5, 2))


def test_jit_vmap_and_grad_through_composition():
    def third(t):
        return jn.jet.compose(slider, jn.Jet.variable(t, 3)).derivatives()[3]

    instants = jnp.array([0.5, 0.7])
    mapped = jax.vmap(third)(instants)
    np.testing.assert_allclose(
        mapped, jn.jet.compose(slider, jn.Jet.variable(instants, 3)).derivatives()[3], rtol=1e-13
    )
    fourth = jn.jet.compose(slider, jn.Jet.variable(AT, 4)).derivatives()[4]
    assert float(jax.jit(jax.grad(third))(AT)) == pytest.approx(float(fourth), rel=1e-11)


LAWS_AT_ORDER_10 = ["interp", "polyval", "softplus", "erf", "cond", "fori_loop", "scan", "matrix"]


@pytest.mark.parametrize("name", LAWS_AT_ORDER_10)
def test_program_does_not_double_with_each_order(name):
    """What a law compiles to grows like a power of the order, so that order 10 is as practical as order 4."""
    function, _ = (SMOOTH | PIECEWISE)[name]

    def size(order):
        program = jax.make_jaxpr(lambda t: jn.jet.compose(function, jn.Jet.variable(t, order)).derivatives())
        return len(str(program(jnp.asarray(AT))))

    assert size(6) < 3.5 * size(3)
