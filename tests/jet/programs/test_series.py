"""Programs run on Taylor series one order at a time: every rule, against mpmath and against nested derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from jounce.execution.compilation import compiler_options
from jounce.jet import Jet, elementary
from jounce.jet.programs.operations import COMPOSED, LINEAR, PAIRS, SLOPES, STEPWISE
from jounce.jet.programs.series import Recursion
from tests.oracles import mp_taylor

ORDER = 6


def series(function, *paths):
    """Run a function along paths, arrays of Taylor coefficients, and return those of its outputs."""

    def run(paths):
        recursion = Recursion(function, [path[0] for path in paths], len(paths[0]) - 1)
        store = jax.tree.map(lambda x: jnp.zeros((len(paths[0]), *x.shape)).at[0].set(x), recursion.outputs)

        def body(k, carry):
            history, store = carry
            found, newest = recursion.advanced(history, k, [path[k] for path in paths])
            history = recursion.noted(history, k, newest)
            return history, jax.tree.map(lambda s, x: s.at[k].set(x), store, found)

        return jax.lax.fori_loop(1, len(paths[0]), body, (recursion.history, store))[1]

    compiled = jax.jit(run, compiler_options=compiler_options())
    return jax.tree.map(np.asarray, compiled([jnp.asarray(path) for path in paths]))


def nested(function, *paths):
    """Return the same coefficients by nested derivatives of the function along the paths."""

    def along(t):
        powers = jnp.cumprod(jnp.concatenate([jnp.ones(1), jnp.full(len(paths[0]) - 1, t)]))
        return function(*(jnp.tensordot(powers, jnp.asarray(path), 1) for path in paths))

    derivatives = [along]
    for _ in range(len(paths[0]) - 1):
        derivatives.append(jax.jacfwd(derivatives[-1]))
    found = jax.jit(lambda t: [f(t) for f in derivatives], compiler_options=compiler_options())(0.0)
    scaled = [jax.tree.map(lambda x, k=k: np.asarray(x) / mp.factorial(k), f) for k, f in enumerate(found)]
    return jax.tree.map(lambda *xs: np.stack([np.asarray(x, float) for x in xs]), *scaled)


def paths(*shapes, order=ORDER, seed=0):
    """Return random paths near values from 0.3 to 0.8, with coefficients that shrink with the order as in motions."""
    random = np.random.default_rng(seed)
    shrink = 0.6 ** np.arange(order + 1)
    return [
        random.uniform(-1, 1, (order + 1, *shape)) * shrink.reshape(-1, *[1] * len(shape)) * 0.25
        + 0.55 * np.eye(order + 1)[0].reshape(-1, *[1] * len(shape))
        for shape in shapes
    ]


def differences(found, expected):
    """Return the largest difference of each output, relative to its largest coefficient."""
    assert found.keys() == expected.keys()
    return {name: float(np.abs(found[name] - x).max() / np.abs(x).max()) for name, x in expected.items()}


FUNCTIONS = {
    "sin": (jnp.sin, mp.sin),
    "cos": (jnp.cos, mp.cos),
    "tan": (jnp.tan, mp.tan),
    "sinh": (jnp.sinh, mp.sinh),
    "cosh": (jnp.cosh, mp.cosh),
    "tanh": (jnp.tanh, mp.tanh),
    "asin": (jnp.arcsin, mp.asin),
    "acos": (jnp.arccos, mp.acos),
    "atan": (jnp.arctan, mp.atan),
    "asinh": (jnp.arcsinh, mp.asinh),
    "acosh": (lambda x: jnp.arccosh(x + 1), lambda x: mp.acosh(x + 1)),
    "atanh": (jnp.arctanh, mp.atanh),
    "exp": (jnp.exp, mp.exp),
    "exp2": (jnp.exp2, lambda x: mp.mpf(2) ** x),
    "expm1": (jnp.expm1, mp.expm1),
    "log": (jnp.log, mp.log),
    "log1p": (jnp.log1p, mp.log1p),
    "erf": (jax.lax.erf, mp.erf),
    "erfc": (jax.lax.erfc, mp.erfc),
    "erfc far out": (lambda x: jax.lax.erfc(x + 5), lambda x: mp.erfc(x + 5)),
    "logistic": (jax.lax.logistic, lambda x: 1 / (1 + mp.exp(-x))),
    "softplus": (jax.nn.softplus, lambda x: mp.log1p(mp.exp(x))),
    "square root": (jnp.sqrt, 0.5),
    "over the root": (jax.lax.rsqrt, -0.5),
    "cube root": (jnp.cbrt, 1 / mp.mpf(3)),
    "real power": (lambda x: x**2.5, 2.5),
    "square": (jnp.square, 2),
    "fifth power": (lambda x: x**5, 5),
    "power zero": (lambda x: jax.lax.integer_pow(x, 0), lambda x: mp.mpf(1)),
    "over the cube": (lambda x: x**-3, -3),
    "inverse": (lambda x: 1.0 / x, -1),
    "magnitude": (lambda x: jnp.abs(x - 2), lambda x: 2 - x),
    "remainder": (
        lambda x: jnp.mod(7 * x, 0.9),
        lambda x: 7 * x - mp.mpf(0.9) * mp.floor(7 * mp.mpf(0.61) / mp.mpf(0.9)),
    ),
    "gradient": (jax.grad(lambda x: x * jnp.sin(x)), lambda x: mp.sin(x) + x * mp.cos(x)),
    "composed": (lambda x: jnp.sin(x) * jnp.exp(-x) / (1 + x * x), lambda x: mp.sin(x) * mp.exp(-x) / (1 + x * x)),
}


def test_elementary_functions_agree_with_mpmath():
    path = [0.61, -0.4, 0.31, 0.17, -0.11, 0.05, 0.02]
    found = series(lambda x: {name: function(x) for name, (function, _) in FUNCTIONS.items()}, np.array(path))
    errors = {}
    with mp.workdps(50):
        for name, (_, function) in FUNCTIONS.items():
            function = float(function) if isinstance(function, mp.mpf) else function
            exact, scale = mp_taylor.composed(function, path)
            errors[name] = mp_taylor.worst(found[name], exact, scale)
    # erfc far out has 5.1e-15 where XLA fuses no products with sums, as in these tests; the others a twentieth of that
    assert max(errors.values()) < 6e-15, sorted(errors.items(), key=lambda e: e[1])[-5:]


def products(x, y):
    """Operations that are not linear, on arrays of shape (2, 3) and (3, 2)."""
    return {
        "product": x * y.T,
        "square": x * x,
        "matrices": x @ y,
        "contracted": jnp.einsum("ij,kj->ik", x, x),
        "batched": jnp.einsum("ij,ji->i", x, y),
        "outer": jnp.einsum("i,j->ij", x[0], y[:, 1]),
        "with a constant": x @ jnp.arange(6.0).reshape(3, 2),
        "constant first": jnp.arange(4.0).reshape(2, 2) @ x,
        "quotient": x / (1 + y.T),
        "under a constant": 2.0 / y,
        "over a constant": y / 3.0,
        "power": (1 + x) ** y.T,
        "of a constant": 1.7**y,
        "angle": jnp.arctan2(x, y.T),
        "angle behind": jnp.arctan2(-x, -y.T),
        "length": jnp.linalg.norm(x),
        "cross": jnp.cross(x, y.T, axis=1),
        "hypotenuse": jnp.hypot(x, y.T),
        "deep": jnp.sin(x * jnp.cos(y.T * jnp.exp(x))),
        "polynomial": jnp.polyval(jnp.array([1.0, -2.0, 0.5]), x),
        "by one number": x.sum() * y,
        "along one axis": x[:, :1] * x + x[:1] * x,
        "over one number": x / y.sum(),
        "one number over": x.sum() / y,
        "sum with one number": x.sum() + y - y[0, 0],
    }


def structure(x, y):
    """Operations that move and select entries, on the same arrays."""
    which = jnp.argmax(x)
    spread = jnp.zeros((4, 3)).at[jnp.array([2, 0])].set(x)
    return {
        "sum": x.sum(0) - y.sum(1),
        "running sum": jnp.cumsum(x, axis=1),
        "mean": x.mean(),
        "joined": jnp.concatenate([x, jnp.ones((1, 3)), y.T]),
        "stacked": jnp.stack([x[0], y[:, 0], jnp.ones(3)]),
        "split": jnp.split(x, 3, axis=1),
        "unstacked": jnp.unstack(y, axis=1),
        "padded": jnp.pad(x, 1, constant_values=5.0),
        "turned": x[::-1].T,
        "gathered": x[jnp.array([1, 0, 1]), jnp.array([2, 2, 0])],
        "scattered": spread,
        "scattered on a constant": jnp.full((4, 3), 7.0).at[1:3].set(x),
        "constant into it": x.at[0, 1].set(4.0),
        "added at places": y.at[jnp.array([0, 0])].add(x.T[:2]),
        "slice from a place": jax.lax.dynamic_slice_in_dim(x, jnp.argmin(y[:2, 0]) * 0 + 1, 2, axis=1),
        "slice put in": jax.lax.dynamic_update_slice(jnp.ones((3, 3)), x, (1, 0)),
        "picked": x.ravel()[which],
        "reshaped": jnp.broadcast_to(x.reshape(3, 1, 2), (3, 2, 2)),
        "larger": jnp.maximum(x, y.T),
        "smaller": jnp.minimum(x, 0.5),
        "clipped": jnp.clip(x, 0.5, 0.6),
        "chosen": jnp.where(x > 0.5, x * x, jnp.sin(y.T)),
        "chosen constant": jnp.where(x > 0.5, 1.0, x),
        "sign": jnp.sign(x - 0.5) * x,
        "whole part": jnp.floor(7 * x) + x,
        "other whole parts": jnp.ceil(7 * x) * x + jnp.round(7 * y.T),
        "copied": jnp.copy(x) * y.T,
        "held": jax.lax.stop_gradient(jnp.floor(x)) + x,
        "negative": -x,
        "branch": jax.lax.cond(x[0, 0] > 0.5, lambda a, b: a * b, lambda a, b: a - b, x, y.T),
        "branch of three": jax.lax.switch(2, [jnp.sin, jnp.cos, jnp.exp], x),
        "branch by a value": jax.lax.switch(
            jnp.clip(jnp.floor(3 * x[0, 0]).astype(int), 0, 2), [jnp.sin, jnp.cos, jnp.exp], x
        ),
        "scan": jax.lax.scan(lambda c, row: (c * row + 1, c + row), y[:, 0], x),
        "scan backwards": jax.lax.scan(lambda c, row: (c + row, c * row), y[:, 0], x, reverse=True),
        "loop": jax.lax.fori_loop(0, 3, lambda i, c: c * x + jnp.float64(i), y.T),
        "mapped": jax.vmap(lambda a, b: jnp.dot(a, b))(x, y.T),
        "held together": jax.lax.optimization_barrier((x, y)),
    }


def flat(function):
    """Return the function with all its outputs side by side, by name."""

    def flattened(*arguments):
        found = function(*arguments)
        return {f"{name} {i}": leaf for name, value in found.items() for i, leaf in enumerate(jax.tree.leaves(value))}

    return flattened


@pytest.mark.slow
@pytest.mark.parametrize("function", [products, structure])
def test_rules_agree_with_nested_derivatives(function):
    order = 3  # nested derivatives take long to compile beyond
    x, y = paths((2, 3), (3, 2), order=order)
    errors = differences(series(flat(function), x, y), nested(flat(function), x, y))
    assert max(errors.values()) < 2e-14, sorted(errors.items(), key=lambda e: e[1])[-5:]


def operations_in(program):
    """Return the names of all operations of a JAX program, those inside calls, branches and loops too."""
    names = {equation.primitive.name for equation in program.eqns}
    inner = jax.tree.leaves([e.params for e in program.eqns], is_leaf=lambda x: hasattr(x, "eqns"))
    return names.union(*(operations_in(x) for x in inner if hasattr(x, "eqns")))


def test_every_rule_is_tried():
    matrices = (jnp.full((2, 3), 0.5), jnp.full((3, 2), 0.5))
    programs = [jax.make_jaxpr(function)(0.5) for function, _ in FUNCTIONS.values()]
    programs += [jax.make_jaxpr(function)(*matrices) for function in (products, structure)]
    tried = set().union(*map(operations_in, programs))
    assert LINEAR.union(SLOPES, PAIRS, COMPOSED, STEPWISE) <= tried


def test_a_program_agrees_with_the_algebra_of_jets_to_a_high_order():
    x, y = paths((4,), (4,), order=20)

    def program(x, y, library):
        near = library.sqrt(1 + x * x) + library.exp(-(x * y)) / (2 + y)
        return library.sin(near) * library.cos(x) + library.log(3 + x) * library.tanh(x * y) + x**3

    class Names:
        sqrt, exp, sin, cos, log, tanh = jnp.sqrt, jnp.exp, jnp.sin, jnp.cos, jnp.log, jnp.tanh

    found = series(lambda x, y: program(x, y, Names), x, y)
    jets = [Jet(tuple(jnp.asarray(c) for c in path)) for path in (x, y)]
    expected = np.stack(program(*jets, elementary).coefficients)
    size = np.max(np.abs(expected), axis=1, keepdims=True)
    assert np.max(np.abs(found - expected) / size) < 2e-13


def test_a_spline_is_followed_in_its_piece():
    times = np.linspace(0.0, 2.0, 15)
    law = jn.laws.SplineMotion(times, np.sin(3 * times), degree=5)
    (path,) = paths((1, 6), order=5)
    path[0] = np.linspace(0.11, 1.93, 6)  # in six of the pieces

    def program(t):
        return law(Jet([t])).coefficients[0]

    found = series(program, path)
    expected = np.stack(law(Jet(tuple(jnp.asarray(c) for c in path))).coefficients)
    assert np.max(np.abs(found - expected)) < 1e-12 * np.max(np.abs(expected))


def test_interpolation_keeps_to_its_interval():
    (path,) = paths((5,), order=3)
    knots, values = np.linspace(0, 1, 6), np.array([0.0, 2.0, 1.0, 3.0, 5.0, 4.0])
    found = series(lambda x: jnp.interp(x, jnp.asarray(knots), jnp.asarray(values)), path)
    piece = np.floor(path[0] * 5).astype(int)
    slope = np.diff(values)[piece] * 5
    assert np.max(np.abs(found[1:] - slope * path[1:])) < 1e-13
    assert np.max(np.abs(found[0] - np.interp(path[0], knots, values))) < 1e-14


@pytest.mark.slow
def test_coefficients_that_come_late_make_the_same_history():
    x, y = (jnp.asarray(path) for path in paths((2, 3), (3, 2)))

    program = flat(products)

    def step(at_once, late, k, now):
        recursion = Recursion(program, (x[0], y[0]), ORDER)
        found, newest = recursion.advanced(at_once, k, now)
        at_once = recursion.noted(at_once, k, newest)
        without, newest = recursion.advanced(late, k, (now[0], None))
        late = recursion.noted(late, k, recursion.corrected(newest, (None, now[1])))
        slope = jax.jvp(lambda y: program(x[0], y), (y[0],), (now[1],))[1]
        gaps = jax.tree.map(lambda a, b, c: jnp.max(jnp.abs(a - b - c)), found, without, slope)
        return at_once, late, (gaps, jax.tree.map(lambda a, b: jnp.max(jnp.abs(a - b)), at_once, late))

    step = jax.jit(step, compiler_options=compiler_options())
    at_once = late = Recursion(program, (x[0], y[0]), ORDER).history
    for k in range(1, ORDER + 1):
        at_once, late, gaps = step(at_once, late, k, (x[k], y[k]))
        assert max(map(float, jax.tree.leaves(gaps))) < 1e-14, k


def test_arguments_known_for_certain_to_be_zero_may_be_left_out():
    x, y = (jnp.asarray(path) for path in paths((3,), (3,)))
    recursion = Recursion(lambda x, y: jnp.sin(x) * y + y, (x[0], y[0]), 1)
    found, _ = recursion.advanced(recursion.history, 1, (x[1], None))
    assert np.allclose(found, jnp.cos(x[0]) * x[1] * y[0], rtol=1e-15, atol=0)


def test_what_does_not_change_stays():
    x = jnp.asarray(paths((3,))[0])
    recursion = Recursion(lambda x: {"still": jnp.arange(3.0), "count": jnp.floor(x), "moving": x}, (x[0],), 1)
    found, _ = recursion.advanced(recursion.history, 1, (x[1],))
    assert not np.any(found["still"])
    assert not np.any(found["count"])
    assert np.array_equal(found["moving"], x[1])
    assert np.array_equal(recursion.outputs["still"], np.arange(3.0))


@pytest.mark.parametrize("operation", [jnp.subtract, jnp.divide, jnp.power, jnp.arctan2])
def test_operands_in_another_order_are_another_operation(operation):
    """Repeated operations are read once, and `b - a` does not repeat `a - b`."""
    a, b = jnp.asarray(2.0), jnp.asarray(3.0)
    recursion = Recursion(lambda a, b: (operation(a, b), operation(b, a)), (a, b), 1)
    assert recursion.outputs == (operation(a, b), operation(b, a))
    found, _ = recursion.advanced(recursion.history, 1, (jnp.asarray(0.5), jnp.asarray(0.25)))
    for (first, second), rates, result in [((a, b), (0.5, 0.25), found[0]), ((b, a), (0.25, 0.5), found[1])]:
        slopes = jax.grad(operation, (0, 1))(first, second)
        assert float(result) == pytest.approx(float(slopes[0] * rates[0] + slopes[1] * rates[1]), rel=1e-14)


@pytest.mark.parametrize(
    "name, function",
    [
        ("bessel_i0e", jax.lax.bessel_i0e),
        ("while", lambda x: jax.lax.while_loop(lambda c: jnp.max(c) < 1, lambda c: 2 * c, x)),
        ("sort", jnp.sort),
    ],
)
def test_an_operation_without_a_rule_is_named(name, function):
    with pytest.raises(TypeError, match=f"'{name}' of JAX has no rule"):
        Recursion(function, (jnp.full(3, 0.5),), 2)
