"""Execution of robot algorithms on batches: the program of one sample, run for many (see `execution.mapped`).

Single samples run as machine code, too: it compiles as fast as one program of XLA, which needs one for each block size,
and a call takes a third of the time.
"""

import math
from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import is_traced
from jounce.execution.mapped import SIDE_BY_SIDE, Mapped
from jounce.execution.threads import thread_count
from jounce.jet.derivatives import plain_derivatives, taylor_coefficients
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.settings import check_process

LEAST_THREADED = 2**12  # samples per thread: fewer take less time than starting a thread
WIDTHS = (8, SIDE_BY_SIDE, 16 * SIDE_BY_SIDE)  # block sizes with XLA: each compiles once for a kind of robot


class Batched:
    """A function on Taylor coefficients, batch last, that is called with plain derivatives, batch first.

    The function takes the tree, a tuple of arrays of shape (order + 1, ..., batch), a pytree of constants and static
    arguments, and returns a pytree of arrays of shape (order + 1, ..., batch). Results are NumPy arrays, or JAX arrays
    under a transformation of JAX.
    """

    def __init__(self, function: Callable[..., Any]):
        self.function = function
        self.mapped = Mapped(self._sample, rows=True, made_of=(Batched._sample, function), widths=WIDTHS)
        update_wrapper(self, function)

    @property
    def jitted(self) -> Any:
        """The function on a block of samples, as `jax.jit` returns it."""
        return self.mapped.on_xla.jitted

    @cached_property
    def nested(self) -> Any:
        """The function compiled for use within transformations of JAX, which accept no compiler options."""
        return jax.jit(self._block, static_argnums=3)

    def __call__(
        self, robot: AbstractRobot, arrays: tuple[Any, ...], constants: Any = (), static: tuple[Any, ...] = ()
    ) -> Any:
        """Return the results for arrays of derivatives, the first one of shape (batch..., order + 1, n)."""
        check_process()
        lead = arrays[0].shape[:-2]
        axes, count = len(lead), math.prod(lead)
        if is_traced((arrays, constants, robot.tree)):
            flat = tuple(jnp.reshape(x, (count, *x.shape[axes:])) for x in arrays)
            result = self.nested(robot.tree, flat, constants, static)
            return jax.tree.map(lambda x: jnp.reshape(x, (*lead, *x.shape[1:])), result)
        flat = tuple(np.reshape(np.asarray(x), (count, *x.shape[axes:])) for x in arrays)
        program = self.mapped.program((robot.tree, constants), flat, static=static)
        result = program(flat, max(1, min(thread_count(), count // LEAST_THREADED)))
        return jax.tree.map(lambda x: np.reshape(x, (*lead, *x.shape[1:])), result)

    def _sample(self, shared: tuple[Any, Any], arrays: tuple[Any, ...], *, static: tuple[Any, ...]) -> Any:
        """Return plain derivatives of the results for plain derivatives of the arrays, samples last."""
        tree, constants = shared
        result = self.function(tree, tuple(map(taylor_coefficients, arrays)), constants, *static)
        return jax.tree.map(plain_derivatives, result)

    def _block(self, tree: Any, arrays: tuple[Any, ...], constants: Any, static: tuple[Any, ...]) -> Any:
        samples_last = tuple(jnp.moveaxis(jnp.asarray(x), 0, -1) for x in arrays)
        result = self._sample((tree, constants), samples_last, static=static)
        return jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0), result)
