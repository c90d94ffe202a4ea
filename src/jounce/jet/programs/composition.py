"""Composition of a jet with any JAX-traceable function: its program is traced once and run on jets.

Elementary, linear and bilinear operations have exact rules, O(K^2) at order K. All branches are run and selected from;
short loops of known length are unrolled. A program with any other operation (a loop with a condition, a special
function) is differentiated by nested forward mode, which is exact, too, but doubles its cost with each order.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import JaxprEqn

from jounce.base.modules import Module, field
from jounce.jet.algebra import Jet, bilinear
from jounce.jet.elementary import FUNCTIONS, erf, tanh
from jounce.jet.programs.captured import Program, captured_function
from jounce.jet.programs.operations import COMPOSED, REARRANGING, STEPWISE
from jounce.jet.programs.reader import ProgramReader, inner_program


def compose(function: Callable[[Any], Any], x: Jet) -> Jet:
    """Return the jet of ``function(x)``, exact to rounding at every order.

    Parameters
    ----------
    function : callable
        Any JAX-traceable function of one scalar that returns a scalar.
    x : Jet
        Its argument, with batch axes of any shape.

    Returns
    -------
    Jet
        Jet of the function, of the order and shape of `x`.

    Raises
    ------
    TypeError
        If the function does not return one scalar for a scalar.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> import jounce as jn
    >>> t = jn.Jet.variable(0.0, order=3)
    >>> [round(float(x), 12) for x in jn.jet.compose(lambda t: jnp.exp(-2 * t), t).derivatives()]
    [1.0, -2.0, 4.0, -8.0]
    """
    return Composed.of(function)(x)


class Composed(Module):
    """A traced function of one scalar that runs on jets.

    Parameters
    ----------
    program : Program
        Program of the function.
    captured : tuple of array
        Captured numbers; if several functions share the program, each has two more axes at its end: the functions, and
        one that broadcasts over the batch.
    """

    program: Program = field(static=True)
    captured: tuple[Any, ...]

    @classmethod
    def of(cls, function: Callable[[Any], Any]) -> "Composed":
        """Return the current program of a function.

        Raises
        ------
        TypeError
            If the function does not return one scalar for a scalar.
        """
        program = captured_function(function, jax.ShapeDtypeStruct((), float))
        if getattr(program.result, "shape", None) != ():
            raise TypeError(f"a function of time must return one scalar for a scalar, got {program.result}")
        return cls(program.program, program.captured)

    def __call__(self, x: Jet) -> Jet:
        """Return the jet of the function, of the order of `x`; batch axes are last."""
        return over_instances(self._at, self.program.shapes, self.captured, x)

    def _at(self, captured: Sequence[Any], x: Jet) -> Jet:
        """Return the jet of one instance for a scalar jet."""
        if has_rules(self.program):
            (result,) = on_jets(self.program, captured, [x])
        else:
            result = _nested(lambda t: self.program(captured, t)[0], x)
        if not isinstance(result, Jet):
            result = Jet.constant(jnp.asarray(result, float), x.order)
        return result.map(lambda c: c.astype(float))


class SampleFunction(Module):
    """A function of the arrays of one sample, with the program that it had when it was traced.

    Parameters
    ----------
    program : Program
        Program of the function.
    captured : tuple of array
        Captured numbers.
    shape : tuple of int
        Shape of the result.
    """

    program: Program = field(static=True)
    captured: tuple[Any, ...]
    shape: tuple[int, ...] = field(static=True)

    @classmethod
    def of(cls, function: Callable[..., Any], *examples: Any) -> "SampleFunction":
        """Return the current program of a function, for arrays with the shapes and types of examples."""
        program = captured_function(lambda *x: jnp.asarray(function(*x), float), *examples)
        return cls(program.program, program.captured, program.result.shape)

    def __call__(self, *samples: Any) -> Any:
        """Return the results for a batch of samples, along the last axes of arguments and result."""
        return jax.vmap(self.at, in_axes=-1, out_axes=-1)(*samples)

    def at(self, *sample: Any) -> Any:
        """Return the result for one sample."""
        return self.program(self.captured, *sample)[0]


def over_instances(
    function: Callable[[Sequence[Any], Any], Any], shapes: Sequence[tuple[int, ...]], captured: Sequence[Any], x: Jet
) -> Jet:
    """Map a function of captured values and one scalar jet over jets with batch axes.

    Parameters
    ----------
    function : callable
        Function of the values and of a jet without batch axes.
    shapes : sequence of tuple of int
        Shapes of the values. Values of several instances have two more axes at their ends: instances and batch.
    captured : sequence of array
        Captured values.
    x : Jet
        Argument with batch axes.
    """
    stacked = [np.ndim(value) > len(shape) for value, shape in zip(captured, shapes, strict=True)]
    if not any(stacked):
        flat = x.map(lambda c: jnp.reshape(jnp.asarray(c, float), -1))
        return jax.vmap(lambda x: function(captured, x))(flat).map(lambda c: jnp.reshape(c, x.shape))
    axes = tuple(-1 if is_many and np.shape(v)[-1] > 1 else None for v, is_many in zip(captured, stacked, strict=True))

    def of_instance(captured: Any, x: Jet) -> Jet:
        given = tuple(
            v[..., 0] if is_many and a is None else v for v, is_many, a in zip(captured, stacked, axes, strict=True)
        )
        return jax.vmap(function, in_axes=(axes, -1), out_axes=-1)(given, x)

    captured_axes = tuple(-2 if is_many else None for is_many in stacked)
    broadcast = x.map(lambda c: jnp.broadcast_to(c, jnp.broadcast_shapes(x.shape, *_ends(captured, stacked))))
    return jax.vmap(of_instance, in_axes=(captured_axes, -2), out_axes=-2)(tuple(captured), broadcast)


def _ends(captured: Sequence[Any], stacked: Sequence[bool]) -> list[tuple[int, ...]]:
    return [np.shape(v)[-2:] for v, is_many in zip(captured, stacked, strict=True) if is_many]


def on_jets(program: Program, captured: Sequence[Any], arguments: Sequence[Any]) -> list[Any]:
    """Return the results of a program for jets; results that do not depend on them are arrays."""
    closed = program.closed
    return _OnJets().read(closed.jaxpr, closed.consts, [*captured, *arguments])


def has_rules(program: Program) -> bool:
    """Return whether each operation of a program has a rule for jets."""
    return all(map(_has_rule, _operations(program.closed.jaxpr)))


def _nested(function: Callable[[Any], Any], x: Jet) -> Jet:
    """Differentiate ``function`` along the polynomial of `x` by nested forward mode."""

    def along(step):
        return function(x.evaluate(step))

    derivatives, derivative = [], along
    for _order in range(x.order + 1):
        derivatives.append(derivative(jnp.zeros_like(x.coefficients[0])))
        derivative = _slope(derivative)
    return Jet.from_derivatives(derivatives)


def _slope(f: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda step: jax.jvp(f, (step,), (jnp.ones_like(step),))[1]


class _OnJets(ProgramReader):
    """Interpreter of programs on jets, and on arrays where values do not depend on time."""

    moving = Jet

    def value(self, x: Any) -> Any:
        return _value(x)

    def applied(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        primitive, parameters, name = equation.primitive, equation.params, equation.primitive.name
        if name in _RULES:
            return [_RULES[name](*operands, **parameters)]
        if name in REARRANGING:
            return [_along_coefficients(primitive, parameters, operands)]
        if name in _BILINEAR:
            return [bilinear(lambda a, b: primitive.bind(a, b, **parameters), *operands)]
        if name in COMPOSED:
            return [self.composed(lambda *xs: COMPOSED[name](*xs, **parameters), operands)]
        return [primitive.bind(*map(_value, operands), **parameters)]  # piecewise constant in time


LONGEST_UNROLLED = 100


def _along_coefficients(primitive: Any, parameters: dict, operands: list[Any]) -> Jet:
    """Apply an operation that is linear in its jets, coefficient by coefficient."""
    order = min(x.order for x in operands if isinstance(x, Jet))
    index_only = primitive.name in ("gather", "dynamic_slice")

    def vanishes(k: int) -> bool:
        return all(x.coefficients[k] is None for x in operands if isinstance(x, Jet))

    def pick(x: Any, k: int) -> Any:
        if isinstance(x, Jet):
            return x.dense().coefficients[k]
        return x if k == 0 or index_only else jnp.zeros_like(x)

    return Jet(
        None if vanishes(k) else primitive.bind(*(pick(x, k) for x in operands), **parameters) for k in range(order + 1)
    )


def _value(x: Any) -> Any:
    return x.coefficients[0] if isinstance(x, Jet) else x


def _select(choice: Any, *cases: Any, **_) -> Any:
    jets = [x for x in cases if isinstance(x, Jet)]
    if not jets:
        return jax.lax.select_n(_value(choice), *cases)
    order = min(x.order for x in jets)
    series = [x if isinstance(x, Jet) else Jet.constant(x, order) for x in cases]
    columns = zip(*(x.dense().coefficients for x in series), strict=False)
    return Jet(jax.lax.select_n(_value(choice), *column) for column in columns)


def _without_parameters(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *operands, **_: function(*operands)


_RULES: dict[str, Callable[..., Any]] = {name: _without_parameters(f) for name, f in FUNCTIONS.items()} | {
    "add": lambda a, b, **_: a + b,
    "add_any": lambda a, b, **_: a + b,
    "sub": lambda a, b, **_: a - b,
    "mul": lambda a, b, **_: a * b,
    "div": lambda a, b, **_: a / b,
    "neg": lambda a, **_: -a,
    "erfc": lambda a, **_: 1.0 - erf(a),
    "logistic": lambda a, **_: 0.5 * (1.0 + tanh(0.5 * a)),
    "select_n": _select,
}
_BILINEAR = frozenset(("dot_general",))
_WITHOUT_RATES = STEPWISE | frozenset("and eq ge gt iota is_finite le lt ne not or xor".split())


def _has_rule(name: str) -> bool:
    return any(name in table for table in (_RULES, COMPOSED, REARRANGING, _BILINEAR, _WITHOUT_RATES))


def _operations(jaxpr: Any) -> Any:
    """Yield the names of all operations, including those inside calls, branches and short loops."""
    for equation in jaxpr.eqns:
        name, parameters = equation.primitive.name, equation.params
        if name == "cond":
            for branch in parameters["branches"]:
                yield from _operations(branch.jaxpr)
        elif hasattr(inner := inner_program(parameters), "jaxpr") and (
            name != "scan" or parameters["length"] <= LONGEST_UNROLLED
        ):
            yield from _operations(inner.jaxpr)
        else:
            yield name
