"""Methods of user classes that act on jets, traced so that captured numbers are arguments.

If a method composes operations without looking at single derivatives, its program on the values alone defines it: that
program runs on jets as on numbers. Whether this holds is checked by comparing the operations of program and method on
jets. All other methods are called as they are, and what they compute, with all their numbers, becomes part of the
compiled program.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr

from jounce.base.modules import Module, Untraced, field
from jounce.jet.algebra import Jet
from jounce.jet.programs.captured import (
    OpaqueObject,
    Program,
    captured_function,
    known_as,
    may_hold_stale_functions,
    value_key,
)
from jounce.jet.programs.composition import has_rules, on_jets as run
from jounce.jet.programs.same_programs import is_same


class ReadMethod(Module):
    """A method in the form of its program on values, which is run on jets.

    Parameters
    ----------
    program : Program
        Program of the captured numbers and of the values of the arguments, instances and batch last.
    captured : tuple of array
        Captured numbers; those of stacked instances have axes for instances and batch at their ends.
    """

    program: Program = field(static=True)
    captured: tuple[Any, ...]

    def __call__(self, method: Callable[[], Any], inputs: Callable[[], Sequence[Any]]) -> Any:
        """Return the result of the method for jets and arrays whose last axes are the instances and the batch."""
        del method
        captured = [
            v if np.ndim(v) > len(shape) else jnp.reshape(jnp.asarray(v), (*shape, 1, 1))
            for v, shape in zip(self.captured, self.program.shapes, strict=True)
        ]

        def once(given: Any) -> Any:
            values, arguments = given
            return self.once([v[..., 0, 0] for v in values], arguments)

        return _along(once, (captured, list(inputs())))

    def once(self, captured: Sequence[Any], arguments: Sequence[Any]) -> Any:
        """Return the result for one instance at one instant."""
        (result,) = run(self.program, captured, arguments)
        if isinstance(result, Jet) or not jnp.issubdtype(result.dtype, jnp.floating):
            return result
        return Jet.constant(result, min(x.order for x in arguments if isinstance(x, Jet)))


class Verbatim(Module):
    """A method that is called as it is; its operations and numbers are part of the compiled program.

    Parameters
    ----------
    key : tuple
        Key that distinguishes it from other methods.
    old : bool
        Whether JAX may have traced parts of it before.
    """

    key: tuple[Any, ...] = field(static=True)
    old: bool = field(static=True)

    def __call__(self, method: Callable[[], Any], inputs: Callable[[], Sequence[Any]]) -> Any:
        """Return the result of the method."""
        del inputs
        with known_as(str(self.key[0])) if self.old else nullcontext():
            return method()


Reading = ReadMethod | Verbatim


class ReadObject(Module):
    """A module, perhaps written by a user, that is called on jets through its traced program.

    Parameters
    ----------
    reading : ReadMethod or Verbatim
        The traced call of the module.
    fields : tuple of array
        Numbers in its fields; those of stacked objects have axes for objects and batch at their ends.
    shapes : tuple of tuple of int
        Shapes of the fields of one object.
    source : Untraced
        The module itself.
    """

    reading: Reading
    fields: tuple[Any, ...]
    shapes: tuple[tuple[int, ...], ...] = field(static=True)
    source: Untraced = field(static=True)

    @classmethod
    def of(cls, source: Any, orders: Sequence[int], shape: tuple[int, ...] = ()) -> "ReadObject":
        """Return the current reading of an object for jets of given orders and shape."""
        leaves, tree = jax.tree.flatten(source)
        shapes = [np.shape(x) for x in leaves]
        jets = [Jet([jax.ShapeDtypeStruct((*shape, 1, 1), float)] * (order + 1)) for order in orders]
        jets[-1] = Jet([jax.ShapeDtypeStruct((1, 1), float)] * (orders[-1] + 1))  # time
        fields = [jax.ShapeDtypeStruct((*field_shape, 1, 1), float) for field_shape in shapes]

        def on_jets(given: Sequence[Any], _: Any) -> Any:
            return jax.tree.unflatten(tree, given[len(jets) :])(*given[: len(jets)])

        def on_values(*values: Any) -> Any:
            program = on_jets([*(Jet([x]) for x in values[: len(jets)]), *values[len(jets) :]], ())
            (value,) = program.coefficients
            return value

        reading = read_method(on_values, on_jets, [*jets, *fields], [])
        return cls(reading, tuple(leaves), tuple(shapes), Untraced(source))

    def __call__(self, *jets: Jet) -> Jet:
        """Return the jet of the object; the last axes of all jets are instances and batch."""

        def source() -> Any:
            return jax.tree.unflatten(jax.tree.structure(self.source.value), self.fields)(*jets)

        def inputs() -> list[Any]:
            pairs = zip(self.fields, self.shapes, strict=True)
            return [*jets, *(jnp.reshape(x, (*s, 1, 1)) if np.ndim(x) == len(s) else x for x, s in pairs)]

        return self.reading(source, inputs)


def read_method(
    on_values: Callable[..., Any],
    on_jets: Callable[..., Any],
    jets: Sequence[Any],
    rates: Sequence[Any],
    whole: Callable[[], Any] | None = None,
) -> Reading:
    """Return the current reading of a method.

    Parameters
    ----------
    on_values : callable
        The method on values, arrays in place of the jets; returns an array.
    on_jets : callable
        The method on jets and on the rates, given as two lists; returns a pytree of arrays.
    jets : sequence of Jet or array
        Shapes and types of the arguments.
    rates : sequence of Jet
        Jets of other inputs, which have no values at order zero.
    whole : callable, optional
        Calls the method without arguments, for methods that the first two cannot call.
    """
    leaves, tree = jax.tree.flatten(([*jets], [*rates]))
    reading: Reading = Verbatim((OpaqueObject(object()),), old=False)  # the later call raises the error again
    functions = [lambda *x: on_jets(*jax.tree.unflatten(tree, x)), *([] if whole is None else [lambda *_: whole()])]
    for function in functions:
        try:
            program = captured_function(lambda *x, f=function: jax.tree.leaves(f(*x)), *leaves)
        except Exception:  # noqa: BLE001
            continue
        reading = Verbatim(value_key(program.traced), may_hold_stale_functions(program.traced))
        if function is functions[0]:
            return _as_program(on_values, program.traced, jets) or reading
        break
    return reading


def _as_program(on_values: Callable[..., Any], traced: ClosedJaxpr, jets: Sequence[Any]) -> ReadMethod | None:
    """Return a method as a program on values; None if it is no such program, or captures no numbers."""
    leaves, tree = jax.tree.flatten([*jets])
    shapes = tuple(x.shape for x in leaves)
    try:
        program = captured_function(on_values, *(x.coefficients[0] if isinstance(x, Jet) else x for x in jets))
        reading = ReadMethod(program.program, program.captured)
        if not program.captured or not has_rules(program.program) or len(jax.tree.leaves(program.result)) != 1:
            return None

        other = _on_series(program.program, tree, shapes)
    except Exception:  # noqa: BLE001 - values alone are not enough for it
        return None
    return reading if is_same(traced, other, program.captured) else None


@lru_cache(maxsize=1000)
def _on_series(program: Program, tree: Any, shapes: tuple[tuple[int, ...], ...]) -> ClosedJaxpr:
    """Return the program that JAX traces when a program on values is run on jets of given shapes."""
    reading, avals = ReadMethod(program, ()), [v.aval for v in program.closed.jaxpr.invars[: len(program.shapes)]]

    def again(captured: Any, *x: Any) -> Any:
        return jax.tree.leaves(reading.once(captured, jax.tree.unflatten(tree, x)))

    example = [jax.ShapeDtypeStruct(aval.shape, aval.dtype) for aval in avals]
    return jax.make_jaxpr(again)(example, *(jax.ShapeDtypeStruct(shape, float) for shape in shapes))


def _along(function: Callable[[Any], Any], given: Any) -> Any:
    """Map a function over instances and batch, the last two axes of all arrays in a pytree."""
    for axis in (-1, -2):
        function = _mapped(function, axis)
    return function(given)


def _mapped(function: Callable[[Any], Any], axis: int) -> Callable[[Any], Any]:
    def mapped(given: Any) -> Any:
        axes = jax.tree.map(lambda x: axis if np.shape(x)[axis] > 1 else None, given)
        if not any(a is not None for a in jax.tree.leaves(axes, is_leaf=lambda a: a is None)):
            return function(given)

        def one(part: Any) -> Any:
            whole = jax.tree.map(
                lambda x, y: x if jnp.ndim(x) == jnp.ndim(y) else jnp.expand_dims(x, axis), part, given
            )
            return jax.tree.map(lambda x: jnp.squeeze(x, axis), function(whole))

        return jax.vmap(one, in_axes=(axes,), out_axes=axis)(given)

    return mapped
