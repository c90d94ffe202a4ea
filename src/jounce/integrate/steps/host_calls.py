"""Functions that run on the host, on numbers that JAX traces: at once, or called by what JAX compiles or maps."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.base.shapes import Numbers
from jounce.settings import called_back

Values = tuple[Any, ...]


def recorded(function: Callable[[Any], Any], values: Any) -> Any:
    """Return what a function gives of the numbers of values that JAX traces; None where it knows none yet.

    Parameters
    ----------
    function : callable
        Maps such values to anything.
    values : pytree
        As within `jax.jit` and `jax.vmap` nothing is known of them.
    """
    results: list[Any] = []

    @jax.custom_jvp
    def record(values: Any) -> Any:
        if not any(isinstance(value, Tracer) for value in jax.tree.leaves(values)):
            results.append(function(values))
        return jnp.zeros(())

    @record.defjvp
    def record_jvp(primals: tuple[Any], _: tuple[Any]) -> tuple[Any, Any]:
        return record(*primals), jnp.zeros(())

    record(values)
    return results[-1] if results else None


def called(function: Callable[[Values], Any], shapes: Any, values: Values) -> Any:
    """Return what a function gives that decides by numbers, where JAX compiles or maps what they follow from.

    Its derivatives of each order are functions of numbers too, and are called likewise; they are found forward, one
    value after another.

    Parameters
    ----------
    function : callable
        Maps values, numbers or such that `jax.jvp` traces, to a pytree of arrays.
    shapes : pytree of jax.ShapeDtypeStruct
        Of what it gives.
    values : tuple of array
        Of floats.
    """
    sizes = [np.shape(value) for value in values]
    ends = np.cumsum([np.prod(size, dtype=int) for size in sizes])

    def of_vector(vector: Numbers) -> Any:
        parts = jnp.split(vector, ends[:-1])
        return function(tuple(part.reshape(size) for part, size in zip(parts, sizes, strict=True)))

    vector = jnp.concatenate([jnp.ravel(value) for value in values])
    return _derivative(of_vector, shapes, len(vector), 0)(vector)


def _derivative(function: Callable[[Numbers], Any], shapes: Any, count: int, degree: int) -> Callable[[Numbers], Any]:
    """Return the derivative of a function of a vector, the directions on the last axes, called on the host."""
    slope = function
    for _ in range(degree):
        slope = jax.jacfwd(slope)
    whole = jax.tree.map(lambda x: jax.ShapeDtypeStruct((*x.shape, *[count] * degree), x.dtype), shapes)

    def on_the_host(vector: Numbers) -> Any:
        return jax.tree.map(np.asarray, slope(jnp.asarray(vector)))

    @jax.custom_jvp
    def jvp(vector: Numbers) -> Any:
        return called_back(on_the_host, whole, vector, vmap_method="sequential")

    @jvp.defjvp
    def along(primals: tuple[Numbers], tangents: tuple[Numbers]) -> tuple[Any, Any]:
        higher = _derivative(function, shapes, count, degree + 1)(*primals)
        return jvp(*primals), jax.tree.map(lambda x: x @ tangents[0], higher)

    return jvp
