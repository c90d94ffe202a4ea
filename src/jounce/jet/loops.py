"""Loops over small arrays, compiled to one piece of machine code, and what such loops need."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import jax
import jax.numpy as jnp
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import jaxpr_as_fun

LARGEST = 2**20  # bytes carried by a loop that is worth it: of larger arrays the calls are a small part

_allowed: ContextVar[bool] = ContextVar("tight loops allowed", default=False)


@contextmanager
def tight_loops() -> Iterator[None]:
    """Allow loops in one piece in what is traced here.

    It must be compiled with the solver's options: with XLA's own, such loops may end the process.
    """
    token = _allowed.set(True)
    try:
        yield
    finally:
        _allowed.reset(token)


def tight_loop(lower: Any, upper: Any, body: Callable[[Any, Any], Any], carry: Any) -> Any:
    """Run `jax.lax.fori_loop`, in one piece where that is allowed and worth it.

    XLA calls each operation of a loop on a CPU as a function of its own, which costs more than small arrays do. The
    marks, which a release that does not know them passes over, ask for the whole loop as one function. Its body must
    be made of elementwise operations, slices and updates: XLA has libraries for products of matrices and sums.
    """
    leaves, structure = jax.tree.flatten(carry)
    size = sum(x.size * x.dtype.itemsize for x in map(jnp.asarray, leaves))
    if not _allowed.get() or size > LARGEST:
        return jax.lax.fori_loop(lower, upper, body, carry)
    loop = jax.make_jaxpr(
        lambda *xs: jax.tree.leaves(jax.lax.fori_loop(lower, upper, body, jax.tree.unflatten(structure, xs)))
    )(*leaves)
    whole = jax.jit(jaxpr_as_fun(loop))
    with set_xla_metadata(xla_cpu_small_call="true", inlineable="false"):
        return jax.tree.unflatten(structure, whole(*leaves))


def halved_sum(x: Any, axis: int) -> Any:
    """Return the sum over an axis by elementwise additions of halves."""
    x = jnp.moveaxis(x, axis, 0)
    while (size := x.shape[0]) > 1:
        half = size // 2
        rest = x[2 * half :]
        x = jnp.concatenate([x[:half] + x[half : 2 * half], rest]) if size % 2 else x[:half] + x[half:]
    return x[0] if x.shape[0] else jnp.zeros(x.shape[1:], x.dtype)
