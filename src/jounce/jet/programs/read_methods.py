"""Methods of users' classes that act on jets: what they compute, read off so that captured numbers are arguments.

A method that composes operations without looking at single derivatives is known by its program on the values alone,
which runs on jets as it does on numbers. Whether it is one is checked, not believed: on jets, program and method must
do the same operations. All other methods are called as they are, and what they compute, their numbers included, is part
of what is compiled.
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
    """A method as its program on values, run on jets.

    Parameters
    ----------
    program : Program
        Of the captured numbers and of the values of the arguments, instances and batch last.
    captured : tuple of array
        The numbers; those of stacked instances have the axes of these and of the batch at their ends.
    """

    program: Program = field(static=True)
    captured: tuple[Any, ...]

    def __call__(self, method: Callable[[], Any], inputs: Callable[[], Sequence[Any]]) -> Any:
        """Return what the method returns for jets and arrays, whose last axes are the instances and the batch."""
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
    """A method that is called as it is: what it computes, with all its numbers, is part of the program.

    Parameters
    ----------
    key : tuple
        Tells it from others.
    old : bool
        Whether JAX may have traced parts of it before.
    """

    key: tuple[Any, ...] = field(static=True)
    old: bool = field(static=True)

    def __call__(self, method: Callable[[], Any], inputs: Callable[[], Sequence[Any]]) -> Any:
        """Return what the method returns."""
        del inputs
        with known_as(str(self.key[0])) if self.old else nullcontext():
            return method()


Reading = ReadMethod | Verbatim


class ReadObject(Module):
    """A module that a user may have written, called on jets, as what it computes.

    Parameters
    ----------
    reading : ReadMethod or Verbatim
        Of its call.
    fields : tuple of array
        The numbers in its fields; those of stacked objects have the axes of these and of the batch at their ends.
    shapes : tuple of tuple of int
        Of the fields of one object.
    source : Untraced
        The object.
    """

    reading: Reading
    fields: tuple[Any, ...]
    shapes: tuple[tuple[int, ...], ...] = field(static=True)
    source: Untraced = field(static=True)

    @classmethod
    def of(cls, source: Any, orders: Sequence[int], shape: tuple[int, ...] = ()) -> "ReadObject":
        """Return what an object computes now of jets of some orders and of a shape."""
        leaves, tree = jax.tree.flatten(source)
        held = [np.shape(x) for x in leaves]
        jets = [Jet([jax.ShapeDtypeStruct((*shape, 1, 1), float)] * (order + 1)) for order in orders]
        jets[-1] = Jet([jax.ShapeDtypeStruct((1, 1), float)] * (orders[-1] + 1))  # the time
        fields = [jax.ShapeDtypeStruct((*its, 1, 1), float) for its in held]

        def on_jets(given: Sequence[Any], _: Any) -> Any:
            return jax.tree.unflatten(tree, given[len(jets) :])(*given[: len(jets)])

        def on_values(*values: Any) -> Any:
            program = on_jets([*(Jet([x]) for x in values[: len(jets)]), *values[len(jets) :]], ())
            (value,) = program.coefficients
            return value

        reading = read_method(on_values, on_jets, [*jets, *fields], [])
        return cls(reading, tuple(leaves), tuple(held), Untraced(source))

    def __call__(self, *jets: Jet) -> Jet:
        """Return the jet of the object; instances and batch are the last axes of all jets."""

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
    """Return what a method computes now.

    Parameters
    ----------
    on_values : callable
        The method of values, arrays in the place of the jets; returns an array.
    on_jets : callable
        The method of jets, and then of the rates, in one list; returns a pytree of arrays.
    jets : sequence of Jet or array
        Shapes and types of its arguments.
    rates : sequence of Jet
        Of what else it may look at, which has no values at order zero.
    whole : callable, optional
        Calls the method, without arguments, where the former two may not be able to.
    """
    leaves, tree = jax.tree.flatten(([*jets], [*rates]))
    reading: Reading = Verbatim((OpaqueObject(object()),), old=False)  # the call raises the error again
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
    """Return a method as a program on values; None where it is none, or holds no numbers."""
    leaves, tree = jax.tree.flatten([*jets])
    shapes = tuple(x.shape for x in leaves)
    try:
        program = captured_function(on_values, *(x.coefficients[0] if isinstance(x, Jet) else x for x in jets))
        reading = ReadMethod(program.program, program.captured)
        if not program.captured or not has_rules(program.program) or len(jax.tree.leaves(program.result)) != 1:
            return None

        other = _on_series(program.program, tree, shapes)
    except Exception:  # noqa: BLE001 - it needs more than values
        return None
    return reading if is_same(traced, other, program.captured) else None


@lru_cache(maxsize=1000)
def _on_series(program: Program, tree: Any, shapes: tuple[tuple[int, ...], ...]) -> ClosedJaxpr:
    """Return what JAX traces as a program on values is run on jets of some shapes."""
    reading, held = ReadMethod(program, ()), [v.aval for v in program.closed.jaxpr.invars[: len(program.shapes)]]

    def again(captured: Any, *x: Any) -> Any:
        return jax.tree.leaves(reading.once(captured, jax.tree.unflatten(tree, x)))

    example = [jax.ShapeDtypeStruct(aval.shape, aval.dtype) for aval in held]
    return jax.make_jaxpr(again)(example, *(jax.ShapeDtypeStruct(shape, float) for shape in shapes))


def _along(function: Callable[[Any], Any], given: Any) -> Any:
    """Map a function over the instances and the batch of a pytree of arrays, whose last two axes they are."""
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
