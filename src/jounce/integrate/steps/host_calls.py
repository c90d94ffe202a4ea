"""Functions that run on the host with the values of JAX tracers: at once, or as callbacks of compiled programs."""

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
    """Return the result of a function of the concrete values of tracers; None if the values are not known.

    Parameters
    ----------
    function : callable
        Function of concrete values, with any result.
    values : pytree
        Values that JAX may trace; within `jax.jit` and `jax.vmap` they are not known.
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
    """Return the result of a function that depends on concrete values, as a callback within `jax.jit` or `jax.vmap`.

    Its derivatives of each order are callbacks, too, computed in forward mode.

    Parameters
    ----------
    function : callable
        Function from values, concrete or traced by `jax.jvp`, to a pytree of arrays.
    shapes : pytree of jax.ShapeDtypeStruct
        Shapes and types of the result.
    values : tuple of array
        Arrays of floats.
    """
    sizes = [np.shape(value) for value in values]
    ends = np.cumsum([np.prod(size, dtype=int) for size in sizes])

    def of_vector(vector: Numbers) -> Any:
        parts = jnp.split(vector, ends[:-1])
        return function(tuple(part.reshape(size) for part, size in zip(parts, sizes, strict=True)))

    vector = jnp.concatenate([jnp.ravel(value) for value in values])
    return _derivative(of_vector, shapes, len(vector), 0)(vector)


def _derivative(function: Callable[[Numbers], Any], shapes: Any, count: int, degree: int) -> Callable[[Numbers], Any]:
    """Return the derivative of a function of a vector as a callback on the host, with directions on the last axes."""
    slope = function
    for _ in range(degree):
        slope = jax.jacfwd(slope)
    result_shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct((*x.shape, *[count] * degree), x.dtype), shapes)

    def on_the_host(vector: Numbers) -> Any:
        return jax.tree.map(np.asarray, slope(jnp.asarray(vector)))

    @jax.custom_jvp
    def jvp(vector: Numbers) -> Any:
        return called_back(on_the_host, result_shapes, vector, vmap_method="sequential")

    @jvp.defjvp
    def along(primals: tuple[Numbers], tangents: tuple[Numbers]) -> tuple[Any, Any]:
        higher = _derivative(function, shapes, count, degree + 1)(*primals)
        return jvp(*primals), jax.tree.map(lambda x: x @ tangents[0], higher)

    return jvp
