"""Loops over small arrays as one function of machine code."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import accumulate
from typing import Any

import jax
import jax.numpy as jnp
import jaxlib.version
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import ClosedJaxpr, Jaxpr, jaxpr_as_fun, jaxprs_in_params

from jounce.execution.alone import is_traced_alone
from jounce.execution.compilation import compiler_options

LIBRARIES = ("dot-library-rewriter", "cpu-parallel-task-assigner")
"""Passes of XLA to leave out of programs with such functions: they put sums into a library as well, and share large
operations among threads, by functions that are out of reach there."""

TRIED = (0, 10)  # releases of jaxlib: of others it is not known whether they break off
LARGEST = 6000  # operations: of a march of twice as many LLVM makes one function in a minute, and many in ten seconds

# not among them: products of matrices, convolutions, sorting and what is foreign, for which XLA calls libraries that
# such a function cannot reach, and scatter, for which it has no code there
SUPPORTED = frozenset(
    "abs acos acosh add add_any and argmax argmin asin asinh atan atan2 atanh broadcast_in_dim cbrt ceil clamp "
    "concatenate cond convert_element_type copy cos cosh custom_jvp_call custom_vjp_call div dynamic_slice "
    "dynamic_update_slice eq erf erfc exp exp2 expm1 floor gather ge gt integer_pow iota is_finite jit le log log1p "
    "logistic lt max min mul ne neg not optimization_barrier or pad pow reduce_and reduce_max reduce_min reduce_or "
    "reduce_prod reduce_sum rem reshape rev round rsqrt scan select_n sign sin sinh slice split sqrt square "
    "squeeze stack stop_gradient sub tan tanh transpose unstack while xor".split()
)


def in_one_piece(function: Callable[[Any], Any], argument: Any, largest: int = LARGEST) -> Any:
    """Return the value of a function that XLA compiles into one piece of machine code where it can.

    XLA calls each operation on a processor as a function of its own, which takes longer than arithmetic on small
    arrays. The mark asks for what XLA does by itself with the smallest loops; one that does not know it passes it over.

    Parameters
    ----------
    function : callable
        Of a pytree of arrays, such as a loop whose length is known only when it runs. In a program compiled with
        `compiler_options`, `without` the `LIBRARIES`: neither the newer code of XLA for fused operations nor its
        libraries can be part of such a function.
    argument : pytree
        Of arrays.
    largest : int, optional
        Most operations of such a piece; of more, XLA makes what it makes by itself.
    """
    if not largest or is_traced_alone():
        return function(argument)
    program, shape = jax.make_jaxpr(function, return_shape=True)(argument)
    leaves = jax.tree.leaves(argument)
    if _tried() and _suits(program.jaxpr, largest):
        given = tuple(map(jnp.asarray, (*program.consts, *leaves)))

        def whole(numbers: jax.Array) -> Any:
            parts = _parted(numbers, given)
            constants = len(program.consts)
            return jaxpr_as_fun(ClosedJaxpr(program.jaxpr, parts[:constants]))(*parts[constants:])

        with set_xla_metadata(xla_cpu_small_call="true", inlineable="false"):
            found = jax.jit(whole)(_joined(given))
    else:
        found = jaxpr_as_fun(program)(*leaves)
    return jax.tree.unflatten(jax.tree.structure(shape), found)


def _joined(arrays: Iterable[jax.Array]) -> jax.Array:
    """Return arrays as one of numbers: counts and choices are numbers, too, of which doubles hold 53 bits.

    XLA finds the memory of what such a function is given where it is used, and ends the process where an argument is
    used nowhere, after it has left out what has no effect. One argument for all is used.
    """
    return jnp.concatenate([array.astype(float).ravel() for array in arrays])


def _parted(numbers: jax.Array, arrays: Sequence[jax.Array]) -> list[jax.Array]:
    """Return the arrays that were joined."""
    ends = list(accumulate(array.size for array in arrays))
    parts = [numbers[end - array.size : end] for array, end in zip(arrays, ends, strict=True)]
    return [part.reshape(array.shape).astype(array.dtype) for part, array in zip(parts, arrays, strict=True)]


def _tried() -> bool:
    """Tell whether this release of XLA, on a processor, is known to compile such functions."""
    return jaxlib.version.__version_info__[:2] == TRIED and compiler_options() is not None


def _operations(program: Jaxpr) -> Iterator[str]:
    """Yield the names of all operations of a program, those of loops and branches once."""
    for equation in program.eqns:
        yield equation.primitive.name
        for part in jaxprs_in_params(equation.params):
            yield from _operations(part)


def _suits(program: Jaxpr, largest: int) -> bool:
    """Tell whether XLA compiles all operations of a program by itself, and as one function before long."""
    names = list(_operations(program))
    return len(names) <= largest and SUPPORTED.issuperset(names)
