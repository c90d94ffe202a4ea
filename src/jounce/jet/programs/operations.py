"""Rules of JAX operations on Taylor coefficients: tables for `composition` and `series`."""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jounce.jet.algebra import whole_power
from jounce.jet.elementary import BY_SLOPE


def times(a: Any, b: Any) -> Any:
    """Return the product of coefficients; None is zero."""
    return None if a is None or b is None else a * b


def _contracted(a: Any, b: Any, *, dimension_numbers: Any, **_: Any) -> Any:
    (first, second), (shared_a, shared_b) = dimension_numbers
    free_a, free_b = (
        [i for i in range(x.ndim) if i not in (*c, *s)] for x, c, s in ((a, first, shared_a), (b, second, shared_b))
    )
    a = jnp.transpose(a, (*shared_a, *free_a, *first)).reshape(
        *(a.shape[i] for i in (*shared_a, *free_a)), *(1,) * len(free_b), -1
    )
    b = jnp.transpose(b, (*shared_b, *free_b, *second)).reshape(
        *(b.shape[i] for i in shared_b), *(1,) * len(free_a), *(b.shape[i] for i in free_b), -1
    )
    return jnp.sum(a * b, axis=-1)


PLAIN = {"sin": jnp.sin, "cos": jnp.cos, "sinh": jnp.sinh, "cosh": jnp.cosh}
PAIRS = {
    "sin": ("sin", "cos", -1.0),
    "cos": ("sin", "cos", -1.0),
    "sinh": ("sinh", "cosh", 1.0),
    "cosh": ("sinh", "cosh", 1.0),
}


def _of_argument(slope: Callable[[Any], Any]) -> Callable[[Any, Any], Any]:
    return lambda x, _y: slope(x)


# a function and its partial derivatives, which may use its value as the last argument
SLOPES: dict[str, tuple[Callable[..., Any], tuple[Callable[..., Any], ...]]] = {
    "exp": (jnp.exp, (lambda _x, y: y,)),
    "expm1": (jnp.expm1, (lambda _x, y: y + 1.0,)),
    "log": (jnp.log, (lambda x, _y: 1.0 / x,)),
    "sqrt": (jnp.sqrt, (lambda _x, y: 0.5 / y,)),
    "cbrt": (jnp.cbrt, (lambda x, y: y / (3.0 * x),)),
    "pow": (jnp.power, (lambda x, p, y: p * y / x, lambda x, _p, y: y * jnp.log(x))),
    "tan": (jnp.tan, (lambda _x, y: 1.0 + y * y,)),
    "tanh": (jnp.tanh, (lambda _x, y: 1.0 - y * y,)),
    "atan2": (jnp.arctan2, (lambda y, x, _z: x / (x * x + y * y), lambda y, x, _z: -y / (x * x + y * y))),
    "erfc": (jax.lax.erfc, (lambda x, _y: -2.0 / math.sqrt(math.pi) * jnp.exp(-x * x),)),
    "logistic": (jax.lax.logistic, (lambda _x, y: y * (1.0 - y),)),
} | {name: (function, (_of_argument(slope),)) for name, (function, slope) in BY_SLOPE.items()}
COMPOSED: dict[str, Callable[..., Any]] = {
    "dot_general": _contracted,
    "square": lambda x: x * x,
    "integer_pow": lambda x, *, y: whole_power(x, y),
    "rsqrt": lambda x, **_: 1.0 / jnp.sqrt(x),
    "exp2": lambda x, **_: jnp.exp(x * math.log(2.0)),
    "abs": lambda x: jnp.where(x < 0, -x, x),
    "max": lambda a, b: jnp.where(a >= b, a, b),
    "min": lambda a, b: jnp.where(a <= b, a, b),
    "clamp": lambda low, x, high: jnp.where(x < low, low, jnp.where(x > high, high, x)),
    "rem": lambda x, y: x - y * jnp.trunc(x / y),
}
BROADCASTING = frozenset("mul div pow atan2".split())
REARRANGING = frozenset(
    "broadcast_in_dim concatenate convert_element_type copy cumsum dynamic_slice gather pad reduce_sum reshape rev "
    "slice squeeze stack transpose".split()
)
ADDITIVE = frozenset("add add_any sub concatenate dynamic_update_slice pad scatter scatter-add select_n stack".split())
LINEAR = ADDITIVE | REARRANGING | frozenset("div mul neg".split())
STEPWISE = frozenset("ceil floor round sign stop_gradient".split())  # piecewise constant in time
