"""How batches of samples go through the algorithms: by machine code made of one sample's program, where there is any.

Else in blocks of few sizes, batch last, in chunks for the cache. Machine code is used for a single sample, too: it is
compiled as fast as one of XLA's programs, of which each size of blocks needs one, and called in a third of the time.
"""

import math
from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.execution.compilation import Compiled
from jounce.execution.device import on_processor
from jounce.execution.side_by_side import SideBySide
from jounce.execution.threads import Threads, thread_count
from jounce.jet.derivatives import plain_derivatives, taylor_coefficients
from jounce.robot.abstract_robot import AbstractRobot
from jounce.settings import check_process
from jounce.shapes import is_traced

CHUNK = 128  # samples that are computed side by side; a GPU computes a block at once
LEAST_THREADED = 2**12  # samples of a thread that runs machine code: fewer are done before threads are started
MOST_LINES = 40_000  # of machine code's text: it is compiled in four seconds, XLA's programs for all widths in as many
WIDTHS = (8, CHUNK, 16 * CHUNK)  # sizes of blocks: each compiles once for a kind of robot
GPU_WIDTHS = (CHUNK, 2**12, 2**17)


class Batched:
    """A function on Taylor coefficients, batch last, made to work on plain derivatives, batch first.

    The function gets the tree, a tuple of arrays of shape (order + 1, ..., batch), a pytree of constants and static
    arguments, and returns a pytree of arrays of the shape (order + 1, ..., batch). Results are NumPy arrays, or JAX
    arrays under a transformation of JAX.
    """

    def __init__(self, function: Callable[..., Any]):
        self.function = function
        self._on_block = Compiled(self._chunks, ("static",), (Batched._chunks, function))
        self.machine_code = SideBySide(
            self._sample, rows=True, made_of=(Batched._sample, function), most_lines=MOST_LINES
        )
        update_wrapper(self, function)

    @property
    def jitted(self) -> Any:
        """The function on a block of samples, as `jax.jit` returns it."""
        return self._on_block.jitted

    @cached_property
    def nested(self) -> Any:
        """The function compiled on its own within transformations of JAX, which take no options of the compiler."""
        return jax.jit(self._block, static_argnums=3)

    def __call__(
        self, robot: AbstractRobot, arrays: tuple[Any, ...], constants: Any = (), static: tuple[Any, ...] = ()
    ) -> Any:
        """Return results for arrays of derivatives, the first one of shape (batch..., order + 1, n)."""
        check_process()
        lead = arrays[0].shape[:-2]
        axes, count = len(lead), math.prod(lead)
        if is_traced((arrays, constants, robot.tree)):
            flat = tuple(jnp.reshape(x, (count, *x.shape[axes:])) for x in arrays)
            found = self.nested(robot.tree, flat, constants, static)
            return jax.tree.map(lambda x: jnp.reshape(x, (*lead, *x.shape[1:])), found)
        flat = tuple(np.reshape(np.asarray(x), (count, *x.shape[axes:])) for x in arrays)
        if (program := self.machine_code.program((robot.tree, constants), flat, static=static)) is not None:
            found = program(flat, max(1, min(thread_count(), count // LEAST_THREADED)))
            return jax.tree.map(lambda x: np.reshape(x, (*lead, *x.shape[1:])), found)

        def computed(block: tuple[np.ndarray, ...]) -> Any:
            return jax.block_until_ready(self._on_block(robot.tree, block, constants, static))

        with Threads(thread_count()) as threads:
            found = list(threads.map(computed, _blocks(flat)))

        def joined(*parts: Any) -> Any:
            whole = np.concatenate(parts)  # a copy that its user may write to
            return np.reshape(whole[:count], (*lead, *whole.shape[1:]))

        return jax.tree.map(joined, *found)

    def _chunks(self, tree: Any, arrays: tuple[Any, ...], constants: Any, static: tuple[Any, ...]) -> Any:
        width = arrays[0].shape[0]
        if width <= CHUNK or not on_processor():
            return self._block(tree, arrays, constants, static)
        parts = tuple(jnp.reshape(x, (width // CHUNK, CHUNK, *x.shape[1:])) for x in arrays)
        found = jax.lax.map(lambda part: self._block(tree, part, constants, static), parts)
        return jax.tree.map(lambda x: jnp.reshape(x, (width, *x.shape[2:])), found)

    def _sample(self, shared: tuple[Any, Any], arrays: tuple[Any, ...], *, static: tuple[Any, ...]) -> Any:
        """Return plain derivatives for those of one sample, last axes of length one."""
        tree, constants = shared
        found = self.function(tree, tuple(map(taylor_coefficients, arrays)), constants, *static)
        return jax.tree.map(plain_derivatives, found)

    def _block(self, tree: Any, arrays: tuple[Any, ...], constants: Any, static: tuple[Any, ...]) -> Any:
        last = tuple(taylor_coefficients(jnp.moveaxis(jnp.asarray(x), 0, -1)) for x in arrays)
        found = self.function(tree, last, constants, *static)
        return jax.tree.map(lambda x: jnp.moveaxis(plain_derivatives(x), -1, 0), found)


def _blocks(arrays: tuple[np.ndarray, ...]) -> list[tuple[np.ndarray, ...]]:
    """Cut arrays of samples into blocks of one of the known widths; the last one is filled up with zeros."""
    count, start, blocks = len(arrays[0]), 0, []
    small, middle, large = WIDTHS if on_processor() else GPU_WIDTHS
    # half of a large block at least is in use, so that no more than twice is computed
    width = small if count <= small else middle if count <= large // 2 else large
    while start < count or not blocks:
        left = count - start
        taken = tuple(x[start : start + width] for x in arrays)
        if left < width:
            taken = tuple(np.concatenate([x, np.zeros((width - left, *x.shape[1:]))]) for x in taken)
        blocks.append(taken)
        start += width
    return blocks
